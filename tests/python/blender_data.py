"""A sphere seen by cameras around it, as files, and ways to break them."""

import json

import numpy as np
import OpenImageIO as oiio
from splitnerf.data.images import write_image

SIZE = 48
ANGLE = 0.7


def look_at(position, target):
    back = np.subtract(position, target) / np.linalg.norm(np.subtract(position, target))
    right = np.cross([0, 0, 1], back)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3] = np.stack([right, np.cross(back, right), back, position], axis=1)
    return pose


def directions_of_map(height):
    """[height, 2 height, 3] unit vectors through a map's texels: u = 0.5 - azimuth / (2 pi), v = polar angle / pi."""
    polar, azimuth = np.pi * (np.mgrid[:height, : 2 * height] + 0.5) / height
    return np.stack([-np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1)


def sphere_alpha(pose, centre, radius, size=SIZE):
    """Coverage of a sphere seen by a pinhole camera."""
    y, x = (np.mgrid[:size, :size] + 0.5 - size / 2) / (0.5 * size / np.tan(0.5 * ANGLE))
    return sphere_seen(pose, x, y, centre, radius)


def sphere_seen(pose, x, y, centre, radius):
    """Coverage of a sphere in the directions (x, y, 1) of a camera, y down, straight from the quadratic."""
    rays = np.stack([x, -y, -np.ones_like(x)], axis=-1) @ pose[:3, :3].T
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    offset = pose[:3, 3] - centre
    return ((rays @ offset) ** 2 > offset @ offset - radius**2).astype(np.float32)


def poses_around(centre, radius, count):
    golden = np.pi * (3 - np.sqrt(5))
    heights = np.linspace(-0.6, 0.8, count)
    angles, rings = golden * np.arange(count), np.sqrt(1 - heights**2)
    directions = np.stack([np.cos(angles) * rings, np.sin(angles) * rings, heights], axis=1)
    return [look_at(centre + 4 * radius * direction, centre) for direction in directions]


def make_blender(root, centre=(0, 0, 0), radius=1.0, train=12, test=3, aim=None, grey=0.5):
    """A grey sphere in the NeRF-Blender layout; the cameras look at `aim`, by default its centre."""
    centre = np.array(centre, dtype=float)
    poses = poses_around(centre if aim is None else np.array(aim, dtype=float), radius, train + test)
    for split, chosen in (("train", poses[:train]), ("test", poses[train:])):
        frames = []
        for i, pose in enumerate(chosen):
            image = np.full((SIZE, SIZE, 4), grey)
            image[..., 3] = sphere_alpha(pose, centre, radius)
            write_image(root / split / f"r_{i}.png", image)
            frames.append({"file_path": f"./{split}/r_{i}", "transform_matrix": pose.tolist()})
        meta = {"camera_angle_x": ANGLE, "frames": frames}
        (root / f"transforms_{split}.json").write_text(json.dumps(meta))
    return root


def make_folders(root):
    """A sphere in view folders."""
    for i, pose in enumerate(poses_around(np.zeros(3), 1.0, 14)):
        name = f"train_{i:03d}" if i < 12 else f"test_{2 * (i - 12) + 9}"
        image = np.full((SIZE, SIZE, 4), 0.5)
        image[..., 3] = sphere_alpha(pose, np.zeros(3), 1.0)
        write_image(root / name / "rgba.png", image)
        matrix = ", ".join(str(value) for value in pose.ravel())
        meta = {"cam_angle_x": ANGLE, "cam_transform_mat": matrix, "imw": SIZE, "imh": SIZE, "envmap": "sky"}
        (root / name / "metadata.json").write_text(json.dumps(meta))
    (root / "val_000").mkdir()
    return root


def write_exr(path, pixels, names=None, window=None, primaries=None):
    """An EXR of float32 pixels [h, w, c] of any values; `window` is left, top, and the whole image's width and height."""
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], "float")
    spec.channelnames = names or tuple("RGBA"[: pixels.shape[2]])
    if window:
        spec.x, spec.y, spec.full_width, spec.full_height = window
    if primaries:
        spec.attribute("chromaticities", oiio.TypeDesc("float[8]"), primaries)
    sink = oiio.ImageOutput.create("any.exr")
    assert sink.open(str(path), spec) and sink.write_image(pixels) and sink.close()
    return path


def edit(root, change, name="transforms_train.json"):
    meta = json.loads((root / name).read_text())
    change(meta)
    (root / name).write_text(json.dumps(meta))


def set_pose(index, value):
    def change(meta):
        pose = np.array(meta["frames"][index]["transform_matrix"])
        meta["frames"][index]["transform_matrix"] = value(pose)

    return change
