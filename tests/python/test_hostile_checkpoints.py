"""Checkpoints that nobody means well with: one line that names them, no crash, no code run, little memory."""

from __future__ import annotations

import io
import os
import pickle
import struct
import zipfile
from pathlib import Path

import pytest
import torch
from tiny_runs import tiny

from splitnerf.training import loop as trainer
from splitnerf.training.checkpoint import load_checkpoint
from splitnerf.data.dataset import load_dataset
from splitnerf.errors import InputError
from splitnerf.pipeline import load_run


def repack(path: Path, change=lambda pickled: pickled, **options) -> None:
    """Writes a checkpoint's container again, its pickle changed."""
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w", **options) as archive:
        for name, part in parts.items():
            archive.writestr(name, change(part) if name.endswith("data.pkl") else part)


class Calls:
    """Pickled, it calls a function."""

    def __init__(self, function, *arguments):
        self.function, self.arguments = function, arguments

    def __reduce__(self):
        return self.function, self.arguments


@pytest.mark.parametrize("payload", [
    lambda folder: Calls(os.system, f"touch {folder / 'owned'}"),
    lambda folder: Calls(eval, f"open({str(folder / 'owned')!r}, 'w')"),
    lambda folder: Calls(bytearray, 10**15),
    lambda folder: Calls(torch.FloatTensor, 10**15),
])  # fmt: skip
def test_a_checkpoint_calls_nothing(begun, tmp_path, payload):
    path = begun[0] / "checkpoint.pt"
    repack(path, lambda _: pickle.dumps({"format": 1, "model": payload(tmp_path)}, protocol=2))
    with pytest.raises(InputError, match="checkpoint.pt: not a readable checkpoint .it asks for"):
        load_checkpoint(path)
    assert not (tmp_path / "owned").exists()


def test_a_checkpoint_is_not_compressed(begun):
    path = begun[0] / "checkpoint.pt"
    repack(path, compression=zipfile.ZIP_DEFLATED)
    with pytest.raises(InputError, match="compressed"):
        load_checkpoint(path)


def test_a_checkpoint_is_no_longer_than_its_file(begun):
    """A directory that lists one part many times."""
    path = begun[0] / "checkpoint.pt"
    raw = path.read_bytes()
    end = raw.rindex(b"PK\x05\x06")
    count, size, start = struct.unpack_from("<HII", raw, end + 10)
    directory = raw[start : start + size] * 50
    tail = struct.pack("<4sHHHHIIH", b"PK\x05\x06", 0, 0, 50 * count, 50 * count, len(directory), start, 0)
    path.write_bytes(raw[:start] + directory + tail)
    with pytest.raises(InputError, match="not a readable checkpoint"):
        load_checkpoint(path)


def first(state: dict) -> dict:
    return next(iter(state["optimiser"]["state"].values()))


def poisoned(tensor: torch.Tensor) -> torch.Tensor:
    return tensor.index_fill(0, torch.tensor([0]), torch.nan)


BAD_CONTENTS = {
    "no model": lambda c: c.pop("model"),
    "no steps": lambda c: c.update(step="many"),
    "endless steps": lambda c: c.update(step=10**400),
    "endless rays": lambda c: c.update(n_rays=10**9),
    "no rays": lambda c: c.update(n_rays=0),
    "NaN seconds": lambda c: c.update(seconds=float("nan")),
    "unknown settings": lambda c: c["config"].update(no_such_key=1),
    "settings of another type": lambda c: c["config"].update(n_levels="many"),
    "settings of a huge grid": lambda c: c["config"].update(grid_resolution=512),
    "settings of a huge table": lambda c: c["config"].update(log2_table_size=24, base_resolution=4096, n_levels=32),
    "settings of a huge light": lambda c: c["config"].update(light_resolution=1024),
    "settings of an endless light": lambda c: c["config"].update(light_resolution=1 << 40),
    "a parameter of another shape": lambda c: c["model"].update({"light.texels": torch.zeros(3)}),
    "a parameter that is no tensor": lambda c: c["model"].update({"light.texels": [0.0]}),
    "a parameter of another kind": lambda c: c["model"].update({"variance": torch.tensor(1)}),
    "a parameter without memory": lambda c: c["model"].update({"light.texels": torch.zeros(1).expand(10**9, 3)}),
    "a NaN parameter": lambda c: c["model"].update({"light.texels": poisoned(c["model"]["light.texels"])}),
    "no optimiser": lambda c: c["optimiser"].pop("state"),
    "a moment of NaN": lambda c: first(c).update(exp_avg=poisoned(first(c)["exp_avg"])),
    "no moment": lambda c: first(c).pop("exp_avg_sq"),
    "no cells": lambda c: c.update(occupancy=torch.zeros(3)),
    "endless cells": lambda c: c.update(occupancy=torch.zeros(1).expand(16**3)),
    "no frame": lambda c: c.update(box_from_world=torch.eye(3).double()),
    "faces without vertices": lambda c: c.update(mesh_vertices=None, mesh_faces=torch.zeros(1, 3, dtype=torch.int64)),
    "faces out of range": lambda c: c.update(mesh_vertices=torch.zeros(3, 3), mesh_faces=torch.tensor([[0, 1, 3]])),
    "negative faces": lambda c: c.update(mesh_vertices=torch.zeros(3, 3), mesh_faces=torch.tensor([[0, 1, -1]])),
    "no faces": lambda c: c.update(mesh_vertices=torch.zeros(3, 3), mesh_faces=torch.zeros(0, 3, dtype=torch.int64)),
}  # fmt: skip


@pytest.fixture(scope="module")
def written(data, tmp_path_factory) -> bytes:
    run = tmp_path_factory.mktemp("written")
    trainer.train(load_dataset(data), tiny(steps=2), run)
    return (run / "checkpoint.pt").read_bytes()


@pytest.mark.parametrize("case", BAD_CONTENTS)
def test_a_checkpoint_that_is_not_one_of_a_run(written, tmp_path, case):
    path = tmp_path / "checkpoint.pt"
    content = torch.load(io.BytesIO(written), weights_only=True)
    BAD_CONTENTS[case](content)
    torch.save(content, path)
    with pytest.raises(InputError, match="checkpoint.pt: not a checkpoint of a run") as caught:
        load_run(tmp_path)
    assert len(str(caught.value).splitlines()) == 1


BAD_STATES = {
    "a parameter too few": lambda c: c["model"].pop("variance"),
    "a parameter too many": lambda c: c["model"].update(other=torch.zeros(3)),
    "a moment of another shape": lambda c: first(c).update(exp_avg=torch.zeros(7)),
    "moments of nothing": lambda c: c["optimiser"]["state"].update({999: first(c)}),
    "no generator": lambda c: c.update(generator=torch.zeros(3, dtype=torch.uint8)),
    "a damaged generator": lambda c: c["torch_generator"].fill_(255),
}


@pytest.mark.parametrize("case", BAD_STATES)
def test_a_checkpoint_that_does_not_fit(data, written, tmp_path, case):
    path = tmp_path / "checkpoint.pt"
    content = torch.load(io.BytesIO(written), weights_only=True)
    BAD_STATES[case](content)
    torch.save(content, path)
    before = torch.get_rng_state()
    with pytest.raises(InputError, match="checkpoint.pt: its") as caught:
        trainer.train(load_dataset(data), tiny(steps=4), tmp_path, resume=True)
    assert len(str(caught.value).splitlines()) == 1
    torch.set_rng_state(before)


def test_settings_that_no_longer_fit_are_named(data, begun):
    for settings in ({"n_levels": 5}, {"grid_resolution": 20}):
        with pytest.raises(InputError, match="checkpoint.pt: its .* does not fit the settings"):
            trainer.train(load_dataset(data), tiny(steps=12, **settings), begun[0], resume=True)
