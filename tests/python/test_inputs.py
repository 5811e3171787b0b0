"""Forms in which photos, masks, lenses and lists come, and that each is read as it is meant."""

import json
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from blender_data import ANGLE, SIZE, edit, make_blender, set_pose, write_exr
from PIL import Image
from splitnerf import errors
from splitnerf.cli import DONE, main
from splitnerf.data.dataset import load_dataset
from splitnerf.data.frames import has_test_split
from splitnerf.data.images import read_colours, read_header, read_image, read_radiance, srgb_to_linear, write_image
from splitnerf.data.layouts import colmap, transforms
from splitnerf.data.layouts.frame import checked_pose, listed_file, listed_image
from splitnerf.data.lens import lens_intrinsics, read_lens
from splitnerf.data.photos import read_mask, separated_mask
from splitnerf.data.reading import Reading
from splitnerf.errors import InputError
from splitnerf.relight.background import read_plate
from splitnerf_tools.capture.photographs import find_photographs, read_upright
from splitnerf_tools.inspection.checks import inspect

DISC = np.hypot(*np.mgrid[-4:5, -4:5]) < 3.5


def png(pixels: np.ndarray, mode: str | None = None) -> Image.Image:
    return Image.fromarray(pixels, mode)


def rgba(colour: np.ndarray, alpha: np.ndarray) -> Image.Image:
    return png(np.dstack([*[colour.astype(np.uint8)] * 3, alpha.astype(np.uint8)]))


def palette(codes: np.ndarray, *colours: tuple[int, int, int]) -> Image.Image:
    image = png(codes.astype(np.uint8), "P")
    image.putpalette(sum(colours, ()))
    return image


FORMS = {
    "white": png(DISC * np.uint8(255)),
    "one": png(DISC * np.uint8(1)),
    "labels from one": png(DISC + np.uint8(1)),
    "half": png(DISC * np.uint8(128)),
    "sixteen bits": png(DISC * np.uint16(65535)),
    "sixteen bits, one": png(DISC * np.uint16(1)),
    "alpha": rgba(np.full_like(DISC, 255, np.uint8), 255 * DISC),
    "black with alpha": rgba(np.zeros_like(DISC, np.uint8), 255 * DISC),
    "cut-out": png(np.dstack([np.arange(243, dtype=np.uint8).reshape(9, 9, 3), 255 * DISC.astype(np.uint8)])),
    "opaque": rgba(255 * DISC, np.full_like(DISC, 255, np.uint8)),
    "colour, nearly grey": png(np.stack([255 * DISC, 255 * DISC, 248 * DISC], 2).astype(np.uint8)),
    "palette": palette(DISC, (0, 0, 0), (128, 0, 0)),
    "palette, white first": palette(~DISC, (255, 255, 255), (0, 0, 0)),
    "palette, red first": palette(~DISC, (128, 0, 0), (0, 0, 0)),
    "palette, white on red": palette(~DISC, (255, 255, 255), (128, 0, 0)),
    "alpha, half": rgba(np.full_like(DISC, 255, np.uint8), 128 * DISC),
    "colour, of two": png(np.repeat(255 * DISC[..., None].astype(np.uint8), 3, 2)),
    "bits": png(255 * DISC.astype(np.uint8)).convert("1"),
}


@pytest.mark.parametrize("form", FORMS)
def test_a_mask_is_read_in_each_form(tmp_path, form):
    FORMS[form].save(tmp_path / "mask.png")
    mask = read_mask(tmp_path / "mask.png")
    assert mask.shape == (*DISC.shape, 1) and np.array_equal(mask[..., 0], DISC * np.iinfo(mask.dtype).max)


def test_a_soft_mask_stays_as_it_is(tmp_path):
    for soft in (np.linspace(0, 255, 81).astype(np.uint8).reshape(9, 9), np.uint8([[0, 0, 85, 170, 255, 255]] * 6)):
        png(soft).save(tmp_path / "mask.png")
        assert np.array_equal(read_mask(tmp_path / "mask.png")[..., 0], soft)
    png(DISC * np.uint8(3)).save(tmp_path / "dark.jpg", quality=30)  # its values are not exact
    assert read_mask(tmp_path / "dark.jpg").max() < 32
    png(large := np.kron(DISC, np.ones((9, 9))) > 0).save(tmp_path / "lossy.webp", quality=30)
    assert np.array_equal(read_mask(tmp_path / "lossy.webp")[..., 0] > 127, large)
    for value, expected in ((0, 0), (255, 255), (7, 255)):
        png(np.full((9, 9), value, np.uint8)).save(tmp_path / "mask.png")
        assert (read_mask(tmp_path / "mask.png") == expected).all()


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (png(np.uint8([[0, 1], [2, 1]])), "holds the labels 0, 1, 2"),
        (png(np.kron(np.uint8([[0, 100, 200]]), np.ones((5, 5), np.uint8))), "holds the labels 0, 100, 200"),
        (png(np.uint8([[[255, 255, 244], [0, 0, 0]]])), "is coloured, which no mask is"),
        (palette(np.uint8([[0, 1, 2]]), (0, 0, 0), (128, 0, 0), (0, 128, 0)), "holds the labels 0, 1, 2"),
    ],
)
def test_a_mask_that_may_mean_several_things_is_refused(tmp_path, image, message):
    image.save(tmp_path / "mask.png")
    with pytest.raises(InputError, match=f"mask.png: {message}"):
        read_mask(tmp_path / "mask.png")


@pytest.mark.parametrize(
    "names", ["RGBAZ", "ZRGBA", "RGBZA", "BGRA", "RGB", ("depth.Z", "beauty.R", "beauty.G", "beauty.B", "beauty.A")]
)
def test_channels_are_found_by_their_names(tmp_path, capsys, names):
    value = {"R": 0.1, "G": 0.2, "B": 0.3, "A": 0.5, "Z": 9.0}
    plain = [name[-1] for name in names]
    pixels = np.tile(np.float32([value[name] for name in plain]), (4, 5, 1))
    write_exr(tmp_path / "x.exr", pixels, tuple(names))
    expected = [value[name] for name in "RGBA" if name in plain]
    assert read_image(tmp_path / "x.exr")[2, 3] == pytest.approx(expected)
    assert read_header(tmp_path / "x.exr") == (4, 5, len(expected), 32)
    assert ("channels of images are not used" in capsys.readouterr().err) == ("Z" in plain)
    if "Z" in plain:
        assert read_radiance(tmp_path / "x.exr")[0, 0] == pytest.approx(expected[:3])


def test_an_image_of_luminance_and_differences_of_colours_is_refused(tmp_path, capsys):
    write_exr(tmp_path / "x.exr", np.ones((4, 4, 3), np.float32), ("Y", "RY", "BY"))
    with pytest.raises(InputError, match=r"x.exr: holds luminance .*; re-export it as R, G, B"):
        read_image(tmp_path / "x.exr")
    for names, is_said in (("RB", True), ("Z", True), ("Y", False)):
        errors._said.clear()
        write_exr(tmp_path / "x.exr", np.ones((4, 4, len(names)), np.float32), tuple(names))
        read_image(tmp_path / "x.exr")
        assert ("images without channels R, G, B or Y" in capsys.readouterr().err) == is_said
        assert read_radiance(tmp_path / "x.exr").shape == (4, 4, 3)  # grey is repeated
    path, spec, samples = str(tmp_path / "x.exr"), oiio.ImageSpec(2, 2, 3, "half"), oiio.DeepData()
    spec.deep, sink = True, oiio.ImageOutput.create("x.exr")
    samples.init(spec)
    assert sink.open(path, spec) and sink.write_deep_image(samples) and sink.close()
    with pytest.raises(InputError, match="x.exr: holds several samples a pixel .deep.; flatten it"):
        read_image(path)
    numbers, sink = oiio.ImageSpec(2, 2, 3, "uint"), oiio.ImageOutput.create("x.exr")
    assert sink.open(path, numbers) and sink.write_image(np.ones((2, 2, 3), np.uint32)) and sink.close()
    with pytest.raises(InputError, match="x.exr: holds whole numbers of 32 bits"):
        read_image(path)


def test_the_layer_that_is_named_as_a_picture_is_taken(tmp_path):
    """A renderer's layers stand in the order of their names."""
    passes = [f"View.{layer}.{c}" for layer in ("AO", "Combined", "Env") for c in "RGB"]
    write_exr(tmp_path / "x.exr", np.tile(np.float32([0.9] * 3 + [0.2] * 3 + [0.7] * 3), (4, 5, 1)), tuple(passes))
    assert (read_image(tmp_path / "x.exr") == np.float32(0.2)).all()


@pytest.mark.parametrize("names", [("depth", "any"), ("albedo", "View.Combined"), ("albedo", "rgba")])
def test_the_part_with_colours_is_the_picture(tmp_path, capsys, names):
    other, colours = oiio.ImageSpec(5, 4, 3, "float"), oiio.ImageSpec(5, 4, 3, "float")
    other.channelnames = ("Z", "U", "V") if names[0] == "depth" else ("R", "G", "B")
    parts = ((other, np.full((4, 5, 3), 7, "f4")), (colours, np.full((4, 5, 3), 0.25, "f4")))
    for name, (spec, _) in zip(names, parts):
        spec.attribute("name", name)
    sink = oiio.ImageOutput.create("x.exr")
    assert sink.open(str(tmp_path / "x.exr"), (other, colours))
    for i, (spec, pixels) in enumerate(parts):
        assert (i == 0 or sink.open(str(tmp_path / "x.exr"), spec, "AppendSubimage")) and sink.write_image(pixels)
    sink.close()
    assert read_header(tmp_path / "x.exr").channels == 3 and (read_image(tmp_path / "x.exr") == 0.25).all()
    assert "of images with several parts one is used (x.exr: part 2)" in capsys.readouterr().err


@pytest.mark.parametrize(("left", "top"), [(2, 1), (-1, -2), (6, 4), (9, 9), (-5, 0)])
def test_a_part_of_an_image_lies_where_its_window_says(tmp_path, left, top):
    part, whole = np.random.default_rng(0).random((4, 5, 3), np.float32), np.zeros((6, 8, 3), np.float32)
    for y in range(4):
        for x in range(5):
            if 0 <= y + top < 6 and 0 <= x + left < 8:
                whole[y + top, x + left] = part[y, x]
    write_exr(tmp_path / "x.exr", part, window=(left, top, 8, 6))
    assert np.array_equal(read_image(tmp_path / "x.exr"), whole) and read_header(tmp_path / "x.exr")[:2] == (6, 8)


def test_an_orientation_is_said(tmp_path, capsys):
    exif = Image.Exif()
    exif[274] = 3
    for name, read in (("x.jpg", read_colours), ("x.png", read_mask)):
        errors._said.clear()
        png(np.zeros((4, 4, 3), np.uint8)).save(tmp_path / name, exif=exif)
        read(tmp_path / name)
        said = capsys.readouterr().err
        assert f"state an EXIF orientation; their pixels are used as they are stored ({tmp_path / name}: 3)" in said


@pytest.mark.parametrize("exposures", [(), (2.0,), (4.0, 0.5), (1e4, 1e4)])
def test_the_exposures_of_a_radiance_file_are_divided_out(tmp_path, capsys, exposures):
    write_image(tmp_path / "x.hdr", np.full((8, 16, 3), 0.5, np.float32))
    whole = (tmp_path / "x.hdr").read_bytes()
    lines = "".join(f"EXPOSURE={x}\n" for x in exposures).encode() + (b"GAMMA=2.2\n" if exposures else b"GAMMA=1\n")
    (tmp_path / "x.hdr").write_bytes(whole.replace(b"FORMAT=", lines + b"FORMAT=", 1))
    is_used = np.prod(exposures) < 1e6
    assert read_radiance(tmp_path / "x.hdr") == pytest.approx(0.5 / np.prod(exposures) ** is_used, rel=0.01)
    said = capsys.readouterr().err
    assert ("the GAMMA of maps are not used (x.hdr)" in said) == bool(exposures)
    assert ("the EXPOSURE of maps is beyond reason and not used (x.hdr)" in said) != is_used


@pytest.mark.parametrize("order", ["-Y 8 +X 16", "+Y 8 +X 16", "-Y 8 -X 16", "+Y 8 -X 16", "+X 8 -Y 16"])
def test_a_radiance_file_may_begin_at_any_corner(tmp_path, order):
    image = np.arange(8 * 16, dtype=np.float32).reshape(8, 16, 1).repeat(3, 2) + 1
    flips = slice(None, None, -1 if "+Y" in order else 1), slice(None, None, -1 if "-X" in order else 1)
    write_image(tmp_path / "x.hdr", image[flips])
    (tmp_path / "x.hdr").write_bytes((tmp_path / "x.hdr").read_bytes().replace(b"-Y 8 +X 16", order.encode()))
    if order.startswith("+X"):
        with pytest.raises(InputError, match="x.hdr: is stored by columns; re-export it"):
            read_radiance(tmp_path / "x.hdr")
    else:
        np.testing.assert_allclose(read_radiance(tmp_path / "x.hdr"), image, rtol=0.01)


def test_grey_photos_of_sixteen_bits_keep_their_values(tmp_path):
    png(np.full((4, 4), 30000, np.uint16)).save(tmp_path / "x.png")
    assert (read_upright(tmp_path / "x.png") == 30000).all()
    png(np.full((4, 4), 0.5, np.float32)).save(tmp_path / "f.tif")
    png(np.full((4, 4), 1 << 17, np.int32)).save(tmp_path / "i.tif")
    for name in ("f.tif", "i.tif"):
        with pytest.raises(InputError, match=f"{name}: holds values of 32 bits, whose white is unknown; save it in 8"):
            read_upright(tmp_path / name)
        (tmp_path / name).unlink()
    (tmp_path / "._x.png").write_bytes(b"a Mac's")
    assert len(find_photographs(tmp_path)) == 1


def test_the_content_of_a_plate_decides_its_curve(tmp_path):
    write_image(tmp_path / "x.png", np.full((4, 4, 3), 0.5, np.float32))
    (tmp_path / "x.png").rename(tmp_path / "x.exr")
    assert read_plate(tmp_path / "x.exr") == pytest.approx(srgb_to_linear(np.float32([128 / 255]))[0], abs=1e-3)


@pytest.mark.parametrize(
    ("lens", "expected"),
    [
        ({"camera_angle_x": 1.0, "camera_angle_y": 0.5}, (100 / np.tan(0.5), 75 / np.tan(0.25), 100, 75)),
        ({"camera_angle_y": 0.5}, (75 / np.tan(0.25), 75 / np.tan(0.25), 100, 75)),
        ({"fl_x": 150, "camera_angle_y": 0.5}, (150, 75 / np.tan(0.25), 100, 75)),
        ({"fl_y": 120}, (120, 120, 100, 75)),
        ({"fl_x": 300, "cx": -20, "cy": 500, "w": 400, "h": 300}, (150, 150, -10, 250)),
    ],
)
def test_each_number_of_a_lens_is_read(lens, expected):
    assert lens_intrinsics(read_lens(lens, "x")[0], (150, 200)) == pytest.approx(expected)


LISTS = [
    ({"test_filenames": [1, 4]}, {0, 2, 3, 5}, {1, 4}),
    ({"val_filenames": [2]}, {0, 1, 3, 4, 5}, {2}),
    ({"test_filenames": [1], "val_filenames": [2]}, {0, 3, 4, 5}, {1}),
    ({"train_filenames": [0, 3], "test_filenames": [1]}, {0, 3}, {1}),
    ({"train_filenames": [0, 1, 3], "val_filenames": [1]}, {0, 3}, {1}),
    ({"train_filenames": [0, 1, 3]}, {0, 1, 3}, None),
    ({"train_filenames": [0, 1], "test_filenames": [0, 1]}, {0, 1}, {0, 1}),
]


@pytest.mark.parametrize(("lists", "train", "test"), LISTS)
def test_what_any_list_holds_out_is_held_out(tmp_path, capsys, lists, train, test):
    make_blender(tmp_path, train=6, test=1)
    content = json.loads((tmp_path / "transforms_train.json").read_text())
    files = [frame["file_path"] for frame in content["frames"]]
    content |= {key: [files[i] for i in numbers] for key, numbers in lists.items()}
    (tmp_path / "transforms.json").write_text(json.dumps(content))
    for split in ("train", "test"):
        (tmp_path / f"transforms_{split}.json").unlink()
    names = {f"r_{i}": i for i in range(6)}
    assert {names[name] for name in load_dataset(tmp_path).frame_names} == train
    assert ("images are in no list of the splits" in capsys.readouterr().err) == ("train_filenames" in lists)
    assert has_test_split(tmp_path) == (test is not None)
    if test is not None:
        assert {names[name] for name in load_dataset(tmp_path, "test").frame_names} == test


@pytest.mark.parametrize("split", ["test", "val"])
def test_images_of_other_files_and_names_without_a_frame_are_said(tmp_path, capsys, split):
    """transforms.json has all photos, and another file those for testing; a list has a name of its own."""
    make_blender(tmp_path, train=6, test=1)
    content = json.loads((tmp_path / "transforms_train.json").read_text())
    (tmp_path / "transforms_train.json").rename(tmp_path / "transforms.json")
    (tmp_path / "transforms_test.json").unlink()
    other = tmp_path / f"transforms_{split}.json"
    other.write_text(json.dumps(content | {"frames": content["frames"][:2]}))
    assert load_dataset(tmp_path).frame_names == ["r_2", "r_3", "r_4", "r_5"]
    assert load_dataset(tmp_path, "test").frame_names == ["r_0", "r_1"]
    assert "images of transforms.json that a file holds out for testing are not trained on" in capsys.readouterr().err
    other.write_text(json.dumps(content))
    assert len(load_dataset(tmp_path).frame_names) == 6
    assert "the scores of test views are those of photos trained on" in capsys.readouterr().err
    other.write_text(json.dumps(content | {"frames": []}))
    assert len(load_dataset(tmp_path)) == 5 and len(load_dataset(tmp_path, "test")) == 1  # every 8th
    (tmp_path / "transforms.json").rename(tmp_path / "transforms_train.json")
    assert not has_test_split(tmp_path) and len(load_dataset(tmp_path)) == 6
    (tmp_path / "transforms_train.json").rename(tmp_path / "transforms.json")
    other.unlink()
    write_image(tmp_path / "masks/a.png", np.ones((4, 4)))
    assert transforms.read(tmp_path, None)[1].mask_path is None
    assert "masks: no frame has a mask there; 'mask_path' of a frame would name it" in capsys.readouterr().err
    lists = {"test_filenames": ["train\\r_1.png", "train/r_9.png", "train/u\u0308.png", f"{tmp_path}/train/r_0.png"]}
    content["frames"][5]["file_path"] = "train/\u00fc.png"
    (tmp_path / "train/r_5.png").rename(tmp_path / "train/\u00fc.png")
    (tmp_path / "transforms.json").write_text(json.dumps(content | lists))
    assert load_dataset(tmp_path).frame_names == ["r_2", "r_3", "r_4"]
    assert "lists of the splits name 1 images that no frame has (train/r_9)" in capsys.readouterr().err


@pytest.mark.parametrize(("damage", "said"), [("none", False), ("inverted", True), ("lens", True)])
def test_masks_that_do_not_fit_the_poses_are_said(tmp_path, capsys, damage, said):
    data = make_blender(tmp_path)
    for path in data.glob("train/*.png") if damage == "inverted" else ():
        write_image(path, 1 - read_image(path))
    if said:
        edit(data, lambda meta: meta.update(fl_x=50, cx=15) if damage == "lens" else meta.update(cy=33))
    load_dataset(data)
    assert ("masks and poses fit badly" in (err := capsys.readouterr().err)) == said
    assert ("principal points lie far from the middle" in err) == said


def test_rounded_poses_become_rotations(capsys):
    rotation = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    pose = np.eye(4)
    pose[:3, :3] = rotation * np.linalg.det(rotation)
    rounded = np.round(pose, 2)
    rounded[:3, :3] += (pose[:3, :3] - rounded[:3, :3]) * 0.7  # as of three decimals
    found = checked_pose(rounded.tolist(), "x")
    assert found[:3, :3].T @ found[:3, :3] == pytest.approx(np.eye(3), abs=1e-9) and np.abs(found - pose).max() < 2e-3
    assert "camera poses are rounded to few digits; the nearest rotations are used (x)" in capsys.readouterr().err
    with pytest.raises(InputError, match="is not a rigid camera-to-world pose"):
        checked_pose((pose @ np.diag([1.003, 1, 1, 1])).tolist(), "x")


def test_names_are_found_in_the_forms_of_other_systems(tmp_path, capsys):
    (tmp_path / "a").mkdir()
    for name in ("a/u\u0308ber.png", "a/b.PNG", "a/c.JPG"):
        (tmp_path / name).write_bytes(b"")
    names = {"a\\\u00fcber.png": "a/u\u0308ber.png", "a/b": "a/b.PNG", ".\\a\\c": "a/c.JPG", "a/c.jpg": "a/c.JPG"}
    for listed, expected in names.items():
        assert listed_image(tmp_path, listed, Path("t")).samefile(tmp_path / expected)
    assert listed_file(tmp_path, "a\\b.PNG", Path("t")).samefile(tmp_path / "a/b.PNG")
    assert not capsys.readouterr().err
    (tmp_path / "a/b.jpg").write_bytes(b"")
    assert listed_image(tmp_path, "a/b", Path("t"), [tmp_path / "a/b.jpg"]).name == "b.PNG"
    assert not capsys.readouterr().err
    assert listed_image(tmp_path, "a/b", Path("t")).name == "b.PNG"
    assert "images of one name differ in their suffixes; the first one is read (b.PNG)" in capsys.readouterr().err


def test_a_mask_is_no_photo(tmp_path):
    """It lies beside the photo, with the photo's name and another suffix, or one more."""
    make_blender(tmp_path, train=6, test=2)
    edit(tmp_path, lambda meta: meta["frames"][2].update(file_path="train/a", mask_path="train/a.png"))
    edit(tmp_path, lambda meta: meta["frames"][3].update(mask_path="", behind_path=""))
    edit(tmp_path, lambda meta: meta["frames"][4].update(mask_path=None))
    (tmp_path / "train/r_2.png").rename(tmp_path / "train/a.jpg")
    write_image(tmp_path / "train/a.png", np.ones((SIZE, SIZE)))
    frames = transforms.read(tmp_path, "train")
    assert frames[2].image_path.name == "a.jpg"
    assert frames[3].mask_path is frames[3].behind_path is frames[4].mask_path is None
    (tmp_path / "train/a.jpg").unlink()
    (tmp_path / "train/a.jpg.png").write_bytes(b"")
    for name in ("train/a", "train/a.jpg"):
        edit(tmp_path, lambda meta, name=name: meta["frames"][2].update(file_path=name))
        with pytest.raises(InputError, match=f"{name}: no such image"):
            transforms.read(tmp_path, "train")


def test_found_masks_have_names_of_their_own():
    images = "cam0/images/0.jpg cam1/images/0.jpg cam1/images/0.png cam1/0.jpg ../cam1/0.jpg cam1_images/0.jpg".split()
    names = [separated_mask(Path("data") / image, Path("data")) for image in images]
    assert len(set(names)) == len(images) and all(name.suffix == ".png" and ".." not in name.parts for name in names)


def test_the_model_of_most_images_is_read_whatever_its_bytes(tmp_path, capsys):
    for k, (n_images, n_points) in enumerate(((4, 1), (2, 900))):
        folder = tmp_path / "sparse" / str(k)
        folder.mkdir(parents=True)
        (folder / "cameras.txt").write_text("1 PINHOLE 48.0 48 60 60 24 24\n")
        points = " ".join(["1.0 2.0 7"] * n_points)
        lines = [f"{i} 1 0 0 0 0 0 {i} 1 r_{i}.png\n{points}\n" for i in range(n_images)]
        (folder / "images.txt").write_text("".join(lines))
    (tmp_path / "images").mkdir()
    for i in range(4):
        write_image(tmp_path / f"images/r_{i}.png", np.ones((48, 48, 4), np.float32))
    frames = colmap.read(tmp_path, None)
    assert len(frames) == 4 and frames[0].lens["w"] == 48
    assert f"{tmp_path}: has 2 COLMAP models; the one with the most images is read" in capsys.readouterr().err
    (tmp_path / "sparse/0/cameras.txt").write_text("1 PINHOLE 48.5 48 60 60 24 24\n")
    with pytest.raises(InputError, match="cameras.txt: is damaged"):
        colmap.read(tmp_path, None)


def test_data_of_close_ups_have_a_page(tmp_path, capsys):
    """Each photo is suspected: the object is cut in all."""
    data = make_blender(tmp_path / "data", train=8)
    for split in ("train", "test"):
        for path in (data / split).glob("*.png"):
            write_image(path, read_image(path)[10:38, 10:38])
        angle = 2 * np.arctan(np.tan(ANGLE / 2) * 28 / SIZE)
        edit(data, lambda meta, angle=angle: meta.update(camera_angle_x=angle), f"transforms_{split}.json")
    assert main(["inspect", str(data), "--out", str(tmp_path / "page.html")]) == DONE
    assert "cut" in capsys.readouterr().out and (tmp_path / "page.html").stat().st_size > 1000


def test_a_world_that_hangs_is_said(tmp_path):
    data = make_blender(tmp_path, train=8)

    def upward():
        findings = inspect(load_dataset(data), None, Reading()).findings
        return next(finding for finding in findings if finding.name == "upward by the cameras")

    assert not upward().advice
    turn = np.diag([1.0, -1, -1, 1])
    for frame in range(8):
        edit(data, set_pose(frame, lambda pose: (turn @ pose).tolist()))
    assert upward().value == "(0.00, 0.00, -1.00)" and "turn the data's world" in upward().advice


def test_keys_that_are_not_used_are_named(tmp_path, capsys):
    make_blender(tmp_path, train=6, test=2)
    load_dataset(tmp_path)
    assert "not used" not in capsys.readouterr().err
    edit(tmp_path, lambda meta: meta.update(applied_scale=0.5, aabb_scale=4))
    edit(tmp_path, lambda meta: meta["frames"][2].update(depth_file_path="d.png", rotation=0.1))
    load_dataset(tmp_path)
    assert "keys that are not used: aabb_scale, applied_scale, depth_file_path" in capsys.readouterr().err
    edit(tmp_path, lambda meta: meta.update(k1=0.1, camera_type="orthographic"))
    assert len(transforms.read_camera_path(tmp_path / "transforms_train.json")) == 6
    said = capsys.readouterr().err
    assert "has lenses that distort; drawn as pin" in said and "not used: aabb_scale, applied_scale, camera" in said


def test_a_lens_that_is_stated_twice_and_a_mask_without_an_object_are_told_of(tmp_path, capsys):
    make_blender(tmp_path, train=6, test=2)
    focal = 0.5 * SIZE / np.tan(0.5 * ANGLE)
    edit(tmp_path, lambda meta: meta.update(fl_x=focal))
    load_dataset(tmp_path)
    assert "note" not in capsys.readouterr().err
    edit(tmp_path, lambda meta: meta.update(fl_x=1.03 * focal))
    write_image(tmp_path / "train/r_4.png", np.zeros((SIZE, SIZE, 4)))
    load_dataset(tmp_path)
    said = capsys.readouterr().err
    what = "'fl_x' and 'camera_angle_x' contradict each other; 'fl_x' counts"
    assert f"{what} (r_0.png: {SIZE} pixels, they agree for {1.03 * SIZE:.0f})" in said
    assert "masks of 1 photos are empty; training takes the object to be nowhere in them (r_4.png)" in said
    edit(tmp_path, lambda meta: meta.pop("camera_angle_x"))
    load_dataset(tmp_path)
    said = capsys.readouterr().err
    what = "in pixels are stated without 'w' and 'h'; they are taken for those of the photos as they are"
    assert f"{what} (r_0.png: {SIZE}x{SIZE})" in said


def test_an_alpha_that_was_multiplied_in_is_told_of(tmp_path, capsys):
    make_blender(tmp_path, train=6, test=2)
    y, x = np.mgrid[:SIZE, :SIZE] - SIZE / 2
    alpha = np.clip((20 - np.hypot(x, y)) / 4, 0, 1)[..., None]
    for colour, is_told in ((0.2, False), (0.5 * alpha, True)):
        for path in (tmp_path / "train").iterdir():
            write_image(path, np.dstack([colour * np.ones((SIZE, SIZE, 3)), alpha]))
        load_dataset(tmp_path)
        assert ("colours never exceed a faint alpha" in capsys.readouterr().err) == is_told


def test_a_background_that_is_not_used_is_named(tmp_path, capsys):
    """Photos that their alpha has cut out show none; a file that is not there, or of another shape, is refused."""
    make_blender(tmp_path, train=6, test=2)
    edit(tmp_path, lambda meta: meta["frames"][2].update(behind_path="train/r_2.png"))
    paths = load_dataset(tmp_path).behind_paths
    assert paths == [None] * 2 + [tmp_path / "train/r_2.png"] + [None] * 3
    assert "'behind_path' is not used" in capsys.readouterr().err
    write_image(tmp_path / "wide.png", np.zeros((8, 32, 4), np.float32))
    for name, told in (("none.png", "no such image"), ("wide.png", "must be RGBA and of its photo's shape")):
        edit(tmp_path, lambda meta, name=name: meta["frames"][2].update(behind_path=name))
        with pytest.raises(InputError, match=f"{name}: {told}"):
            load_dataset(tmp_path)
