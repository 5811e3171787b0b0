"""Writers of rendered views: a class for each layout, each a :class:`splitnerf_tools.synth.writer.Writer`."""

from __future__ import annotations

from functools import partial

from splitnerf_tools.synth.layouts.neus import NeusWriter
from splitnerf_tools.synth.layouts.shiny import ShinyWriter
from splitnerf_tools.synth.layouts.stanford_orb import StanfordOrbWriter
from splitnerf_tools.synth.writer import FULL_TRUTH, SceneWriter

WRITERS = {name: partial(SceneWriter, layout=name) for name in FULL_TRUTH} | {
    "shiny": ShinyWriter,
    "stanford-orb": StanfordOrbWriter,
    "neus": NeusWriter,
}
"""By the name that `--layout` takes: called with the folder and the horizontal field of view."""
LAYOUTS = tuple(WRITERS)
