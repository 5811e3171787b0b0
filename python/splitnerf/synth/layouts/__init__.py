"""How rendered views are written: a class a layout, each a :class:`splitnerf.synth.writer.Writer`."""

from __future__ import annotations

from functools import partial

from splitnerf.synth.layouts.neus import NeusWriter
from splitnerf.synth.layouts.shiny import ShinyWriter
from splitnerf.synth.layouts.stanford_orb import StanfordOrbWriter
from splitnerf.synth.writer import FULL_TRUTH, SceneWriter

WRITERS = {name: partial(SceneWriter, layout=name) for name in FULL_TRUTH} | {
    "shiny": ShinyWriter,
    "stanford-orb": StanfordOrbWriter,
    "neus": NeusWriter,
}
"""By the name that `--layout` takes: called with the folder and the horizontal field of view."""
LAYOUTS = tuple(WRITERS)
