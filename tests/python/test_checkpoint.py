"""What a checkpoint may hold, and what a run takes back from it."""

from __future__ import annotations

import errno
import functools
import io
import os
from collections import OrderedDict
from pathlib import Path

import pytest
import torch
from test_files import no_more_than
from test_hostile_checkpoints import Calls, first, repack
from tiny_runs import tiny

from splitnerf.data import tensor_files
from splitnerf.data.dataset import load_dataset
from splitnerf.data.tensor_files import LONGEST_PICKLE
from splitnerf.errors import InputError
from splitnerf.render.model import SceneModel
from splitnerf.render.occupancy import make_grid
from splitnerf.training import checkpoint
from splitnerf.training import loop as trainer
from splitnerf.training.checkpoint import load_checkpoint, restore_generator, restore_optimiser, restored_grid
from splitnerf.training.schedule import make_optimiser


@pytest.fixture(scope="module")
def written(data, tmp_path_factory) -> bytes:
    """The checkpoint of a run of 2 steps with the seed 5."""
    run = tmp_path_factory.mktemp("written")
    trainer.train(load_dataset(data), tiny(steps=2, seed=5), run)
    return (run / "checkpoint.pt").read_bytes()


@pytest.fixture
def content(written) -> dict:
    return torch.load(io.BytesIO(written), weights_only=True)


def stored(content: dict, folder: Path) -> dict:
    """What is read of a file of this content."""
    torch.save(content, folder / "checkpoint.pt")
    return load_checkpoint(folder / "checkpoint.pt")


# ---- the file ----


def test_another_format_is_refused(content, tmp_path):
    with pytest.raises(InputError, match="checkpoint format 2, this version reads 1"):
        stored(content | {"format": 2}, tmp_path)


def test_a_pickle_that_is_too_long_is_not_read(written, tmp_path):
    path = tmp_path / "checkpoint.pt"
    path.write_bytes(written)
    repack(path, lambda pickled: pickled + bytes(LONGEST_PICKLE - len(pickled)))
    assert load_checkpoint(path)["step"] == 2
    repack(path, lambda pickled: pickled + bytes(1))
    with pytest.raises(InputError, match="its pickle is too long"):
        load_checkpoint(path)


def test_the_unpickler_calls_nothing_by_itself(tmp_path, monkeypatch):
    """Without the look into the pickle that comes before it."""
    monkeypatch.setattr(tensor_files, "_check_pickle", lambda pickled: None)
    with pytest.raises(InputError, match="not a readable checkpoint"):
        stored({"format": 1, "model": Calls(os.system, f"touch {tmp_path / 'owned'}")}, tmp_path)
    assert not (tmp_path / "owned").exists()


def test_a_missing_file_is_told(tmp_path):
    with pytest.raises(InputError, match="checkpoint.pt: no checkpoint there"):
        load_checkpoint(tmp_path / "checkpoint.pt")


def test_a_disk_that_is_full_keeps_the_old_file(content, tmp_path, monkeypatch):
    """torch tells it by its own kind of error, after a part is written; the words are those of the system."""
    path = tmp_path / "checkpoint.pt"
    path.write_bytes(b"old")

    def fails(content, file, cause=None):
        file.write(b"new")
        try:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)) if cause else ValueError
        except (OSError, ValueError):
            raise RuntimeError("unexpected pos")

    for cause, words in ((False, "unexpected pos"), (True, "No space left on device")):
        monkeypatch.setattr(torch, "save", functools.partial(fails, cause=cause))
        with pytest.raises(OSError, match=f"checkpoint.pt: cannot be written .{words}.$"):
            checkpoint.save_checkpoint(path, config=tiny(), fingerprint="", state={})
    monkeypatch.undo()
    with no_more_than(700), pytest.raises(OSError, match="checkpoint.pt: cannot be written .File too large.$"):
        checkpoint.save_checkpoint(path, config=tiny(), fingerprint="", state={"x": torch.zeros(9999)})
    assert path.read_bytes() == b"old" and list(tmp_path.iterdir()) == [path]


class Elsewhere(torch.Tensor):
    """A tensor of a device that another machine may lack."""

    def cpu(self) -> torch.Tensor:
        return self.as_subclass(torch.Tensor)


def test_tensors_of_any_device_are_stored_as_those_of_the_cpu(tmp_path):
    """In dictionaries and lists alike; other values stay as they are."""
    x = torch.arange(3.0)
    far = x.as_subclass(Elsewhere)
    path = tmp_path / "checkpoint.pt"
    state = {"model": OrderedDict(a=far), "optimiser": {"state": {0: {"step": far}}, "groups": [far, 4]}, "sky": far}
    checkpoint.save_checkpoint(path, config=tiny(), fingerprint="f", state=state)
    found = torch.load(path, weights_only=True)
    groups = found["optimiser"]["groups"]
    for tensor in (found["model"]["a"], found["optimiser"]["state"][0]["step"], groups[0], found["sky"]):
        assert type(tensor) is torch.Tensor and torch.equal(tensor, x)
    assert groups[1] == 4 and found["fingerprint"] == "f" and found["format"] == 1
    assert type(found["model"]) is OrderedDict and found["config"]["run"]["steps"] == tiny().run.steps


# ---- what it holds ----

MESH = {"mesh_vertices": torch.zeros(4, 3), "mesh_faces": torch.tensor([[0, 1, 3]])}
SKY = torch.zeros(256, 3)  # of as many directions as the bits have
AIMS = torch.tensor([[0.0, 0.6, -0.8]]).repeat(256, 1)


def sent(n: int, *emitters: int, **changed: object) -> dict:
    """Cached light, with that of n emitters of these numbers, some of it changed."""
    return {"sky": SKY, "aims": AIMS, "sent": torch.zeros(n, 3), "emitters": torch.tensor(emitters, dtype=torch.int64)} | changed


def gaps(texels: torch.Tensor) -> torch.Tensor:
    """The same shape in memory with gaps."""
    return texels.repeat(1, 2)[:, ::2]


ALLOWED = {
    "the most rays": lambda c: c.update(n_rays=8192),
    "more rays at first than later": lambda c: c.update(
        n_rays=20000, config=c["config"] | {"constants": c["config"]["constants"] | {"initial_rays": 20000}}
    ),
    "parameters whose sum is too large": lambda c: c["model"]["light.texels"].fill_(3e38),
    "the largest progress": lambda c: c.update(meshed_at=1.0, previewed_at=1.0, seconds=0.0, step=0),
    "no mean of quality yet": lambda c: c.update(psnr_mean=None),
    "a mesh of smaller numbers": lambda c: c.update(
        MESH, mesh_faces=MESH["mesh_faces"].int(), occlusion_light=sent(0)
    ),
    "light that a mesh sends": lambda c: c.update(MESH, occlusion_light=sent(4, 0, 2, 255, 4 * 256 - 1)),
    "light of a mesh that nothing hits": lambda c: c.update(MESH, occlusion_light=sent(0)),
    "light that was not sent yet": lambda c: c.update(MESH, occlusion_light=sent(0, sent=None, emitters=None)),
    "light that weighs rays": lambda c: c.update(environment=torch.zeros(32, 64, 3)),
    "a GPU": lambda c: c.update(device="cuda", generator=torch.zeros(16, dtype=torch.uint8)),
}  # fmt: skip
REFUSED = {
    "progress beyond the end": (lambda c: c.update(meshed_at=1.1), "meshed_at is 1.1"),
    "negative progress": (lambda c: c.update(previewed_at=-0.1), "previewed_at is -0.1"),
    "a negative step": (lambda c: c.update(step=-1), "step is -1"),
    "one ray too many": (lambda c: c.update(n_rays=8193), "n_rays is 8193"),
    "no fingerprint": (lambda c: c.update(fingerprint=None), "fingerprint is missing or of another type"),
    "a sky of other directions": (lambda c: c["occlusion_light"].update(sky=SKY[1:]), "the sky's light is missing"),
    "fewer aims than cells": (
        lambda c: c["occlusion_light"].update(aims=AIMS[1:]), "the traced directions is missing or of another",
    ),
    "no aims": (lambda c: c["occlusion_light"].update(aims=None), "the traced directions is missing or of another"),
    "aims of no length": (lambda c: c["occlusion_light"].update(aims=SKY), "the traced directions are not of length 1"),
    "a single aim that is longer": (
        lambda c: c["occlusion_light"].update(aims=torch.cat([AIMS[1:], 1.01 * AIMS[:1]])), "are not of length 1",
    ),
    "an aim of NaN": (lambda c: c["occlusion_light"]["aims"][7].fill_(torch.nan), "the traced directions has NaN"),
    "light of other emitters": (
        lambda c: c.update(MESH, occlusion_light=sent(5, 0, 2, 3, 4)), "the light that the mesh sends is missing",
    ),
    "light of emitters of no numbers": (
        lambda c: c.update(MESH, occlusion_light=sent(4, emitters=None)), "the number of each emitter is missing",
    ),
    "numbers of emitters without light": (
        lambda c: c.update(MESH, occlusion_light=sent(4, 0, 2, 3, 4, sent=None)), "the light that the mesh sends is missing",
    ),
    "emitters out of order": (lambda c: c.update(MESH, occlusion_light=sent(3, 0, 5, 4)), "emitters do not ascend"),
    "an emitter twice": (lambda c: c.update(MESH, occlusion_light=sent(3, 0, 5, 5)), "emitters do not ascend"),
    "an emitter one too far": (lambda c: c.update(MESH, occlusion_light=sent(2, 0, 4 * 256)), "name vertices that are none"),
    "an emitter before the first": (lambda c: c.update(MESH, occlusion_light=sent(2, -1, 4)), "name vertices that are none"),
    "light of no mesh": (
        lambda c: c.update(occlusion_light=sent(2, 0, 4), mesh_vertices=None, mesh_faces=None), "name vertices that are none",
    ),
    "emitters without aims": (lambda c: c["occlusion_light"].pop("aims"), "occlusion_light is missing or of another kind"),
    "a mesh of a number": (lambda c: c.update(MESH, mesh_vertices=torch.tensor(1.0)), "mesh_vertices is missing"),
    "no light of the occlusion": (lambda c: c.update(occlusion_light={}), "occlusion_light is missing"),
    "light of an occlusion without any": (
        lambda c: c["config"].update(occlusion={"kind": "off"}, shading={"method": "split"}),
        "occlusion_light is missing",
    ),
    "light that weighs rays, turned": (
        lambda c: c.update(environment=torch.zeros(64, 32, 3)), "environment is missing",
    ),
    "light's noise of one number": (lambda c: c.update(light_noise=torch.zeros(1).double()), "light_noise is missing"),
    "light's noise in a column": (lambda c: c.update(light_noise=c["light_noise"][:, None]), "light_noise is missing"),
    "light's noise of NaN": (lambda c: c["light_noise"].fill_(torch.nan), "light_noise has NaN"),
    "no cameras": (lambda c: c.update(cameras=None), "cameras are missing"),
    "cameras without lenses": (lambda c: c["cameras"].pop("intrinsics"), "cameras are missing"),
    "more cameras than lenses": (
        lambda c: c["cameras"].update(poses=torch.cat(2 * [c["cameras"]["poses"]])), "cameras' intrinsics",
    ),
    "a photo's size of three numbers": (lambda c: c["cameras"].update(size=torch.ones(3).long()), "cameras' size"),
    "a frame of single precision": (lambda c: c.update(box_from_world=torch.eye(4)), "box_from_world is missing"),
    "no exposures": (lambda c: c.pop("exposures"), "exposures is missing"),
    "no word on how it ended": (lambda c: c.pop("stopped"), "stopped is missing"),
    "no mean of quality": (lambda c: c.pop("psnr_mean"), "psnr_mean is of another type"),
    "a start without a surface": (
        lambda c: c.update(start={"distance": torch.full((16, 16, 16), 2.0), "trust": torch.ones(16, 16, 16)}),
        "start has no surface",
    ),
    "a mean of quality that is a word": (lambda c: c.update(psnr_mean="high"), "psnr_mean is of another type"),
    "an unknown device": (lambda c: c.update(device="tpu"), "device is 'tpu'"),
    "cells of another shape": (lambda c: c.update(cells=c["cells"].flatten()), "cells is missing"),
    "too few values of cells": (lambda c: c.update(occupancy=c["occupancy"][1:]), "occupancy is missing"),
    "a generator of numbers": (lambda c: c.update(generator=torch.zeros(5056)), "generator is missing"),
    "no generator of torch": (lambda c: c.pop("torch_generator"), "torch_generator is missing"),
    "vertices without faces": (lambda c: c.update(MESH, mesh_faces=None), "mesh_faces is missing"),
    "faces without vertices": (lambda c: c.update(MESH, mesh_vertices=None), "mesh_vertices is missing"),
    "vertices of double precision": (
        lambda c: c.update(MESH, mesh_vertices=torch.zeros(4, 3).double()), "mesh_vertices is missing",
    ),
    "flat vertices": (lambda c: c.update(MESH, mesh_vertices=torch.zeros(4, 2)), "mesh_vertices is missing"),
    "a face one too far": (
        lambda c: c.update(MESH, mesh_faces=torch.tensor([[0, 1, 4]])), "names vertices that are none",
    ),
    "moments without their steps": (lambda c: first(c).pop("step"), "the optimiser's step is missing"),
    "a parameter that leaves out places": (
        lambda c: c["model"].update({"light.texels": gaps(c["model"]["light.texels"])}), "light.texels is missing",
    ),
    "a light of more texels": (
        lambda c: c["model"].update({"light.texels": torch.zeros(3, 3)}), "light.texels does not fit the settings",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", ALLOWED)
def test_what_a_run_may_write_is_read(content, tmp_path, case):
    ALLOWED[case](content)
    assert stored(content, tmp_path).keys() == content.keys()


@pytest.mark.parametrize("case", REFUSED)
def test_what_no_run_writes_is_refused(content, tmp_path, case):
    change, message = REFUSED[case]
    change(content)
    with pytest.raises(InputError) as caught:
        stored(content, tmp_path)
    assert "checkpoint.pt: not a checkpoint of a run (" in str(caught.value) and message in str(caught.value)


# ---- what is taken back ----


def test_moments_come_back_and_rates_are_those_of_the_settings(content):
    settings = tiny(learning_rate=0.07)
    optimiser = make_optimiser(SceneModel(settings), settings)
    fresh = [{key: x for key, x in group.items() if key != "params"} for group in optimiser.param_groups]
    restore_optimiser(optimiser, content, Path("checkpoint.pt"))
    assert [{key: x for key, x in group.items() if key != "params"} for group in optimiser.param_groups] == fresh
    parameters = [parameter for group in optimiser.param_groups for parameter in group["params"]]
    for index, moments in content["optimiser"]["state"].items():
        assert all(torch.equal(optimiser.state[parameters[index]][name], moments[name]) for name in moments)
    assert len(optimiser.state) == len(content["optimiser"]["state"]) > 0


@pytest.mark.parametrize("index", [-1, "count", "0"])
def test_moments_of_no_parameter_are_refused(content, index):
    settings = tiny()
    optimiser = make_optimiser(SceneModel(settings), settings)
    count = sum(len(group["params"]) for group in optimiser.param_groups)
    state = content["optimiser"]["state"]
    state[count if index == "count" else index] = state[count - 1]  # which would fit the last parameter
    with pytest.raises(InputError, match="its optimiser does not fit the settings"):
        restore_optimiser(optimiser, content, Path("checkpoint.pt"))


def test_cells_come_back_by_their_values_and_by_their_classes(content):
    values, cells = restored_grid(make_grid(tiny()), content, Path("checkpoint.pt"))
    assert torch.equal(values, content["occupancy"]) and torch.equal(cells, content["cells"])
    with pytest.raises(InputError, match="its occupancy grid does not fit the settings"):
        restored_grid(make_grid(tiny(grid_resolution=20)), content, Path("checkpoint.pt"))


def test_generators_go_on_where_they_stopped_or_begin_with_seed_and_step(content):
    """A state fits its own device; a run that changes it does not draw again what it drew in its first step."""
    before, generator = torch.get_rng_state(), torch.Generator().manual_seed(1)
    try:
        restore_generator(generator, content, Path("checkpoint.pt"))
        assert torch.equal(generator.get_state(), content["generator"])
        assert torch.equal(torch.get_rng_state(), content["torch_generator"])
        restore_generator(generator, content | {"device": "cuda"}, Path("checkpoint.pt"))
        drawn = torch.rand(3, generator=generator)
        assert torch.equal(drawn, torch.rand(3, generator=torch.Generator().manual_seed(5 + 2)))
    finally:
        torch.set_rng_state(before)
