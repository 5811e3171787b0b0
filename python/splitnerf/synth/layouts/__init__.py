"""How rendered views are written: a class a layout, each a :class:`splitnerf.synth.writer.Writer`."""

from __future__ import annotations

from functools import partial

from splitnerf.synth.layouts.dtc import DtcWriter
from splitnerf.synth.layouts.glossy import GlossyWriter
from splitnerf.synth.layouts.glossy_real import GlossyRealWriter
from splitnerf.synth.layouts.neus import NeusWriter
from splitnerf.synth.layouts.openillumination import OpenIlluminationWriter
from splitnerf.synth.layouts.owl import OwlWriter
from splitnerf.synth.layouts.shiny import ShinyWriter
from splitnerf.synth.layouts.stanford_orb import StanfordOrbWriter
from splitnerf.synth.writer import FULL_TRUTH, SceneWriter

WRITERS = {name: partial(SceneWriter, layout=name) for name in FULL_TRUTH} | {
    "shiny": ShinyWriter,
    "stanford-orb": StanfordOrbWriter,
    "owl": OwlWriter,
    "openillumination": OpenIlluminationWriter,
    "dtc": DtcWriter,
    "glossy": GlossyWriter,
    "glossy-real": GlossyRealWriter,
    "neus": NeusWriter,
}
"""By the name that `--layout` takes: called with the folder and the horizontal field of view."""
LAYOUTS = tuple(WRITERS)
