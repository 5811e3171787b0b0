"""What tests of several files share: tiny data sets and runs, and a painted ball."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
import trimesh
from painted_ball import heights, photos, sky, textured
from splitnerf import errors
from splitnerf.cli import DONE
from splitnerf.data.asset import Asset
from splitnerf.data.dataset import Dataset, load_dataset
from splitnerf.data.images import write_image
from splitnerf.refinement.texels import AssetTexels
from splitnerf.training.loop import Training
from splitnerf_tools.demo.scene import write_demo_dataset
from tiny_runs import tiny, train_scene
from tiny_runs import train as command_train
from viewer_server import numbered_sky, serving, triangle


def tiny_dataset(folder: Path, n_train: int) -> Path:
    """The demo's scene in few pixels, without its true mesh: to measure distances to it takes longer than a run of a few steps
    does else, see `data_with_mesh`."""
    write_demo_dataset(folder, size=24, n_train=n_train, n_test=2, spp=4)
    (folder / "mesh.ply").unlink()
    return folder


@pytest.fixture(autouse=True)
def unsaid(monkeypatch) -> None:
    """No note was written yet."""
    monkeypatch.setattr(errors, "_said", set())


@pytest.fixture(scope="session")
def data(tmp_path_factory) -> Path:
    """A data set small enough that a step takes milliseconds. Tests that change it change a copy."""
    return tiny_dataset(tmp_path_factory.mktemp("data") / "tiny", n_train=6)


@pytest.fixture(scope="session")
def other_data(tmp_path_factory) -> Path:
    """Another one, of fewer views."""
    return tiny_dataset(tmp_path_factory.mktemp("data") / "other", n_train=5)


@pytest.fixture(scope="session")
def data_with_mesh(data, tmp_path_factory) -> Path:
    """The data with a true mesh: a ball, as a run of a few steps is still one."""
    folder = shutil.copytree(data, tmp_path_factory.mktemp("data") / "meshed")
    trimesh.creation.icosphere(subdivisions=2, radius=0.67).export(folder / "mesh.ply")
    return folder


@pytest.fixture(scope="session")
def trained_once(data, tmp_path_factory) -> Path:
    """A run of 4 steps as `splitnerf train` leaves it."""
    run = tmp_path_factory.mktemp("trained") / "run"
    assert command_train(data, run, "--steps", "4") == DONE
    return run


@pytest.fixture
def done(trained_once, tmp_path) -> Path:
    """A copy of it, to be changed."""
    return shutil.copytree(trained_once, tmp_path / "run")


@pytest.fixture
def begun(data, tmp_path) -> tuple[Path, bytes]:
    """A run of 8 steps, and its checkpoint."""
    run = tmp_path / "run"
    run.mkdir()
    train_scene(load_dataset(data), tiny(steps=8), run)
    return run, (run / "checkpoint.pt").read_bytes()


@pytest.fixture
def at_step(monkeypatch) -> Callable[[int, Callable[[], object]], None]:
    """A function that calls another when the given step of a training begins."""

    def set_up(step: int, action: Callable[[], object]) -> None:
        refresh = Training.refresh
        monkeypatch.setattr(Training, "refresh", lambda self: (self.step == step and action(), refresh(self)))

    return set_up


@pytest.fixture(scope="session")
def ball() -> Asset:
    """A ball of one material."""
    return textured(trimesh.creation.icosphere(subdivisions=3))


@pytest.fixture(scope="session")
def painted(ball) -> tuple[Asset, Dataset]:
    """A ball with a colour and a roughness per side, and its photos."""
    texels = AssetTexels(ball)
    height = heights(texels)
    values = texels.start.clone()
    values[:, :3] = torch.where(height > 0, torch.tensor([0.7, 0.25, 0.1]), torch.tensor([0.15, 0.3, 0.6]))
    values[:, 3:4] = torch.where(height > 0, 0.35, 0.7)
    asset = texels.asset_with(texels.maps(values))
    return asset, photos(asset, sky())


@pytest.fixture
def shown_run(tmp_path):
    """A run's folder for the viewer: an asset and its light."""
    folder = tmp_path / "mine"
    folder.mkdir()
    triangle().write(folder / "mesh.glb")
    write_image(folder / "environment.exr", numbered_sky())
    return folder


@pytest.fixture
def served(shown_run):
    """A server that shows it."""
    with serving(shown_run) as server:
        yield server
