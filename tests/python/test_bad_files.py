"""Damaged and hostile files in one table: the damage to a good one, and the line that names it. No crash, little memory."""

import json
import shutil
import struct
import zlib
from collections.abc import Callable
from functools import cache
from pathlib import Path

import layout_scenes
import numpy as np
import pytest
import trimesh
from blender_data import SIZE, edit, make_blender, make_folders, set_pose, write_exr
from gltf_builder import Gltf, beside, triangle
from layout_scenes import COLMAP_CAMERAS, COUNT, write_colmap, write_neus, write_transforms
from splitnerf.data.dataset import load_dataset
from splitnerf.data.environment import read_environment
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import encode_image, read_image, write_image
from splitnerf.data.truth import load_view_truths, read_mesh
from splitnerf.errors import InputError
from splitnerf.pipeline import load_splits

ENDLESS = 10**400
DOWN = np.arange(SIZE)
Damage = Callable[[Path], object]  # changes a folder; gives the path to be read where the form is one of files


def meta(change: Callable[[dict], object], name: str = "transforms_train.json") -> Damage:
    """A change of a JSON file."""
    return lambda root: edit(root, change, name)


def frame(**keys: object) -> Damage:
    """Other keys of one frame."""
    return meta(lambda m: m["frames"][1].update(keys))


def pose(change: Callable[[np.ndarray], np.ndarray]) -> Damage:
    """Another pose of frame 2."""
    return meta(set_pose(2, lambda p: change(p).tolist()))


def rewritten(name: str, change: Callable[[bytes], bytes]) -> Damage:
    """Other bytes in a file."""

    def write(root: Path) -> Path:
        path = root / name
        path.write_bytes(change(path.read_bytes() if path.exists() else b""))
        return path

    return write


def file(name: str, content: bytes) -> Damage:
    """A file of this content."""
    return rewritten(name, lambda _: content)


def picture(name: str, *shape: int, value: float = 1.0) -> Damage:
    """Another image in its place."""
    return lambda root: write_image(root / name, np.full(shape, value))


def alpha(masks: Callable[[int], np.ndarray]) -> Damage:
    """Other masks of all photos."""

    def write(root: Path) -> None:
        for i, path in enumerate(sorted((root / "train").iterdir())):
            write_image(path, np.dstack([np.full((SIZE, SIZE, 3), 0.5), masks(i)]))

    return write


def floats(pixels: np.ndarray, name: str = "a.exr") -> Damage:
    """An EXR file of any values, which `write_image` would look at."""
    return lambda root: write_exr(root / name, pixels.astype(np.float32))


def radiance(value: float) -> Damage:
    """A photo of floats with one channel of one pixel of this value."""
    pixels = np.ones((SIZE, SIZE, 4))
    pixels[3, 4, 1] = value
    return lambda root: [frame(file_path="train/r_1.exr")(root), floats(pixels, "train/r_1.exr")(root)]


NO_JSON = (b"{not json", b"\xff\xfe", b"[" * 100_000)
TRANSFORMS = {
    "no frames key": (meta(lambda m: m.pop("frames")), "transforms_train.json: missing key 'frames'"),
    "frames no list": (meta(lambda m: m.update(frames={"a": 1})), "'frames' must be a list"),
    "zero frames": (meta(lambda m: m["frames"].clear()), "transforms_train.json: has no frames"),
    "no angle": (meta(lambda m: m.pop("camera_angle_x")), "transforms_train.json: missing key 'camera_angle_x'"),
    "bad angle": (meta(lambda m: m.update(camera_angle_x="1")), "must be a positive num.* below pi, got the text '1'"),
    "true angle": (meta(lambda m: m.update(camera_angle_x=True)), "must be a positive num.* below pi, got True"),
    "angle of degrees": (meta(lambda m: m.update(camera_angle_x=3.15)), "_x' must be .* radians below pi, got 3.15"),
    "tiny width": (meta(lambda m: m.update(w=1e-300, fl_x=20)), "'w' must be a positive number"),
    "no file path": (meta(lambda m: m["frames"][1].pop("file_path")), "missing key 'file_path' in frame 1"),
    "no pose": (meta(lambda m: m["frames"][1].pop("transform_matrix")), "missing key 'transform_matrix' in frame 1"),
    "NaN pose": (pose(lambda p: p * np.nan), r"frame 2 \(r_2.png\) has NaN"),
    "endless pose": (pose(lambda p: p + 2e9 * np.eye(4, k=3)), r"frame 2 \(r_2.png\) has NaN, inf"),
    "endless number": (meta(lambda m: m["frames"][2]["transform_matrix"][0].__setitem__(3, ENDLESS)), "is not a 4x4"),
    "scaled pose": (pose(lambda p: p * [[2], [2], [2], [1]]), r"frame 2 \(r_2.png\) is not a rigid"),
    "mirrored pose": (pose(lambda p: p * [-1, 1, 1, 1]), r"frame 2 \(r_2.png\) is not a rigid"),
    "slanted pose": (pose(lambda p: p + 0.01 * np.eye(4, k=-3)), r"frame 2 \(r_2.png\) is not a rigid"),
    "3x3 pose": (pose(lambda p: p[:3, :3]), r"frame 2 \(r_2.png\) is not a 4x4"),
    "text pose": (frame(transform_matrix="identity"), r"frame 1 \(r_1.png\) is not a 4x4"),
    "name of a root": (frame(file_path="/"), "^/: no such image"),
    "name of two lines": (frame(file_path="a\nb"), "a b: no such image"),
    "name of half a character": (frame(file_path="\ud800"), "no such image"),
    **{f"long {key}": (frame(**{key: "x" * 5000}), "no such image") for key in ("file_path", "mask_path")},
    "one image twice": (frame(file_path="train/../train/r_2"), "r_2.png: two frames have this image; remove one"),
    **{
        f"exposure {x}": (frame(exposure=x), "'exposure' of frame 1 must be a pos")
        for x in ("bright", -1, 5e-5, 2e4, np.nan)
    },
    **{f"gamma {x}": (frame(gamma=x), "'gamma' must be 0") for x in ("sRGB", 0.9, 5.1, float("nan"))},
    "a json list": (file("transforms_train.json", b"[1, 2]"), "transforms_train.json: must hold a json object"),
    **{f"no json, {x[:9]}": (file("transforms_train.json", x), "train.json: is not valid json") for x in NO_JSON},
    "no folder": (shutil.rmtree, "data: no such folder"),
    "no transforms": (lambda root: [p.unlink() for p in root.glob("*.json")], "neither transf.*npz, nor a COLMAP mod"),
    "missing image": (lambda root: (root / "train/r_4.png").unlink(), "r_4: no such image"),
    "truncated image": (rewritten("train/r_4.png", lambda whole: whole[:100]), "r_4.png: .*(truncated|cannot be read)"),
    "larger image": (picture("train/r_4.png", SIZE, 52, 4), "r_4.png: is 52x48, r_0.png is 48x48, and one lens is"),
    "neither alpha nor mask": (picture("train/r_4.png", SIZE, SIZE, 3), "r_4.png: has no alpha channel and its frame"),
    "empty masks": (alpha(lambda i: np.zeros((SIZE, SIZE))), "train: every mask is empty"),
    "full masks": (alpha(lambda i: np.ones((SIZE, SIZE))), "train: nothing says where the object is"),
    "masks of no object": (alpha(lambda i: np.outer(DOWN < 2 + i, DOWN >= SIZE - 2)), "masks and poses contradict"),
    **{f"radiance {x}": (radiance(x), "r_1.exr: has NaN, infinite or neg") for x in (np.nan, np.inf, -0.5)},
}


def keys(**content: object) -> Damage:
    return meta(lambda m: m.update(content), "transforms.json")


NERFSTUDIO = {
    "mask of another size": (picture("masks/v03.png.png", SIZE, 8), "v03.png.png: is 8x48, its image v03.png is 48x48"),
    "mask of another kind": (keys(mask_kind=["depth"]), "'mask_kind' must be one of auto, object, ignore"),
    "lens without a model": (keys(camera_model="FOV"), "transforms.json: camera model 'FOV' is not read; undistort"),
    "list of lenses": (keys(camera_model=["OPENCV"]), "is not read"),
    "a list in words": (keys(val_filenames="images/v03.png"), "'val_filenames' must be a list of images"),
    "decentred fisheye": (keys(camera_model="OPENCV_FISHEYE", p1=0.1), "a fisheye with 'p1' or 'p2' is not read"),
    "fisheye in words": (keys(is_fisheye="true", k1=0.1), "'is_fisheye' must be true or false, got the text 'true'"),
    "coefficient in words": (keys(k1="strong"), "'k1' is no coefficient of a lens: the text 'strong'"),
    "coefficient NaN": (keys(k2=float("nan")), "'k2' is no coefficient of a lens: nan"),
    **{f"coefficient {n}": (keys(k1=k), "'k1' is no coefficient") for n, k in (("endless", ENDLESS), (1001, 1001))},
    "f-theta lens": (keys(ftheta_p1=0.3), "'ftheta_p1' is not read"),
    "rolling shutter": (keys(rolling_shutter=[0, 0, 0.1]), "'rolling_shutter' is not read"),
    "further coefficients": (keys(k1=0.1, k5=0.1), "'k5' is not read; undistort"),
    "two poses of an image": (
        meta(lambda m: m["frames"].append(m["frames"][5] | {"file_path": "images/v03.png"}), "transforms.json"),
        "transforms.json: has two poses of v03.png; remove one",
    ),
    **{f"lens that folds {k}": (keys(k1=k), "its lens, undistorted, covers (0|19)% of the") for k in (-900, -10)},
}


def ground(**content: object) -> Damage:
    return lambda root: (root / "ground.json").write_text(json.dumps(content))


UP = {"normal": [0, 0, 1]}
PLANES = [UP | {"offset": x} for x in ("low", np.nan)] + [{"normal": n, "offset": 0} for n in ([0, 1], [0, 0, 1.002])]
GROUND = {
    "known too well": (floats(np.full((4, 8, 4), 1.1), "surroundings.exr"), "surroundings.exr: is no map of radiance"),
    **{str(plane): (ground(**plane), "ground.json: is no plane") for plane in ({"offset": 0}, UP, *PLANES)},
}

METADATA = "train_003/metadata.json"


def matrix(*entries: object) -> Damage:
    return meta(lambda m: m.update(cam_transform_mat=",".join(map(str, entries))), METADATA)


VIEW_FOLDERS = {
    "no matrix": (meta(lambda m: m.pop("cam_transform_mat"), METADATA), f"{METADATA}: missing key 'cam_transform_mat'"),
    "no angle": (meta(lambda m: m.pop("cam_angle_x"), METADATA), f"{METADATA}: missing key 'cam_angle_x'"),
    "twelve numbers": (matrix(*[1] * 12), "train_003.*: cam_transform_mat is not a 4x4"),
    "words": (matrix(*["one"] * 16), "train_003.*: cam_transform_mat is not a 4x4"),
    "all zero": (matrix(*[0] * 16), "train_003.*: cam_transform_mat is not a rigid"),
    "no photo": (lambda root: (root / "train_003/rgba.png").unlink(), "train_003/rgba.png: no such image"),
    "no metadata": (lambda root: (root / METADATA).unlink(), f"{METADATA}: no such file"),
}


def cameras(content: dict) -> Damage:
    """A model with other cameras, as text or binary as it was, and the images of before."""

    def write(root: Path) -> None:
        model = root / "sparse/0"
        images = {path: path.read_bytes() for path in model.glob("images.*")}
        (layout_scenes.write_binary_model if (model / "images.bin").exists() else layout_scenes.write_text_model)(
            model, content, []
        )
        for path, old in images.items():
            path.write_bytes(old)

    return write


def first_camera(model: int, name: str, *parameters: float) -> Damage:
    return cameras(COLMAP_CAMERAS | {1: (model, name, [9, 9], parameters)})


TWICE = rewritten("sparse/0/cameras.txt", lambda whole: whole.replace(b"\n7 ", b"\n1 ")), "has two cameras of one num"
COLMAP = {
    "another camera model": (first_camera(7, "FOV", 1, 1, 1, 1, 1), "camera model FOV is not read"),
    "no camera": (cameras({5: COLMAP_CAMERAS[1], 6: COLMAP_CAMERAS[7]}), "has camera 1, which the model lacks"),
    "no focal length": (first_camera(1, "PINHOLE", 0, 1, 1, 1), "camera 1: 'fl_x' must be"),
    "NaN": (first_camera(3, "RADIAL", 9, 4, 4, np.nan, 0), "camera 1: 'k1' is no coefficient"),
    "missing image": (lambda root: (root / "images/v05.png").unlink(), "v05.png: no such image, with or without a suf"),
}
POINTS = 8 + struct.calcsize("<I7dI") + len("v08.png") + 1  # where the first image's number of points stands


def images_bin(start: int, content: bytes, end: int) -> Damage:
    """Other bytes from one place to another."""
    return rewritten("sparse/0/images.bin", lambda whole: whole[:start] + content + whole[end:])


DAMAGED = "images.bin: is damaged or no file of COLMAP "
BINARY = {
    "no image": (file("sparse/0/images.bin", bytes(8)), "images.bin: has no registered image"),
    "endless images": (images_bin(0, struct.pack("<Q", 1 << 60), 8), DAMAGED + ".unpack requires"),
    "endless points": (images_bin(POINTS, struct.pack("<Q", 1 << 60), POINTS + 8), DAMAGED + ".it ends too early"),
    "endless name": (images_bin(POINTS - 8, b"v" * 9999, POINTS - 1), DAMAGED),
}


def arrays(change: Callable[[dict], object]) -> Damage:
    def write(root: Path) -> None:
        found = dict(np.load(root / "cameras_sphere.npz"))
        change(found)
        np.savez(root / "cameras_sphere.npz", **found)

    return write


SKEWED = np.array([[9.0, 0.1, 0, 0], [0, 9, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
NO_MATRIX = r"cameras_sphere.npz: world_mat_2 is not a 4x4 matrix K \[R . t\] of finite numbers"
MATRICES = {"words": np.full((4, 4), "one"), "3x3": np.eye(3), "NaN": np.eye(4) * np.nan, "flat": np.zeros((4, 4))}
NEUS = {
    **{name: (arrays(lambda a, x=x: a.update(world_mat_2=x)), NO_MATRIX) for name, x in MATRICES.items()},
    "skewed": (arrays(lambda a: a.update(world_mat_2=SKEWED)), "world_mat_2 has skewed pixels"),
    "a gap": (arrays(lambda a: a.pop("world_mat_2")), "cameras_sphere.npz: needs world_mat_0, world_mat_1 and so on"),
    "too few": (arrays(lambda a: a.pop(f"world_mat_{COUNT - 1}")), "image: has 16 images, cameras_sphere.npz has 15"),
    "none": (arrays(lambda a: [a.pop(f"world_mat_{i}") for i in range(COUNT)]), "needs world_mat_0"),
    "large": (arrays(lambda a: a.update(world_mat_2=np.zeros((400, 400)))), "has more than 4096 bytes"),
    "an object": (arrays(lambda a: a.update(world_mat_2=np.array([{}], object))), "cannot be read as a file of NumPy"),
}


def png(width: int, height: int) -> bytes:
    """A PNG that claims a size and holds next to nothing."""
    parts = (b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0), b"IDAT" + zlib.compress(b""), b"IEND")
    chunks = (struct.pack(">I", len(part) - 4) + part + struct.pack(">I", zlib.crc32(part)) for part in parts)
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


SUFFIXES = (".png", ".jpg", ".exr", ".hdr")


def half(whole: bytes) -> bytes:
    return whole[: len(whole) // 2]


def write_images(root: Path) -> None:
    for suffix in SUFFIXES:
        write_image(root / f"cut{suffix}", np.random.default_rng(2).random((64, 64, 3)).astype(np.float32))


CLAIMED = "is said to be 4000x4000, too large for its file"
WORDLESS = struct.pack("<II14s4sI4i64x", 20000630, 2, b"displayWindow", b"\xff\xff\xff\0", 16, 0, 0, 7, 3)
BITMAP = struct.pack("<2sIHHIIiiHHIIiiII", b"BM", 58, 0, 0, 54, 40, 1, 1, 1, 24, 0, 4, 1, 1, 0, 0) + bytes(4)
IMAGES = {
    **{f"half {s}": (rewritten(f"cut{s}", half), f"cut{s}: .*(truncated|cannot be read)") for s in SUFFIXES},
    "flipped bit": (rewritten("cut.png", lambda data: data[:99] + bytes([data[99] ^ 1]) + data[100:]), "cut.png: tr"),
    "no pixels": (rewritten("cut.png", lambda data: data[:33]), "cut.png: truncated or damaged image"),
    "none": (lambda root: root / "gone.png", "gone.png: no such image"),
    "text": (file("a.png", b"no image"), "a.png: cannot be read"),
    "large PNG": (file("a.png", png(4000, 4000)), f"a.png: {CLAIMED}"),
    "large HDR": (file("a.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4000 +X 4000\n"), f"a.hdr: {CLAIMED}"),
    "too many pixels": (file("a.png", png(20_000, 20_000) + bytes(300_000)), "is 20000x20000, the most is 134 megapix"),
    "error that is no text": (file("a.exr", WORDLESS), "a.exr: cannot be read as an image"),
    "another format": (file("a.png", BITMAP), "a.png: cannot be read as an image"),
}


def with_texel(value: float) -> Damage:
    pixels = np.ones((4, 8, 3))
    pixels[1, 2] = value
    return floats(pixels)


PNG = encode_image(np.ones((4, 8, 3)), ".png")
MAPS = {
    "NaN": (with_texel(np.nan), "a.exr: has NaN or infinite pixels"),
    "infinite": (with_texel(np.inf), "a.exr: has NaN or infinite pixels"),
    "negative": (with_texel(-0.04), "a.exr: has negative pixels, 0.1% of its light"),
    "bright": (with_texel(2e12), "a.exr: has pixels above 1e.12, whose sums overflow"),
    "upright": (floats(np.ones((10, 21, 3))), "a.exr: is 21x10; an equirectangular map is twice as wide as high"),
    "black": (floats(np.zeros((4, 8, 3))), "a.exr: is black and lights nothing"),
    **{name: (file(name, PNG), f"{name}: an environment map must hold linear") for name in ("a.png", "a.hdr", "a.exr")},
    "none": (lambda root: root / "b.hdr", "no such environment map"),
}


FLAT = trimesh.Trimesh(np.zeros((3, 3)), [[0, 1, 2]], process=False).export(file_type="ply")
MESHES = {
    "flat": (file("flat.ply", FLAT), "flat.ply: degenerate or empty mesh"),
    "text": (file("a.ply", b"no mesh"), "a.ply: cannot be read as a mesh"),
    "none": (lambda root: root / "b.ply", "no such mesh"),
}
TRUTH = {
    "another size": (picture("test/r_0_normal.png", 8, 8, 3), "r_0_normal.png: is 8x8, not the size of r_0.png"),
    "no alpha": (picture("test/r_0_albedo.png", SIZE, SIZE, 3), "r_0_albedo.png: needs 4 channels, has 3; re-export"),
}
POINTS_ALONE = trimesh.PointCloud(np.eye(3)).export(file_type="ply")
AT_THE_START = {"points": (file("mesh.ply", POINTS_ALONE), "mesh.ply: degenerate or empty mesh; replace"), **TRUTH}


# ---- glTF ----


def gltf(change: Callable[[Gltf], object], **attributes: object) -> Damage:
    """A changed triangle."""

    def write(root: Path) -> Path:
        asset = triangle(NORMAL=[[0, 0, 1]] * 3, **attributes)
        change(asset)
        return asset.write(root / "a.glb")

    return write


def content(**parts: object) -> Damage:
    return gltf(lambda g: g.json.update(parts))


def primitive(**parts: object) -> Damage:
    return gltf(lambda g: g.json["meshes"][0]["primitives"][0].update(parts))


def indices(*values: int) -> Damage:
    return gltf(lambda g: g.json["meshes"][0]["primitives"][0].update(indices=g.accessor(values, "uint16")))


def positions(values: np.ndarray) -> Damage:
    return gltf(lambda g: g.json["meshes"][0]["primitives"][0]["attributes"].update(POSITION=g.accessor(values)))


def accessor(**parts: object) -> Damage:
    return gltf(lambda g: g.json["accessors"][0].update(parts))


def texture(g: Gltf, **material: object) -> None:
    """A texture without coordinates."""
    slot = {"baseColorTexture": {"index": g.texture(np.ones((2, 2, 3)))}}
    number = g.material(name="m", pbrMetallicRoughness=slot, **material)
    g.json["meshes"][0]["primitives"][0]["material"] = number


def broken_image(g: Gltf) -> None:
    texture(g)
    g.json["images"][0] = {"name": "bad", "bufferView": g.view(b"no image")}


def endless_factor(g: Gltf) -> None:
    pbr = {"roughnessFactor": float("nan")}
    g.json["meshes"][0]["primitives"][0]["material"] = g.material(name="m", pbrMetallicRoughness=pbr)


def of_second_buffer(g: Gltf) -> None:
    """As a file of EXT_meshopt_compression whose fallback was left out."""
    g.json["buffers"] = [{"byteLength": len(g.binary)}] * 2
    g.json["bufferViews"][0]["buffer"] = 1


GLTF = {
    "extensions": (content(extensionsRequired=["KHR_texture_basisu", "EXT_a"]), "requires EXT_a, KHR_texture_basisu"),
    "empty": (content(meshes=[], nodes=[], scenes=[{}]), "has no triangles; export a mesh"),
    "points": (primitive(mode=0), "has no triangles, only points or lines"),
    "no accessor": (primitive(indices=99), "is not valid glTF"),
    "a circle": (content(nodes=[{"children": [0]}]), "node 0 stands in the scene twice"),
    "flat": (content(nodes=[{"mesh": 0, "scale": [1, 0, 1]}]), "has no triangles"),
    "glTF 1": (content(asset={"version": "1.0"}), "is glTF 1.0; only 2.0 is read"),
    "NaN": (positions(np.full((3, 3), np.nan)), "mesh 'part' has NaN or infinite values in POSITION"),
    "large scale": (content(nodes=[{"mesh": 0, "scale": [1e39] * 3}]), "has NaN or infinite coordinates after its tr"),
    "far away": (content(nodes=[{"mesh": 0, "scale": [2e12] * 3}]), "has vertices farther than 1e.12 from the origin"),
    "no area": (positions(np.zeros((3, 3))), "no triangle has an area"),
    "four vertices": (positions(np.zeros((4, 3))), "has 3 values of NORMAL for 4 vertices"),
    "index 3": (indices(0, 1, 3), "vertex indices out of range, 3 of 3"),
    "two indices": (indices(0, 1), "has 2 indices, not three a triangle"),
    "long accessor": (accessor(count=1000), "an accessor reaches beyond its buffer view"),
    "negative count": (accessor(count=-3), "not valid glTF"),
    "no coordinates": (gltf(texture), "material 'm' has textures, but a mesh with it has no TEXCOORD_0"),
    "two coordinates": (gltf(lambda g: texture(g, emissiveTexture={"index": 0, "texCoord": 1})), "'m' have different"),
    "NaN factor": (gltf(endless_factor), "material 'm' has a factor that is no usable number"),
    "no image": (gltf(broken_image), "image 0 'bad': cannot be read as an image"),
    "no stride": (gltf(lambda g: g.json["bufferViews"][0].update(byteStride=0)), "byteStride"),
    "half": (rewritten("a.glb", half), "truncated GLB"),
    "ten bytes": (rewritten("a.glb", lambda whole: whole[:10]), "truncated GLB"),
    "GLB 1": (rewritten("a.glb", lambda whole: whole[:4] + b"\1\0\0\0" + whole[8:]), "GLB version 1"),
    "another container": (rewritten("a.glb", lambda whole: b"glTX" + whole[4:]), "is neither a GLB nor glTF's JSON"),
    "nothing": (file("a.glb", b""), "is neither a GLB nor glTF's JSON"),
    "a list": (file("a.glb", b"[]"), "is JSON but not glTF"),
    "second buffer of no file": (gltf(of_second_buffer), "buffer 1 has neither a file nor a binary chunk"),
    "deep JSON": (file("a.gltf", b"[" * 100_000), "a.gltf: is neither"),
    "no file": (lambda root: root / "b.glb", "b.glb: no such file"),
    "no buffer": (lambda root: beside(root, "gone%20too.bin"), "gone too.bin: no such file, though a.gltf refers"),
    "a pipe": (lambda root: beside(root, "pipe.bin"), "pipe.bin: no such file"),
    **{
        f"outside by {uri}": (lambda root, uri=uri: beside(root, uri), "a.gltf: refers to .*, outside its folder")
        for uri in ("../secret.bin", "%2e%2e/secret.bin", "sub/../../secret.bin", "{root}/secret.bin", "link.bin")
    },
}


def of_file(read: Callable[[Path], object]) -> Callable[[Path, object], object]:
    return lambda _, path: read(path)


LOADED = lambda folder, _: load_dataset(folder)
FORMS = {  # what writes a good folder, what reads it or the path that the damage gives, and the table of damages
    "transforms": (make_blender, LOADED, TRANSFORMS),
    "nerfstudio": (lambda root: write_transforms(root, masks=True), LOADED, NERFSTUDIO),
    "ground": (make_blender, LOADED, GROUND),
    "view folders": (make_folders, LOADED, VIEW_FOLDERS),
    "COLMAP, binary": (lambda root: write_colmap(root, binary=True), LOADED, COLMAP | BINARY),
    "COLMAP, text": (lambda root: write_colmap(root, binary=False), LOADED, COLMAP | {"one camera twice": TWICE}),
    "NeuS": (write_neus, LOADED, NEUS),
    "image": (write_images, of_file(read_image), IMAGES),
    "map": (Path.exists, of_file(read_environment), MAPS),
    "mesh": (Path.exists, of_file(read_mesh), MESHES),
    "truth": (make_blender, lambda root, _: load_view_truths(load_dataset(root, "test")), TRUTH),
    "truth of a run": (make_blender, lambda root, _: load_splits(root, 1), AT_THE_START),
    "glTF": (lambda root: triangle().write(root / "a.glb"), of_file(read_asset), GLTF),
}


@pytest.fixture(scope="module")
def good(tmp_path_factory) -> Callable[[str, Path], object]:
    """Copies a form's good folder to a path."""

    @cache
    def written(form: str) -> Path:
        folder = tmp_path_factory.mktemp("good")
        FORMS[form][0](folder)
        return folder

    return lambda form, folder: shutil.copytree(written(form), folder)


@pytest.mark.parametrize(("form", "case"), [(form, case) for form, (*_, table) in FORMS.items() for case in table])
def test_bad_files_give_one_line_that_names_them(good, tmp_path, capfd, form, case):
    _, read, table = FORMS[form]
    damage, message = table[case]
    good(form, tmp_path / "data")
    path = damage(tmp_path / "data")
    with pytest.raises(InputError, match=message) as caught:
        read(tmp_path / "data", path)
    line = str(caught.value)
    assert line.startswith((str(tmp_path), "/: ")) and len(line) < 6000
    assert "libpng" not in capfd.readouterr().err  # a line beside the program's own
