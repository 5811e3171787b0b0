"""What benchmarks measure on: environment maps in the forms that estimators read, meshes, and other libraries.

Each library is optional: a missing one is left out, with a note on stderr and on the page.
"""

from __future__ import annotations

import importlib
import math
import os
from pathlib import Path

import numpy as np
import torch
import trimesh
from splitnerf.data.environment import read_environment
from splitnerf.errors import note
from splitnerf.fields import LightPyramid
from splitnerf.relight.studio import studio_light
from torch import Tensor
from torch.nn import functional as F

# Their brightest ten-thousandth of the sphere sends less than 1 %, 3 % and 57 % of the light.
MEASURED = {"soft": "blender_courtyard.exr", "medium": "blender_studio.exr", "hard sun": "blender_sunrise.exr"}
SUBDIVISION, FINEST = 4, 512  # samples along the edge of a texel that its mean is taken from, and of the map, at least
LEFT_OUT: list[str] = []  # what the page that is being made lacks


def data_folder() -> Path:
    """The folder of measured maps and meshes: SPLITNERF_DATA, or ../shared/data."""
    return Path(os.environ.get("SPLITNERF_DATA", "../shared/data"))


def lights() -> dict[str, np.ndarray]:
    """Maps [h, 2h, 3] by name: measured ones if the data folder has them, else skies without and with a sun."""
    files = {name: data_folder() / "hdri" / file for name, file in MEASURED.items()}
    if all(path.is_file() for path in files.values()):
        return {name: read_environment(path) for name, path in files.items()}
    return {"procedural sky": studio_light("overcast"), "procedural sun": studio_light("sunny")}


class MapLight:
    """Radiance of an equirectangular map from any direction: bilinear, with the map's means beneath for a filtered lookup."""

    def __init__(self, radiance: np.ndarray):
        self.levels = [torch.from_numpy(np.ascontiguousarray(radiance))]
        while len(self.levels[-1]) > 4:
            self.levels.append(self.levels[-1].unflatten(0, (-1, 2)).unflatten(2, (-1, 2)).mean((1, 3)))
        self.padded = [
            torch.cat([level[:, -1:], level, level[:, :1]], 1).permute(2, 0, 1)[None].contiguous()
            for level in self.levels
        ]

    def __call__(self, directions: Tensor, level: int = 0) -> Tensor:
        """directions [n, 3] -> radiance [n, 3]."""
        image = self.padded[level]
        width = image.shape[3] - 2
        x, y, z = directions.unbind(1)
        u = 0.5 - torch.atan2(y, x) / (2 * math.pi)
        v = torch.acos(z.clamp(-1, 1)) / math.pi
        grid = torch.stack([(u * width + 1) / (width + 2) * 2 - 1, v * 2 - 1], -1)[None, None]
        return F.grid_sample(image, grid, padding_mode="border", align_corners=False)[0, :, 0].T

    def filtered(self, directions: Tensor, solid_angles: Tensor) -> Tensor:
        """Radiance [n, 3] averaged over about these solid angles [n] (sr), by linear interpolation of two mip levels."""
        texel = 4 * math.pi / self.levels[0][..., 0].numel()
        lod = (0.5 * torch.log2(solid_angles / texel)).clamp(0, len(self.levels) - 1.001)
        below, share = lod.floor().long(), lod.frac()[:, None]
        out = torch.empty_like(directions)
        for level in below.unique().tolist():
            here = below == level
            fine, coarse = (self(directions[here], level + k) for k in (0, 1))
            out[here] = torch.lerp(fine, coarse, share[here])
        return out


def octahedral_directions(n: int) -> np.ndarray:
    """[n^2, 3] unit directions of an octahedral map's texel centres, row by row (Praun and Hoppe 2003)."""
    centre = (2 * np.arange(n) + 1) / n - 1
    v, u = np.meshgrid(centre, centre, indexing="ij")
    z = 1 - np.abs(u) - np.abs(v)
    fold = np.maximum(-z, 0)
    points = np.stack([u - np.where(u < 0, -1, 1) * fold, v - np.where(v < 0, -1, 1) * fold, z], -1).reshape(-1, 3)
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def cell_means(light: MapLight, resolution: int) -> Tensor:
    """[resolution^2, 3] means of a light over an octahedral map's texels."""
    parts = max(SUBDIVISION, FINEST // resolution)
    fine = torch.from_numpy(octahedral_directions(resolution * parts)).float()
    return light(fine).view(resolution, parts, resolution, parts, 3).mean((1, 3)).reshape(-1, 3)


def pyramid_of(light: MapLight, resolution: int) -> LightPyramid:
    """The pyramid whose texels hold the means of a light over them."""
    cells = cell_means(light, resolution)
    pyramid = LightPyramid(resolution)
    with torch.no_grad():
        pyramid.texels.zero_()
        pyramid.texels[-(resolution**2) :] = torch.log(cells.clamp(min=1e-5))
    return pyramid


def armadillo() -> trimesh.Trimesh:
    """The scan of the data folder in the unit sphere, or a bumpy sphere of as many triangles."""
    path = data_folder() / "meshes" / "armadillo_ingp.obj"
    if not path.is_file():
        return trimesh.Trimesh(*bumpy_sphere(224), process=False)
    mesh = trimesh.load(path, process=False)
    mesh.apply_translation(-mesh.bounds.mean(0))
    mesh.apply_scale(1 / np.linalg.norm(mesh.vertices, axis=1).max())
    return mesh


def bumpy_sphere(n: int) -> tuple[np.ndarray, np.ndarray]:
    """A sphere with bumps of about 2 n^2 triangles: vertices [v, 3] float32, faces [f, 3] int32."""
    polar, azimuth = np.meshgrid(
        np.linspace(0.01, np.pi - 0.01, n + 1), np.linspace(0, 2 * np.pi, n + 1), indexing="ij"
    )
    radius = 1 + 0.15 * np.sin(9 * polar) * np.cos(11 * azimuth)
    sine = np.sin(polar)
    vertices = radius[..., None] * np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(polar)], -1)
    index = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return vertices.reshape(-1, 3).astype(np.float32), faces.astype(np.int32)


def leave_out(text: str) -> None:
    """Says what is missing, and keeps it for the page."""
    LEFT_OUT.append(text)
    note(text)


def peer(name: str, why: str) -> object | None:
    """A library, or None with a line on stderr that says what is missing without it."""
    try:
        return importlib.import_module(name)
    except (ImportError, OSError) as error:
        leave_out(f"{name} is not installed ({str(error).splitlines()[0]}): {why} is left out")
        return None


def drjit_ready() -> bool:
    """Whether Dr.Jit can compile for this processor; it needs an LLVM library, which DRJIT_LIBLLVM_PATH may name."""
    if peer("drjit", "what Dr.Jit compiles") is None:
        return False
    if "DRJIT_LIBLLVM_PATH" not in os.environ:
        found = sorted(Path("/usr/lib").glob("*/libLLVM-1[6-9].so")) + sorted(Path("/usr/lib").glob("*/libLLVM.so.1*"))
        if found:
            os.environ["DRJIT_LIBLLVM_PATH"] = str(found[-1])
    import drjit

    if drjit.has_backend(drjit.JitBackend.LLVM):
        return True
    leave_out("Dr.Jit finds no LLVM library; set DRJIT_LIBLLVM_PATH: what needs it is left out")
    return False
