"""Losses and the shading model against closed forms."""

import math
from types import SimpleNamespace

import pytest
import torch
from splitnerf.config import Config
from splitnerf.training import losses


def rays(weights: list[float], metallic: list[float]) -> SimpleNamespace:
    return SimpleNamespace(
        weights=torch.tensor(weights),
        shares=torch.tensor(weights),
        shaded=torch.arange(len(weights)),
        points=SimpleNamespace(metallic=torch.tensor(metallic)[:, None]),
    )


class Sky:
    """A light of one colour, tinted towards +z."""

    def __init__(self, colour: list[float], tint: float):
        self.colour, self.tint = torch.tensor(colour), tint

    def __call__(self, directions, roughness):
        return self.colour * torch.exp(self.tint * directions[:, 2:] * torch.tensor([1.0, 0.0, -1.0]))


def test_neutral_light_loss_measures_chroma_alone():
    """Grey light of any brightness costs nothing; a tint e^(t z), e^0, e^(-t z) costs the mean of 2 (t z)^2 / 3."""
    generator = torch.Generator().manual_seed(0)
    config = Config().replace({"neutral_queries": 20000})
    assert losses.neutral_light_loss(Sky([3.0, 3.0, 3.0], 0.0), config, generator).item() == pytest.approx(
        0.0, abs=1e-9
    )
    coloured = Sky([math.exp(0.5), 1.0, math.exp(-0.5)], 0.0)  # the same from everywhere: (0.5^2 + 0 + 0.5^2) / 3
    assert losses.neutral_light_loss(coloured, config, generator).item() == pytest.approx(0.5 / 3, rel=1e-4)
    tinted = losses.neutral_light_loss(Sky([1.0, 1.0, 1.0], 0.6), config, generator).item()
    assert tinted == pytest.approx(2.0 / 3.0 * 0.36 / 3.0, rel=0.03)


def entropy(albedo: list[float], weights: list[float] | None = None, roughness: list[float] | None = None) -> float:
    """Of grey points, from many draws."""
    n = len(albedo)
    config = Config().replace({"entropy_points": 4000, "albedo_width": 0.3, "gloss_width": 0.2})
    ray = SimpleNamespace(
        shares=torch.tensor(weights or [1.0] * n).repeat(2000),
        shaded=torch.arange(2000 * n),
        points=SimpleNamespace(
            albedo=torch.tensor(albedo)[:, None].expand(-1, 3).repeat(2000, 1),
            roughness=torch.tensor(roughness or [0.5] * n)[:, None].repeat(2000, 1),
            metallic=torch.zeros(2000 * n, 1),
        ),
    )
    return losses.material_entropy_loss(ray, config, torch.Generator().manual_seed(0)).item()


def test_material_entropy_counts_materials():
    """One material: 0. k equal shares of materials far apart: ln k. Two that differ by d in ln albedo:
    -ln(1/2 + e^(-3 (d/width)^2 / 4) / 2). A share that no ray sees does not count."""
    assert entropy([0.4]) == pytest.approx(0.0, abs=1e-6)
    assert entropy([0.02, 0.2, 0.9]) == pytest.approx(math.log(3), abs=0.01)
    close = -math.log(0.5 + 0.5 * math.exp(-0.75 * (math.log(0.31 / 0.26) / 0.3) ** 2))
    assert entropy([0.25, 0.30]) == pytest.approx(close, rel=0.02)
    apart = -math.log(0.5 + 0.5 * math.exp(-0.25 * (0.8 / 0.2) ** 2))
    assert entropy([0.2, 0.2], roughness=[0.1, 0.9]) == pytest.approx(apart, abs=0.01)
    assert entropy([0.02, 0.9], weights=[1.0, 0.0]) == pytest.approx(0.0, abs=1e-6)


def test_metals_by_hand():
    """Eq. (18); dark metals, but neither bright ones nor dielectrics; nothing costs nothing."""
    metallic, shares = torch.tensor([[1.0], [0.4]]), torch.tensor([0.5, 0.25])
    metal, _ = losses.material_losses(torch.ones(2, 3), metallic, shares)
    assert metal.item() == pytest.approx((0.5 + 0.25 * 0.16) / 0.75)
    albedo = torch.tensor([[0.1, 0.2, 0.0], [0.5, 0.1, 0.1], [0.01, 0.01, 0.01]])
    dark = losses.material_losses(albedo, torch.tensor([[1.0], [1.0], [0.0]]), torch.ones(3))[1]
    assert dark.item() == pytest.approx((1 - 0.2 / 0.4) / 3)
    assert not losses.material_losses(torch.zeros(0, 3), torch.zeros(0, 1), torch.zeros(0)).any()
