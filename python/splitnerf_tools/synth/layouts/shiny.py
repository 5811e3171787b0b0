"""Writes the form of Shiny Blender: NeRF-Blender's, with files of normals and coverage for the test images."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from splitnerf.data.images import write_image
from splitnerf_tools.synth.writer import Maps, SceneWriter


class ShinyWriter(SceneWriter):
    """A writer: `r_000_normal.png` is n / 2 + 1 / 2, `r_000_alpha.png` the coverage."""

    relights = False

    def _write_truth(self, image: Path, maps: Maps) -> None:
        alpha = maps["alpha"][..., None]
        normal = np.concatenate([0.5 * maps["smooth_normal"] + 0.5, alpha], axis=-1)
        write_image(image.with_name(f"{image.stem}_normal.png"), normal)
        write_image(image.with_name(f"{image.stem}_alpha.png"), maps["alpha"])
