"""Losses and the shading model against closed forms."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
import torch
from torch.nn import functional as F

from splitnerf import losses
from splitnerf.config import Config


def rays(weights: list[float], metallic: list[float]) -> SimpleNamespace:
    return SimpleNamespace(
        weights=torch.tensor(weights), shaded=torch.arange(len(weights)),
        points=SimpleNamespace(metallic=torch.tensor(metallic)[:, None]),
    )  # fmt: skip


def test_metal_loss_is_the_weighted_square():
    assert losses.metal_loss(rays([0.5, 0.25], [1.0, 0.4])).item() == pytest.approx((0.5 + 0.25 * 0.16) / 2)


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
    assert losses.neutral_light_loss(Sky([3.0, 3.0, 3.0], 0.0), config, generator).item() == pytest.approx(0.0, abs=1e-9)
    tinted = losses.neutral_light_loss(Sky([1.0, 1.0, 1.0], 0.6), config, generator).item()
    assert tinted == pytest.approx(2.0 / 3.0 * 0.36 / 3.0, rel=0.03)


class Stripes(torch.nn.Module):
    """Materials that change at x = 0 only."""

    def forward(self, inputs):
        right = (inputs[:, :1] > 0).float()
        return (0.25 * right).expand(-1, 3), right, torch.zeros_like(right)


def test_smoothness_loss_counts_steps_and_nothing_else():
    """Points on the plane z = 0: away from the step nothing differs; astride it, the share that the shift carries across."""
    config = Config().replace({
        "smoothness_points": 20000, "albedo_smoothness": 1.0, "gloss_smoothness": 0.0, "smoothness_radius": 0.02,
    })  # fmt: skip
    field = SimpleNamespace(encode=lambda x: x, outputs_at=lambda x, f: x)
    model = SimpleNamespace(sdf_field=field, head_inputs=lambda x, outputs, features: x, material=Stripes())

    def loss(x: float) -> float:
        n = 20000
        positions = torch.tensor([x, 0.0, 0.0]).expand(n, 3)
        albedo, roughness, metallic = Stripes()(positions)
        ray = SimpleNamespace(
            shaded=torch.arange(n), weights=torch.ones(n), positions=positions,
            normals=F.one_hot(torch.full((n,), 2), 3).float(),
            points=SimpleNamespace(albedo=albedo, roughness=roughness, metallic=metallic),
        )  # fmt: skip
        return losses.smoothness_loss(model, ray, config, torch.Generator().manual_seed(0)).item()

    step = (0.25 + 1e-3) ** 0.5 - 1e-3**0.5
    assert loss(0.5) == 0.0 and loss(-0.5) == 0.0
    crossed = 0.5 * torch.erfc(torch.tensor(0.5) / 2**0.5).item()  # a normal variable beyond half its deviation
    assert loss(0.01) == pytest.approx(step * crossed, rel=0.05)
