"""Saves and loads the state of a run. A checkpoint holds tensors and plain values only: loading runs no code."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from splitnerf.config import Config
from splitnerf.data.tensor_files import check_tensor, read_tensors, write_tensors
from splitnerf.errors import InputError
from splitnerf.refinement.refine import STATE
from splitnerf.render.model import grid_spec
from splitnerf.render.occupancy import OccupancyGrid
from splitnerf.render.seen import Cameras
from splitnerf.training.start import HELD_UNTIL, StartShape

FORMAT = 2
KINDS = {dict: "config model optimiser", str: "fingerprint", int: "step n_rays", bool: "stopped"}
KINDS[float] = "seconds meshed_at previewed_at"
LARGEST = {"step": 1e12, "seconds": 1e12, "meshed_at": 1.0, "previewed_at": 1.0}
MOMENTS = ("exp_avg", "exp_avg_sq")
CACHED_LIGHT = {"sky", "aims", "sent", "emitters"}


def save(training: Any) -> None:
    """Writes the checkpoint of a :class:`splitnerf.training.loop.Training`."""
    t, start = training, training.take_step.start if training.progress < HELD_UNTIL else None
    state = dict(
        step=t.step,
        seconds=t.seconds,
        n_rays=t.n_rays,
        previewed_at=t.previewed_at,
        stopped=t.stopped,
        psnr_mean=t.log.psnr,
        exposures=t.exposures.sums,
        model=t.model.state_dict(),
        optimiser={"state": t.optimiser.state_dict()["state"]},  # the rates are those of settings and step
        device=t.generator.device.type,
        generator=t.generator.get_state(),
        torch_generator=torch.get_rng_state(),
        occupancy=t.grid.values,
        cells=t.grid.cells,
        box_from_world=torch.from_numpy(t.dataset.box_from_world),
        start=None if start is None else start.state(),
        cameras=Cameras.of(t.dataset)._asdict(),
        light_turns=t.model.turns,
        ground=None if t.dataset.ground is None else torch.from_numpy(t.dataset.ground),
        **t.mesh.state(),
    )
    save_checkpoint(t.run / "checkpoint.pt", config=t.config, fingerprint=t.fingerprint, state=state)


def restore(training: Any) -> None:
    """Puts the state of its run's checkpoint into a :class:`splitnerf.training.loop.Training`. Raises InputError where the
    checkpoint cannot be read, or belongs to other images or settings."""
    t, path = training, training.run / "checkpoint.pt"
    content = load_checkpoint(path)
    check_same_scene(content, t.fingerprint, t.run)
    restore_model(t.model, content, path)
    restore_optimiser(t.optimiser, content, path)
    restore_generator(t.generator, content, path)
    t.grid.values, t.grid.cells = restored_grid(t.grid, content, path)
    t.step, t.seconds, t.n_rays, t.previewed_at = (content[x] for x in ("step", "seconds", "n_rays", "previewed_at"))
    t.log.psnr = content["psnr_mean"]
    # A run that was stopped for its export goes on with the export's refinement; one that has it trains on.
    t.stopped = content["stopped"] and (t.run / STATE).is_file()
    if t.exposures.learned:
        t.exposures.restore(content["exposures"])
    if content.get("start") is not None:
        tensors = {name: x.to(t.grid.device) for name, x in content["start"].items()}
        t.take_step.start = StartShape(box=t.config.constants.box, **tensors)
    t.model.open_levels(t.progress)
    t.mesh.restore(content)


def save_checkpoint(path: Path, *, config: Config, fingerprint: str, state: dict) -> None:
    """Writes a new file, then renames it over the old checkpoint, which an error leaves as it is. Raises OSError."""
    write_tensors(path, {"format": FORMAT, "config": dataclasses.asdict(config), "fingerprint": fingerprint, **state})


def load_checkpoint(path: Path) -> dict:
    """Reads a checkpoint from any source, see :func:`splitnerf.data.tensor_files.read_tensors`. Raises InputError where the file is
    missing, truncated or of another format, or it holds values whose type, shape or range the trainer does not write, or numbers
    that are not finite."""
    if not path.is_file():
        raise InputError(f"{path}: no checkpoint there; train without --resume first")
    try:
        content = read_tensors(path)
    except ValueError as error:
        raise InputError(f"{path}: not a readable checkpoint ({error}); use another, or train anew") from None
    found = content["format"]
    if found != FORMAT:
        raise InputError(f"{path}: checkpoint format {found}, this version reads {FORMAT}")
    try:
        _check_content(content)
    except (ValueError, InputError) as error:
        raise InputError(f"{path}: not a checkpoint of a run ({error}); use another, or train anew") from None
    return content


def check_same_scene(content: dict, fingerprint: str, run: Path) -> None:
    """Raises InputError where a run's checkpoint was trained on other images."""
    if content["fingerprint"] != fingerprint:
        raise InputError(
            f"{run / 'checkpoint.pt'}: was trained on other images, or with another --downscale or --eval-mode; give those, or "
            "another --out"
        )


def config_of(content: dict) -> Config:
    """The settings of the run that wrote the checkpoint."""
    return Config().replace(content["config"])


def restore_model(model: nn.Module, content: dict, path: Path) -> None:
    """Puts a checkpoint's parameters into a model. Raises InputError where the settings differ from the
    checkpoint's."""
    ours, stored = model.state_dict(), content["model"]
    for name in [*ours, *stored]:
        if name not in ours or name not in stored or ours[name].shape != stored[name].shape:
            raise InputError(f"{path}: its parameter {name} does not fit the settings; leave them as they were")
    model.load_state_dict(stored)


def restore_optimiser(optimiser: torch.optim.Optimizer, content: dict, path: Path) -> None:
    """Puts the moments of a checkpoint into an AdamW; rates and decay are the settings'. Raises InputError where they
    do not fit."""
    parameters = [parameter for group in optimiser.param_groups for parameter in group["params"]]
    stored = content["optimiser"]["state"]
    for index, moments in stored.items():
        fits = isinstance(index, int) and 0 <= index < len(parameters)
        if not fits or any(moments[name].shape != parameters[index].shape for name in MOMENTS):
            raise InputError(f"{path}: its optimiser does not fit the settings; leave them as they were")
    optimiser.load_state_dict({"state": stored, "param_groups": optimiser.state_dict()["param_groups"]})


def restore_generator(generator: torch.Generator, content: dict, path: Path) -> None:
    """Restores the run's random generator and torch's own of the CPU. A state does not fit another device: a run that
    continues on one seeds its generator anew, by seed and step. Raises InputError where the values are no states."""
    try:
        if content["device"] == generator.device.type:
            generator.set_state(content["generator"])
        else:
            generator.manual_seed(config_of(content).run.seed + content["step"])
        torch.set_rng_state(content["torch_generator"])
    except RuntimeError as error:
        raise InputError(f"{path}: its random generators cannot be restored ({error}); train anew") from None


def restored_grid(grid: OccupancyGrid, content: dict, path: Path) -> tuple[Tensor, Tensor]:
    """The stored values [r^3] and classes [r, r, r] of a grid's cells, on its device. Raises InputError where there are
    others."""
    stored = content["occupancy"], content["cells"]
    if stored[0].shape != grid.values.shape or stored[1].shape != grid.cells.shape:
        raise InputError(f"{path}: its occupancy grid does not fit the settings; leave grid_resolution as it was")
    return stored[0].to(grid.device), stored[1].to(grid.device)


def _check_content(content: dict) -> None:
    """Raises ValueError or InputError where a value is not what the trainer writes."""
    for kind, keys in KINDS.items():
        for key in keys.split():
            if not isinstance(content.get(key), kind):
                raise ValueError(f"{key} is missing or of another type")
    for key, largest in LARGEST.items():
        if not 0 <= content[key] <= largest:
            raise ValueError(f"{key} is {content[key]}")
    if type(content.get("psnr_mean", "missing")) not in (float, type(None)):  # None before the first step
        raise ValueError("psnr_mean is of another type")
    check_tensor("exposures", content.get("exposures"), (-1, 4), torch.float32)
    config = config_of(content)
    if (start := content.get("start")) is not None:
        if not isinstance(start, dict):
            raise ValueError("start is of another type")
        for name in ("distance", "trust"):
            check_tensor(f"start's {name}", start.get(name), (config.sampling.grid_resolution,) * 3, torch.float32)
        if len(StartShape(start["distance"], start["trust"], config.constants.box).near) == 0:
            raise ValueError("start has no surface")
    if not 1 <= content["n_rays"] <= max(config.constants.initial_rays, config.sampling.max_rays):
        raise ValueError(f"n_rays is {content['n_rays']}")
    for name, parameter in content["model"].items():
        check_tensor(f"parameter {name}", parameter, None, torch.float32)
    state = content["optimiser"].get("state")
    if not isinstance(state, dict) or not all(isinstance(moments, dict) for moments in state.values()):
        raise ValueError("the optimiser's state is missing")
    for moments in state.values():
        check_tensor("the optimiser's step", moments.get("step"), (), torch.float32)
        for name in MOMENTS:
            check_tensor(f"the optimiser's {name}", moments.get(name), None, torch.float32)
    if content.get("device") not in ("cpu", "cuda"):
        raise ValueError(f"device is {content.get('device')!r}")
    for key in ("generator", "torch_generator"):
        check_tensor(key, content.get(key), (-1,), torch.uint8)
    resolution = config.sampling.grid_resolution
    check_tensor("occupancy", content.get("occupancy"), (resolution**3,), torch.float32)
    check_tensor("cells", content.get("cells"), (resolution,) * 3, torch.uint8)
    _check_sizes(config, content["model"])
    check_tensor("box_from_world", content.get("box_from_world"), (4, 4), torch.float64)
    box = content["box_from_world"]
    if not (box[0, 0] > 0 and torch.equal(box[:, :3], box[0, 0] * torch.eye(4, 3).double()) and box[3, 3] == 1):
        raise ValueError("box_from_world is not a uniform scale and a translation")
    _check_cameras(content.get("cameras"))
    if (turns := content.get("light_turns")) is not None:
        check_tensor("the light's turns", turns, (len(content["cameras"]["poses"]), 3, 3), torch.float32)
    if (ground := content.get("ground")) is not None:
        check_tensor("ground", ground, (4,), torch.float64)
    vertices, faces = content.get("mesh_vertices"), content.get("mesh_faces")
    if vertices is not None or faces is not None:
        check_tensor("mesh_vertices", vertices, (-1, 3), torch.float32)
        check_tensor("mesh_faces", faces, (-1, 3), torch.int32, torch.int64)
        if not (faces.numel() and 0 <= int(faces.min()) and int(faces.max()) < len(vertices)):
            raise ValueError("mesh_faces is empty or names vertices that are none")
    _check_light(config, content)


def _check_cameras(cameras: object) -> None:
    """Raises ValueError where they are none."""
    if not isinstance(cameras, dict) or cameras.keys() != set(Cameras._fields):
        raise ValueError("cameras are missing or of another type")
    check_tensor("cameras' poses", cameras["poses"], (-1, 4, 4), torch.float32)
    check_tensor("cameras' intrinsics", cameras["intrinsics"], (len(cameras["poses"]), 4), torch.float32)
    check_tensor("cameras' sizes", cameras["sizes"], (len(cameras["poses"]), 2), torch.int64)


def _check_light(config: Config, content: dict) -> None:
    """Raises ValueError where the cached light, stored in addition to the parameters, does not fit the settings."""
    height, cached = config.constants.occlusion_environment_height, content.get("occlusion_light")
    if content.get("environment") is not None:
        check_tensor("environment", content["environment"], (height, 2 * height, 3), torch.float32)
    has_mesh = content.get("mesh_vertices") is not None
    expected = CACHED_LIGHT if has_mesh and config.occlusion.kind == "bits" else set()
    if not isinstance(cached, dict) or cached.keys() != expected:
        raise ValueError("occlusion_light is missing or of another kind")
    if cached:
        _check_bits(cached, config.constants.occlusion_directions, len(content["mesh_vertices"]))


def _check_bits(cached: dict, k: int, n_vertices: int) -> None:
    """Raises ValueError where the cached light is not that of bits of k directions on a mesh of so many vertices."""
    check_tensor("the sky's light", cached["sky"], (k, 3), torch.float32)
    check_tensor("the traced directions", cached["aims"], (k, 3), torch.float32)
    if (cached["aims"].norm(dim=1) - 1.0).abs().max() > 1e-3:
        raise ValueError("the traced directions are not of length 1")
    emitters = cached["emitters"]
    if emitters is None and cached["sent"] is None:
        return
    check_tensor("the number of each emitter", emitters, (-1,), torch.int64)
    if len(emitters) and not (
        emitters[0] >= 0 and emitters[-1] < n_vertices * k and (emitters[1:] > emitters[:-1]).all()
    ):
        raise ValueError("the numbers of the emitters do not ascend, or name vertices that are none")
    check_tensor("the light that the mesh sends", cached["sent"], (len(emitters), 3), torch.float32)


def _check_sizes(config: Config, parameters: dict[str, Tensor]) -> None:
    """Raises ValueError where the settings need larger tensors than the file holds; the model is allocated next."""
    grid = grid_spec(config)
    sizes = {"sdf_field.grid.table": grid.n_entries * grid.n_features}
    if config.light.kind == "pyramid":
        sizes["light.texels"] = 3 * sum(4**k for k in range(2, config.light.resolution.bit_length()))
    for name, size in sizes.items():
        if name not in parameters or parameters[name].numel() != size:
            raise ValueError(f"parameter {name} does not fit the settings")
