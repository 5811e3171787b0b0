"""Narrow-band marching cubes against the dense grid, timed in one run after checking that the meshes are equal.

    python tests/bench/meshing.py [RUN ...]

The field is a torus joined with a box, and that of each RUN given. Equal: the same faces and, to a millionth of the
box, the same vertices. The peer is skimage.measure.marching_cubes on the dense volume, its evaluation not counted.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
import torch
from skimage.measure import marching_cubes

from splitnerf.export.meshing import extract_mesh

RESOLUTIONS = (128, 256, 512)
BOX = 1.5


def torus_and_box(x: torch.Tensor) -> torch.Tensor:
    ring = torch.hypot(torch.hypot(x[:, 0], x[:, 1]) - 0.8, x[:, 2]) - 0.2
    q = (x - torch.tensor([0.1, 0.0, 0.3])).abs() - torch.tensor([0.3, 0.25, 0.5])
    return torch.minimum(ring, q.clamp(min=0).norm(dim=1) + q.amax(dim=1).clamp(max=0))


class Counting:
    def __init__(self, sdf):
        self.sdf, self.n = sdf, 0

    def __call__(self, x: torch.Tensor) -> torch.Tensor:
        self.n += len(x)
        return self.sdf(x)


def volume_of(sdf, box: float, resolution: int) -> np.ndarray:
    axis = torch.linspace(-box, box, resolution)
    slabs = [torch.cartesian_prod(x[None], axis, axis) for x in axis]
    with torch.no_grad():
        return torch.stack([sdf(slab).view(resolution, resolution) for slab in slabs]).numpy()


def timed(function, *args, **kwargs):
    start = time.perf_counter()
    result = function(*args, **kwargs)
    return result, time.perf_counter() - start


def compare(name: str, sdf, box: float) -> None:
    for resolution in RESOLUTIONS:
        band, full = Counting(sdf), Counting(sdf)
        (vertices, faces), seconds = timed(extract_mesh, band, box, resolution)
        (dense_vertices, dense_faces), dense_seconds = timed(extract_mesh, full, box, resolution, dense=True)
        equal = np.array_equal(faces, dense_faces) and np.abs(vertices - dense_vertices).max() < 1e-6 * box
        volume = volume_of(sdf, box, resolution)
        peer, peer_seconds = timed(marching_cubes, volume, 0.0)
        print(
            f"{name} {resolution}^3: {len(faces)} faces, {'equal' if equal else 'DIFFERS'}; evaluations {band.n} of "
            f"{full.n} ({100 * band.n / full.n:.1f} %); narrow band {seconds:.2f} s, dense {dense_seconds:.2f} s; "
            f"skimage on the dense values {peer_seconds:.2f} s, {len(peer[1])} faces",
            flush=True,
        )


def main() -> None:
    print(f"{torch.get_num_threads()} threads")
    compare("torus and box", torus_and_box, BOX)
    for run in sys.argv[1:]:
        from splitnerf.workflow import load_run

        model, _, _ = load_run(Path(run))
        compare(Path(run).name, model.sdf_field.sdf, model.config.surface.box)


if __name__ == "__main__":
    main()
