"""A grey sphere seen by cameras around it, written in each layout, and photos through lenses that bend."""

import json
import struct
from pathlib import Path

import numpy as np
from blender_data import ANGLE, SIZE, poses_around, sphere_alpha
from scipy.spatial.transform import Rotation
from splitnerf.data.images import write_image

FOCAL = 0.5 * SIZE / np.tan(0.5 * ANGLE)
LENS = (FOCAL, FOCAL, SIZE / 2, SIZE / 2)
COUNT = 16
CENTRE, RADIUS = np.zeros(3), 1.0
BACK = np.diag([1.0, -1.0, -1.0, 1.0])  # from OpenGL's camera axes to OpenCV's


def world_to_camera(pose: np.ndarray) -> np.ndarray:
    """[4, 4] with OpenCV's axes, of a camera-to-world pose with OpenGL's."""
    return np.linalg.inv(pose @ BACK)


def sphere_poses(count: int = COUNT) -> list[np.ndarray]:
    return poses_around(CENTRE, RADIUS, count)


def write_pictures(root: Path, images: str, masks: str | None, suffix: str = ".png") -> list[np.ndarray]:
    """Images of the sphere, with alpha or with masks beside them; returns the poses."""
    poses = sphere_poses()
    for i, pose in enumerate(poses):
        alpha = sphere_alpha(pose, CENTRE, RADIUS)
        pixels = np.dstack([np.full((SIZE, SIZE, 3), 0.5), alpha])
        write_image(root / images / f"v{i:02d}{suffix}", pixels if masks is None else pixels[..., :3])
        if masks is not None:
            write_image(root / masks / f"v{i:02d}{suffix}.png", alpha)
    return poses


def write_transforms(root: Path, *, masks: bool = False, suffix: str = ".png", **keys: object) -> Path:
    """A transforms.json as nerfstudio writes it; `keys` are added to the file."""
    poses = write_pictures(root, "images", "masks" if masks else None, suffix)
    frames = []
    for i, pose in enumerate(poses):
        frame = {"file_path": f"images/v{i:02d}{suffix}", "transform_matrix": pose.tolist()}
        frames.append(frame | ({"mask_path": f"masks/v{i:02d}{suffix}.png"} if masks else {}))
    lens = dict(zip(("fl_x", "fl_y", "cx", "cy"), LENS)) | {"w": SIZE, "h": SIZE}
    (root / "transforms.json").write_text(json.dumps(lens | keys | {"frames": frames}))
    return root


def write_neus(root: Path, *, masks: bool = True) -> Path:
    """NeuS's layout, each projection times a factor of its own, as scripts that normalise differently leave them."""
    poses = write_pictures(root, "image", "mask" if masks else None)
    k = np.array([[FOCAL, 0, SIZE / 2 - 0.5], [0, FOCAL, SIZE / 2 - 0.5], [0, 0, 1]])
    arrays = {}
    for i, pose in enumerate(poses):
        arrays[f"world_mat_{i}"] = np.eye(4)
        arrays[f"world_mat_{i}"][:3] = (k @ world_to_camera(pose)[:3]) * (-1) ** i * (1 + 0.1 * i)
        arrays[f"scale_mat_{i}"] = np.diag([2.0, 2.0, 2.0, 1.0])
    np.savez(root / "cameras_sphere.npz", **arrays)
    return root


COLMAP_CAMERAS = {  # number and parameters of a pinhole of 10 times the sphere's pictures, and of one as large as them
    1: (1, "PINHOLE", [10 * SIZE, 10 * SIZE], [10 * FOCAL, 10 * FOCAL, 5 * SIZE, 5 * SIZE]),
    7: (0, "SIMPLE_PINHOLE", [SIZE, SIZE], [FOCAL, SIZE / 2, SIZE / 2]),
}


def write_colmap(
    root: Path, *, binary: bool, place: str = "sparse/0", masks: bool = False, cameras: dict | None = None
) -> Path:
    """A sparse model; its images have two points each, and cameras in turn."""
    poses = write_pictures(root, "images", "masks" if masks else None)
    cameras = COLMAP_CAMERAS if cameras is None else cameras
    numbers = list(cameras)
    images = []
    for i in (*range(COUNT // 2, COUNT), *range(COUNT // 2)):  # in no order of names
        motion = world_to_camera(poses[i])
        quaternion = Rotation.from_matrix(motion[:3, :3]).as_quat()[[3, 0, 1, 2]] * (-1) ** i * (1 + 1e-4 * i)
        images.append((i + 100, [*quaternion, *motion[:3, 3]], numbers[i % len(numbers)], f"v{i:02d}.png"))
    folder = root / place
    folder.mkdir(parents=True, exist_ok=True)
    (write_binary_model if binary else write_text_model)(folder, cameras, images)
    return root


def write_binary_model(folder: Path, cameras: dict, images: list) -> None:
    parts = [struct.pack("<Q", len(cameras))]
    for number, (model, _, size, parameters) in cameras.items():
        parts += [struct.pack("<IiQQ", number, model, *size), struct.pack(f"<{len(parameters)}d", *parameters)]
    (folder / "cameras.bin").write_bytes(b"".join(parts))
    parts = [struct.pack("<Q", len(images))]
    for number, motion, camera, name in images:
        points = struct.pack("<ddq", 1.5, 2.5, -1) + struct.pack("<ddq", 3.5, 4.5, 12)
        parts += [struct.pack("<I7dI", number, *motion, camera), name.encode() + b"\0", struct.pack("<Q", 2), points]
    (folder / "images.bin").write_bytes(b"".join(parts))


def write_text_model(folder: Path, cameras: dict, images: list) -> None:
    lines = ["# Camera list with one line of data per camera:", f"# Number of cameras: {len(cameras)}"]
    for number, (_, name, size, parameters) in cameras.items():
        lines.append(" ".join(map(str, [number, name, *size, *map(float, parameters)])))
    (folder / "cameras.txt").write_text("\n".join(lines) + "\n")
    lines = ["# Image list with two lines of data per image:"]
    for i, (number, motion, camera, name) in enumerate(images):
        lines.append(" ".join(map(str, [number, *map(float, motion), camera, name])))
        lines.append("" if i % 2 else "1.5 2.5 -1 3.5 4.5 12")
    (folder / "images.txt").write_text("\n".join(lines) + "\n")


def opencv_points(x: np.ndarray, y: np.ndarray, k: dict) -> tuple[np.ndarray, np.ndarray]:
    """Where a lens images the direction (x, y, 1), by the formulas of OpenCV's manual; with `fisheye` those of its
    fisheye."""
    k1, k2, k3, k4, p1, p2 = (k.get(name, 0.0) for name in ("k1", "k2", "k3", "k4", "p1", "p2"))
    r = np.hypot(x, y)
    if k.get("fisheye"):
        theta = np.arctan(r)
        bent = theta * (1 + k1 * theta**2 + k2 * theta**4 + k3 * theta**6 + k4 * theta**8)
        return bent / r * x, bent / r * y
    radial = 1 + k1 * r**2 + k2 * r**4 + k3 * r**6
    return (x * radial + 2 * p1 * x * y + p2 * (r**2 + 2 * x**2), y * radial + p1 * (r**2 + 2 * y**2) + 2 * p2 * x * y)


def seen_by_pixels(k: dict, lens: tuple, height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """The directions (x, y, 1) that the pixels' middles of a photo through a lens show, by fixed-point iteration."""
    fx, fy, cx, cy = lens
    row, column = np.mgrid[:height, :width] + 0.5
    u, v = (column - cx) / fx, (row - cy) / fy
    x, y = u.copy(), v.copy()
    for _ in range(200):
        a, b = opencv_points(x, y, k)
        x, y = x + 0.7 * (u - a), y + 0.7 * (v - b)
    return x, y
