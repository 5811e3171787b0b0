"""The steps of the refinement: texels, their priors, and the light, by closed forms and by other solvers."""

import numpy as np
import pytest
import torch
from painted_ball import sky
from splitnerf.data.environment import sample_environment
from splitnerf.refinement.light import EnvironmentLight, footprints, read
from splitnerf.refinement.light_equations import LightEquations, Rows
from splitnerf.refinement.normal_equations import APART, EDGE, NormalEquations, Prior
from splitnerf.refinement.similar_texels import SimilarTexels, weighted_quantiles
from splitnerf.refinement.texels import TexelPairs
from splitnerf.refinement.unknowns import GROUPS, N_UNKNOWNS


def chain(frame: torch.Tensor | None = None, m: int = 3, **weights: float) -> Prior:
    """A prior of m texels, 1 - 2 and 0 - 1 joined, with one weight for all unknowns; `frame` turns tilts of 1 into the frame of 0."""
    of_all = {name: torch.full((N_UNKNOWNS,), weights.get(name, 0.0)) for name in ("smooth", "flat", "anchor")}
    pairs = TexelPairs(m, np.array([[1, 2], [0, 1]]), torch.empty(0, 2, 2) if frame is None else frame[None])
    return Prior(pairs=pairs, groups=GROUPS, like=torch.full((2,), weights.get("like", 0.0)), **of_all)


def fitted(prior: Prior, observed: torch.Tensor, usual: torch.Tensor | None = None) -> torch.Tensor:
    """[m, n] where the steps end if each unknown of each texel was observed once, with one precision."""
    m = len(observed)
    equations, unknowns = NormalEquations(torch.zeros(m, N_UNKNOWNS), prior, 0.0), torch.zeros(m, N_UNKNOWNS)
    for _ in range(60):
        for begin in range(0, N_UNKNOWNS, 3):
            of_channel = torch.zeros(m, 3, N_UNKNOWNS)
            for c in range(min(3, N_UNKNOWNS - begin)):
                of_channel[:, c, begin + c] = 1.0
            residual = torch.einsum("bcn,bn->bc", of_channel, unknowns - observed)
            texels = torch.arange(m)[:, None].expand(-1, 4)
            equations.add(texels, torch.full((m, 4), 0.25), of_channel, torch.ones(m, 3), residual)
        step = equations.step(unknowns, usual, 60)
        unknowns = unknowns + step
        equations.move(step)
    return unknowns


def test_normals_across_a_seam_are_compared_in_one_frame():
    """A tilt that is one direction of space in two frames, one of them turned, is no difference."""
    frame = torch.tensor([[0.6, -0.8], [0.8, 0.6]])
    prior = chain(frame, flat=1.0)
    observed = torch.zeros(3, N_UNKNOWNS)
    observed[1:, 5:] = torch.tensor([0.3, -0.1])
    observed[0, 5:] = frame @ observed[1, 5:]
    torch.testing.assert_close(fitted(prior, observed), observed)
    values, rows = torch.randn(3, N_UNKNOWNS), torch.randn(2, N_UNKNOWNS)
    torch.testing.assert_close(
        (prior.pairs.differences(values) * rows).sum(), (values * prior.pairs.adjoint(rows)).sum()
    )


def test_small_differences_are_smoothed_and_edges_are_kept():
    """The stationary point of the written cost, and what it means at an edge."""
    observed = torch.zeros(3, N_UNKNOWNS)
    observed[:, 3] = torch.tensor([0.30, 0.32, 0.80])
    observed[:, 5:] = torch.tensor([[0.0, 0.0], [0.01, -0.01], [0.01, 0.4]])
    found = fitted(chain(flat=1.0), observed)
    at = found.clone().requires_grad_(True)
    apart = (at[1:] - at[:-1]).square()
    cost = 0.5 * (at - observed).square().sum()
    for part in apart.split(GROUPS, dim=1):
        cost = cost + 0.5 * EDGE**2 * torch.log1p(part.sum(1) / EDGE**2).sum()
    assert torch.autograd.grad(cost, at)[0].abs().max() < 1e-4
    assert found[1, 3] - found[0, 3] < 0.6 * 0.02 and found[2, 3] - found[1, 3] > 0.95 * 0.48
    # the edge in the second component of the normal frees the first one too, which would be smoothed alone
    assert abs(found[2, 5] - found[1, 5]) < abs(found[1, 5] - found[0, 5])


@pytest.mark.parametrize("of", [0, 1])
def test_a_usual_roughness_or_metallic_pulls_at_the_cost_that_is_written(of):
    observed, usual = torch.zeros(3, N_UNKNOWNS), torch.full((3, 2), torch.nan)
    observed[:, 3:5] = torch.tensor([[0.3, 0.9], [0.3, 0.1], [0.9, 0.5]])
    observed[:, 3 + of], usual[:, of] = torch.tensor([0.3, 0.3, 0.9]), torch.tensor([0.3, 0.35, 0.3])
    found = fitted(chain(like=0.5), observed, usual)
    at = found[:, 3 + of].clone().requires_grad_(True)
    pull = 0.25 * APART**2 * torch.log1p(((at - usual[:, of]) / APART).square()).sum()
    assert torch.autograd.grad(0.5 * (at - observed[:, 3 + of]).square().sum() + pull, at)[0].abs().max() < 1e-4
    assert at[0].item() == pytest.approx(0.3, abs=1e-5) and 0.31 < at[1] < 0.32  # a third of the way, nearly
    assert at[2] > 0.83  # what differs much moves by a tenth of the way
    torch.testing.assert_close(found[:, 4 - of], observed[:, 4 - of])
    torch.testing.assert_close(fitted(chain(like=5.0), observed), observed)


@pytest.mark.parametrize(("others", "is_metals"), [(1, True), (8, False)])
def test_a_colour_has_the_gloss_of_most_of_its_texels(others, is_metals):
    """Random unknowns of red and blue texels, most with one roughness and metallic per colour; few of a metal's differ."""
    unknowns = torch.rand(5000, N_UNKNOWNS, generator=torch.Generator().manual_seed(0))
    red = torch.arange(5000) % 2 == 0
    unknowns[:, :3] = torch.where(red[:, None], torch.tensor([0.9, 0.1, 0.1]), torch.tensor([0.1, 0.2, 0.8]))
    same = torch.arange(5000) % 21 >= others
    unknowns[same, 3:5] = torch.where(red[same, None], torch.tensor([0.1, 0.95]), torch.tensor([0.9, 0.05]))
    similar = SimilarTexels(unknowns, 0)
    unknowns[:, [0, 1, 2, 4]] = 0.5  # what is similar or metal was so at the start
    expected = torch.stack([torch.where(red, 0.1, 0.9), torch.where(red & is_metals, 0.95, torch.nan)], dim=1)
    torch.testing.assert_close(similar.usual_gloss(unknowns), expected, equal_nan=True)


def test_a_colour_counts_for_those_nearby_and_not_for_those_farther_away():
    """A few rough greys beside many smooth ones of almost the same grey; as dark ones they have a roughness of their own."""
    unknowns = torch.rand(8000, N_UNKNOWNS, generator=torch.Generator().manual_seed(0))
    few = torch.arange(8000) < 100
    unknowns[:, 3] = torch.where(few, 0.7, 0.2)
    for grey, roughness in ((0.50, 0.2), (0.1, 0.7)):
        unknowns[:, :3] = torch.where(few, grey, 0.55)[:, None]
        assert (SimilarTexels(unknowns, 0).usual_gloss(unknowns)[few, 0] == roughness).all()
    weights = np.array([[1.0, 1.0, 1.0], [0.0, 5.0, 1.0], [9.0, 1.0, 1.0]])
    assert weighted_quantiles(np.array([3.0, 1.0, 2.0]), weights, 0.5).tolist() == [2.0, 1.0, 3.0]


def test_the_equations_find_what_linear_observations_say():
    """Without a prior to speak of the least-squares solution, by another program's solver."""
    generator = torch.Generator().manual_seed(0)
    truth = torch.rand(6, N_UNKNOWNS, generator=generator)
    start = torch.zeros_like(truth)
    equations = NormalEquations(start, chain(m=6, smooth=1e-9, anchor=1e-9), 0.5)
    texels = torch.arange(6).repeat(40).repeat_interleave(2)[:, None].expand(-1, 4)
    shares = torch.full((480, 4), 0.25)
    jacobian = torch.randn(240, 3, N_UNKNOWNS, generator=generator).repeat_interleave(2, 0)
    weights = (torch.rand(240, 3, generator=generator) + 0.1).repeat_interleave(2, 0)
    residual = torch.einsum("bcn,bn->bc", jacobian, start[texels[:, 0]] - truth[texels[:, 0]])
    equations.add(texels, shares, jacobian, weights, residual)
    step = equations.step(start, None, 100)
    torch.testing.assert_close(start + step, truth, atol=1e-3, rtol=0)
    # what was seen is carried along: at the new place it asks for nothing more
    equations.move(step)
    assert equations.step(start + step, None, 100).abs().max() < 1e-3


def test_the_prior_takes_texels_along_that_no_photo_shows():
    equations = NormalEquations(torch.zeros(4, N_UNKNOWNS), chain(m=4, smooth=10.0, anchor=1e-6), 0.0)
    one = torch.eye(N_UNKNOWNS)
    jacobian = torch.stack([one[:3], one[3:6], one[4:]]).repeat_interleave(2, 0)
    texels, shares = torch.zeros(6, 4, dtype=torch.int64), torch.full((6, 4), 0.25)
    equations.add(texels, shares, jacobian, torch.ones(6, 3), -torch.ones(6, 3))
    step = equations.step(torch.zeros(4, N_UNKNOWNS), None, 200)
    torch.testing.assert_close(step[:3], torch.ones(3, N_UNKNOWNS), atol=0.02, rtol=0)
    assert step[3].abs().max() < 1e-6


def test_a_light_is_what_it_was_made_from_and_is_read_as_the_tracer_reads_it():
    map_ = np.random.default_rng(1).uniform(0.2, 3.0, (16, 32, 3)).astype(np.float32)
    light = EnvironmentLight(torch.from_numpy(map_))
    np.testing.assert_allclose(light.radiance().numpy(), map_, rtol=1e-5)
    directions = np.random.default_rng(0).normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    at = footprints(16, torch.from_numpy(directions.astype(np.float32)))
    found = read(torch.from_numpy(map_).view(-1, 3), *at).numpy()
    np.testing.assert_allclose(found, sample_environment(map_, directions), rtol=2e-4, atol=2e-4)
    # a coarse texel lights the whole of its cell
    light.levels[0][:, 2, 0] += 1.0
    raised = light.radiance().numpy() / map_
    assert raised[4:6, :2].min() > 1.5 and abs(raised[12:].max() - 1) < 1e-5
    np.testing.assert_allclose(raised[:, -1], raised[:, 2], rtol=1e-4)  # over the seam as on its other side


def observed_light(
    truth: torch.Tensor, start: torch.Tensor, directions: torch.Tensor, n_steps: int = 20, share: float = 0.5
) -> torch.Tensor:
    """The light that is found where n rays see the mean of their k directions' radiance, without noise."""
    light = EnvironmentLight(start)
    equations = LightEquations(light, share_of_rows=1.0)
    slopes, weights = torch.full_like(directions, 1 / directions.shape[1]), torch.ones(len(directions), 3)
    texels, shares = footprints(light.height, directions.reshape(-1, 3))

    def radiance_of(map_: torch.Tensor) -> torch.Tensor:
        return read(map_.reshape(-1, 3), texels, shares).view_as(directions)

    k = directions.shape[1]
    for _ in range(n_steps):
        for part in torch.arange(len(directions)).split(500):
            rays = (part[:, None] * k + torch.arange(k)).flatten()
            now = radiance_of(light.radiance())[part]
            rows = Rows(texels[rays], shares[rays], slopes[part], weights[part])
            equations.add(rows, now, now.mean(1) - radiance_of(truth)[part].mean(1))
        equations.step(share)
    return light.radiance()


def test_a_light_that_is_seen_is_found_and_the_rest_is_smooth_and_grey():
    random = torch.Generator().manual_seed(0)
    directions = torch.nn.functional.normalize(torch.randn(20000, 1, 3, generator=random), dim=2)
    directions[..., 2] = directions[..., 2].abs()  # only the upper half is seen
    truth = torch.from_numpy(sky())
    noise = torch.exp(0.5 * torch.randn(16, 32, 3, generator=random))
    found = observed_light(truth, noise, directions)
    assert (found.log() - truth.log())[1:7].abs().max() < 0.1

    def colour(map_: torch.Tensor) -> torch.Tensor:
        return (map_.log() - map_.log().mean(2, keepdim=True))[10:].std()

    assert colour(found) < 0.05 * colour(noise) and found[10:].log().std() < 0.2 * noise[10:].log().std()


def test_the_lights_curvature_is_that_of_the_errors():
    """A step from a light towards a near one, where the photos say all: the whole way, less what the damping takes."""
    random = torch.Generator().manual_seed(1)
    directions = torch.nn.functional.normalize(torch.randn(30000, 2, 3, generator=random), dim=2)
    start = torch.from_numpy(sky())
    truth = start * torch.exp(0.1 * torch.sin(torch.arange(32) / 5.0))[None, :, None]
    found = observed_light(truth, start, directions, n_steps=1, share=1.0)
    way, asked = ((light / start).log()[2:-2] for light in (found, truth))
    assert 0.7 < (way * asked).sum() / asked.square().sum() < 1.05


def test_the_light_moves_to_what_photos_show():
    """Pixels that say nothing leave the light to what is seen around the object, where that is known."""
    surroundings = np.zeros((16, 32, 4), np.float32)
    surroundings[8:] = [0.3, 0.6, 1.2, 1.0]
    light = EnvironmentLight(torch.full((16, 32, 3), 0.6))
    equations = LightEquations(light, share_of_rows=1.0, surroundings=surroundings)
    for _ in range(12):
        texels, shares = footprints(
            16, torch.nn.functional.normalize(torch.randn(40, 3, generator=torch.Generator().manual_seed(0)), dim=1)
        )
        slopes = torch.full((40, 1, 3), 1e-6)
        equations.add(Rows(texels, shares, slopes, torch.ones(40, 3)), torch.full((40, 1, 3), 0.6), torch.zeros(40, 3))
        equations.step(1.0)
    radiance = light.radiance()
    torch.testing.assert_close(radiance[10:15].mean((0, 1)), torch.tensor([0.3, 0.6, 1.2]), rtol=0.05, atol=0)
