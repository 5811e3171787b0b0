"""Refinement from files to files."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from tqdm import tqdm

from splitnerf.data.asset import Asset
from splitnerf.data.dataset import load_dataset
from splitnerf.data.environment import read_environment
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import area_average
from splitnerf.data.json_files import write_json
from splitnerf.errors import InputError
from splitnerf.export.bake import UnwrappedMesh, bake_occlusion
from splitnerf.export.environment import write_environment
from splitnerf.export.glb import write_glb
from splitnerf.refinement.fit import Refined, RefinementSettings, refine
from splitnerf.refinement.texels import check_form

OCCLUSION_OFFSET = 0.006  # distance of a ray's start from the mesh, as a share of its extent
LEAST_HEIGHT, LARGEST_HEIGHT = 8, 256  # rows of the light that is fitted


def fitting_height(height: int) -> int:
    """The largest 8 2^k that divides a map's number of rows and is at most LARGEST_HEIGHT; 0 where there is none."""
    sizes = [LEAST_HEIGHT << k for k in range(int(math.log2(LARGEST_HEIGHT // LEAST_HEIGHT)) + 1)]
    return max((size for size in sizes if height % size == 0), default=0)


def read_light(folder: Path) -> np.ndarray:
    """[h, 2 h, 3] the light beside an asset, averaged down to a height that can be fitted.

    Raises:
        InputError: There is none, or it cannot be used.
    """
    path = folder / "environment.exr"
    light = read_environment(path)
    height = fitting_height(light.shape[0])
    if height == 0 or light.shape[1] != 2 * light.shape[0]:
        raise InputError(f"{path}: is {light.shape[1]}x{light.shape[0]}; a light of 8 2^k rows, twice as wide, is needed")
    return area_average(light, light.shape[0] // height).astype(np.float32)


def occlusion_texture(asset: Asset) -> np.ndarray:
    """[h, w] the open share of each texel's hemisphere, for viewers that trace no rays."""
    mesh = UnwrappedMesh(asset.vertices, asset.triangles, asset.normals, asset.tangents, asset.uv)
    extent = float(np.ptp(asset.vertices, axis=0).max())
    return bake_occlusion(mesh, asset.materials[0].albedo_texture.shape[0], OCCLUSION_OFFSET * extent)


def refine_run(run: Path, data: Path, out: Path, *, downscale: int, settings: RefinementSettings) -> Refined:
    """Refines the asset of a run; writes mesh.glb, environment.exr and .hdr and refinement.json.

    Raises:
        InputError: The run, the data or the light cannot be used; nothing was written.
        RuntimeError: Numbers are no longer finite; nothing was written.
        OSError: A file cannot be written.
    """
    path = run / "mesh.glb"
    if not path.is_file():
        raise InputError(f"{path}: no such asset; finish the run, or write it with `splitnerf export {run}`")
    asset, light = read_asset(path), read_light(run)
    try:
        check_form(asset)
    except ValueError as error:
        raise InputError(f"{path}: {error}; give an asset that `splitnerf train` or `export` wrote") from error
    dataset = load_dataset(data, "train", downscale)
    with tqdm(total=settings.sweeps, desc="refining", unit="step", leave=False, disable=None) as bar:
        try:
            refined = refine(dataset, asset, light, settings, report=lambda sweep: bar.update())
        except InputError as error:
            raise InputError(f"{path} and {data}: {error}") from error
    out.mkdir(parents=True, exist_ok=True)
    write_glb(out / "mesh.glb", refined.asset, occlusion_texture(refined.asset))
    write_environment(out, refined.light)
    said = {"outline": refined.outline, "sweeps": [sweep._asdict() for sweep in refined.sweeps]}
    write_json(out / "refinement.json", said)
    return refined
