"""Digital Twin Catalog, DSLR: held-out photos and, with --truth, the distance to the true mesh.

The set's toolkit computes no scores, and the paper's could not be checked: every eighth photo is held out, PSNR is over sRGB in
the mask, shape the mean of both directions' mean nearest distance. --truth is the folder of the models.
"""

from __future__ import annotations

from pathlib import Path

import trimesh

from splitnerf.data.frames import TEST_STRIDE
from splitnerf.data.layouts import dtc as layout
from splitnerf.data.lit_photos import read_lit_photo
from splitnerf.errors import InputError
from splitnerf.evaluate.metrics import mesh_distances
from splitnerf.evaluate.published.common import Column, Delivered, Options, Scores, mean_of
from splitnerf.evaluate.published.openillumination import srgb_psnr
from splitnerf.progress import tracked

LAYOUT = layout
COLUMNS: tuple[Column, ...] = (
    ("view_psnr", "novel, PSNR", "{:.2f}"), ("chamfer", "chamfer", "{:.5f}"), ("f_score", "F", "{:.3f}"),
)  # fmt: skip


def score(delivered: Delivered, root: Path, options: Options) -> Scores:
    """Scores every eighth photo, and the mesh against the truth."""
    images, notes = [], ["the choice of photos and scores is this project's, see docs/data.md"]
    frames = layout.read(root)[::TEST_STRIDE]
    for frame in tracked(frames if delivered.environment is not None else [], "novel, image"):
        photo, mask = read_lit_photo(frame)
        image = delivered.render(frame, delivered.environment)["radiance"]
        inside = mask > 0.5
        images.append({"name": frame.name, "view_psnr": srgb_psnr(image[inside], photo[inside]) if inside.any() else None})
    means = {"view_psnr": mean_of(images, "view_psnr"), "chamfer": None, "f_score": None}
    if options.truth is None:
        notes.append("no --truth with the models: the mesh is not scored")
    else:
        mesh = trimesh.Trimesh(delivered.vertices, delivered.asset.triangles, process=False)
        means["chamfer"], means["f_score"] = mesh_distances(mesh, true_mesh(root, options.truth))
    return Scores(means, images, notes)


def true_mesh(root: Path, models: Path) -> trimesh.Trimesh:
    """The true mesh in the world of the photos.

    Raises:
        InputError: A file is missing or cannot be used.
    """
    path = models / layout.model_name(root) / layout.MESH
    if not path.is_file():
        raise InputError(f"{path}: no such mesh; give --truth the folder of the set's models")
    try:
        mesh = trimesh.load(path, force="mesh", process=False)
    except Exception as error:  # trimesh's loaders raise whatever their parser meets
        raise InputError(f"{path}: cannot be read as a mesh ({str(error)[:80]}); replace it") from None
    return trimesh.Trimesh(trimesh.transform_points(mesh.vertices, layout.object_to_world(root)), mesh.faces, process=False)
