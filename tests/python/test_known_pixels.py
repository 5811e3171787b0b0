"""What masks mean, and that pixels which say nothing are used nowhere."""

import dataclasses

import numpy as np
import pytest
import torch
from blender_data import SIZE, edit, look_at, make_blender, set_pose, sphere_alpha
from layout_scenes import CENTRE, COUNT, LENS, RADIUS, sphere_poses, write_transforms
from op_checks import generator
from splitnerf.data.dataset import Dataset, dataset_fingerprint, load_dataset, write_ground
from splitnerf.data.images import write_image
from splitnerf.data.normalisation import MasksContradict, estimate_box, nearest_to_rays, transform_points
from splitnerf.data.reading import Reading
from splitnerf.data.truth import ViewTruth
from splitnerf.errors import InputError
from splitnerf.evaluate.protocol import evaluate_maps
from splitnerf.refinement.outline import outline_pixels
from splitnerf.refinement.pixels import covered_pixels
from splitnerf.render.stereo import visual_hull
from splitnerf.training.batches import PixelSource
from tiny_runs import tiny

OBJECT, IGNORE = Reading(mask_kind="object"), Reading(mask_kind="ignore")


def passer_by(i: int) -> np.ndarray:
    """[SIZE, SIZE] white but for a black block that is somewhere else in each photo."""
    kept = np.ones((SIZE, SIZE), np.float32)
    kept[5 * (i % 6) : 5 * (i % 6) + 12, 7 * (i % 5) : 7 * (i % 5) + 9] = 0
    return kept


def ignoring_scene(root):
    """Photos with alpha whose mask files leave passers-by out."""
    write_transforms(root)
    for i in range(COUNT):
        write_image(root / f"masks/m{i}.png", passer_by(i))
        edit(root, lambda m, i=i: m["frames"][i].update(mask_path=f"masks/m{i}.png"), "transforms.json")
    return root


# ---- what masks mean ----


@pytest.mark.parametrize(("radius", "share"), [(RADIUS, 39), (1.35 * RADIUS, 76)])
def test_masks_of_the_object_are_told_by_their_look(tmp_path, capsys, radius, share):
    """Though they cover most of a photo, where they leave its edge."""
    write_transforms(tmp_path, masks=True)
    for i, pose in enumerate(sphere_poses()):
        write_image(tmp_path / f"masks/v{i:02d}.png.png", sphere_alpha(pose, CENTRE, radius))
    data = load_dataset(tmp_path)
    assert data.known is None and data.images[..., 3].mean() == pytest.approx(share / 100, abs=0.006)
    load_dataset(tmp_path, "test")
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert f"{tmp_path}: its mask files are taken for the object's, which covers {share}% of the photos" in said


def test_masks_that_are_nowhere_white_are_said(tmp_path, capsys):
    root = write_transforms(tmp_path, masks=True)
    faint = sphere_alpha(sphere_poses()[1], CENTRE, RADIUS) * np.linspace(0.6, 2, SIZE).clip(0, 0.97)
    write_image(root / "masks/v01.png.png", faint)
    load_dataset(root)
    assert "masks that are nowhere white make the object clear (v01.png.png: 96.9%)" in capsys.readouterr().err


@pytest.mark.parametrize("kind", ["object", "auto"])
def test_a_mask_that_is_white_everywhere_leaves_the_alpha(tmp_path, capsys, kind):
    root = write_transforms(tmp_path, mask_kind=kind)
    expected = load_dataset(root)
    for i in range(COUNT):
        write_image(root / f"masks/v{i:02d}.png", np.ones((SIZE, SIZE)))
        edit(root, lambda meta, i=i: meta["frames"][i].update(mask_path=f"masks/v{i:02d}.png"), "transforms.json")
    assert np.array_equal(load_dataset(root).images, expected.images)
    assert "where a mask is white everywhere the photo's own alpha counts (v" in capsys.readouterr().err


def test_masks_that_keep_nearly_all_say_what_to_ignore(tmp_path, capsys):
    data, plain = load_dataset(ignoring_scene(tmp_path)), load_dataset(write_transforms(tmp_path / "plain"))
    assert "its mask files are taken to ignore what is black, as they keep 95% of the photos" in capsys.readouterr().err
    known = np.stack([passer_by(i) > 0 for i in range(COUNT) if i % 8])
    assert np.array_equal(data.known, known)
    assert np.array_equal(data.images, plain.images * known[..., None])
    assert np.array_equal(load_dataset(tmp_path, "test").known, np.stack([passer_by(0), passer_by(8)]) > 0)
    for i in range(COUNT):  # 65% of a photo, and 57% of its edge
        write_image(tmp_path / f"masks/m{i}.png", np.float32([np.arange(SIZE) >= 17] * SIZE))
    assert load_dataset(tmp_path).known.mean() == pytest.approx(31 / 48)
    assert "to ignore what is black, as they keep 65% of the photos" in capsys.readouterr().err
    write_image(tmp_path / "masks/m3.png", np.zeros((SIZE, SIZE)))
    with pytest.raises(InputError, match="v03.png: its masks ignore all of it; remove the frame"):
        load_dataset(tmp_path)


def test_masks_that_contradict_the_poses_are_no_objects(tmp_path, capsys):
    """White on a third of the photo, here and there."""
    root = ignoring_scene(tmp_path)
    for i in range(COUNT):
        kept = np.zeros((SIZE, SIZE), np.float32)
        kept[:, (3 * i) % 32 : (3 * i) % 32 + 16] = 1
        write_image(root / f"masks/m{i}.png", kept)
    data = load_dataset(root)
    assert "taken to ignore what is black, as masks of the object would contradict the poses" in capsys.readouterr().err
    assert data.known.mean() == pytest.approx(1 / 3)
    with pytest.raises(InputError, match="masks and poses contradict each other"):
        load_dataset(root, reading=OBJECT)


def test_an_option_settles_what_masks_mean(tmp_path, capsys):
    root = write_transforms(tmp_path / "a")
    for i, pose in enumerate(sphere_poses()):
        write_image(root / f"masks/m{i}.png", sphere_alpha(pose, CENTRE, 1.2 * RADIUS))
        edit(root, lambda m, i=i: m["frames"][i].update(mask_path=f"masks/m{i}.png"), "transforms.json")
    own = load_dataset(write_transforms(tmp_path / "b"))
    wide, known = load_dataset(root, reading=OBJECT), load_dataset(root, reading=IGNORE)
    assert wide.known is None and wide.images[..., 3].sum() > 1.2 * own.images[..., 3].sum()
    assert np.array_equal(known.known, wide.images[..., 3] > 0.5)
    assert np.array_equal(known.images, own.images * known.known[..., None])
    assert "mask files" not in capsys.readouterr().err


def test_a_file_settles_what_its_masks_mean(tmp_path, capsys):
    """Masks that look like such of what to ignore, of a file that calls them the object's."""
    root = ignoring_scene(tmp_path)
    edit(root, lambda m: m.update(mask_kind="object"), "transforms.json")
    data = load_dataset(root)
    assert data.known is None and np.array_equal(data.images[0, ..., 3], passer_by(1))
    edit(root, lambda m: m.update(mask_kind="ignore"), "transforms.json")
    assert np.array_equal(load_dataset(root).known[0], passer_by(1) > 0)
    assert "mask files" not in capsys.readouterr().err


def test_photos_need_a_mask_of_the_object(tmp_path):
    root = write_transforms(tmp_path, masks=True)
    with pytest.raises(InputError, match="images: nothing says where the object is"):
        load_dataset(root, reading=IGNORE)
    for i in range(COUNT):  # black is the object
        write_image(root / f"masks/v{i:02d}.png.png", 1 - sphere_alpha(sphere_poses()[i], CENTRE, 0.7 * RADIUS))
    with pytest.raises(InputError, match="only says what to ignore .black.; invert it if black is the object"):
        load_dataset(root)


def test_dynamic_masks_are_white_where_they_ignore(tmp_path, monkeypatch):
    monkeypatch.setattr("splitnerf.data.photos.SILHOUETTE_SIZE", 16)
    root = write_transforms(tmp_path, masks=True)
    for i in range(0, COUNT, 2):
        write_image(root / f"images/dynamic_mask_v{i:02d}.png", 1 - passer_by(i))
    data = load_dataset(root)
    for name, known in zip(data.frame_names, data.known):
        i = int(name[1:])
        assert np.array_equal(known, passer_by(i) > 0 if i % 2 == 0 else np.ones((SIZE, SIZE), bool))
    assert not data.images[~data.known].any() and data.images[..., 3].mean() > 0.25
    assert np.array_equal(data.select([1, 0]).known, data.known[[1, 0]])
    both = ignoring_scene(tmp_path / "both")
    write_image(both / "images/dynamic_mask_v01.png", 1 - passer_by(4))
    assert np.array_equal(load_dataset(both).known[0], passer_by(1) * passer_by(4) > 0)


@pytest.mark.parametrize("factor", [2, 5])
def test_a_coarser_pixel_is_known_where_all_of_it_is(tmp_path, factor):
    data = load_dataset(ignoring_scene(tmp_path), downscale=factor)
    size = SIZE // factor
    for name, known in zip(data.frame_names, data.known):
        fine = passer_by(int(name[1:]))[: size * factor, : size * factor] > 0
        assert np.array_equal(known, fine.reshape(size, factor, size, factor).all(axis=(1, 3)))
    assert not data.images[~data.known].any()


def test_runs_are_not_resumed_with_other_data(tmp_path):
    data = load_dataset(ignoring_scene(tmp_path))
    other = data.known.copy()
    other[0, 0, 30:] = False  # where the photo is empty in any case
    turns = np.tile(np.eye(3), (len(data), 1, 1))
    changes = [{}, {"known": other}, {"known": None}, {"ground": np.ones(4)}, {"light_turns": turns}]
    changes += [{"intrinsics": 1.1 * data.intrinsics}, {"split": "test"}]
    assert len({dataset_fingerprint(dataclasses.replace(data, **x)) for x in changes}) == len(changes)


# ---- who must not use unknown pixels ----


@pytest.fixture
def half_known():
    """The sphere's photos of which every second view knows one half."""
    return halved(lambda i: i % 2 == 0)


def halved(is_half):
    poses = np.float32(sphere_poses())
    alpha = np.stack([sphere_alpha(pose, CENTRE, RADIUS) for pose in sphere_poses()])
    known = np.ones(alpha.shape, bool)
    known[:, :, : SIZE // 2] = [[[not is_half(i)]] for i in range(COUNT)]
    images = np.float32(np.stack([np.full_like(alpha, 0.5)] * 3 + [alpha], axis=-1) * known[..., None])
    lenses, names = np.tile(np.float32(LENS), (COUNT, 1)), [str(i) for i in range(COUNT)]
    return Dataset("half", None, "train", 1, images, poses, lenses, names, [], np.eye(4), known)


@pytest.mark.parametrize("share", [0.0, 0.8, 1.0])
def test_training_draws_known_pixels_only(half_known, share):
    """The colours of the others say so here."""
    images = np.array(half_known.images)
    images[~half_known.known] = [1, 0, 0, 1]
    source = PixelSource(dataclasses.replace(half_known, images=images), share, generator())
    pixels = source.draw(20_000)[2].numpy()
    assert not (pixels[:, 0] == 1).any()
    assert (pixels[:, 3] == 1).mean() == pytest.approx(0.4 if share == 0 else 0.75, abs=0.2)


def test_the_visual_hull_keeps_what_is_not_known(half_known):
    """In the run's box and cells."""
    config, source = tiny(box=1.3, grid_resolution=32), PixelSource(half_known, 0.5, generator())
    hull = lambda data: PixelSource(data, 0.5, generator()).hull(config)
    whole, half = hull(halved(lambda i: False)), hull(half_known)
    as_background = hull(dataclasses.replace(half_known, known=None))
    assert (half | ~whole).all() and half.sum() < 1.5 * whole.sum()
    assert as_background.sum() < 0.7 * whole.sum()
    assert torch.equal(half, visual_hull(32, 1.3, source.possible, source.poses, source.intrinsics))


def test_the_box_does_not_count_what_is_not_known(half_known):
    masks, lenses, far = half_known.images[..., 3] > 0.5, half_known.intrinsics, half_known.poses.copy()
    far[:, :3, 3] += [7.0, 0, 0]
    with pytest.raises(MasksContradict):
        estimate_box(masks, far, lenses)
    box = estimate_box(masks, far, lenses, half_known.known)
    true = estimate_box(halved(lambda i: False).images[..., 3] > 0.5, far, lenses)
    assert box == pytest.approx(true, rel=0.05, abs=0.05) and -box[0, 3] / box[0, 0] == pytest.approx(7.0, abs=0.1)


def test_refinement_reads_known_pixels_only(half_known):
    data = half_known
    pixels = covered_pixels(data)
    assert len(pixels) == (data.images[..., 3] > 0.5).sum()
    near, coverage = outline_pixels(data)
    places = near.view, near.centre[:, 1].astype(int), near.centre[:, 0].astype(int)
    assert data.known[places].all()
    # What its masks' edge against the unknown adds is covered, as the photos say.
    assert np.array_equal(coverage, data.images[(*places, 3)])


def test_scores_are_over_known_pixels(half_known):
    """A prediction that is right where a photo knows anything, and wrong by 0.1 elsewhere."""
    data = half_known
    whole = [np.where(k[..., None], i, [0.6, 0.6, 0.6, 1]) for i, k in zip(data.images, data.known)]
    predictions = [{"rgb": image[..., :3], "alpha": image[..., 3]} for image in whole]
    truths = [ViewTruth() for _ in data.frame_names]
    scores = evaluate_maps(predictions, data, truths)["novel_view"]
    assert scores["psnr"] == 100 and scores["ssim"] == pytest.approx(1)
    for prediction in predictions:
        prediction["rgb"] = prediction["rgb"] + 0.1
    full = evaluate_maps(predictions, dataclasses.replace(data, known=None), truths)["novel_view"]["psnr"]
    shares = [(i[..., 3] * k).sum() / k.sum() for i, k in zip(data.images, data.known)]
    expected = np.mean([-10 * np.log10(0.01 * share) for share in shares])
    assert evaluate_maps(predictions, data, truths)["novel_view"]["psnr"] == pytest.approx(expected, abs=1e-3)
    assert full < expected


# ---- where the object stands ----


def test_parallel_axes_rounded_to_float32():
    """Cameras side by side that all look the same way; their axes are not exactly of length 1."""
    turn = look_at([3.0, 2.0, 1.0], np.zeros(3)).astype(np.float32).astype(np.float64)
    origins = turn[:3, 3] + np.random.default_rng(0).normal(size=(20, 2)) @ turn[:3, :2].T
    lengths = 1 + 3e-7 * np.arange(20)[:, None]
    assert np.linalg.norm(nearest_to_rays(origins, turn[:3, 2] * lengths) @ turn[:3, 2]) < 1e-3


def test_parallel_cameras_find_the_object_by_the_masks():
    """It is not at the origin, so that the axes alone do not say how far away it is; pixels are half as wide as high."""
    centre, radius = np.array([0.0, 0.0, -9.0]), 0.5
    poses = [np.eye(4) for _ in range(12)]
    for i, pose in enumerate(poses):
        pose[:3, 3] = [0.8 * np.cos(i), 0.8 * np.sin(2 * i), 0.01 * i]
    masks = np.repeat([sphere_alpha(pose, centre, radius) > 0.5 for pose in poses], 2, axis=2)
    box = estimate_box(masks, np.stack(poses), np.tile(LENS, (12, 1)) * [2, 1, 2, 1])
    inside = box[:3, :3] @ centre + box[:3, 3]
    assert np.linalg.norm(inside) < 0.7 and 0.1 < box[0, 0] * radius <= 1.0


@pytest.mark.parametrize(("radius", "kept"), [(0.3, False), (0.45, True), (1.2, True), (1.5, False)])
def test_an_object_about_as_large_as_the_box_stays_where_it_is(radius, kept):
    """Though one mask of twenty is empty; pixels are half as wide as high."""
    poses = np.array(sphere_poses(20))
    masks = np.repeat([sphere_alpha(pose, CENTRE, RADIUS) > 0.5 for pose in poses], 2, axis=2)
    masks[7], poses[:, :3, 3] = False, radius * poses[:, :3, 3]
    assert np.array_equal(estimate_box(masks, poses, np.tile(LENS, (20, 1)) * [2, 1, 2, 1]), np.eye(4)) == kept


@pytest.mark.parametrize("masked", [True, False])
@pytest.mark.parametrize(
    ("form", "said"),
    [
        (np.linalg.inv, "all 14 cameras stand at one place; estimate poses, or invert them"),
        (lambda pose: np.linalg.inv(pose.round(6)), "the cameras look away from what they have in common; poses"),
        (lambda pose: pose @ np.diag([1, -1, -1, 1]), "look away .*, with OpenGL's axes"),
    ],
)
def test_poses_of_another_form_are_named(tmp_path, form, said, masked):
    """Inverses of poses around the origin are at one place, but for rounding."""
    root = write_transforms(tmp_path)
    for i in range(COUNT):
        edit(root, set_pose(i, lambda pose: form(pose).tolist()), "transforms.json")
        if not masked:
            write_image(root / f"images/v{i:02d}.png", np.full((SIZE, SIZE, 3), 0.5))
    with pytest.raises(InputError, match=said):
        load_dataset(root, masked=masked)


@pytest.mark.parametrize("alpha", ["empty", "moved"])
def test_the_frame_that_contradicts_the_others_is_named(tmp_path, alpha):
    root = make_blender(tmp_path)
    image = np.full((SIZE, SIZE, 4), 0.5)
    image[..., 3] = 0
    if alpha == "moved":
        image[:9, :9, 3] = 1
    write_image(root / "train/r_7.png", image)
    with pytest.raises(InputError, match=r"contradict each other, .* \(those of r_7.png and the others\); check"):
        load_dataset(root)


def test_the_unit_of_the_data_does_not_matter(tmp_path):
    found = []
    for unit in (1e-9, 1e4):
        root, units = write_transforms(tmp_path / f"{unit}"), np.array([[1.0, 1, 1, unit]] * 3 + [[1, 1, 1, 1]])
        for i in range(COUNT):
            edit(root, set_pose(i, lambda pose: (pose * units).tolist()), "transforms.json")
        found.append(load_dataset(root).poses)
    np.testing.assert_allclose(*found, atol=1e-4)


def test_an_origin_far_away_is_brought_near(tmp_path):
    """Coordinates of a land survey: float32 keeps half a metre of them."""
    survey = np.array([447_012.5, 5_411_003.0, 212.0])
    near = load_dataset(write_transforms(tmp_path / "near"))
    root = write_transforms(tmp_path / "far")
    moved = np.pad(survey[:, None], ((0, 1), (3, 0)))
    for i in range(COUNT):
        edit(root, set_pose(i, lambda pose: (pose + moved).tolist()), "transforms.json")
    write_ground(root, np.array([0, 0.6, 0.8, survey @ [0, 0.6, 0.8]]))
    found = Reading(separated=tmp_path / "found")
    write_ground(found.separated, np.array([0, 0.6, 0.8, 5]))  # which training found, from the near origin
    far, test = load_dataset(root, reading=found), load_dataset(root, "test")
    assert far.ground[3] == pytest.approx((survey - far.origin) @ [0, 0.6, 0.8], abs=1e-6)
    (root / "ground.json").unlink()
    assert load_dataset(root, reading=found).ground[3] == 5
    assert np.array_equal(far.origin, test.origin) and np.array_equal(far.origin, np.round(far.origin / 10) * 10)
    assert far.world_poses[:, :3, 3] + far.origin == pytest.approx(near.world_poses[:, :3, 3] + survey, abs=1e-4)
    assert np.abs(far.origin - survey).max() < 10 and np.abs(far.world_poses[:, :3, 3]).max() < 20
    back = transform_points(far.world_from_box, np.zeros((1, 3)))[0] + far.origin
    assert np.linalg.norm(back - survey) < 0.5
    assert not near.origin.any()


def test_far_splits_of_their_own_share_their_origin(tmp_path):
    root = make_blender(tmp_path, centre=(2e6, 0, 0), test=1)
    train, test = load_dataset(root), load_dataset(root, "test")
    assert train.origin[0] == pytest.approx(2e6, abs=10) and np.array_equal(train.origin, test.origin)
    assert np.array_equal(train.box_from_world, test.box_from_world)
    assert np.array_equal(load_dataset(root, reading=Reading("all")).origin, train.origin)
