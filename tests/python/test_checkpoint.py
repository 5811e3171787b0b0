"""What a checkpoint may hold, and what a run takes back from it: a file from anywhere costs one line, not a crash, code or memory."""

import errno
import functools
import io
import os
import pickle
import struct
import zipfile
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from splitnerf.data import tensor_files
from splitnerf.data.dataset import load_dataset
from splitnerf.data.tensor_files import LONGEST_PICKLE
from splitnerf.errors import InputError
from splitnerf.render.model import SceneModel
from splitnerf.training import checkpoint
from splitnerf.training.checkpoint import load_checkpoint, restore_generator, restore_optimiser
from splitnerf.training.schedule import make_optimiser
from test_files import no_more_than
from tiny_runs import tiny, train_scene


@pytest.fixture(scope="module")
def written(data, tmp_path_factory) -> bytes:
    """The checkpoint of a run of 2 steps with the seed 5."""
    run = tmp_path_factory.mktemp("written")
    train_scene(load_dataset(data), tiny(steps=2, seed=5), run)
    return (run / "checkpoint.pt").read_bytes()


@pytest.fixture
def content(written) -> dict:
    return torch.load(io.BytesIO(written), weights_only=True)


@pytest.fixture
def path(written, tmp_path) -> Path:
    """The file, to be damaged."""
    (tmp_path / "checkpoint.pt").write_bytes(written)
    return tmp_path / "checkpoint.pt"


def stored(content: dict, folder: Path) -> dict:
    """What is read of a file of this content."""
    torch.save(content, folder / "checkpoint.pt")
    return load_checkpoint(folder / "checkpoint.pt")


# ---- the file ----


def repack(path: Path, change=lambda pickled: pickled, **options) -> None:
    """Writes a checkpoint's container again, its pickle changed."""
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w", **options) as archive:
        for name, part in parts.items():
            archive.writestr(name, change(part) if name.endswith("data.pkl") else part)


def list_parts_often(path: Path) -> None:
    """Writes a directory that lists each part 50 times."""
    raw = path.read_bytes()
    count, size, start = struct.unpack_from("<HII", raw, raw.rindex(b"PK\x05\x06") + 10)
    directory = raw[start : start + size] * 50
    tail = struct.pack("<4sHHHHIIH", b"PK\x05\x06", 0, 0, 50 * count, 50 * count, len(directory), start, 0)
    path.write_bytes(raw[:start] + directory + tail)


class Calls:
    """Pickled, it calls a function."""

    def __init__(self, function, *arguments):
        self.function, self.arguments = function, arguments

    def __reduce__(self):
        return self.function, self.arguments


def calling(function: Callable, *arguments: object) -> Callable[[Path], None]:
    content = {"format": 1, "model": Calls(function, *arguments)}
    return lambda path: repack(path, lambda _: pickle.dumps(content, protocol=2))


def flip_a_bit(path: Path) -> None:
    with zipfile.ZipFile(path) as archive:
        largest = max(archive.infolist(), key=lambda part: part.file_size)
    raw = bytearray(path.read_bytes())
    raw[largest.header_offset + 400 + largest.file_size // 2] ^= 0x80
    path.write_bytes(raw)


DAMAGED = {
    "a shell's command": (calling(os.system, "touch owned"), "not a readable checkpoint .it asks for"),
    "a line of Python": (calling(eval, "open('owned', 'w')"), "not a readable checkpoint .it asks for"),
    "an endless array": (calling(bytearray, 10**15), "not a readable checkpoint .it asks for"),
    "an endless tensor": (calling(torch.FloatTensor, 10**15), "not a readable checkpoint .it asks for"),
    "compressed parts": (functools.partial(repack, compression=zipfile.ZIP_DEFLATED), "its parts are compressed"),
    "more parts than bytes": (list_parts_often, "not a readable checkpoint"),
    "a pickle that is too long": (
        lambda path: repack(path, lambda pickled: pickled + bytes(LONGEST_PICKLE + 1 - len(pickled))),
        "its pickle is too long",
    ),
    "a bit that flipped": (flip_a_bit, "the checksum of .* is wrong"),
    "no file": (Path.unlink, "no checkpoint there"),
    "another format": (
        lambda path: torch.save(torch.load(path, weights_only=True) | {"format": 1}, path),
        "format 1, this version reads 2",
    ),
}


@pytest.mark.parametrize("case", DAMAGED)
def test_a_damaged_file_is_refused_and_calls_nothing(path, monkeypatch, case):
    monkeypatch.chdir(path.parent)
    damage, message = DAMAGED[case]
    damage(path)
    with pytest.raises(InputError, match=f"checkpoint.pt: .*{message}"):
        load_checkpoint(path)
    assert not Path("owned").exists()


def test_a_pickle_may_be_as_long_as_is_allowed(path):
    repack(path, lambda pickled: pickled + bytes(LONGEST_PICKLE - len(pickled)))
    assert load_checkpoint(path)["step"] == 2


def test_the_unpickler_calls_nothing_by_itself(tmp_path, monkeypatch):
    """Without the look into the pickle that comes before it."""
    monkeypatch.setattr(tensor_files, "_check_pickle", lambda pickled: None)
    with pytest.raises(InputError, match="not a readable checkpoint"):
        stored({"format": 1, "model": Calls(os.system, f"touch {tmp_path / 'owned'}")}, tmp_path)
    assert not (tmp_path / "owned").exists()


def test_a_disk_that_is_full_keeps_the_old_file(tmp_path, monkeypatch):
    """torch raises its own kind of error, after a part is written; the words are those of the system."""
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
    assert groups[1] == 4 and found["fingerprint"] == "f" and found["format"] == checkpoint.FORMAT
    assert type(found["model"]) is OrderedDict and found["config"]["run"]["steps"] == tiny().run.steps


# ---- what it holds ----

MESH = {"mesh_vertices": torch.zeros(4, 3), "mesh_faces": torch.tensor([[0, 1, 3]])}
SKY = torch.zeros(256, 3)  # of as many directions as the bits have
AIMS = torch.tensor([[0.0, 0.6, -0.8]]).repeat(256, 1)


def put(*keys: str, **values: object) -> Callable[[dict], None]:
    """Puts values in place of those of a checkpoint, or of a dictionary within it."""
    return lambda content: functools.reduce(dict.__getitem__, keys, content).update(values)


def drop(*keys: str) -> Callable[[dict], object]:
    return lambda content: functools.reduce(dict.__getitem__, keys[:-1], content).pop(keys[-1])


def changed(key: str, change: Callable) -> Callable[[dict], None]:
    """Puts what a function makes of a value in its place."""
    return lambda content: content.update({key: change(content[key])})


def parameter(name: str, change: Callable) -> Callable[[dict], None]:
    return lambda content: content["model"].update({name: change(content["model"][name])})


def moments(**values: object) -> Callable[[dict], None]:
    """Puts moments in place of those of the first parameter; None takes one away."""

    def change(content: dict) -> None:
        first = content["optimiser"]["state"][0]
        first.update(values)
        for name in [name for name, value in values.items() if value is None]:
            del first[name]

    return change


def mesh(**values: object) -> Callable[[dict], None]:
    return put(**MESH | values)


def sends(n: int, *emitters: int, **values: object) -> Callable[[dict], None]:
    """A mesh, and the cached light with that of n emitters of these numbers, some of it changed."""
    light = {"sky": SKY, "aims": AIMS, "sent": torch.zeros(n, 3), "emitters": torch.tensor(emitters, dtype=torch.int64)}
    return mesh(occlusion_light=light | values)


def light(**values: object) -> Callable[[dict], None]:
    return put("occlusion_light", **values)


def poisoned(tensor: torch.Tensor) -> torch.Tensor:
    return tensor.index_fill(0, torch.tensor([0]), torch.nan)


ALLOWED = {
    "the most rays": put(n_rays=8192),
    "more rays first than later": lambda c: (put(n_rays=20000)(c), put("config", "constants", initial_rays=20000)(c)),
    "parameters whose sum is too large": parameter("light.texels", lambda x: x.fill_(3e38)),
    "the largest progress": put(meshed_at=1.0, previewed_at=1.0, seconds=0.0, step=0),
    "no mean of quality yet": put(psnr_mean=None),
    "a mesh of smaller numbers": lambda c: (sends(0)(c), put(mesh_faces=MESH["mesh_faces"].int())(c)),
    "light that a mesh sends": sends(4, 0, 2, 255, 4 * 256 - 1),
    "light of a mesh that nothing hits": sends(0),
    "light that was not sent yet": sends(0, sent=None, emitters=None),
    "light that weighs rays": put(environment=torch.zeros(32, 64, 3)),
    "a GPU": put(device="cuda", generator=torch.zeros(16, dtype=torch.uint8)),
}
REFUSED = [
    ("meshed_at is 1.1", put(meshed_at=1.1)),
    ("previewed_at is -0.1", put(previewed_at=-0.1)),
    ("step is -1", put(step=-1)),
    ("step is missing or of another type", put(step="many")),
    ("step is 10000000", put(step=10**400)),
    ("seconds is nan", put(seconds=float("nan"))),
    ("n_rays is 8193", put(n_rays=8193)),
    ("fingerprint is missing or of another type", put(fingerprint=None)),
    ("stopped is missing", drop("stopped")),
    ("psnr_mean is of another type", drop("psnr_mean")),
    ("exposures is missing", drop("exposures")),
    ("device is 'tpu'", put(device="tpu")),
    ("no_such_key", put("config", no_such_key=1)),
    ("n_levels", put("config", n_levels="many")),
    # a small file may not make a large model
    ("occupancy is missing", put("config", grid_resolution=512)),
    ("table does not fit the settings", put("config", log2_table_size=24, base_resolution=4096, n_levels=32)),
    ("light.texels does not fit the settings", put("config", light_resolution=1024)),
    ("light.resolution", put("config", light_resolution=1 << 40)),
    ("light.texels does not fit the settings", parameter("light.texels", lambda x: torch.zeros(3, 3))),
    ("light.texels is missing", parameter("light.texels", lambda x: torch.zeros(1).expand(10**9, 3))),
    ("light.texels is missing", parameter("light.texels", lambda x: x.repeat(1, 2)[:, ::2])),  # with gaps in memory
    ("light.texels has NaN", parameter("light.texels", poisoned)),
    ("variance is missing", parameter("variance", lambda x: x.long())),
    ("model is missing", drop("model")),
    ("the optimiser's state is missing", drop("optimiser", "state")),
    ("the optimiser's step is missing", moments(step=None)),
    ("the optimiser's exp_avg_sq is missing", moments(exp_avg_sq=None)),
    ("the optimiser's exp_avg has NaN", moments(exp_avg=torch.tensor([torch.nan]))),
    ("generator is missing", put(generator=torch.zeros(5056))),
    ("torch_generator is missing", drop("torch_generator")),
    ("occupancy is missing", put(occupancy=torch.zeros(1).expand(16**3))),
    ("cells is missing", changed("cells", torch.flatten)),
    ("box_from_world is missing", put(box_from_world=torch.eye(4))),
    ("box_from_world is missing", put(box_from_world=torch.eye(3).double())),
    *(
        ("box_from_world is not a uniform scale and a translation", changed("box_from_world", change))
        for change in (
            torch.zeros_like,
            lambda box: box * torch.tensor([[-1.0], [1], [1], [1]]),
            lambda box: torch.cat([box[:3], torch.ones_like(box[:1])]),
            lambda box: box + 0.5 * torch.eye(4).roll(1, 1) * torch.tensor([[1.0], [0], [0], [0]]),
        )
    ),
    ("cameras are missing", put(cameras=None)),
    ("cameras are missing", drop("cameras", "intrinsics")),
    ("cameras' intrinsics", lambda c: put("cameras", poses=torch.cat(2 * [c["cameras"]["poses"]]))(c)),
    ("cameras' sizes", put("cameras", sizes=torch.ones(3).long())),
    ("start has no surface", put(start={"distance": torch.full((16, 16, 16), 2.0), "trust": torch.ones(16, 16, 16)})),
    # the mesh
    ("mesh_faces is missing", mesh(mesh_faces=None)),
    ("mesh_vertices is missing", mesh(mesh_vertices=None)),
    ("mesh_vertices is missing", mesh(mesh_vertices=torch.zeros(4, 3).double())),
    ("names vertices that are none", mesh(mesh_faces=torch.tensor([[0, 1, 4]]))),
    ("names vertices that are none", mesh(mesh_faces=torch.tensor([[0, 1, -1]]))),
    ("mesh_faces is empty", mesh(mesh_faces=torch.zeros(0, 3, dtype=torch.int64))),
    # the light, and what the mesh sends
    ("environment is missing", put(environment=torch.zeros(64, 32, 3))),
    ("occlusion_light is missing", put(occlusion_light={})),
    ("occlusion_light is missing or of another kind", drop("occlusion_light", "aims")),
    ("occlusion_light is missing", put("config", occlusion={"kind": "off"}, shading={"method": "split"})),
    ("the sky's light is missing", light(sky=SKY[1:])),
    ("the traced directions is missing or of another", light(aims=AIMS[1:])),
    ("the traced directions has NaN", light(aims=poisoned(AIMS))),
    ("the traced directions are not of length 1", light(aims=SKY)),
    ("are not of length 1", light(aims=torch.cat([AIMS[1:], 1.01 * AIMS[:1]]))),
    ("the light that the mesh sends is missing", sends(5, 0, 2, 3, 4)),
    ("the light that the mesh sends is missing", sends(4, 0, 2, 3, 4, sent=None)),
    ("the number of each emitter is missing", sends(4, emitters=None)),
    ("emitters do not ascend", sends(3, 0, 5, 4)),
    ("emitters do not ascend", sends(3, 0, 5, 5)),
    ("name vertices that are none", sends(2, 0, 4 * 256)),
    ("name vertices that are none", sends(2, -1, 4)),
    ("occlusion_light is missing or of another kind", put(mesh_vertices=None, mesh_faces=None)),
]


@pytest.mark.parametrize("case", ALLOWED)
def test_what_a_run_may_write_is_read(content, tmp_path, case):
    ALLOWED[case](content)
    assert stored(content, tmp_path).keys() == content.keys()


@pytest.mark.parametrize(("message", "change"), REFUSED, ids=[message for message, _ in REFUSED])
def test_what_no_run_writes_is_refused(content, tmp_path, message, change):
    change(content)
    with pytest.raises(InputError) as caught:
        stored(content, tmp_path)
    found = str(caught.value)
    assert "checkpoint.pt: not a checkpoint of a run (" in found and message in found and len(found.splitlines()) == 1


# ---- what is taken back ----

MISFITS = {
    "a parameter too few": (drop("model", "variance"), {}),
    "a parameter too many": (put("model", other=torch.zeros(3)), {}),
    "a moment of another shape": (moments(exp_avg=torch.zeros(7)), {}),
    "no generator": (put(generator=torch.zeros(3, dtype=torch.uint8)), {}),
    "a damaged generator": (lambda c: c["torch_generator"].fill_(255), {}),
}


@pytest.mark.parametrize("case", MISFITS)
def test_a_checkpoint_that_does_not_fit_is_refused(data, content, tmp_path, case):
    change, settings = MISFITS[case]
    change(content)
    torch.save(content, tmp_path / "checkpoint.pt")
    before = torch.get_rng_state()
    said = "checkpoint.pt: its .* (does not fit the settings|cannot be restored)"
    with pytest.raises(InputError, match=said) as caught:
        train_scene(load_dataset(data), tiny(steps=4, **settings), tmp_path, resume=True)
    assert len(str(caught.value).splitlines()) == 1
    torch.set_rng_state(before)


@pytest.mark.parametrize("index", [-1, "count", "0"])
def test_moments_of_no_parameter_are_refused(content, index):
    settings = tiny()
    optimiser = make_optimiser(SceneModel(settings), settings)
    count = sum(len(group["params"]) for group in optimiser.param_groups)
    state = content["optimiser"]["state"]
    state[count if index == "count" else index] = state[count - 1]  # which would fit the last parameter
    with pytest.raises(InputError, match="its optimiser does not fit the settings"):
        restore_optimiser(optimiser, content, Path("checkpoint.pt"))


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
