"""The terms of the loss in preset `paper`, as its equations print them."""

from __future__ import annotations

import pytest
import torch
from op_checks import generator, unit

from splitnerf.config import preset
from splitnerf.render.model import SceneModel
from splitnerf.render.occupancy import make_grid
from splitnerf.render.renderer import find_samples, render_rays
from splitnerf.training.batches import Batch, draw_probes
from splitnerf.training.step import loss_terms

SMALL = {
    "n_levels": 4, "log2_table_size": 10, "grid_resolution": 16, "material_width": 16, "occlusion_width": 16, "light_width": 16,
    "light_samples": 64, "light_queries": 32, "min_step": 0.02,
}  # fmt: skip


@pytest.fixture(scope="module")
def rendered():
    """A model of preset paper, rays that meet its sphere or its edge, and the terms of the loss."""
    torch.manual_seed(0)
    config = preset("paper").replace(SMALL)
    model, g = SceneModel(config), generator(2)
    grid = make_grid(config)
    grid.update(model.sdf_field.sdf, model.s_value)
    n = 300
    origins = 3.0 * unit(torch.randn(n, 3, generator=g))
    directions = unit(0.4 * torch.randn(n, 3, generator=g) - origins)
    target = 0.9 * torch.rand(n, 4, generator=g)  # nowhere saturated
    batch = Batch(origins, directions, target, torch.rand(n, 3, generator=g), torch.rand(n, generator=g), draw_probes(config, g))
    light = model.evaluate_light()
    ray = render_rays(model, light, find_samples(model, grid.cells, *batch.rays, probes=batch.probes))
    return config, batch, ray, loss_terms(model, light, batch, ray, None, None, g, 0, 0.0)


def weighted(terms, name: str) -> float:
    return terms[name].weight * terms[name].value.item()


def test_colours_are_summed_over_channels_and_averaged_over_rays(rendered):
    """Eq. (3) with its weight of 10, in sRGB, over the batch's own background."""
    config, batch, ray, terms = rendered
    predicted = batch.background + ray.opacity[:, None] * (ray.colour - batch.background)
    truth = batch.background + batch.target[:, 3:] * (batch.target[:, :3] - batch.background)
    expected = 10.0 * (predicted - truth).square().sum(1).mean().item()
    assert (ray.opacity > 0.5).any() and (ray.opacity < 0.1).any()
    assert weighted(terms, "colour") == pytest.approx(expected, rel=1e-5)


def test_gradients_are_averaged_over_points(rendered):
    _, _, ray, terms = rendered
    expected = 0.1 * (ray.gradients.norm(dim=1) - 1.0).square().mean().item()
    assert weighted(terms, "eikonal") == pytest.approx(expected, rel=1e-4)


def test_metals_are_averaged_by_rendering_weight(rendered):
    """Eq. (18), w normalised: the weights sum to 1."""
    _, _, ray, terms = rendered
    w = ray.shares / ray.shares.sum()
    assert weighted(terms, "metal") == pytest.approx(0.001 * (w @ ray.points.metallic[:, 0].square()).item(), rel=1e-4)


def test_nothing_but_the_papers_terms(rendered):
    """The occlusion's comes with the first mesh."""
    assert set(rendered[3]) == {"colour", "eikonal", "light", "metal"} and rendered[3]["light"].weight == 10.0


def test_the_light_is_summed_over_channels_and_averaged_over_queries(monkeypatch):
    """Eq. (11), for a light of one value that is c, 2c, 3c off its integral in the three channels: c^2 + 4 c^2 + 9 c^2."""
    from splitnerf.training import losses

    config, off = preset("paper").replace(SMALL), torch.tensor([0.1, 0.2, 0.3])

    class Off(torch.nn.Module):
        """Radiance 1; more where it is asked at a roughness."""

        def forward(self, directions, roughness):
            return 1.0 + (roughness > 0) * off

    loss = losses.light_loss(Off(), config, generator(), 0)
    assert loss.item() == pytest.approx(off.square().sum().item(), rel=1e-4)
