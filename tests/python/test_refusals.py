"""What cannot be done is refused in one line, before anything is lost."""

import errno
import json
import os

import numpy as np
import pytest
from gltf_builder import triangle
from splitnerf.cli import DONE, FAILED, main
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import write_image
from tiny_runs import command, contents, refused


@pytest.fixture
def grey(tmp_path):
    write_image(tmp_path / "grey.hdr", np.full((8, 16, 3), 0.5, np.float32))
    return tmp_path / "grey.hdr"


@pytest.fixture
def asset(tmp_path):
    return triangle().write(tmp_path / "asset.glb")


def relit(asset, *words: object) -> list[object]:
    return ["relight", asset, "--size", "4", "--spp", "1", *words]


def test_relight_replaces_only_its_own_pictures(tmp_path, asset, grey, capsys):
    photos = tmp_path / "photos"
    for i in range(3):
        write_image(photos / f"{i:03d}.png", np.full((4, 4, 3), 0.5))
        write_image(photos / f"{i:03d}.exr", np.full((4, 4, 3), 0.5))
        content = (photos / f"{i:03d}.exr").read_bytes()
        (photos / f"{i:03d}.exr").write_bytes(content.replace(b"SplitNeRF", b"Blender.."))
    before = contents(photos)
    for words in ((), ("--overwrite",), ("--overwrite", "--turntable", "2")):
        error = refused(capsys, *relit(asset, "--env", grey, "--out", photos, *words))
        assert "000.exr: was not written by relight" in error
    assert before == contents(photos)
    for name in ("000.png", "000.exr"):
        (photos / name).unlink()
    assert command(*relit(asset, "--env", grey, "--out", photos)) == DONE
    assert command(*relit(asset, "--env", grey, "--out", photos, "--overwrite")) == DONE
    assert all((photos / path.name).read_bytes() == content for path, content in before.items() if path.stem != "000")


def test_an_overwriting_relight_without_room_keeps_the_pictures(tmp_path, asset, grey, monkeypatch, capsys):
    words = relit(asset, "--env", grey, "--out", tmp_path / "out", "--turntable", 2)
    assert command(*words) == DONE
    before = contents(tmp_path / "out")

    def fails(_) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", fails)
    assert command(*words, "--overwrite", "--seed", 5) == FAILED
    assert "000.exr: cannot be written (No space left on device)" in capsys.readouterr().err
    assert before == contents(tmp_path / "out")


def test_a_map_without_a_name_has_no_folder_of_its_own(tmp_path, asset, grey, capsys):
    (tmp_path / "...hdr").write_bytes(grey.read_bytes())
    words = relit(asset, "--env", grey, "--env", tmp_path / "...hdr", "--out", tmp_path / "a/b")
    assert "...hdr: has no name that a folder could have" in refused(capsys, *words)
    assert not (tmp_path / "a").exists()


@pytest.mark.parametrize(
    ("content", "n", "message"),
    [
        ({"w": 0.5, "h": 0.5}, 1, "'w' and 'h' must lie between 1 and 16384, got 0 and 0"),
        ({"w": 1e9, "h": 1e9}, 1, "'w' and 'h' must lie between 1 and 16384"),
        ({}, 3, "path.json: has 3 cameras, more than 2; split it"),
    ],
)
def test_pictures_and_camera_paths_have_an_end(tmp_path, asset, grey, capsys, monkeypatch, content, n, message):
    monkeypatch.setattr("splitnerf.relight.cameras.MOST_VIEWS", 2)
    frames, path = [{"transform_matrix": np.eye(4).tolist()}] * n, tmp_path / "path.json"
    path.write_text(json.dumps(content | {"camera_angle_x": 1.0, "frames": frames}))
    size = () if content else ("--size", "4")
    words = ["relight", asset, "--spp", "1", *size, "--env", grey, "--path", path, "--out", tmp_path / "out"]
    assert message in refused(capsys, *words)


def test_numbers_of_pictures_and_paths_have_a_limit(tmp_path, asset, grey, capsys):
    out = tmp_path / "out"
    assert "--turntable must be at least 1 and at most 100000" in refused(
        capsys, *relit(asset, "--env", grey, "--turntable", 10**9, "--out", out)
    )
    for option, value in (("--size", 100000), ("--spp", 3 * 10**9), ("--train", 10**9)):
        words = ["synth", asset, "--light", grey, "--out", out, option, value]
        assert f"{option} must be at least 1 and at most" in refused(capsys, *words)
    for words in (["evaluate", asset, "--data", tmp_path], ["ablate", tmp_path]):
        assert "--spp must be at least 1 and at most 1048576" in refused(capsys, *words, "--spp", 3 * 10**9)
    assert not out.exists()


def test_an_asset_without_scenes_makes_data(tmp_path, grey):
    gltf = triangle()
    gltf.json.pop("scenes", None)
    gltf.json.pop("scene", None)
    source = gltf.write(tmp_path / "asset.glb")
    words = "--size", 8, "--train", 1, "--test", 1, "--spp", 1, "--out", tmp_path / "data"
    assert command("synth", source, "--light", grey, *words) == DONE
    placed, original = read_asset(tmp_path / "data/asset.glb"), read_asset(source)
    assert len(placed.triangles) == len(original.triangles) and np.abs(placed.vertices).max() <= 1.0001


def test_scores_of_another_run_are_not_replaced(data, other_data, done, tmp_path, capsys):
    run, before = done, contents(done)
    assert "was trained on other images" in refused(capsys, "evaluate", run, "--data", other_data)
    for option, victim in (("--table", "checkpoint.pt"), ("--out", "checkpoint.pt"), ("--out", "config.toml")):
        words = ["evaluate", run, "--data", data, option, run / victim]
        assert f"{victim}: is not an earlier result, and would be replaced" in refused(capsys, *words)
    assert contents(run) == before
    (tmp_path / "empty.json").touch()
    for _ in range(2):
        words = ["evaluate", run, "--data", data, "--table", tmp_path / "t.md", "--out", tmp_path / "empty.json"]
        assert command(*words) == DONE


VIEWS = 3, {}, {"psnr": "high"}, {"psnr": "high", "ssim": 1, "lpips": None}
OTHERS = {"novel_view": None, "f_score": []}, {"albedo": None}


@pytest.mark.parametrize("content", [*({"novel_view": x} for x in VIEWS), *OTHERS])
def test_scores_of_other_types(tmp_path, capsys, content):
    (tmp_path / "evaluation.json").write_text(json.dumps(content))
    error = refused(capsys, "evaluate", tmp_path, "--table", tmp_path / "t.md")
    assert "evaluation.json: is not an evaluation" in error
    (tmp_path / "evaluation.json").write_text(json.dumps({"novel_view": None, "f_score": 0.5}))
    assert main(["evaluate", str(tmp_path)]) == DONE


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (ValueError("no\nsuch"), "unexpected ValueError: no such"),
        (KeyError("a"), "unexpected KeyError: 'a'"),
        (TypeError("x"), "unexpected TypeError: x"),
        (MemoryError(), "not enough memory; use smaller sizes"),
        (MemoryError("of 3 GiB"), "not enough memory (of 3 GiB); use smaller sizes"),
        (OSError(errno.EACCES, "Permission denied", "/a/b"), "/a/b: Permission denied"),
        (RuntimeError("words"), "words"),
    ],
)
def test_any_error_is_one_line(monkeypatch, capsys, error, words):
    def fails(*_):
        raise error

    monkeypatch.setattr("splitnerf.config.settings_table", fails)
    assert main(["info", "--settings"]) == FAILED
    printed = capsys.readouterr().err
    assert printed.startswith(f"splitnerf: {words}") and len(printed.splitlines()) == 1
    if "unexpected" in words:
        monkeypatch.setenv("SPLITNERF_TRACEBACK", "1")
        with pytest.raises(type(error)):
            main(["info", "--settings"])
