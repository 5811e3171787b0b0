"""Occlusion factors that are traced beside the training, against those that a step traces itself."""

from __future__ import annotations

import threading
from concurrent.futures import Future
from types import SimpleNamespace

import pytest
import torch
import trimesh
from op_checks import generator
from splitnerf.config import Config
from splitnerf.ops import MeshScene
from splitnerf.render.model import SceneModel
from splitnerf.render.renderer import RenderedRays, find_samples, render_rays
from splitnerf.training import late_occlusion, losses
from splitnerf.training.late_occlusion import LateOcclusion, one_of_each_run
from tiny_runs import tiny
from torch.nn import functional as F

ALL = {
    "occlusion_share": 1.0,
    "occlusion_rays": 8,
    "constants.occlusion_environment_height": 8,
    "sphere_radius": 0.6,
    "min_step": 0.05,
}


class Scene(SimpleNamespace):
    """A ball under a roof that takes a part of the sky from it."""

    def __init__(self, **settings: object):
        torch.manual_seed(0)
        self.config: Config = tiny("paper", **ALL | settings)
        self.model = SceneModel(self.config)
        with torch.no_grad():
            self.model.occlusion.net[-1].weight.normal_()
            self.model.sdf_field.hidden_direction[:, 3:].normal_(std=0.1)  # so that the table has slopes
        self.model.occlusion.use(None)
        roof = trimesh.creation.box((0.8, 0.8, 0.1)).apply_translation((0.3, 0.0, 0.9))
        self.mesh = MeshScene(roof.vertices, roof.faces)
        self.environment = self.model.light.panorama(8).detach()

    def rendered(self) -> RenderedRays:
        rays_d = F.normalize(torch.randn(24, 3, generator=generator()) * 0.15 + torch.tensor([0.0, 0.0, -1.0]), dim=1)
        rays_o, cells = torch.tensor([[0.0, 0.0, 1.4]]).repeat(24, 1), torch.ones(16, 16, 16, dtype=torch.uint8)
        found = find_samples(self.model, cells, rays_o, rays_d, torch.full((24,), 0.5))
        return render_rays(self.model, self.model.evaluate_light(), found)

    def at_once(self, ray: RenderedRays, seed: int) -> torch.Tensor:
        return losses.occlusion_loss(ray, self.mesh, self.environment, self.config, generator(), seed)

    def gradients(self, loss: torch.Tensor) -> dict[str, torch.Tensor]:
        parameters = {k: p for k, p in self.model.named_parameters() if k.startswith(("occlusion", "sdf_field"))}
        found = torch.autograd.grad(loss, list(parameters.values()), retain_graph=True, allow_unused=True)
        return {name: grad for name, grad in zip(parameters, found) if grad is not None and grad.any()}


@pytest.fixture
def hand(monkeypatch) -> list[tuple[Future, tuple]]:
    """Futures in place of threads, with what each was asked; the test fulfils them."""
    asked = []

    def begin(function, *args):
        future = Future()
        asked.append((future, lambda: future.set_result(function(*args)), args))
        return future

    monkeypatch.setattr(late_occlusion, "in_background", begin)
    return asked


@pytest.mark.parametrize(
    "settings",
    [{}, {"occlusion_directional": True, "occlusion_channels": 3}, {"normals": "analytic", "materials.inputs": "grid"}],
)
def test_of_a_model_that_stands_still_it_is_the_loss_of_the_step(hand, settings):
    """All samples are taken: value and slopes of both, the rays by the same seed."""
    scene = Scene(**settings)
    late, ray = LateOcclusion(scene.model, generator()), scene.rendered()
    assert late.loss(ray, scene.mesh, scene.environment, 5) is None
    hand[0][1]()
    found = late.loss(ray, scene.mesh, scene.environment, 6)
    expected = scene.at_once(ray, 5)
    assert found.item() == pytest.approx(expected.item(), rel=1e-4) and expected > 1e-3
    assert scene.at_once(ray, 6).item() != pytest.approx(expected.item(), rel=1e-4)
    ours, theirs = scene.gradients(found), scene.gradients(expected)
    assert ours.keys() == theirs.keys() and "sdf_field.grid.table" in ours and "occlusion.net.0.weight" in ours
    for name, grad in theirs.items():
        assert (ours[name] - grad).norm() <= 1e-4 * grad.norm(), name


def test_what_is_predicted_is_of_now_and_what_was_traced_of_then(hand):
    """The network moves to +-30: factors of 1 and of 0 against the truth of the step before, by its weights."""
    scene = Scene()
    late, ray = LateOcclusion(scene.model, generator()), scene.rendered()
    late.loss(ray, scene.mesh, scene.environment, 5)
    hand[0][1]()
    truth = hand[0][0].result()
    for bias, factor in ((30.0, 1.0), (-30.0, 0.0)):
        with torch.no_grad():
            scene.model.occlusion.net[-1].weight.zero_()
            scene.model.occlusion.net[-1].bias.fill_(bias)
            scene.model.sdf_field.out_bias[0] += 0.2
        found = late.loss(scene.rendered(), scene.mesh, scene.environment, 6)
        expected = ray.shares @ (factor - truth).square().sum(1) / ray.shares.sum()
        assert found.item() == pytest.approx(expected.item(), rel=1e-4)
    assert 0.05 < truth.mean() < 0.999


def test_a_step_goes_on_while_rays_are_traced(hand):
    """One set of points is traced at a time; the newest known one is used, again and again; an empty step asks nothing."""
    scene = Scene(occlusion_share=0.25)
    late, ray = LateOcclusion(scene.model, generator()), scene.rendered()

    def loss(seed: int, ray: RenderedRays = ray) -> torch.Tensor | None:
        return late.loss(ray, scene.mesh, scene.environment, seed)

    assert [loss(seed) for seed in range(3)] == [None] * 3 and len(hand) == 1
    hand[0][1]()
    first = [loss(seed).item() for seed in (3, 4, 5)]
    assert len(set(first)) == 1 and [asked[2][-1] for asked in hand] == [0, 3]
    hand[1][1]()
    empty = SimpleNamespace(shaded=ray.shaded[:0])
    second = loss(6, empty)
    assert second.item() != first[0] and len(hand) == 2
    assert loss(7).item() == second.item() and hand[2][2][-1] == 7
    numbers, _, shapes = hand[2][2][:3]
    m = round(0.25 * len(ray.shaded))
    assert [list(x) for x in shapes] == [[m, 3]] * 3 + [[m, 1], [8, 16, 3]] and len(numbers) == 10 * m + 8 * 16 * 3


def test_a_thread_traces_and_what_goes_wrong_there_is_told(monkeypatch):
    scene = Scene()
    late, ray = LateOcclusion(scene.model, generator()), scene.rendered()
    done, may_go, trace = [], threading.Event(), late_occlusion.traced_factors
    monkeypatch.setattr(
        late_occlusion,
        "traced_factors",
        lambda *args: may_go.wait(20) and done.append(threading.current_thread()) or trace(*args),
    )
    assert late.loss(ray, scene.mesh, scene.environment, 0) is None and not done
    may_go.set()
    late.close()
    assert len(done) == 1 and done[0] is not threading.main_thread()
    monkeypatch.setattr(late_occlusion, "traced_factors", lambda *args: 1 / 0)
    assert late.loss(ray, scene.mesh, scene.environment, 1) is None
    with pytest.raises(ZeroDivisionError):
        for _ in range(2000):
            late.loss(ray, scene.mesh, scene.environment, 2)
            threading.Event().wait(0.01)
    late.close()


def test_chosen_numbers_are_one_of_each_run_and_all_have_one_chance():
    """10 of 103: each in its tenth, each number about as often as any other; none where nothing is to be chosen.

    A number on the border of two tenths may come twice.
    """
    g, counts, first = generator(), torch.zeros(103), torch.arange(10) * 103
    for _ in range(3000):
        chosen = one_of_each_run(103, 0.1, g)
        assert len(chosen) == 10 and ((chosen + 1) * 10 > first).all() and (chosen * 10 < first + 103).all()
        counts.index_add_(0, chosen, torch.ones(10))
    assert (counts - 3000 * 10 / 103).abs().max() < 5 * (3000 * 10 / 103) ** 0.5
    assert torch.equal(one_of_each_run(7, 2.0, g), torch.arange(7))
    assert len(one_of_each_run(0, 0.1, g)) == len(one_of_each_run(4, 0.1, g)) == 0
