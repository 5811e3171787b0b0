"""LPIPS: asked where the package and its backbone's weights are there, else refused in a line, and never downloaded."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from published_scenes import write_set
from splitnerf.cli import DONE, main
from splitnerf.evaluate import lpips as ours
from splitnerf.evaluate.lpips import BACKBONE_WEIGHTS, find_distance

IMAGE = np.random.default_rng(3).uniform(0, 1, (48, 64, 3)).astype(np.float32)


@pytest.fixture
def weights(tmp_path, monkeypatch):
    """Where the backbone's weights belong; nothing is there yet, and whoever reads from a network fails."""
    monkeypatch.setattr(torch.hub, "_hub_dir", str(tmp_path / "hub"))
    monkeypatch.setattr("urllib.request.urlopen", lambda *_, **__: pytest.fail("the network was asked"))
    path = tmp_path / "hub/checkpoints" / BACKBONE_WEIGHTS
    path.parent.mkdir(parents=True)
    return path


class StandIn(torch.nn.Module):
    """The mean absolute difference, in place of the package's network."""

    def __init__(self, net, verbose):
        super().__init__()
        assert net == "vgg" and not verbose

    def forward(self, x, y):
        assert x.shape == y.shape == (1, 3, 48, 64) and x.dtype == torch.float32
        assert min(x.min(), y.min()) < -0.9 and max(x.max(), y.max()) > 0.9  # [-1, 1]
        return (x - y).abs().mean()[None, None, None, None]


def test_the_distance_is_the_packages(weights, monkeypatch):
    monkeypatch.setitem(sys.modules, "lpips", SimpleNamespace(LPIPS=StandIn))
    weights.write_bytes(b"")
    distance, missing = find_distance()
    assert missing == "" and distance(IMAGE, IMAGE) == 0.0
    assert distance(IMAGE, 1 - IMAGE) == pytest.approx(2 * np.abs(2 * IMAGE - 1).mean(), rel=1e-5)


def test_what_is_missing_is_said_in_a_line(weights, monkeypatch, tmp_path):
    """The package, its import, the weights, or weights that can be read."""

    def refused() -> str:
        distance, missing = find_distance()
        assert distance is None and "\n" not in missing
        return missing

    monkeypatch.setitem(sys.modules, "lpips", None)
    assert refused() == "the package lpips is not installed (pip install 'splitnerf[lpips]')"
    monkeypatch.delitem(sys.modules, "lpips")
    (tmp_path / "lpips.py").write_text("raise RuntimeError('operator torchvision::nms\\ndoes not exist')")
    with monkeypatch.context() as patch:
        patch.syspath_prepend(tmp_path)
        line = refused()
        assert "torchvision::nms does not exist" in line and f"the torchvision of torch {torch.__version__}" in line
    monkeypatch.setitem(sys.modules, "lpips", SimpleNamespace(LPIPS=StandIn))
    assert refused() == f"{weights} is missing; it is https://download.pytorch.org/models/{BACKBONE_WEIGHTS}"
    weights.write_bytes(b"damaged")
    monkeypatch.setitem(sys.modules, "lpips", SimpleNamespace(LPIPS=lambda **_: torch.load(weights)))
    assert refused().startswith(f"{weights} cannot be used (")


def test_a_published_protocol_has_it_or_says_why_not(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("published_scenes.SPP", 4)
    root = write_set(tmp_path, "shiny", False).root
    asset, light = next(tmp_path.rglob("asset.glb")), root / "light.hdr"
    command = ["evaluate", str(asset), "--data", str(root), "--env", str(light), "--protocol", "shiny"]
    command += ["--spp", "2", "--views", "1", "--out", str(tmp_path / "scores.json")]
    monkeypatch.setattr("splitnerf.evaluate.published.scoring.find_distance", lambda: (lambda image, truth: 0.125, ""))
    assert main(command) == DONE
    printed = capsys.readouterr().out
    assert "novel, LPIPS" in printed and "0.125" in printed and "LPIPS was not" not in printed
    monkeypatch.setattr("splitnerf.evaluate.published.scoring.find_distance", lambda: (None, "x.pth is missing"))
    assert main(command) == DONE
    printed = capsys.readouterr().out
    assert "note: LPIPS was not computed: x.pth is missing" in printed and "novel, LPIPS" not in printed


def test_the_packages_own_network(weights):
    """With weights drawn at random: 0 for equal images, and more for worse ones."""
    try:
        import lpips  # noqa: F401
        from torchvision.models import vgg16
    except Exception as error:
        pytest.skip(f"needs lpips and a torchvision of this torch: {error}")
    torch.manual_seed(0)
    torch.save(vgg16(weights=None).state_dict(), weights)
    distance, missing = ours.find_distance()
    assert missing == "" and distance(IMAGE, IMAGE) == 0.0
    noise = np.random.default_rng(4).normal(0, 1, IMAGE.shape).astype(np.float32)
    found = [distance(np.clip(IMAGE + size * noise, 0, 1), IMAGE) for size in (0.02, 0.1, 0.5)]
    assert 0 < found[0] < found[1] < found[2]
