"""Refinement from files to files."""

from __future__ import annotations

import copy
import dataclasses
import hashlib
import time
from pathlib import Path

import numpy as np

from splitnerf.data.asset import Asset, check_place, vertex_tangents
from splitnerf.data.dataset import Dataset, dataset_fingerprint, load_dataset, with_exposures
from splitnerf.data.environment import read_environment
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import area_average
from splitnerf.data.json_files import read_json, write_json
from splitnerf.data.reading import Reading
from splitnerf.data.tensor_files import read_tensors, write_tensors
from splitnerf.errors import InputError
from splitnerf.export.bake import bake_occlusion
from splitnerf.export.scene import write_environment
from splitnerf.export.writers import write_glb
from splitnerf.files import locked
from splitnerf.progress import Interrupt, Progress
from splitnerf.refinement.fit import FitSettings
from splitnerf.refinement.stage import Refined, Stage, decibels
from splitnerf.refinement.texels import check_form

TRAINED = "trained"  # the folder in a run of what training alone exported
STATE, STATE_FORMAT = "refinement.pt", 9
RECORD = "refinement.json"
OCCLUSION_OFFSET = 0.006  # distance of a ray's start from the mesh, as a share of its extent
HEIGHTS = 256, 128, 64, 32, 16, 8  # rows that the light may have while it is fitted


def fitting_height(height: int) -> int:
    """The largest of HEIGHTS that divides a map's number of rows; 0 where none does."""
    return next((size for size in HEIGHTS if height % size == 0), 0)


def read_light(folder: Path) -> np.ndarray:
    """[h, 2 h, 3] the light in the folder of an asset, averaged down to a height that can be fitted. Raises InputError where there
    is none, or it cannot be used."""
    path = folder / "environment.exr"
    light = read_environment(path)
    height = fitting_height(light.shape[0])
    if height == 0 or light.shape[1] != 2 * light.shape[0]:
        raise InputError(
            f"{path}: is {light.shape[1]}x{light.shape[0]}; a light of 8 2^k rows, twice as wide, is needed"
        )
    return area_average(light, light.shape[0] // height).astype(np.float32)


def occlusion_texture(asset: Asset) -> np.ndarray:
    """[h, w] the open share of each texel's hemisphere, for viewers that trace no rays."""
    extent = float(np.ptp(asset.vertices, axis=0).max())
    return bake_occlusion(asset, asset.materials[0].roughness_metallic_texture.shape[0], OCCLUSION_OFFSET * extent)


def source_of(run: Path) -> Path:
    """The folder in a run that holds what training alone exported: RUN/trained, or RUN where there was no
    refinement."""
    return run / TRAINED if (run / TRAINED / "mesh.glb").is_file() else run


class OtherState(InputError):
    """A state from which a refinement cannot continue."""


class StateFile:
    """The state of an unfinished refinement, in a file in the folder of the results that is deleted at its end; `origin` is the
    hash that identifies the refinement, see :func:`origin_of`."""

    def __init__(self, folder: Path, origin: str):
        self.path, self.origin = folder / STATE, origin
        self.saved_at = time.monotonic()
        self.content: dict[str, object] = {}

    def load(self) -> dict | None:
        """The state; None where there is no file. Raises OtherState where it cannot be read, or is another refinement's."""
        if not self.path.is_file():
            return None
        try:
            content = read_tensors(self.path)
        except ValueError as error:
            raise OtherState(f"{self.path}: not a readable state ({error}); delete it to begin anew") from None
        if content["format"] != STATE_FORMAT or content.get("origin") != self.origin:
            raise OtherState(f"{self.path}: is of another asset, other photos or settings; delete it to begin anew")
        return content

    def take(self, stage: Stage) -> None:
        """Remembers the state of a stage that has made its sweeps to their ends."""
        self.content = {}  # never three states in memory
        self.content = copy.deepcopy(stage.state())

    def save(self) -> None:
        """Writes the state that was taken last. Raises OSError where the disk is full; the old file is kept."""
        write_tensors(self.path, {"format": STATE_FORMAT, "origin": self.origin, **self.content})
        self.saved_at = time.monotonic()


def origin_of(source: Path, dataset: Dataset, settings: FitSettings) -> str:
    """A hash of all that decides the bits of a sweep: the asset, its light, the photos and the settings."""
    fixed = dataclasses.replace(settings, sweeps=1, minutes=0.0)  # these say only when it ends
    digest = hashlib.sha256(f"{fixed} {dataset_fingerprint(dataset)}".encode())
    for name in ("mesh.glb", "environment.exr"):
        digest.update((source / name).read_bytes())
    return digest.hexdigest()


def refine_folder(
    source: Path, dataset: Dataset, out: Path, settings: FitSettings, *, resume: bool = False, save_minutes: float = 2.0
) -> Refined | None:
    """Fits the asset and the light of a folder to photos, with a bar; Ctrl-C ends it, keeps the state before the sweep and returns
    None. While the first sweep is prepared there is nothing to keep: Ctrl-C raises KeyboardInterrupt. Raises InputError where the
    asset, the light, the photos or the state cannot be used, and RuntimeError where numbers are no longer finite; no result was
    written then. Raises OSError where a file cannot be written.

    Args:
        source: The folder of mesh.glb and environment.exr.
        out: The folder of the results: mesh.glb, environment.exr and .hdr, and refinement.json. The state of
            an unfinished refinement stands there; the caller deletes it (:func:`forget_state`) once all is done.
        resume: Whether to continue from that state, if there is one.
        save_minutes: The time between two saves of the state.
    """
    asset, light = read_source(source)
    out.mkdir(parents=True, exist_ok=True)
    kept = StateFile(out, origin_of(source, dataset, settings))
    state = kept.load() if resume else None
    with Progress(0.0, leave=False, at_once=True) as bar:
        try:
            stage = Stage(dataset, asset, light, settings, state, bar.show)
        except (ValueError, KeyError, TypeError, IndexError, OverflowError) as error:
            if state is None:
                raise
            raise OtherState(
                f"{kept.path}: not the state of this refinement ({error}); delete it to begin anew"
            ) from error
    with Interrupt() as interrupt:
        complete = True
        kept.take(stage)
        with Progress(stage.progress) as bar:
            stage.show = bar.show
            while not stage.finished and not interrupt.asked:
                n_sweeps = len(stage.sweeps)
                interrupt.attempt(stage.advance)
                complete = len(stage.sweeps) > n_sweeps
                if complete:
                    kept.take(stage)
                    if time.monotonic() - kept.saved_at > 60.0 * save_minutes:
                        kept.save()
                    bar.show(stage.progress, stage.message(len(stage.sweeps)))
        kept.save()  # also where all is done: what follows may be interrupted, too
        if not complete or not stage.finished:
            return None
    with Progress(0.0, leave=False) as bar:
        stage.show = bar.show
        refined = stage.result()
    write_glb(out / "mesh.glb", refined.asset, occlusion_texture(refined.asset))
    write_environment(out, refined.light)
    write_json(out / RECORD, record_of(refined, stage.seconds))
    return refined


def read_source(source: Path) -> tuple[Asset, np.ndarray]:
    """The asset and the light [h, 2 h, 3] of a folder. Raises InputError where they cannot be fitted."""
    path = source / "mesh.glb"
    if not path.is_file():
        raise InputError(f"{path}: no such asset; finish the run, or write it with `splitnerf export {source}`")
    asset, light = with_normal_texture(without_detail(read_asset(path))), read_light(source)
    try:
        check_form(asset)
    except ValueError as error:
        raise InputError(f"{path}: {error}; give an asset that `splitnerf train` or `export` wrote") from error
    return asset, light


def without_detail(asset: Asset) -> Asset:
    """The asset with its albedo averaged down to the size of its other textures, if a refinement has made it finer."""
    material = asset.materials[0]
    fine, coarse = material.albedo_texture, material.roughness_metallic_texture
    if fine is None or coarse is None or len(fine) <= len(coarse) or len(fine) % len(coarse):
        return asset
    albedo = area_average(fine, len(fine) // len(coarse)).astype(np.float32)
    return dataclasses.replace(asset, materials=[dataclasses.replace(material, albedo_texture=albedo)])


def with_normal_texture(asset: Asset) -> Asset:
    """The asset with the mesh's own normals as its normal texture, if a refinement has left it out."""
    material = asset.materials[0]
    if material.normal_texture is not None or material.roughness_metallic_texture is None or asset.uv is None:
        return asset
    straight = np.tile(np.float32([0, 0, 1]), (*material.roughness_metallic_texture.shape[:2], 1))
    tangents = vertex_tangents(asset.vertices, asset.triangles, asset.normals, asset.uv)
    return dataclasses.replace(
        asset, tangents=tangents, materials=[dataclasses.replace(material, normal_texture=straight)]
    )


def record_of(refined: Refined, seconds: float) -> dict:
    """The contents of refinement.json."""
    return {
        "seconds": round(seconds, 1),
        "outline": refined.outline,
        "lamp": None if refined.lamp is None else refined.lamp._asdict(),
        "level": refined.level,
        "tint": refined.tint,
        "saturated": refined.saturated,
        "held_out": list(refined.held),
        "delivered": refined.delivered,
        "normal_texture": refined.asset.materials[0].normal_texture is not None,
        "detail": refined.detail,
        "sweeps": [sweep._asdict() for sweep in refined.sweeps],
    }


def refinement_summary(run: Path) -> dict:
    """The changes by the refinement of a run; pairs are before and after."""
    try:
        record = read_json(run / RECORD, "sweeps")
        sweeps, outline = record["sweeps"], record["outline"]
        return {
            "steps": len(sweeps),
            "seconds": record["seconds"],
            "photos_psnr": [decibels(sweeps[i]["error"]) for i in (0, -1)],
            "outline_error": [outline[0], outline[-1]] if outline else None,
            "held_out_psnr": [decibels(error) for error in record["held_out"]],
            "delivered": record["delivered"],
            "level": float(record["level"]),
            "tint": record.get("tint", [1.0, 1.0, 1.0]),
            "normal_texture": record["normal_texture"],
            "detail": record["detail"],
            "lamp": record["lamp"] is not None,
            "saturated": record["saturated"],
        }
    except (KeyError, TypeError, IndexError, ValueError, OverflowError):
        raise InputError(f"{run / RECORD}: is damaged; refine the run again") from None


def forget_state(folder: Path) -> None:
    """Deletes the state of a refinement that is done or void."""
    (folder / STATE).unlink(missing_ok=True)


def refine_run(
    run: Path, data: Path, out: Path, *, downscale: int, settings: FitSettings, resume: bool, reading: Reading
) -> Refined | None:
    """Refines what training exported into a run, or another asset that stands where its photos are; see
    :func:`refine_folder`."""
    source = source_of(run)
    with locked(out):
        read_source(source)
        dataset = with_exposures(load_dataset(data, "train", downscale, reading), run)
        check_place(source, dataset.origin)
        try:
            refined = refine_folder(source, dataset, out, settings, resume=resume)
        except InputError as error:
            raise InputError(f"{source / 'mesh.glb'} and {data}: {error}") from error
        if refined is not None:
            forget_state(out)
    return refined
