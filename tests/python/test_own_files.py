"""A user's own files are never lost: the program deletes and replaces what it can show to be its own."""

import os
import shutil
from unittest.mock import Mock

import cv2
import numpy as np
import pytest
from PIL import Image
from splitnerf.cli import BAD_INPUT, DONE
from splitnerf.errors import InputError
from splitnerf.files import LOCK, atomic_path, is_own, locked, own_folder
from splitnerf_tools.capture import prepare as preparation
from splitnerf_tools.capture.photographs import find_photographs
from splitnerf_tools.separation.separate import separate
from tiny_runs import command, contents, refused, train


@pytest.fixture
def mine(tmp_path):
    """A folder of the user's."""
    folder = tmp_path / "mine"
    folder.mkdir()
    return folder


def test_a_lock_is_no_file_of_the_users(mine, tmp_path):
    """Neither one of that name nor the target of a link, which may come from a stranger's archive."""
    (tmp_path / "key").write_text("secret")
    (mine / LOCK).symlink_to(tmp_path / "key")
    with pytest.raises(InputError, match="is a link, and no lock"), locked(mine):
        pass
    (mine / LOCK).unlink()
    (mine / LOCK).write_text("thesis")
    with pytest.raises(InputError, match="is no lock of this program"), locked(mine):
        pass
    assert (tmp_path / "key").read_text() == "secret" and (mine / LOCK).read_text() == "thesis"


def test_a_folder_is_emptied_only_by_its_maker(mine, tmp_path):
    """And kept for the same purpose. A link to a folder of ours is the user's."""
    own_folder(mine, "a")
    (mine / "result").touch()
    own_folder(mine, "a")
    assert (mine / "result").exists()
    own_folder(mine, "b")
    assert not (mine / "result").exists() and is_own(mine)
    own_folder(mine)
    (mine / "result").touch()
    own_folder(mine)  # without a purpose there is none to keep it for
    assert not (mine / "result").exists()
    (tmp_path / "link").symlink_to(mine)
    with pytest.raises(InputError, match="link: holds other files"):
        own_folder(tmp_path / "link")
    (mine / ".splitnerf").rename(mine / "thesis")
    for purpose in ("b", ""):
        with pytest.raises(InputError, match="mine: holds other files"):
            own_folder(mine, purpose)
    assert (mine / "thesis").exists()


def test_masks_are_not_found_into_a_users_folder(mine):
    (mine / "thesis.txt").touch()
    with pytest.raises(InputError, match="mine: holds other files"):
        separate(None, None, mine, steps=1, minutes=0.0, seed=0)
    assert (mine / "thesis.txt").exists()


def test_overwrite_replaces_runs_alone(data, mine, done, capsys):
    for name in ("mesh.glb", "report.html", "config.toml"):
        (mine / name).write_text("mine = 1")
    before = contents(mine)
    assert train(data, mine, "--steps", "1", "--overwrite") == BAD_INPUT
    assert "mine/config.toml: is of no run, and would be deleted" in capsys.readouterr().err
    assert contents(mine) == before
    (done / "separated").mkdir()
    (done / "separated/thesis.txt").touch()
    assert train(data, done, "--steps", "1", "--overwrite") == DONE
    assert (done / "separated/thesis.txt").exists()


@pytest.mark.parametrize(("name", "words"), [("export", ("--formats", "obj")), ("refine", ("--data", "data"))])
def test_results_do_not_replace_others(done, mine, tmp_path, capsys, name, words):
    """Those of another run never, other files only as asked."""
    other = shutil.copytree(done, tmp_path / "other")
    (mine / "mesh.obj").write_text("mine")
    before = contents(other) | contents(mine)
    for more in ((), ("--overwrite",)):
        assert "other: holds another run" in refused(capsys, name, done, *words, "--out", other, *more)
    shutil.copytree(other, done / "other")  # also where the folder that is exported lies around it
    assert "other: holds another run" in refused(capsys, name, done, *words, "--out", done / "other")
    assert "mine/mesh.obj: would be replaced" in refused(capsys, name, done, *words, "--out", mine)
    assert contents(other) | contents(mine) == before


def test_what_a_refinement_fitted_or_begins_with_is_not_replaced(done, mine, capsys):
    (done / "refined").mkdir()
    (done / "refined/refinement.json").write_text("{}")
    for name in ("mesh.glb", "environment.exr"):
        shutil.copy(done / name, mine)
    before = contents(mine) | contents(done)
    assert "refined: holds what a refinement fitted" in refused(capsys, "export", done, "--out", done / "refined")
    assert "mine: holds the asset" in refused(capsys, "refine", mine, "--data", "data", "--out", mine, "--overwrite")
    assert "mesh.glb: would be replaced" in refused(capsys, "refine", done, "--data", "data", "--out", mine, "--resume")
    assert contents(mine) | contents(done) == before


@pytest.mark.parametrize("words", [(), ("--overwrite",)])
def test_previews_of_no_run_stay(data, mine, capsys, words):
    """Nor does an empty file of settings make a run of a folder."""
    (mine / "previews").mkdir()
    (mine / "previews/step_000002.png").write_bytes(b"mine")
    assert "previews: is of no run" in refused(capsys, "train", data, "--out", mine, *words)
    for name in ("config.toml", "mesh.glb"):
        (mine / name).touch()
    said = "is of no run" if words else "holds a run already"
    assert said in refused(capsys, "train", data, "--out", mine, *words) and (mine / "mesh.glb").exists()
    assert (mine / "previews/step_000002.png").read_bytes() == b"mine"


@pytest.mark.parametrize("name", ["trained", "refined", "previews", "separated"])
def test_links_in_a_run_lead_nowhere(data, done, mine, capsys, name):
    """An archive of somebody's may hold them."""
    for file in ("mesh.glb", "environment.exr", "step_000002.png"):
        (mine / file).write_text("mine")
    before = contents(mine)
    shutil.rmtree(done / name, ignore_errors=True)
    (done / name).symlink_to(mine)
    assert f"{name}: is a link" in refused(capsys, "train", data, "--out", done, "--overwrite")
    assert f"{name}: is a link" in refused(capsys, "export", done, "--out", done / "trained")
    assert f"{name}: is a link" in refused(capsys, "refine", done, "--data", data)
    assert contents(mine) == before


def test_only_files_are_replaced(data, done, mine, capsys):
    os.mkfifo(mine / "pipe")
    said = "pipe: is a device or a pipe, which is not replaced"
    with pytest.raises(InputError, match=said), atomic_path(mine / "pipe"):
        pass
    names = "index.html", "chair_evaluation.json", "photo.png"
    for name in names:
        (mine / name).write_text("mine")
    shutil.copy(done / "mesh.glb", mine / "chair.glb")
    assert "index.html: is not an earlier result" in refused(capsys, "inspect", data, "--out", mine / "index.html")
    said = refused(capsys, "evaluate", mine / "chair.glb", "--data", data)
    assert "chair_evaluation.json: is not an earlier result" in said
    assert "photo.png: exists" in refused(capsys, "evaluate", done, "--data", data, "--sheet", mine / "photo.png")
    assert [(mine / name).read_text() for name in names] == ["mine"] * 3


@pytest.mark.parametrize("name", ["mesh.obj", "mesh_albedo.png"])
def test_an_export_is_replaced_as_asked(done, mine, capsys, name):
    (mine / name).write_text("mine")
    assert f"{name}: would be replaced" in refused(capsys, "export", done, "--out", mine, "--formats", "obj")
    assert command("export", done, "--out", mine, "--formats", "obj", "--overwrite") == DONE
    assert (mine / name).read_bytes() != b"mine"


REPLACED = {"ablation.md": ("ablate", "data"), "batch.md": ("batch", "data"), "logs/ray.log": ("batch", "data")}
REPLACED |= {"prefilter.png": ("bench", "prefilter")}
REFUSED = [(name, words, "would be replaced") for name, words in REPLACED.items()]
REFUSED += [("data/light.hdr", ("demo", *more), "data: holds other files") for more in ((), ("--overwrite",))]
REFUSED += [(f"{name}/x.txt", ("prepare", "data"), "mine: holds other files") for name in ("work", "frames", "images")]


@pytest.mark.parametrize(("name", "words", "said"), REFUSED)
def test_files_of_the_users_stay(data, mine, capsys, name, words, said):
    """In place of tables, logs and renderings, and beside photos that are prepared."""
    (mine / name).parent.mkdir(exist_ok=True)
    (mine / name).write_text("mine")
    before = contents(mine)
    assert said in refused(capsys, *(data if word == "data" else word for word in words), "--out", mine)
    assert contents(mine) == before


def test_frames_of_a_video_are_kept_for_it_alone(tmp_path, monkeypatch):
    """And not written again; another video, another number of frames or a changed file is another purpose."""
    write = Mock(side_effect=lambda video, folder, n, _: Image.new("L", (n, 3)).save(folder / f"{video.stem}{n}.png"))
    monkeypatch.setattr(preparation, "write_frames", write)
    found = []
    for name, n, content in (("a.mp4", 4, ""), ("a.mp4", 4, ""), ("b.mp4", 4, ""), ("b.mp4", 2, ""), ("b.mp4", 2, "x")):
        with open(tmp_path / name, "a") as video:  # what is added changes it
            video.write(content)
        settings = preparation.PrepareSettings(frames=n)
        found += [photo.name for photo in preparation._photographs(tmp_path / name, tmp_path / "out", settings, print)]
    assert found == ["a4", "a4", "b4", "b2", "b2"] and write.call_count == 4


def test_photos_have_names_of_their_own(tmp_path):
    """Also where the name that one would get is another's."""
    for i, name in enumerate(("a.png", "a.bmp", "a_png.bmp", "b.png")):
        cv2.imwrite(str(tmp_path / name), np.full((4, 4, 3), 50 * i, np.uint8))
    assert [photo.name for photo in find_photographs(tmp_path)] == ["a_bmp", "a_png_", "a_png", "b"]
