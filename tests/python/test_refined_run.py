"""A run with refinement: what is delivered and scored, how it ends, how it continues, its messages."""

import dataclasses
import json
import re
import shutil
import signal
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from painted_ball import sky, with_textures
from splitnerf import pipeline, progress
from splitnerf.cli import BAD_INPUT, DONE, FAILED, INTERRUPTED, main
from splitnerf.cli.common import print_refinement
from splitnerf.data.dataset import load_dataset
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import read_image
from splitnerf.data.tensor_files import read_tensors
from splitnerf.errors import InputError
from splitnerf.evaluate.scoring import Protocol, score_asset
from splitnerf.export.scene import write_environment
from splitnerf.export.writers import write_glb
from splitnerf.refinement import refine as refinement_files
from splitnerf.refinement import stage as stage_module
from splitnerf.refinement.fit import FitSettings, Refinement
from splitnerf.refinement.pixels import covered_pixels
from splitnerf.refinement.refine import OtherState, refine_folder
from splitnerf.refinement.stage import Stage, decibels
from splitnerf.run_folder import data_of
from splitnerf_tools.report.sections import refinement_section
from tiny_runs import refused, train

REFINED = ("--set", "refinement.enabled=true", "--set", "refinement_sweeps=2")
DELIVERED = ("mesh.glb", "environment.exr", "environment.hdr", "refinement.json")


@pytest.fixture(scope="module")
def run(data, tmp_path_factory) -> Path:
    """A run with a refinement."""
    folder = tmp_path_factory.mktemp("refined") / "run"
    assert train(data, folder, "--steps", "25", "--deterministic", *REFINED) == DONE
    return folder


def bytes_of(run: Path, *names: str) -> list[bytes]:
    """The files' contents."""
    return [(run / n).read_bytes() for n in names]


# ---- what a run holds ----


def test_a_run_delivers_what_was_fitted_and_keeps_what_was_trained(run):
    assert all((run / name).stat().st_size > 0 for name in (*DELIVERED, "mesh.ply", "evaluation.json", "report.html"))
    assert not (run / "refinement.pt").exists()
    fitted, trained = read_asset(run / "mesh.glb"), read_asset(run / "trained" / "mesh.glb")
    assert np.array_equal(fitted.triangles, trained.triangles)
    assert not np.allclose(fitted.vertices, trained.vertices, atol=1e-5)
    assert not np.array_equal(*(read_image(folder / "environment.exr") for folder in (run, run / "trained")))


def test_the_export_says_at_once_what_it_does(run, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(progress, "LINE_EVERY", 0.0)
    assert main(["export", str(run), "--out", str(tmp_path), "--texture-size", "32"]) == DONE
    said = [line.split("export, ")[1] for line in capsys.readouterr().err.splitlines() if "export, " in line]
    assert said == ["surface on a grid of 32^3", "fewer faces", "texture coordinates", "textures", "files"]


def test_what_is_delivered_is_what_is_scored(run, data):
    """By path tracing, the light with it; a later evaluation says the same."""
    scores = json.loads((run / "evaluation.json").read_text())
    assert scores["scored"] == "asset" and scores["spp"] == Protocol.spp
    own = score_asset(
        read_asset(run / "mesh.glb"), read_image(run / "environment.exr"), load_dataset(data, "test"), {}, Protocol.spp
    ).scores
    for key in ("novel_view", "albedo", "roughness_mae", "light_psnr"):
        assert scores[key] == own[key], key
    record = json.loads((run / "refinement.json").read_text())
    assert scores["seconds"] > record["seconds"] > 0 and len(record["sweeps"]) == 2
    before = (run / "evaluation.json").read_bytes()
    assert main(["evaluate", str(run), "--data", str(data)]) == DONE
    again = json.loads((run / "evaluation.json").read_text())
    assert again == json.loads(before)


def test_without_a_refinement_the_fields_are_scored(data, tmp_path):
    run = tmp_path / "run"
    assert train(data, run, "--steps", "12", "--set", "refinement.enabled=true", "--no-refine") == DONE
    assert json.loads((run / "evaluation.json").read_text())["scored"] == "fields"
    assert not (run / "trained").exists() and not any((run / name).exists() for name in DELIVERED[3:])
    assert "<h2>Refinement</h2>" not in (run / "report.html").read_text()


def test_another_run_in_the_folder_leaves_nothing_of_the_refinement(run, data, tmp_path):
    again = shutil.copytree(run, tmp_path / "run")
    assert train(data, again, "--steps", "12", "--overwrite") == DONE
    assert not (again / "trained").exists() and not any((again / name).exists() for name in DELIVERED[3:])
    # And so does a run that goes on without.
    again = shutil.copytree(run, tmp_path / "on" / "run")
    assert main(["train", str(data), "--out", str(again), "--resume", "--no-refine"]) == DONE
    assert not (again / "trained").exists() and not (again / "refinement.json").exists()
    assert bytes_of(again, "mesh.glb") == bytes_of(run / "trained", "mesh.glb")


def test_an_export_does_not_replace_what_the_refinement_fitted(run, tmp_path, capsys):
    run = shutil.copytree(run, tmp_path / "run")
    kept = bytes_of(run, *DELIVERED)
    options = ["--texture-size", "32", "--faces", "200"]
    assert "refinement" in refused(capsys, "export", run, "--out", run, *options)
    assert main(["export", str(run), *options]) == DONE
    assert bytes_of(run, *DELIVERED) == kept
    assert read_asset(run / "trained" / "mesh.glb").materials[0].albedo_texture.shape == (32, 32, 3)


def test_an_export_elsewhere_holds_what_the_refinement_fitted(run, tmp_path, capsys):
    """Twice as large, its names and its light as the run's."""
    assert main(["export", str(run), "--out", str(tmp_path / "out"), "--scale", "2"]) == DONE
    fitted, out = read_asset(run / "mesh.glb"), read_asset(tmp_path / "out" / "mesh.glb")
    assert fitted.name == out.name == run.name
    assert out.vertices == pytest.approx(2 * fitted.vertices, abs=1e-6)
    for name in ("albedo_texture", "roughness_metallic_texture", "normal_texture"):
        assert np.array_equal(getattr(out.materials[0], name), getattr(fitted.materials[0], name))
    assert bytes_of(tmp_path / "out", *DELIVERED[1:3]) == bytes_of(run, *DELIVERED[1:3])
    ours, full = (trimesh.load(folder / "mesh.ply", process=False) for folder in (run, tmp_path / "out"))
    assert full.vertices == pytest.approx(2 * ours.vertices, abs=1e-5)
    assert np.array_equal(full.visual.vertex_colors, ours.visual.vertex_colors)


# ---- its end, and going on ----


def stop_after(monkeypatch, sweeps: int) -> None:
    """Sends SIGINT to this process once a stage has made so many sweeps."""
    advance = Stage.advance

    def counted(stage):
        sweep = advance(stage)
        if sweep.number == sweeps:
            signal.raise_signal(signal.SIGINT)
        return sweep

    monkeypatch.setattr(Stage, "advance", counted)


def test_a_run_that_was_interrupted_in_its_refinement_ends_with_the_bits_of_another(
    run, data, tmp_path, capsys, monkeypatch
):
    halves = tmp_path / "run"  # the files hold its name
    with monkeypatch.context() as patch:
        stop_after(patch, 1)
        assert train(data, halves, "--steps", "25", "--deterministic", *REFINED) == INTERRUPTED
    assert "in the refinement" in capsys.readouterr().out
    assert (halves / "refinement.pt").is_file() and not (halves / "mesh.glb").exists()
    trained = (halves / "trained" / "mesh.glb").stat().st_mtime_ns
    assert main(["train", str(data), "--out", str(halves), "--resume"]) == DONE
    assert (halves / "trained" / "mesh.glb").stat().st_mtime_ns == trained and not (halves / "refinement.pt").exists()
    assert bytes_of(halves, *DELIVERED[:3]) == bytes_of(run, *DELIVERED[:3])


@pytest.mark.parametrize("minutes", [0.0, 2.0])
@pytest.mark.parametrize("part", ["refinement.refine.write_environment", "pipeline.score_run", "pipeline.forget_state"])
def test_a_run_that_was_killed_while_it_wrote_its_results_ends_with_the_bits_of_another(
    run, data, tmp_path, monkeypatch, part, minutes
):
    """With a state of the refinement and without."""
    killed, minutes = tmp_path / "run", ("--set", f"checkpoint_minutes={minutes}")

    def fails(*_, **__):
        raise MemoryError

    with monkeypatch.context() as patch:
        patch.setattr(f"splitnerf.{part}", fails)
        assert train(data, killed, "--steps", "25", "--deterministic", *REFINED, *minutes) == FAILED
    assert (killed / "mesh.glb").exists()
    assert main(["train", str(data), "--out", str(killed), "--resume"]) == DONE
    names = (*DELIVERED[:3], *(f"trained/{name}" for name in ("mesh.glb", "environment.exr")))
    assert bytes_of(killed, *names) == bytes_of(run, *names) and not (killed / "refinement.pt").exists()


def test_more_steps_make_the_state_void(data, tmp_path, monkeypatch):
    run = tmp_path / "run"
    with monkeypatch.context() as patch:
        stop_after(patch, 1)
        assert train(data, run, "--steps", "12", *REFINED) == INTERRUPTED
    before = bytes_of(run / "trained", "mesh.glb")
    assert main(["train", str(data), "--out", str(run), "--resume", "--steps", "20"]) == DONE
    assert bytes_of(run / "trained", "mesh.glb") != before
    assert len(json.loads((run / "refinement.json").read_text())["sweeps"]) == 2


@pytest.fixture
def folder(painted, tmp_path) -> Path:
    """A folder with an asset of a wrong grey and its light."""
    write_glb(tmp_path / "mesh.glb", with_textures(painted[0], albedo_texture=np.full((64, 64, 3), 0.35, np.float32)))
    write_environment(tmp_path, sky())
    return tmp_path


QUICK = FitSettings(sweeps=4, sweep_share=0.1, pixels=256, albedo_size=0)


def n_pixels(painted) -> int:
    """The pixels that show the ball."""
    return len(covered_pixels(painted[1]))


def stop_within(monkeypatch, sweep: int) -> None:
    """Sends SIGINT to this process before the second batch of a sweep, counted from 0; the sweep ends there."""
    gather = Refinement.gather

    def interrupted(fit, surface):
        error = gather(fit, surface)
        if fit.n_sweeps == sweep:
            signal.raise_signal(signal.SIGINT)
            raise AssertionError("the sweep goes on")
        return error

    monkeypatch.setattr(Refinement, "gather", interrupted)


@pytest.mark.parametrize(("stop", "sweeps"), [(stop_after, (1, 2, 3)), (stop_within, (0, 2))])
def test_a_stage_goes_on_from_each_of_its_states(painted, folder, monkeypatch, stop, sweeps):
    """Interrupted after every sweep, or within sweeps that begin again, it ends with the bits of the whole; the time of all parts
    counts."""
    whole = refine_folder(folder, painted[1], folder / "whole", QUICK)
    for n in sweeps:
        with monkeypatch.context() as patch:
            stop(patch, n)
            assert refine_folder(folder, painted[1], folder / "parts", QUICK, resume=n > sweeps[0]) is None
        content = read_tensors(folder / "parts" / "refinement.pt")
        assert len(content["sweeps"]) == n and not (folder / "parts" / "mesh.glb").exists()
    parts = refine_folder(folder, painted[1], folder / "parts", QUICK, resume=True)
    assert parts.sweeps[-1].seconds > content["seconds"] and parts.outline == whole.outline
    assert [s.error for s in parts.sweeps] == [s.error for s in whole.sweeps]
    assert bytes_of(folder / "parts", *DELIVERED[:3]) == bytes_of(folder / "whole", *DELIVERED[:3])


def test_a_signal_ends_the_preparations(painted, folder, monkeypatch):
    monkeypatch.setattr(refinement_files, "Stage", lambda *_: signal.raise_signal(signal.SIGINT))
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a process in the background may ignore it
    try:
        with pytest.raises(KeyboardInterrupt):
            refine_folder(folder, painted[1], folder, QUICK)
    finally:
        signal.signal(signal.SIGINT, before)


def test_the_state_is_kept_from_time_to_time(painted, folder, monkeypatch):
    saved = []
    monkeypatch.setattr(refinement_files, "write_tensors", lambda path, content: saved.append(len(content["sweeps"])))
    refine_folder(folder, painted[1], folder, QUICK, save_minutes=1e-9)
    assert saved == [1, 2, 3, 4, 4]
    saved.clear()
    refine_folder(folder, painted[1], folder, QUICK, save_minutes=10.0)
    assert saved == [4]  # before the results are written


def test_another_state_is_refused(painted, folder, monkeypatch):
    """Of other settings, another asset, damaged, or of another form; sweeps and minutes may change."""
    asset, data = painted
    with monkeypatch.context() as patch:
        stop_after(patch, 1)
        refine_folder(folder, data, folder, QUICK)
    state = (folder / "refinement.pt").read_bytes()

    def refused(match: str, settings: FitSettings = QUICK) -> None:
        with pytest.raises(OtherState, match=match):
            refine_folder(folder, data, folder, settings, resume=True)

    refused("settings", dataclasses.replace(QUICK, light_step=1.0))
    content = read_tensors(folder / "refinement.pt")
    for broken in (
        {"vertices": content["vertices"][1:]},
        {"vertices": np.nan * content["vertices"]},
        {"sweeps": [[1.0]]},
        {"outline": [None]},
        *({"fit": content["fit"] | {name: content["fit"][name][1:]}} for name in ("light", "unknowns")),
        {"fit": content["fit"] | {"random": {}}},
        {"fit": None},
    ):
        torch.save(content | broken, folder / "refinement.pt")
        refused("not the state")
    (folder / "refinement.pt").write_bytes(state[:1000])
    refused("not a readable state")
    (folder / "refinement.pt").write_bytes(state)
    longer = dataclasses.replace(QUICK, sweeps=2, minutes=5.0)
    assert len(refine_folder(folder, data, folder, longer, resume=True).sweeps) == 2
    (folder / "refinement.pt").write_bytes(state)
    write_glb(folder / "mesh.glb", asset)
    refused("another asset")


def test_a_run_knows_its_data(run, data, tmp_path, capsys):
    """Where they are and how they were averaged; what is gone or was never said is asked for."""
    assert data_of(run) == (data.resolve(), 1)
    again, out = shutil.copytree(run, tmp_path / "again"), tmp_path / "refined"
    assert main(["refine", str(again), "--sweeps", "1", "--out", str(out)]) == DONE and (out / "mesh.glb").is_file()
    for content in ('{"data": "%s", "downscale": 1}' % (tmp_path / "gone"), None):
        (again / "data.json").unlink() if content is None else (again / "data.json").write_text(content)
        error = refused(capsys, "refine", again, "--sweeps", "1", "--out", out / "more")
        assert "does not say where its data are, or they are gone; give --data" in error
    (again / "data.json").write_text('{"data": ".", "downscale": 0}')
    with pytest.raises(InputError, match="data.json: is damaged"):
        data_of(again)


def test_refine_starts_from_what_was_trained_and_can_be_interrupted(run, data, tmp_path, monkeypatch, capsys):
    """The same command again on a refined run does what the refinement did."""
    run = shutil.copytree(run, tmp_path / "run")
    command = ["refine", str(run), "--data", str(data), "--sweeps", "2"]
    with monkeypatch.context() as patch:
        stop_after(patch, 1)
        assert main(command) == INTERRUPTED
    assert "--resume" in capsys.readouterr().out
    assert main([*command, "--resume"]) == DONE
    assert bytes_of(run / "refined", "mesh.glb", "environment.exr") == bytes_of(run, "mesh.glb", "environment.exr")
    assert not (run / "refined" / "refinement.pt").exists()
    for again in (command, [*command, "--resume"]):  # it may have taken an hour
        assert main(again) == BAD_INPUT and "would be replaced" in capsys.readouterr().err
    assert main([*command[:-1], "1", "--overwrite"]) == DONE


def test_an_asset_that_was_placed_elsewhere_is_not_compared_with_the_photos(run, data, tmp_path, capsys):
    placed = tmp_path / "placed"
    assert main(["export", str(run), "--out", str(placed), "--formats", "glb", "--pivot", "foot"]) == DONE
    for words in (["evaluate", str(placed / "mesh.glb")], ["refine", str(placed)]):
        assert "the asset stands elsewhere than the photos" in refused(capsys, *words, "--data", data)


def test_a_size_is_of_what_was_trained(run, tmp_path, capsys):
    small = ["--faces", "200", "--texture-size", "32", "--formats", "glb"]
    assert main(["export", str(run), "--out", str(tmp_path), *small]) == DONE
    assert "of what was trained, without the refinement" in capsys.readouterr().err


class Clock:
    """A clock that goes on by a second with each batch, and by what is asked with each round of the outline."""

    def __init__(self, monkeypatch, of_batch: float, of_round: float = 0.0):
        self.now, self.rounds = 0.0, []
        monkeypatch.setattr(stage_module.time, "monotonic", lambda: self.now)
        gather = Refinement.gather

        def slow_batch(refinement, surface):
            self.now += of_batch
            return gather(refinement, surface)

        def slow_outline(dataset, asset, seed, begins):
            while begins(len(self.rounds)):
                self.rounds.append(self.now)
                self.now += of_round
            return asset, []

        monkeypatch.setattr(Refinement, "gather", slow_batch)
        monkeypatch.setattr(stage_module, "fit_outline", slow_outline)


def test_time_ends_a_stage_by_its_minutes(painted, monkeypatch):
    clock, settings = Clock(monkeypatch, of_batch=1.0), dataclasses.replace(QUICK, minutes=1e-6, outline=False)
    stage = Stage(painted[1], painted[0], sky(), settings)
    assert not stage.finished and stage.progress < 1.0  # a first sweep is always made
    stage.advance()
    assert stage.finished and stage.progress == 1.0
    stage.settings = dataclasses.replace(QUICK, minutes=1e6)
    assert not stage.finished and stage.progress == 0.25
    stage.settings, stage.started = dataclasses.replace(QUICK, minutes=2.0), clock.now - 66.0
    assert stage.progress == pytest.approx(0.55)


def test_a_slow_machine_keeps_to_the_minutes_by_smaller_sweeps(painted, monkeypatch):
    """Sweeps of 50 batches of a second each, in two minutes: four sweeps of 30 batches."""
    share = 50 * 64 / n_pixels(painted)
    settings = dataclasses.replace(QUICK, minutes=2.0, sweeps=1000, pixels=64, sweep_share=share, outline=False)
    clock, shares = Clock(monkeypatch, of_batch=1.0), []
    stage = Stage(painted[1], painted[0], sky(), settings, show=lambda share, told: shares.append(share))
    sizes = []
    while not stage.finished:
        before = clock.now
        stage.advance()
        sizes.append(clock.now - before)
    assert sizes == [30.0] * 4 and clock.now == 120.0
    assert sorted(shares) == shares and shares[-1] == 0.99 and len(shares) > 120 and stage.progress == 1.0
    # the time of a sweep's own step counts, and a last sweep takes what is left, if that is half of one
    for taken, more in ((70.0, [30.0, 20.0]), (80.0, [30.0]), (110.0, [])):
        stage = Stage(painted[1], painted[0], sky(), settings)
        stage.advance()
        stage.started, sizes = clock.now - taken, []
        while not stage.finished:
            before = clock.now
            stage.advance()
            sizes.append(clock.now - before)
        assert sizes == more, taken


def test_a_slow_outline_leaves_time_for_the_sweeps(painted, monkeypatch):
    """A further round begins only if it ends in the first half of the minutes; the first one always does."""
    for of_round, rounds in ((10.0, 3), (25.0, 2), (31.0, 1), (500.0, 1)):
        with monkeypatch.context() as patch:
            clock = Clock(patch, of_batch=1.0, of_round=of_round)
            patch.setattr(Refinement, "make_lamp_compact", lambda *_: pytest.fail("a lamp") if of_round > 60 else None)
            begins = Stage._begins
            patch.setattr(Stage, "_begins", lambda stage, turn: turn < 3 and begins(stage, turn))
            stage = Stage(painted[1], painted[0], sky(), dataclasses.replace(QUICK, minutes=2.0))
            assert len(clock.rounds) == rounds and not stage.finished


# ---- what it says ----


def test_the_bar_and_the_last_line_say_what_changes(painted, folder, capsys):
    refine_folder(folder, painted[1], folder, QUICK)
    printed = capsys.readouterr().err
    assert printed.startswith("  0% 00:00<? refinement, outline, round 1 of 3\n")
    assert re.search(r"100% .* refinement, step 4, photos [1-4]\d\.\d\d dB", printed)
    summary = pipeline.refinement_summary(folder)
    before, after = summary["photos_psnr"]
    first, *_, last = json.loads((folder / "refinement.json").read_text())["sweeps"]
    assert after > before and (before, after) == (decibels(first["error"]), decibels(last["error"]))
    assert summary["steps"] == 4
    for changes, told in (
        ({}, f"{after:.2f} dB"),
        ({"delivered": 0, "lamp": True, "normal_texture": False}, "no step"),
        ({"held_out_psnr": [30.0, 29.0], "lamp": None}, "photos held out lose what training had fitted"),
        ({}, "no highlight tells how bright the light is"),
        ({"level": 1.1}, "the light was made 1.10 times as bright"),
        ({"tint": [1.25, 1.0, 0.8]}, "red, green, blue are multiplied by 1.25, 1.00, 0.80"),
    ):
        print_refinement(summary | changes)
        assert told in capsys.readouterr().out


def test_the_report_shows_before_and_after(run):
    page = (run / "report.html").read_text()
    for name in ("photo", "before", "after"):
        assert len(re.findall(rf'<img[^>]* alt="[^"]*, {name}"', page)) == 2, name  # test views
    for text in ("one factor per colour channel", "as highlights ask", "are saturated", "<h2>Refinement</h2>"):
        assert text in page


def test_the_reports_numbers_are_those_of_its_pictures():
    photo = np.full((8, 8, 3), 0.5)
    page = {
        "views": [{"name": "a", "pictures": [photo, photo + 0.1, photo + 0.01], "coverage": [0.2, 0.1]}],
        "summary": dict(steps=3, seconds=9.0, outline_error=None, saturated=0.125, lamp=True, delivered=2)
        | {"level": 1.0, "tint": [1.0], "photos_psnr": [20.0, 30.0], "held_out_psnr": [21.0, 29.0]},
        "lights": [np.ones((4, 8, 3))] * 2,
    }
    section = refinement_section(page)
    assert section["rows"][0][1:] == ("20.00 dB", "40.00 dB") and section["rows"][2][1:] == ("0.2", "0.1")
    assert section["saturated"] == "12.5 %" and len(section["views"][0]["cells"]) == 3
    assert section["views"][0]["score"] == "20.00 → 40.00 dB"
