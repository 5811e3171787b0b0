"""What tests of several files share: tiny data sets and runs."""

from __future__ import annotations

from pathlib import Path

import pytest
from tiny_runs import tiny

from splitnerf.data.dataset import load_dataset
from splitnerf.demo.scene import write_demo_dataset
from splitnerf.training.loop import train


@pytest.fixture(scope="session")
def data(tmp_path_factory) -> Path:
    """A data set small enough that a step takes milliseconds. Tests that change it change a copy."""
    return write_demo_dataset(tmp_path_factory.mktemp("data") / "tiny", size=24, n_train=6, n_test=2, spp=4)


@pytest.fixture(scope="session")
def other_data(tmp_path_factory) -> Path:
    """Another one, of fewer views."""
    return write_demo_dataset(tmp_path_factory.mktemp("data") / "other", size=24, n_train=5, n_test=2, spp=4)


@pytest.fixture
def begun(data, tmp_path) -> tuple[Path, bytes]:
    """A run of 8 steps, and its checkpoint."""
    run = tmp_path / "run"
    run.mkdir()
    train(load_dataset(data), tiny(steps=8), run)
    return run, (run / "checkpoint.pt").read_bytes()
