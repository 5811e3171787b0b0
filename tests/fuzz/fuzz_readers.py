"""Fuzzes the readers: python tests/fuzz/fuzz_readers.py READER [libFuzzer's options]

READER is json, colmap, neus, png, exr, hdr, glb or checkpoint. The corpus begins with small valid files that the program writes
itself; what libFuzzer adds to it lies in build/fuzz/READER. A reader may return or raise InputError with one line;
anything else, more than -timeout seconds or more than -rss_limit_mb of memory is a finding, and its input is kept in
build/fuzz.

Sums over a PNG's chunks and a zip's parts, which every mutation breaks, are mended in half of the inputs before the
reader sees them.
"""

import contextlib
import gc
import io
import json
import os
import struct
import sys
import tempfile
import types
import zipfile
import zlib
from functools import partial
from pathlib import Path

import atheris
import numpy as np
import torch
from splitnerf.config import Config
from splitnerf.data.asset import Asset, Material
from splitnerf.data.dataset import load_dataset
from splitnerf.data.environment import read_environment
from splitnerf.data.frames import read_frames
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import read_image, read_radiance, write_image
from splitnerf.data.layouts.transforms import read_camera_path
from splitnerf.errors import InputError
from splitnerf.export.writers import write_glb
from splitnerf.render.model import SceneModel
from splitnerf.training.checkpoint import load_checkpoint, restore_model, restore_optimiser, save_checkpoint
from splitnerf.training.schedule import make_optimiser

DEFAULTS = ["-rss_limit_mb=3000", "-timeout=20", "-max_len=65536"]  # the last of two values counts
INSTRUMENTED = ("splitnerf", "zipfile", "pickletools", "torch._weights_only_unpickler")
SIZE = 16
RAW, MENDED = b"\0", b"\1"  # first byte of an input for the readers whose files hold sums


def instrument() -> None:
    """Has libFuzzer see which lines run. An editable install's own import hook keeps atheris's from doing so."""
    for function in gc.get_objects():
        if isinstance(function, types.FunctionType) and (function.__module__ or "").startswith(INSTRUMENTED):
            atheris.instrument_func(function)


def disc(size: int = SIZE) -> np.ndarray:
    """[size, size, 4], grey within a circle, else transparent."""
    y, x = np.mgrid[:size, :size] - (size - 1) / 2
    return np.stack([np.full((size, size), 0.5)] * 3 + [(np.hypot(x, y) < size / 4) * 1.0], axis=-1)


def write_scene(folder: Path) -> dict:
    """Images of a ball, and the content of their transforms_train.json."""
    frames = []
    for i, angle in enumerate(np.linspace(0, 2 * np.pi, 6, endpoint=False)):
        c, s = np.cos(angle), np.sin(angle)
        pose = np.array([[-s, 0, c, 4 * c], [c, 0, s, 4 * s], [0, 1, 0, 0], [0, 0, 0, 1.0]])
        write_image(folder / f"r_{i}.png", disc())
        frames.append({"file_path": f"./r_{i}", "transform_matrix": pose.tolist()})
    return {"camera_angle_x": 0.7, "frames": frames}


class Reader:
    """What a reader is fed: `corpus()` gives its seeds, `read(data)` takes one input that lies in `self.folder`."""

    def __init__(self, folder: Path):
        self.folder = folder

    def file(self, name: str, data: bytes) -> Path:
        path = self.folder / name
        path.write_bytes(data)
        return path


class JsonReader(Reader):
    """A dataset's transforms file, and the same as a camera path."""

    def __init__(self, folder: Path):
        super().__init__(folder)
        self.scene = write_scene(folder)

    def corpus(self) -> list[bytes]:
        lens = {"fl_x": 20.0, "fl_y": 20.0, "cx": 8.0, "cy": 8.0, "w": SIZE, "h": SIZE}
        masked = [frame | {"mask_path": "r_0.png"} for frame in self.scene["frames"]]
        return [json.dumps(content).encode() for content in (self.scene, lens | {"frames": masked})]

    def read(self, data: bytes) -> None:
        path = self.file("transforms_train.json", data)
        with contextlib.suppress(InputError):
            read_camera_path(path)
        load_dataset(self.folder)


class ColmapReader(Reader):
    """One of the files of a sparse model, which the first byte of an input names, beside the others as they were."""

    files = ("cameras.bin", "images.bin", "cameras.txt", "images.txt")

    def __init__(self, folder: Path):
        super().__init__(folder)
        write_scene(folder / "images")
        camera, (w, h) = 1, (SIZE, SIZE)
        images = [(i + 1, 1.0, 0.1 * i, 0.0, 0.0, 0.0, 0.0, 4.0, camera, f"r_{i}.png") for i in range(6)]
        binary = [struct.pack("<I7dI", *image[:9]) + image[9].encode() + bytes(9) for image in images]
        self.parts = [
            struct.pack("<QIiQQ5d", 1, camera, 3, w, h, 20.0, 8.0, 8.0, 0.1, 0.01),
            struct.pack("<Q", 6) + b"".join(binary),
            f"# cameras\n{camera} RADIAL {w} {h} 20 8 8 0.1 0.01\n".encode(),
            "".join(" ".join(map(str, image)) + "\n1 2 -1\n" for image in images).encode(),
        ]

    def corpus(self) -> list[bytes]:
        return [bytes([i]) + part for i, part in enumerate(self.parts)]

    def read(self, data: bytes) -> None:
        chosen = data[0] % len(self.files) if data else 0
        (self.folder / "sparse").mkdir(exist_ok=True)
        for i, name in enumerate(self.files):
            (self.folder / "sparse" / name).unlink(missing_ok=True)
            if i // 2 == chosen // 2:  # binary files go before text
                self.file(f"sparse/{name}", data[1:] if i == chosen else self.parts[i])
        read_frames(self.folder, "train")


class NeusReader(Reader):
    """A file of cameras beside its images."""

    def __init__(self, folder: Path):
        super().__init__(folder)
        write_scene(folder / "image")

    def corpus(self) -> list[bytes]:
        matrix = np.array([[20.0, 0, 8, 0], [0, 20, 8, 0], [0, 0, 1, 4], [0, 0, 0, 1]])
        np.savez(self.folder / "seed.npz", **{f"world_mat_{i}": matrix for i in range(6)})
        return [(self.folder / "seed.npz").read_bytes()]

    def read(self, data: bytes) -> None:
        self.file("cameras_sphere.npz", data)
        read_frames(self.folder, "train")


class ImageReader(Reader):
    """A file by itself; as bare pixels and, where it may be one, as an environment map."""

    def __init__(self, folder: Path, suffix: str):
        super().__init__(folder)
        self.suffix = suffix

    def corpus(self) -> list[bytes]:
        seeds, path = [], self.folder / f"seed{self.suffix}"
        for pixels in (disc(8)[..., :3] if self.suffix == ".hdr" else disc(8), disc(4)[:2, ..., :3]):
            write_image(path, pixels)
            seeds.append(path.read_bytes())
        return [kind + seed for seed in seeds for kind in (RAW, MENDED)] if self.suffix == ".png" else seeds

    def read(self, data: bytes) -> None:
        if self.suffix == ".png":
            data = mended(data[1:]) if data[:1] == MENDED else data[1:]
        path = self.file(f"image{self.suffix}", data)
        for read in (read_environment, read_radiance):
            with contextlib.suppress(InputError):
                read(path)
        read_image(path)


def mended(data: bytes) -> bytes:
    """A PNG with the sums that its chunks should have."""
    out, at = bytearray(data[:8]), 8
    while at + 12 <= len(data):
        length = min(struct.unpack_from(">I", data, at)[0], len(data) - at - 12)
        body = data[at + 4 : at + 8 + length]
        out += struct.pack(">I", length) + body + struct.pack(">I", zlib.crc32(body))
        at += 12 + length
    return bytes(out)


class GlbReader(Reader):
    """Raw files, and a JSON before a fixed binary chunk."""

    def corpus(self) -> list[bytes]:
        corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
        normals = corners - 0.25
        texture = np.full((4, 4, 3), 0.5, np.float32)
        asset = Asset(
            "seed",
            corners,
            np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.int32),
            (normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32),
            np.zeros(4, np.int32),
            [Material(albedo_texture=texture)],
            uv=corners[:, :2].copy(),
        )
        write_glb(self.folder / "seed.glb", asset)
        raw = (self.folder / "seed.glb").read_bytes()
        length = struct.unpack_from("<I", raw, 12)[0]
        self.binary = raw[20 + length :]
        return [RAW + raw, MENDED + raw[20 : 20 + length]]

    def read(self, data: bytes) -> None:
        if data[:1] == MENDED:
            text = data[1:] + b" " * (-len(data[1:]) % 4)
            chunk = struct.pack("<I4s", len(text), b"JSON") + text + self.binary
            data = RAW + struct.pack("<4sII", b"glTF", 2, 12 + len(chunk)) + chunk
        read_asset(self.file("asset.glb", data[1:]))


class CheckpointReader(Reader):
    """Raw files, and a pickle among the parts of a valid container; what loads goes into a model and its optimiser."""

    def corpus(self) -> list[bytes]:
        levels = {"n_levels": 2, "start_levels": 2, "log2_table_size": 4, "base_resolution": 2, "grid_resolution": 2}
        widths = {"constants.surface_width": 4, "constants.materials_width": 4, "light_resolution": 16}
        config = Config().replace(levels | widths)
        model = SceneModel(config)
        optimiser = make_optimiser(model, config)
        for parameter in model.parameters():
            parameter.grad = torch.ones_like(parameter)
        optimiser.step()
        save_checkpoint(
            self.folder / "seed.pt",
            config=config,
            fingerprint="0",
            state=dict(
                step=1,
                seconds=1.0,
                n_rays=64,
                meshed_at=0.0,
                previewed_at=0.0,
                model=model.state_dict(),
                optimiser=optimiser.state_dict(),
                generator=torch.Generator().get_state(),
                torch_generator=torch.get_rng_state(),
                occupancy=torch.zeros(8),
                box_from_world=torch.eye(4).double(),
                mesh_vertices=torch.eye(3),
                mesh_faces=torch.tensor([[0, 1, 2]]),
            ),
        )
        raw = (self.folder / "seed.pt").read_bytes()
        with zipfile.ZipFile(io.BytesIO(raw)) as archive:
            self.parts = {entry.filename: archive.read(entry) for entry in archive.infolist()}
        self.pickle = next(name for name in self.parts if name.endswith("data.pkl"))
        return [RAW + raw, MENDED + self.parts[self.pickle]]

    def read(self, data: bytes) -> None:
        if data[:1] == MENDED:
            container = io.BytesIO()
            with zipfile.ZipFile(container, "w") as archive:
                for name, part in self.parts.items():
                    archive.writestr(name, data[1:] if name == self.pickle else part)
            data = RAW + container.getvalue()
        path = self.file("checkpoint.pt", data[1:])
        content = load_checkpoint(path)
        config = Config().replace(content["config"])
        model = SceneModel(config)
        restore_model(model, content, path)
        restore_optimiser(make_optimiser(model, config), content, path)


READERS = {
    "json": JsonReader,
    "colmap": ColmapReader,
    "neus": NeusReader,
    **{name: partial(ImageReader, suffix=f".{name}") for name in ("png", "exr", "hdr")},
    "glb": GlbReader,
    "checkpoint": CheckpointReader,
}


def main() -> None:
    if len(sys.argv) < 2 or sys.argv[1] not in READERS:
        sys.exit(f"usage: fuzz_readers.py {'|'.join(READERS)} [libFuzzer's options]")
    name, options = sys.argv[1], sys.argv[2:]
    corpus = Path("build/fuzz") / name
    corpus.mkdir(parents=True, exist_ok=True)
    options = [*DEFAULTS, f"-artifact_prefix=build/fuzz/{name}-", *options]
    with tempfile.TemporaryDirectory() as folder, open(os.devnull, "w") as unread:
        reader = READERS[name](Path(folder))
        for i, seed in enumerate(reader.corpus()):
            (corpus / f"seed_{i}").write_bytes(seed)

        def feed(data: bytes) -> None:
            with contextlib.redirect_stderr(unread):  # notes
                try:
                    reader.read(data)
                except InputError as error:
                    assert len(str(error).splitlines()) == 1, error

        instrument()
        given = any(not option.startswith("-") for option in options)
        atheris.Setup([sys.argv[0], *options, *([] if given else [str(corpus)])], feed)
        atheris.Fuzz()


if __name__ == "__main__":
    main()
