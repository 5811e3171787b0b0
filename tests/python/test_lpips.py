"""LPIPS by the user's file of VGG16 and the wheel's heads."""

import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from splitnerf.errors import InputError
from splitnerf.evaluate import lpips

IMAGE = np.random.default_rng(3).uniform(0, 1, (48, 64, 3)).astype(np.float32)
CHANNELS = 4, 5, 6, 7, 8  # of the blocks of a small network


@pytest.fixture
def small(tmp_path, monkeypatch) -> Path:
    """A file of small networks' weights, and the package lpips with heads for them, of which no code runs."""
    (folder := tmp_path / "lpips/weights/v0.1").mkdir(parents=True)
    (tmp_path / "lpips/__init__.py").write_text("raise RuntimeError('operator torchvision::nms does not exist')")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "lpips", raising=False)
    generator, state, n = torch.Generator().manual_seed(0), {}, 3
    for block, width in zip(lpips.BLOCKS, CHANNELS):
        for i in block:
            state[f"features.{i}.weight"] = torch.randn(width, n, 3, 3, generator=generator) / (3 * n**0.5)
            state[f"features.{i}.bias"] = 0.1 * torch.randn(width, generator=generator)
            n = width
    heads = {f"lin{k}.model.1.weight": torch.rand(1, n, 1, 1, generator=generator) for k, n in enumerate(CHANNELS)}
    torch.save(heads, folder / "vgg.pth")
    torch.save(state, tmp_path / "vgg16.pth")
    return tmp_path / "vgg16.pth"


def test_the_distance_is_zhangs(small):
    """By his definition, with torch's own layers: d = sum_l mean_hw |w_l (y_l - y0_l)|^2 of features of unit length."""
    state, heads = torch.load(small), torch.load(small.parent / "lpips/weights/v0.1/vgg.pth")
    noise = np.random.default_rng(4).normal(0, 1, IMAGE.shape).astype(np.float32)
    mean, deviation = (torch.tensor(x)[:, None, None] for x in ([-0.030, -0.088, -0.188], [0.458, 0.448, 0.450]))

    def features(image: np.ndarray) -> list[torch.Tensor]:
        x, found, i = (torch.from_numpy(image).permute(2, 0, 1)[None] * 2 - 1 - mean) / deviation, [], 0
        for count in (2, 2, 3, 3, 3):
            for _ in range(count):
                layer = [state[f"features.{i}.{part}"] for part in ("weight", "bias")]
                x, i = torch.conv2d(x, *layer, padding=1).relu(), i + 2
            found.append(torch.nn.functional.normalize(x, dim=1))
            x, i = torch.nn.MaxPool2d(2)(x), i + 1
        return found

    distance, sizes = lpips.Lpips(small), []
    for size in (0.02, 0.1, 0.5):
        worse = np.clip(IMAGE + size * noise, 0, 1)
        of_levels = zip(features(worse), features(IMAGE), heads.values())
        expected = sum(((x - y).square() * w).sum(1).mean() for x, y, w in of_levels).item()
        sizes.append(distance(worse, IMAGE))
        assert sizes[-1] == pytest.approx(expected, rel=1e-4)
    assert 0 == distance(IMAGE, IMAGE) < sizes[0] < sizes[1] < sizes[2]


def test_what_is_missing_is_said_in_a_line(small, monkeypatch):
    """The package, its heads, the weights, weights that can be read, and those of VGG16."""

    def refused() -> str:
        with pytest.raises(InputError) as error:
            lpips.Lpips(small)
        assert "\n" not in str(error.value)
        return str(error.value)

    torch.save(torch.load(small) | {"features.28.bias": torch.zeros(9)}, small)
    assert refused() == f"{small}: is of another network than VGG16; give {lpips.SOURCE}"
    torch.save({"features.0.weight": torch.zeros(1)}, small)
    assert refused() == f"{small}: cannot be used for LPIPS ('features.0.bias'); give {lpips.SOURCE}"
    small.unlink()
    assert refused().startswith(f"{small}: cannot be used for LPIPS (") and "No such file" in refused()
    (small.parent / "lpips/weights/v0.1/vgg.pth").write_bytes(b"damaged")
    assert refused().endswith("; pip install --no-deps lpips")
    monkeypatch.setattr(lpips, "find_spec", lambda _: None)
    assert refused() == "--lpips needs the package lpips; pip install --no-deps lpips"


def test_our_distance_is_that_of_the_package(tmp_path, monkeypatch):
    """With its own heads, and VGG16 with weights drawn at random."""
    package = find_spec("lpips")
    if package is None:
        pytest.skip("needs the package lpips")
    generator, layers, n = torch.Generator().manual_seed(0), [], 3
    for block, width in zip(lpips.BLOCKS, (64, 128, 256, 512, 512)):
        for _ in block:
            layers += [torch.nn.Conv2d(n, width, 3, padding=1), torch.nn.ReLU()]
            torch.nn.init.normal_(layers[-2].weight, 0, (2 / (9 * n)) ** 0.5, generator=generator)
            n = width
        layers.append(torch.nn.MaxPool2d(2))
    vgg16 = torch.nn.Module()
    vgg16.features = torch.nn.Sequential(*layers)
    torch.save(vgg16.state_dict(), tmp_path / "vgg16.pth")
    models = SimpleNamespace(vgg16=lambda pretrained: vgg16)
    monkeypatch.setitem(sys.modules, "torchvision", SimpleNamespace(models=models))
    monkeypatch.delitem(sys.modules, "lpips", raising=False)
    theirs = import_module("lpips").LPIPS(net="vgg", verbose=False)
    x, y = (torch.from_numpy(i).permute(2, 0, 1)[None] * 2 - 1 for i in (IMAGE, 1 - IMAGE))
    with torch.no_grad():
        assert lpips.Lpips(tmp_path / "vgg16.pth")(IMAGE, 1 - IMAGE) == pytest.approx(theirs(x, y).item(), rel=1e-4)
