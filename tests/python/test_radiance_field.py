"""The radiance field of a whole place: its parts by closed forms."""

import math

import pytest
import torch
from splitnerf_tools.separation import field as fields
from splitnerf_tools.separation.field import RadianceField, RayMeasure, Rendered, resampled, search_loss, spread_loss


def rendered(weights, edges, *first):
    weights, edges, *first = (torch.tensor([x]) for x in (weights, edges, *(first or (weights, edges))))
    return Rendered(torch.zeros(1, 3), weights, edges[:, 1:], edges, *first)


def test_the_grids_reach_from_their_coarsest_cells_to_their_finest():
    field = RadianceField()
    ends = [(levels[0][0], levels[-1][0]) for levels in (field.fine.spec.levels(), field.coarse.spec.levels())]
    assert ends == [(16, 640), (16, 160)]


def test_contraction():
    """All of space goes into the ball of radius 2, and that ball into the grid's unit cube."""
    points = torch.tensor([[0.3, -0.2, 0.5], [0.0, 4.0, 0.0], [1e6, 0, 0]])
    short = torch.tensor([[0.3, -0.2, 0.5], [0.0, 1.75, 0.0], [2.0, 0, 0]])
    torch.testing.assert_close(fields.contracted(points), short)
    torch.testing.assert_close(RadianceField._encoded(lambda unit: unit, points), short / 4 + 0.5)


@pytest.mark.parametrize("jitter, hidden", [(False, None), (True, None), (False, lambda points: points[..., 0] > 0)])
def test_even_fog_of_one_colour(jitter, hidden):
    """Light falls exponentially from the near limit on, but in hidden space; the last sample takes the rest. The samples' random
    places are within their intervals."""
    field, o, d = RadianceField(), torch.tensor([[3.0, 0, 0], [0, 2, 0]]), torch.tensor([[-1.0, 0, 0], [0, 1, 0]])
    thin = 2.5 + math.log(0.4)
    with torch.no_grad():
        for layer, bias in (field.first[2], thin), (field.trunk[2], thin), (field.head[4], 1):
            layer.weight.zero_(), layer.bias.fill_(bias)
        got = field.render(o, d, 32, 16, jitter, hidden)
    measure = RayMeasure(o, d)
    for weights, edges in (got.weights, got.edges), (got.first_weights, got.first_edges):
        fog = 0.4 * (measure.points(edges)[..., 0] <= (1e9 if hidden is None else 0))
        gone = (fog * measure.distances(edges).diff()).cumsum(1)[:, :-1]
        torch.testing.assert_close(weights.cumsum(1)[:, :-1], 1 - torch.exp(-gone), atol=1e-5, rtol=1e-4)
        torch.testing.assert_close(weights.sum(1), torch.ones(2))
    torch.testing.assert_close(got.distances, measure.distances(got.edges[:, 1:] - 0.5 * got.edges.diff()))
    torch.testing.assert_close(got.colour, torch.full((2, 3), 1 / (1 + math.exp(-1))), atol=2e-3, rtol=0)
    apart = float((got.first_edges - torch.linspace(0, 1, 33)).abs().max()) * 32
    assert (got.edges.diff() >= 0).all() and (0.4 < apart < 0.5 if jitter else apart == 0)


def test_steps_are_even_near_the_middle_and_grow_with_the_distance():
    measure = RayMeasure(torch.tensor([[3.0, 0, 0]]), torch.tensor([[-1.0, 0, 0]]))
    distances = measure.distances(torch.linspace(0, 1, 401)[None])[0]
    torch.testing.assert_close(distances[[0, -1]], torch.tensor([0.1, 300.0]), rtol=1e-4, atol=1e-4)
    steps = distances.diff()
    assert (steps > 0).all() and abs(float(distances[steps.argmin()]) - 3) < 0.05
    assert steps[-1] > 100 * steps.min()


def test_samples_go_where_the_weights_are():
    edges = torch.linspace(0, 1, 65)[None]
    even = resampled(edges, torch.full((1, 64), 1 / 64), 16, False)
    torch.testing.assert_close(even, torch.linspace(0, 1, 17)[None], atol=1e-5, rtol=0)
    weights = torch.zeros(1, 64)
    weights[0, 40] = 1
    found = resampled(edges, weights, 32, False)
    assert (found.diff() >= 0).all() and found[0, 0] == 0 and found[0, -1] == 1
    assert ((found > edges[0, 39]) & (found < edges[0, 42])).sum() > 28


def test_spread_of_two_weights():
    """Halves that fill [0, 0.1] and [0.8, 1]: 2 w1 w2 0.85 + (w1^2 0.1 + w2^2 0.2) / 3."""
    loss = spread_loss(rendered([0.5, 0.0, 0.5], [0.0, 0.1, 0.8, 1.0]))
    assert float(loss) == pytest.approx(0.5 * 0.85 + 0.25 * 0.3 / 3)


def test_search_must_bound_the_samples():
    good = rendered([0.5, 0.5], [0.2, 0.3, 0.4], [0.0, 1.0, 0.0], [0.0, 0.1, 0.5, 1.0])
    bad = rendered([0.5, 0.5], [0.2, 0.3, 0.4], [0.9, 0.1, 0.0], [0.0, 0.1, 0.5, 1.0])
    assert float(search_loss(good)) == 0
    assert float(search_loss(bad)) == pytest.approx(2 * 0.4**2 / 0.5, rel=1e-5)


def test_gradients_fall_near_the_camera():
    values = torch.ones(1, 3, 1, requires_grad=True)
    out = fields.with_less_gradient(values, torch.tensor([[0.15, 0.75, 3.0]]))
    assert torch.equal(out, values)
    out.sum().backward()
    torch.testing.assert_close(values.grad[0, :, 0], torch.tensor([0.01, 0.25, 1.0]))
