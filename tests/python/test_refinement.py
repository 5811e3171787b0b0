"""The refinement: its parts by closed forms, and a textured ball whose photos the path tracer made."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh

from splitnerf.cli import BAD_INPUT, DONE, main
from splitnerf.data.asset import Asset, Material
from splitnerf.data.dataset import Dataset
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import linear_to_srgb
from splitnerf.data.tangents import vertex_tangents
from splitnerf.errors import InputError
from splitnerf.export.environment import write_environment
from splitnerf.export.glb import write_glb
from splitnerf.export.unwrap import unwrap
from splitnerf.refinement.conjugate_gradients import conjugate_gradients
from splitnerf.refinement.fit import Refinement, RefinementSettings, refine, srgb_slope
from splitnerf.refinement.job import fitting_height
from splitnerf.refinement.light import EnvironmentLight, look_up
from splitnerf.refinement.light_equations import LightEquations
from splitnerf.refinement.like_texels import with_like_roughness
from splitnerf.refinement.normal_equations import APART, EDGE, NormalEquations, Prior
from splitnerf.refinement.outline import fit_outline, weld
from splitnerf.refinement.pixels import PixelFilter, covered_pixels
from splitnerf.refinement.texels import AssetTexels, materials_of
from splitnerf.refinement.unknowns import GROUPS, N_UNKNOWNS, into_range, to_unknowns, to_values
from splitnerf.render.path_traced import AssetRenderer

SIZE = 64  # texels
PHOTO = 40  # pixels
FOCAL = 60.0


def textured(vertices: np.ndarray, faces: np.ndarray, size: int = SIZE) -> Asset:
    """A mesh with smooth normals and plain textures."""
    normals = np.asarray(trimesh.Trimesh(vertices, faces, process=False).vertex_normals, np.float32)
    origins, faces, uv = unwrap(vertices.astype(np.float32), faces, size)
    vertices, normals = vertices[origins].astype(np.float32), normals[origins]
    material = Material(
        roughness=1.0, metallic=1.0, albedo_texture=np.full((size, size, 3), 0.4, np.float32),
        roughness_metallic_texture=np.tile(np.float32([0.5, 0.0]), (size, size, 1)),
        normal_texture=np.tile(np.float32([0, 0, 1]), (size, size, 1)),
    )  # fmt: skip
    tangents = vertex_tangents(vertices, faces, normals, uv)
    ids = np.zeros(len(faces), np.int32)
    return Asset("ball", vertices, faces.astype(np.int32), normals, ids, [material], uv=uv, tangents=tangents)


def with_textures(asset: Asset, **textures: np.ndarray) -> Asset:
    return replace(asset, materials=[replace(asset.materials[0], **textures)])


@pytest.fixture(scope="module")
def ball() -> Asset:
    mesh = trimesh.creation.icosphere(subdivisions=3)
    return textured(mesh.vertices, mesh.faces)


def sky(height: int = 16) -> np.ndarray:
    """A bright lamp over a gradient."""
    map_ = np.full((height, 2 * height, 3), 0.5, np.float32) * np.linspace(1.5, 0.5, height)[:, None, None]
    map_[3:5, 6:9] = (12.0, 11.0, 9.0)
    return map_.astype(np.float32)


def looking(azimuth: float, elevation: float, distance: float = 3.4) -> np.ndarray:
    """[4, 4] camera-to-world of a camera that looks at the origin, OpenGL axes."""
    back = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    right = np.cross([0, 0, 1], back)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3] = np.column_stack([right, np.cross(back, right), back, distance * back])
    return pose.astype(np.float32)


def photos(asset: Asset, environment: np.ndarray, n: int = 10, spp: int = 128) -> Dataset:
    """The asset seen from all around, as photos."""
    renderer = AssetRenderer(asset)
    poses = np.stack([looking(2.4 * i, np.arcsin(1.6 * (i + 0.5) / n - 0.8)) for i in range(n)])
    lens, images = (FOCAL, FOCAL, PHOTO / 2, PHOTO / 2), []
    for i, pose in enumerate(poses):
        maps = renderer.render(environment, pose, lens, PHOTO, PHOTO, spp=spp, seed=i)
        straight = maps["radiance"] / np.maximum(maps["alpha"], 1e-6)[..., None]
        images.append(np.dstack([linear_to_srgb(straight).clip(0, 1), maps["alpha"]]))
    return Dataset(
        "ball", Path(), "train", 1, np.stack(images).astype(np.float32), poses, np.tile(np.float32(lens), (n, 1)),
        [str(i) for i in range(n)], [Path(str(i)) for i in range(n)], np.eye(4),
    )  # fmt: skip


@pytest.fixture(scope="module")
def painted(ball) -> tuple[Asset, Dataset]:
    """A ball with a colour and a roughness per side, and its photos."""
    texels = AssetTexels(ball)
    height = heights(ball, texels)
    values = texels.start.clone()
    values[:, :3] = torch.where(height > 0, torch.tensor([0.7, 0.25, 0.1]), torch.tensor([0.15, 0.3, 0.6]))
    values[:, 3:4] = torch.where(height > 0, 0.35, 0.7)
    asset = texels.asset_with(texels.maps(values))
    return asset, photos(asset, sky())


def heights(asset: Asset, texels: AssetTexels) -> torch.Tensor:
    """[m, 1] z of the covered texels."""
    from splitnerf.export.bake import rasterise

    return torch.from_numpy(rasterise(asset.uv, asset.triangles, texels.size).interpolate(asset.vertices, asset.triangles))[:, 2:]


def test_unknowns_stand_for_the_values_within_their_ranges():
    generator = torch.Generator().manual_seed(0)
    values = torch.rand(200, 8, generator=generator).clamp(0.05, 0.95)
    values[:, 5:] = torch.nn.functional.normalize(values[:, 5:] - torch.tensor([0.5, 0.5, -0.5]), dim=1)
    torch.testing.assert_close(to_values(to_unknowns(values)), values, atol=2e-6, rtol=1e-5)
    wild = to_values(into_range(10 * torch.randn(200, N_UNKNOWNS, generator=generator)))
    assert wild[:, :5].min() >= 0 and wild[:, :5].max() <= 1
    torch.testing.assert_close(wild[:, 5:].norm(dim=1), torch.ones(200), atol=1e-6, rtol=0)
    assert wild[:, 7].min() > 0.4


def test_the_filter_has_the_windows_moments():
    offsets = PixelFilter().draw(200_000, np.random.default_rng(0))
    t = np.linspace(0, 1, 10001)
    window = 0.35875 - 0.48829 * np.cos(2 * np.pi * t) + 0.14128 * np.cos(4 * np.pi * t) - 0.01168 * np.cos(6 * np.pi * t)
    variance = 9 * np.average((t - 0.5) ** 2, weights=window)
    assert np.abs(offsets.mean(0)).max() < 0.005
    np.testing.assert_allclose(offsets.var(0), variance, rtol=0.02)
    assert abs(np.corrcoef(offsets.T)[0, 1]) < 0.01


def test_points_read_what_the_path_tracer_reads(ball):
    """Albedo, roughness, metallic and shading normals at first hits, with random textures."""
    random = np.random.default_rng(1)
    tilted = random.normal(size=(SIZE, SIZE, 3)) * 0.3 + [0, 0, 1]
    asset = with_textures(
        ball, albedo_texture=random.random((SIZE, SIZE, 3), np.float32),
        roughness_metallic_texture=random.random((SIZE, SIZE, 2), np.float32),
        normal_texture=(tilted / np.linalg.norm(tilted, axis=2, keepdims=True)).astype(np.float32),
    )  # fmt: skip
    pose, n = looking(0.3, 0.4), 16
    many = AssetRenderer(asset).render(
        sky(), pose, (FOCAL, FOCAL, n / 2, n / 2), n, n, spp=1024, pixel_filter="box", bounces=0
    )
    data = replace(photos(ball, sky(), 1, 1), poses=pose[None], intrinsics=np.float32([[FOCAL, FOCAL, n / 2, n / 2]]),
                   images=np.ones((1, n, n, 4), np.float32))  # fmt: skip
    pixels, texels = covered_pixels(data), AssetTexels(asset)
    inside = np.flatnonzero(many["alpha"].reshape(-1) == 1)
    offsets = np.stack(np.meshgrid(*[(np.arange(32) + 0.5) / 32 - 0.5] * 2), axis=-1).reshape(1, -1, 2)
    origins, directions = pixels.rays(inside, np.repeat(offsets, len(inside), 0))
    fit = Refinement(data, asset, sky(), RefinementSettings())
    triangle, u, v = fit.scene.trace_closest(origins.reshape(-1, 3), directions.reshape(-1, 3))
    samples = texels.sample(triangle, u, v, -directions.reshape(-1, 3))
    values = torch.from_numpy(np.concatenate([asset.materials[0].albedo_texture, asset.materials[0].roughness_metallic_texture,
                                              asset.materials[0].normal_texture], 2)).view(-1, 8)  # fmt: skip
    read = (values[samples.footprints.texels] * samples.footprints.weights[..., None]).sum(1)
    found = torch.cat(list(materials_of(read, samples)), 1).view(len(inside), -1, 8).mean(1).numpy()
    names = ("albedo", "roughness", "metallic", "normal")
    wanted = np.concatenate([many[name].reshape(n * n, -1) for name in names], 1)[inside]
    assert np.abs(found - wanted).max() < 0.05 and np.abs(found - wanted).mean() < 0.006


def test_a_shaded_point_is_what_the_path_tracer_renders(painted):
    """The mean of many estimates against photos without noise to speak of: no error is left where all is true."""
    asset, data = painted
    fit = Refinement(data, asset, sky(), RefinementSettings(light_step=0.0, pixels=4000))
    surface = fit.surface()
    error = np.mean([fit.gather(surface) for _ in range(6)])
    grey = Refinement(data, with_textures(asset, albedo_texture=np.full((SIZE, SIZE, 3), 0.35, np.float32)), sky(), fit.settings)
    assert abs(error) < 2e-4 < 0.05 * grey.gather(grey.surface())


@pytest.fixture(scope="module")
def cornered() -> tuple[Asset, Dataset]:
    """A rough metal ball on a plate of the same metal: each hides light from the other and sends it some."""
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.6)
    ball.apply_translation([0, 0, 0.55])
    plate = trimesh.creation.box(extents=[2.0, 2.0, 0.2]).subdivide().subdivide()
    plate.apply_translation([0, 0, -0.15])
    both = trimesh.util.concatenate([ball, plate])
    gloss = np.tile(np.float32([0.8, 1.0]), (SIZE, SIZE, 1))
    asset = with_textures(textured(both.vertices, both.faces), roughness_metallic_texture=gloss,
                          albedo_texture=np.full((SIZE, SIZE, 3), 0.9, np.float32))  # fmt: skip
    return asset, photos(asset, 0.4 * sky(), n=6, spp=256)


def test_light_that_the_asset_hides_and_sends_is_the_path_tracers(cornered):
    """No error is left where all is true; a shade too dark or too bright would leave one."""
    asset, data = cornered
    fit = Refinement(data, asset, 0.4 * sky(), RefinementSettings(light_step=0.0, pixels=4000))
    surface = fit.surface()
    assert abs(np.mean([fit.gather(surface) for _ in range(6)])) < 1.5e-4


def test_errors_are_those_of_srgb(painted):
    """A light that is a tenth too bright."""
    asset, data = painted
    fit = Refinement(data, asset, 1.1 * sky(), RefinementSettings(light_step=0.0, pixels=4000))
    surface = fit.surface()
    target = torch.from_numpy(fit.pixels.target)
    open_above = ~torch.from_numpy(fit.pixels.saturated)
    wanted = (open_above * (srgb_slope(target.clamp(min=0.02)) * 0.1 * target) ** 2).mean().item()
    assert np.mean([fit.gather(surface) for _ in range(6)]) == pytest.approx(wanted, rel=0.15)


def test_each_batch_has_directions_of_its_own(painted):
    asset, data = painted
    fit = Refinement(data, asset, sky(), RefinementSettings(pixels=64))
    _, samples = fit.see()
    texels, shares = fit.texels.rows(samples.footprints), samples.footprints.weights
    colours = []
    for fit.n_batches in (0, 0, 1):
        unknowns = (fit.unknowns[texels] * shares[..., None]).sum(1)
        colours.append(fit.shade(fit.surface(), samples, unknowns).colours.detach())
    assert torch.equal(colours[0], colours[1]) and not torch.equal(colours[0], colours[2])


def chain(**weights: float) -> Prior:
    """A prior of texels 0 - 1 - 2, with one weight for all unknowns."""
    of_all = {name: torch.full((N_UNKNOWNS,), weights.get(name, 0.0)) for name in ("smooth", "flat", "anchor", "like")}
    return Prior(pairs=torch.tensor([[0, 1], [1, 2]]), groups=GROUPS, **of_all)


def fitted(prior: Prior, observed: torch.Tensor, like: torch.Tensor, n_steps: int = 60) -> torch.Tensor:
    """[m, n] where the steps end if each unknown of each texel was observed once, with one precision."""
    m = len(observed)
    equations, unknowns = NormalEquations(torch.zeros(m, N_UNKNOWNS), prior, 0.0), torch.zeros(m, N_UNKNOWNS)
    for _ in range(n_steps):
        for begin in range(0, N_UNKNOWNS, 3):
            of_channel = torch.zeros(m, 3, N_UNKNOWNS)
            for c in range(min(3, N_UNKNOWNS - begin)):
                of_channel[:, c, begin + c] = 1.0
            residual = torch.einsum("bcn,bn->bc", of_channel, unknowns - observed)
            texels = torch.arange(m)[:, None].expand(-1, 4)
            equations.add(texels, torch.full((m, 4), 0.25), of_channel, torch.ones(m, 3), residual)
        step = equations.step(unknowns, like, 60)
        unknowns = unknowns + step
        equations.move(step)
    return unknowns


def test_small_differences_are_smoothed_and_edges_are_kept():
    """The stationary point of the written cost, and what it means at an edge."""
    observed = torch.zeros(3, N_UNKNOWNS)
    observed[:, 3] = torch.tensor([0.30, 0.32, 0.80])
    observed[:, 5:] = torch.tensor([[0.0, 0.0], [0.01, -0.01], [0.01, 0.4]])
    found = fitted(chain(flat=1.0), observed, observed)
    at = found.clone().requires_grad_(True)
    apart = (at[1:] - at[:-1]).square()
    cost = 0.5 * (at - observed).square().sum()
    for part in apart.split(GROUPS, dim=1):
        cost = cost + 0.5 * EDGE**2 * torch.log1p(part.sum(1) / EDGE**2).sum()
    assert torch.autograd.grad(cost, at)[0].abs().max() < 1e-4
    assert found[1, 3] - found[0, 3] < 0.6 * 0.02 and found[2, 3] - found[1, 3] > 0.95 * 0.48
    # the edge in the second component of the normal frees the first one too, which would be smoothed alone
    assert abs(found[2, 5] - found[1, 5]) < abs(found[1, 5] - found[0, 5])


def test_like_texels_pull_at_the_cost_that_is_written():
    observed, like = torch.zeros(3, N_UNKNOWNS), torch.zeros(3, N_UNKNOWNS)
    observed[:, 3], like[:, 3] = torch.tensor([0.3, 0.3, 0.9]), torch.tensor([0.3, 0.35, 0.3])
    found = fitted(chain(like=1.0), observed, like)
    at = found.clone().requires_grad_(True)
    pull = 0.5 * APART**2 * torch.log1p(((at - like) / APART).square()).sum()
    assert torch.autograd.grad(0.5 * (at - observed).square().sum() + pull, at)[0].abs().max() < 1e-4
    assert found[0, 3] == pytest.approx(0.3, abs=1e-5) and 0.31 < found[1, 3] < 0.34  # half way, nearly
    assert found[2, 3] > 0.87  # what differs is not merged


def test_a_colour_has_the_roughness_that_most_of_its_texels_have():
    unknowns = torch.rand(5000, N_UNKNOWNS, generator=torch.Generator().manual_seed(0))
    red = torch.arange(5000) % 2 == 0
    unknowns[:, :3] = torch.where(red[:, None], torch.tensor([0.9, 0.1, 0.1]), torch.tensor([0.1, 0.2, 0.8]))
    same = torch.arange(5000) % 10 < 6
    unknowns[same, 3] = torch.where(red[same], 0.1, 0.9)
    found = with_like_roughness(unknowns, 0)
    torch.testing.assert_close(found[:, 3], torch.where(red, 0.1, 0.9))
    torch.testing.assert_close(found[:, [0, 1, 2, 4, 5, 6]], unknowns[:, [0, 1, 2, 4, 5, 6]])
    assert torch.isfinite(with_like_roughness(unknowns[red], 0)).all()  # one colour


def test_conjugate_gradients_solve_a_system():
    random = torch.Generator().manual_seed(0)
    factor = torch.randn(30, 30, generator=random)
    matrix, right = factor @ factor.T + torch.eye(30), torch.randn(30, generator=random)
    found = conjugate_gradients(lambda x: matrix @ x, lambda x: x / matrix.diagonal(), right, 60)
    torch.testing.assert_close(found, torch.linalg.solve(matrix, right), rtol=1e-3, atol=1e-3)


def test_the_equations_find_what_linear_observations_say():
    """Without a prior to speak of the least-squares solution, by another program's solver."""
    generator = torch.Generator().manual_seed(0)
    truth = torch.rand(6, N_UNKNOWNS, generator=generator)
    start = torch.zeros_like(truth)
    prior = chain(smooth=1e-9, anchor=1e-9)
    equations = NormalEquations(start, prior, 0.5)
    texels = torch.arange(6).repeat(40).repeat_interleave(2)[:, None].expand(-1, 4)
    shares = torch.full((480, 4), 0.25)
    jacobian = torch.randn(240, 3, N_UNKNOWNS, generator=generator).repeat_interleave(2, 0)
    weights = (torch.rand(240, 3, generator=generator) + 0.1).repeat_interleave(2, 0)
    residual = torch.einsum("bcn,bn->bc", jacobian, start[texels[:, 0]] - truth[texels[:, 0]])
    equations.add(texels, shares, jacobian, weights, residual)
    step = equations.step(start, start, 100)
    torch.testing.assert_close(start + step, truth, atol=1e-3, rtol=0)
    # what was seen is carried along: at the new place it asks for nothing more
    equations.move(step)
    assert equations.step(start + step, start, 100).abs().max() < 1e-3


def test_the_prior_takes_texels_along_that_no_photo_shows():
    prior = chain(smooth=10.0, anchor=1e-6)
    equations = NormalEquations(torch.zeros(4, N_UNKNOWNS), prior, 0.0)
    one = torch.eye(N_UNKNOWNS)
    jacobian = torch.stack([one[:3], one[3:6], one[4:]]).repeat_interleave(2, 0)
    texels, shares = torch.zeros(6, 4, dtype=torch.int64), torch.full((6, 4), 0.25)
    equations.add(texels, shares, jacobian, torch.ones(6, 3), -torch.ones(6, 3))
    nothing = torch.zeros(4, N_UNKNOWNS)
    step = equations.step(nothing, nothing, 200)
    torch.testing.assert_close(step[:3], torch.ones(3, N_UNKNOWNS), atol=0.02, rtol=0)
    assert step[3].abs().max() < 1e-6


def test_a_light_is_what_it_was_made_from_and_is_read_as_the_tracer_reads_it():
    from splitnerf.data.environment import sample_environment

    map_ = np.random.default_rng(1).uniform(0.2, 3.0, (16, 32, 3)).astype(np.float32)
    light = EnvironmentLight(torch.from_numpy(map_))
    np.testing.assert_allclose(light.radiance().numpy(), map_, rtol=1e-5)
    directions = np.random.default_rng(0).normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    found = look_up(torch.from_numpy(map_), torch.from_numpy(directions.astype(np.float32))).numpy()
    np.testing.assert_allclose(found, sample_environment(map_, directions), rtol=2e-4, atol=2e-4)
    # a coarse texel lights the whole of its cell
    light.levels[0][:, 2, 0] += 1.0
    raised = light.radiance().numpy() / map_
    assert raised[4:6, :2].min() > 1.5 and abs(raised[12:].max() - 1) < 1e-5
    np.testing.assert_allclose(raised[:, -1], raised[:, 2], rtol=1e-4)  # over the seam as on its other side


def observed_light(truth: torch.Tensor, start: torch.Tensor, directions: torch.Tensor, n_steps: int = 20, share: float = 0.5) -> torch.Tensor:
    """The light that is found where n rays see the mean of their k directions' radiance, without noise."""
    light = EnvironmentLight(start)
    equations = LightEquations(light, share_of_rows=1.0)
    slopes, weights = torch.full_like(directions, 1 / directions.shape[1]), torch.ones(len(directions), 3)
    seen = lambda map_: look_up(map_, directions.reshape(-1, 3)).view_as(directions).mean(1)  # noqa: E731
    for _ in range(n_steps):
        for part in torch.arange(len(directions)).split(500):
            residual = seen(light.radiance())[part] - seen(truth)[part]
            equations.add(directions[part], slopes[part], weights[part], residual)
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
    colour = lambda map_: (map_.log() - map_.log().mean(2, keepdim=True))[10:].std()  # noqa: E731
    assert colour(found) < 0.3 * colour(noise) and found[10:].log().std() < 0.5 * noise[10:].log().std()


def test_the_lights_curvature_is_that_of_the_errors():
    """A step from a light towards a near one, where the photos say all: the whole way, less what the damping takes."""
    random = torch.Generator().manual_seed(1)
    directions = torch.nn.functional.normalize(torch.randn(30000, 2, 3, generator=random), dim=2)
    start = torch.from_numpy(sky())
    truth = start * torch.exp(0.1 * torch.sin(torch.arange(32) / 5.0))[None, :, None]
    found = observed_light(truth, start, directions, n_steps=1, share=1.0)
    way = (found / start).log()[2:-2]
    asked = (truth / start).log()[2:-2]
    assert 0.7 < (way * asked).sum() / asked.square().sum() < 1.05


@pytest.fixture(scope="module")
def refined(painted):
    """The ball from a wrong start, under the true light."""
    asset, data = painted
    texels = AssetTexels(asset)
    start = texels.start.clone()
    start[:, :3], start[:, 3] = 0.35, 0.5
    wrong = texels.asset_with(texels.maps(start))
    settings = RefinementSettings(sweeps=14, sweep_share=1.0, light_step=0.0, pixels=2000, directions=16, outline=False)
    return wrong, refine(data, wrong, sky(), settings)


def test_a_balls_albedo_is_found_and_its_roughness_approached(painted, refined):
    asset, (wrong, result) = painted[0], refined
    assets = (("true", asset), ("wrong", wrong), ("found", result.asset))
    values, sweeps = {name: AssetTexels(a).start for name, a in assets}, result.sweeps
    height = heights(asset, AssetTexels(asset))[:, 0].abs()
    seen = (height > 0.1) & (height < 0.8)
    error = lambda name: (values[name] - values["true"])[seen, :3].abs().mean().item()  # noqa: E731
    assert error("found") < 0.25 * error("wrong")
    assert values["found"][seen & (values["true"][:, 3] > 0.5), 3].mean() > 0.54  # 0.7 in truth, 0.5 at the start
    assert values["found"][seen, 4].mean() < 0.1  # no metal is invented
    assert sweeps[-1].error < 0.03 * sweeps[0].error
    assert sweeps[-1].moved[0] < 0.3 * sweeps[0].moved[0]
    np.testing.assert_allclose(result.light, sky(), rtol=1e-5)


def test_a_wrong_light_comes_nearer_to_the_true_one(painted):
    asset, data = painted
    grey = np.full_like(sky(), 0.8)
    settings = RefinementSettings(
        sweeps=8, sweep_share=1.0, pixels=1000, anchor=1e4, directions=16, outline=False
    )
    result = refine(data, asset, grey, settings)
    light, sweeps = result.light, result.sweeps
    cosine = np.sin((np.arange(16) + 0.5) * np.pi / 16)[:, None, None]
    apart = lambda map_: (np.abs(np.log(map_) - np.log(sky())) * cosine).mean()  # noqa: E731
    assert apart(light) < 0.6 * apart(grey) and sweeps[-1].error < 0.1 * sweeps[0].error
    row, column = np.unravel_index(light.mean(2).argmax(), light.shape[:2])
    assert 2 <= row <= 5 and 5 <= column <= 9  # the lamp


def test_equal_seeds_give_equal_bits(painted):
    asset, data = painted
    settings = RefinementSettings(sweeps=2, sweep_share=0.1, pixels=256)
    first, second = (refine(data, asset, sky(), settings) for _ in range(2))
    np.testing.assert_array_equal(first.asset.vertices, second.asset.vertices)
    np.testing.assert_array_equal(*(r.asset.materials[0].albedo_texture for r in (first, second)))
    np.testing.assert_array_equal(first.light, second.light)


def test_saturated_pixels_ask_for_no_less_light(painted):
    asset, data = painted
    white = replace(data, images=np.concatenate([np.ones_like(data.images[..., :3]), data.images[..., 3:]], -1))
    fit = Refinement(white, asset, 40 * sky(), RefinementSettings(pixels=200))
    assert abs(fit.gather(fit.surface())) < 1e-12
    assert fit.equations.curvature.abs().max() < 1e-12


def test_slope_of_srgb():
    x = torch.linspace(0.02, 1, 50, dtype=torch.float64)
    numeric = (linear_to_srgb((x + 1e-6).numpy()) - linear_to_srgb((x - 1e-6).numpy())) / 2e-6
    np.testing.assert_allclose(srgb_slope(x).numpy(), numeric, rtol=1e-3)


@pytest.mark.parametrize("scale", [0.96, 1.04])
@pytest.mark.parametrize("hard", [False, True])
def test_a_balls_outline_is_found(ball, painted, scale, hard):
    """A ball that is too small or too large gets its size back, from masks with soft edges and without, and stays closed."""
    data = painted[1]
    if hard:
        alpha = (data.images[..., 3:] > 0.5).astype(np.float32)
        data = replace(data, images=np.concatenate([data.images[..., :3], alpha], -1))
    wrong = replace(ball, vertices=scale * ball.vertices)
    found, errors = fit_outline(data, wrong)
    radius = np.linalg.norm(found.vertices, axis=1)
    assert abs(radius.mean() - 1) < 0.15 * abs(scale - 1) and radius.std() < 0.01
    assert errors[-1] < 0.3 * errors[0]
    assert weld(found.vertices).max() == weld(ball.vertices).max()  # what was one vertex still is


def test_a_true_outline_stays(ball, painted):
    found, errors = fit_outline(painted[1], ball)
    assert np.abs(np.linalg.norm(found.vertices, axis=1) - 1).max() < 0.01 and errors[-1] < 5e-3


@pytest.mark.parametrize(("height", "fitted"), [(128, 128), (512, 256), (96, 32), (8, 8), (7, 0)])
def test_fitted_heights(height, fitted):
    assert fitting_height(height) == fitted


def test_an_asset_of_another_form_is_refused(ball):
    for wrong in (
        replace(ball, uv=None), replace(ball, materials=ball.materials * 2),
        with_textures(ball, normal_texture=None), with_textures(ball, albedo_texture=np.ones((8, 8, 3), np.float32)),
        replace(ball, materials=[replace(ball.materials[0], roughness=0.5)]),
    ):  # fmt: skip
        with pytest.raises(ValueError, match="asset"):
            AssetTexels(wrong)


def test_photos_that_show_nothing_of_the_asset_are_refused(painted):
    asset, data = painted
    elsewhere = replace(asset, vertices=asset.vertices + np.float32([50, 0, 0]))
    with pytest.raises(InputError, match="shows the asset"):
        refine(data, elsewhere, sky(), RefinementSettings(sweeps=1, pixels=64, outline=False))
    empty = replace(data, images=np.zeros_like(data.images))
    with pytest.raises(InputError, match="no pixel"):
        refine(empty, asset, sky(), RefinementSettings(sweeps=1, pixels=64))
    full = replace(data, images=np.ones_like(data.images))
    assert fit_outline(full, asset) == (asset, [])  # masks without edges say nothing of the outline


def test_the_command_writes_an_asset_and_says_what_is_wrong(tmp_path, capsys, painted, data):
    run = tmp_path / "run"
    run.mkdir()
    assert main(["refine", str(run), "--data", str(data)]) == BAD_INPUT
    assert "mesh.glb" in capsys.readouterr().err
    asset = replace(painted[0], vertices=0.8 * painted[0].vertices)
    write_glb(run / "mesh.glb", asset)
    assert main(["refine", str(run), "--data", str(data)]) == BAD_INPUT
    assert "environment.exr" in capsys.readouterr().err
    write_environment(run, sky(32))
    assert main(["refine", str(run), "--data", str(data), "--sweeps", "0"]) == BAD_INPUT
    assert not (run / "refined").exists()
    assert main(["refine", str(run), "--data", str(data), "--sweeps", "1"]) == DONE
    new = read_asset(run / "refined" / "mesh.glb")
    assert new.materials[0].albedo_texture.shape == (SIZE, SIZE, 3)
    assert (run / "refined" / "environment.exr").is_file() and (run / "refined" / "refinement.json").is_file()
