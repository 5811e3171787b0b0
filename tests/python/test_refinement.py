"""The refinement: its parts by closed forms, and a textured ball whose photos the path tracer made."""

from dataclasses import replace

import numpy as np
import pytest
import torch
import trimesh
from painted_ball import FOCAL, SIZE, heights, looking, photos, sky, textured, with_textures
from splitnerf.cli import BAD_INPUT, DONE, main
from splitnerf.data.asset import Asset
from splitnerf.data.dataset import Dataset
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import linear_to_srgb
from splitnerf.errors import InputError
from splitnerf.export.bake import rasterise
from splitnerf.export.scene import write_environment
from splitnerf.export.writers import write_glb
from splitnerf.refinement import fit as fit_module
from splitnerf.refinement.fit import FitSettings, Refinement, srgb_slope
from splitnerf.refinement.level import level_of_light
from splitnerf.refinement.normal_equations import NormalEquations
from splitnerf.refinement.outline import fit_outline
from splitnerf.refinement.pixels import brightest_around, covered_pixels
from splitnerf.refinement.refine import fitting_height
from splitnerf.refinement.stage import Refined, Stage
from splitnerf.refinement.texels import AssetTexels, frames_of, materials_of, patch_width, texels_per_pixel
from splitnerf.refinement.unknowns import N_UNKNOWNS, into_range, to_unknowns, to_values
from splitnerf.render.path_traced import AssetRenderer
from test_refreshes import calls
from tiny_runs import refused


def test_unknowns_stand_for_the_values_within_their_ranges():
    generator = torch.Generator().manual_seed(0)
    values = torch.rand(200, 8, generator=generator).clamp(0.05, 0.95)
    values[:, 5:] = torch.nn.functional.normalize(values[:, 5:] - torch.tensor([0.5, 0.5, -0.5]), dim=1)
    torch.testing.assert_close(to_values(to_unknowns(values)), values, atol=2e-6, rtol=1e-5)
    wild = to_values(into_range(10 * torch.randn(200, N_UNKNOWNS, generator=generator)))
    assert wild[:, :5].min() >= 0 and wild[:, :5].max() <= 1
    torch.testing.assert_close(wild[:, 5:].norm(dim=1), torch.ones(200), atol=1e-6, rtol=0)
    assert wild[:, 7].min() > 0.4


def test_points_read_what_the_path_tracer_reads(ball):
    """Albedo, roughness, metallic and shading normals at first hits, with random textures."""
    random = np.random.default_rng(1)
    tilted = random.normal(size=(SIZE, SIZE, 3)) * 0.3 + [0, 0, 1]
    asset = with_textures(
        ball,
        albedo_texture=random.random((SIZE, SIZE, 3), np.float32),
        roughness_metallic_texture=random.random((SIZE, SIZE, 2), np.float32),
        normal_texture=(tilted / np.linalg.norm(tilted, axis=2, keepdims=True)).astype(np.float32),
    )
    pose, n = looking(0.3, 0.4), 16
    lens = (FOCAL, FOCAL, n / 2, n / 2)
    many = AssetRenderer(asset).render(sky(), pose, lens, n, n, spp=1024, pixel_filter="box", bounces=0)
    view = {"poses": pose[None], "intrinsics": np.float32([lens]), "images": np.ones((1, n, n, 4), np.float32)}
    data = replace(photos(ball, sky(), 1, 1), **view)
    pixels, texels = covered_pixels(data), AssetTexels(asset)
    inside = np.flatnonzero(many["alpha"].reshape(-1) == 1)
    offsets = np.stack(np.meshgrid(*[(np.arange(32) + 0.5) / 32 - 0.5] * 2), axis=-1).reshape(1, -1, 2)
    origins, directions = pixels.rays(inside, np.repeat(offsets, len(inside), 0))
    fit = Refinement(data, asset, sky(), FitSettings())
    triangle, u, v = fit.scene.trace_closest(origins.reshape(-1, 3), directions.reshape(-1, 3))
    samples = texels.sample(triangle, u, v, -directions.reshape(-1, 3))
    kinds = ("albedo", "roughness_metallic", "normal")
    maps = [getattr(asset.materials[0], f"{kind}_texture") for kind in kinds]
    values = torch.from_numpy(np.concatenate(maps, 2)).view(-1, 8)
    read = (values[samples.footprints.texels] * samples.footprints.weights[..., None]).sum(1)
    found = torch.cat(list(materials_of(read, samples)), 1).view(len(inside), -1, 8).mean(1).numpy()
    names = ("albedo", "roughness", "metallic", "normal")
    wanted = np.concatenate([many[name].reshape(n * n, -1) for name in names], 1)[inside]
    assert np.abs(found - wanted).max() < 0.05 and np.abs(found - wanted).mean() < 0.006


@pytest.fixture(scope="module")
def cornered() -> tuple[Asset, Dataset]:
    """A rough metal ball on a plate of the same metal: each hides light from the other and sends it some."""
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.6)
    ball.apply_translation([0, 0, 0.55])
    plate = trimesh.creation.box(extents=[2.0, 2.0, 0.2]).subdivide().subdivide()
    plate.apply_translation([0, 0, -0.15])
    both = trimesh.util.concatenate([ball, plate])
    gloss = np.tile(np.float32([0.8, 1.0]), (SIZE, SIZE, 1))
    asset = with_textures(
        textured(both), roughness_metallic_texture=gloss, albedo_texture=np.full((SIZE, SIZE, 3), 0.9, np.float32)
    )
    return asset, photos(asset, 0.4 * sky(), n=6, spp=256)


def test_light_that_the_asset_hides_and_sends_is_the_path_tracers(cornered):
    """No error is left where all is true; a shade too dark or too bright would leave one."""
    asset, data = cornered
    fit = Refinement(data, asset, 0.4 * sky(), FitSettings(light_step=0.0, pixels=4000))
    surface = fit.surface()
    assert abs(np.mean([fit.gather(surface) for _ in range(6)])) < 1.5e-4


def test_a_pixel_knows_the_brightest_around_it_that_the_object_covers():
    photo = np.zeros((5, 6, 4), np.float32)
    photo[..., 3] = 1.0
    photo[1, 1, :3], photo[3, 4, :3] = (0.8, 0.2, 0.0), 0.9
    photo[3, 4, 3] = 0.5  # the outline's
    wanted = np.zeros((5, 6, 3), np.float32)
    wanted[:3, :3] = 0.8, 0.2, 0.0
    np.testing.assert_array_equal(brightest_around(photo), wanted)


def test_errors_are_those_of_srgb_at_the_brightest_pixel_around(painted):
    """A light that is a tenth too bright, and pixels beside others four times as bright."""
    asset, data = painted
    fit = Refinement(data, asset, 1.1 * sky(), FitSettings(light_step=0.0, pixels=4000))
    surface = fit.surface()
    fit.pixels.brightest = 4 * fit.pixels.target
    target, tone = (torch.from_numpy(x) for x in (fit.pixels.target, fit.pixels.brightest))
    open_above = ~torch.from_numpy(fit.pixels.saturated)
    wanted = (open_above * (srgb_slope(tone.clamp(min=0.02)) * 0.1 * target) ** 2).mean().item()
    assert np.mean([fit.gather(surface) for _ in range(6)]) == pytest.approx(wanted, rel=0.15)


def test_each_batch_has_directions_of_its_own(painted):
    asset, data = painted
    fit = Refinement(data, asset, sky(), FitSettings(pixels=64))
    _, samples = fit.see(fit.fitted, fit.random)
    texels, shares = fit.texels.rows(samples.footprints), samples.footprints.weights
    colours = []
    for seed in (0, 0, 1):
        unknowns = (fit.unknowns[texels] * shares[..., None]).sum(1)
        colours.append(fit.shade(fit.surface(), samples, unknowns, seed=seed).colours.detach())
    assert torch.equal(colours[0], colours[1]) and not torch.equal(colours[0], colours[2])


def test_the_level_of_the_light_is_set_before_the_fit(painted):
    asset, data = painted
    gloss = np.tile(np.float32([0.3, 1.0]), (SIZE, SIZE, 1))
    dark_metal = np.full((SIZE, SIZE, 3), 0.04 * 1.9, np.float32)
    asset = with_textures(asset, albedo_texture=dark_metal, roughness_metallic_texture=gloss)
    fit = Refinement(data, asset, sky(), FitSettings())
    fit.begin_at(level_of_light(fit.texels.start))
    assert fit.level == pytest.approx(1.9, rel=1e-4)
    torch.testing.assert_close(fit.light.radiance(), 1.9 * torch.from_numpy(sky()), rtol=1e-3, atol=1e-4)
    assert (to_values(fit.unknowns)[:, 4] == 0).all()


def test_texels_know_their_points_on_the_mesh():
    """What a point of a triangle reads of its four texels' points is, inside charts, the point."""
    asset = textured(trimesh.creation.icosphere(subdivisions=2), 256)
    texels, triangle = AssetTexels(asset), np.arange(len(asset.triangles))
    third = np.full(len(triangle), 1 / 3)
    at = texels.sample(triangle, third, third, asset.vertices[asset.triangles[:, 0]])
    read = torch.from_numpy(texels.positions)[texels.rows(at.footprints)] * at.footprints.weights[..., None]
    apart = (read.sum(1) - at.positions).norm(dim=1)
    assert texels.positions.shape == (len(texels.index), 3) and apart.median() < 1e-5 and apart.max() < 0.02


def test_texels_on_both_sides_of_a_seam_are_neighbours():
    """Along all seams, next to each other in space; a direction of space has one tilt, whichever frame it is told in."""
    asset = textured(trimesh.creation.icosphere(subdivisions=3), 256)
    texels = AssetTexels(asset)
    chart, (i, j) = torch.from_numpy(texels.chart), texels.pairs.ends.unbind(1)
    seam = chart[i] != chart[j]
    positions = torch.from_numpy(texels.positions)
    apart = (positions[i] - positions[j]).norm(dim=1)
    assert apart[seam].max() < 2.1 * apart[~seam].median()
    ends = torch.bincount(texels.pairs.ends[~seam].flatten(), minlength=len(chart)) < 4
    joined = torch.zeros(len(chart), dtype=torch.bool).index_fill(0, texels.pairs.ends[seam].flatten(), True)
    assert joined[ends].float().mean() > 0.9
    covered = rasterise(asset.uv, asset.triangles, texels.size)
    axes = frames_of(*(covered.interpolate(x, asset.triangles) for x in (asset.normals, asset.tangents)))
    tilts = torch.from_numpy(axes @ np.array([0.1, 0.05, -0.2])).float()  # of a direction nearly along the surface
    assert texels.pairs.differences(tilts)[seam].abs().max() < 0.02  # what the surface bends between the two


def refine(*arguments) -> Refined:
    """A refinement with all its sweeps."""
    stage = Stage(*arguments)
    while not stage.finished:
        stage.advance()
    return stage.result()


@pytest.fixture(scope="module")
def refined(painted):
    """The ball from a wrong start, under the true light."""
    asset, data = painted
    texels = AssetTexels(asset)
    start = texels.start.clone()
    start[:, :3], start[:, 3] = 0.35, 0.5
    wrong = texels.asset_with(texels.maps(start))
    settings = FitSettings(14, sweep_share=1, light_step=0, pixels=2000, directions=16, outline=False, albedo_size=0)
    return wrong, refine(data, wrong, sky(), settings)


def test_a_balls_albedo_is_found_and_its_roughness_approached(painted, refined):
    asset, (wrong, result) = painted[0], refined
    with_normals = replace(result.asset.materials[0], normal_texture=asset.materials[0].normal_texture)
    assets = (("true", asset), ("wrong", wrong), ("found", replace(result.asset, materials=[with_normals])))
    values, sweeps = {name: AssetTexels(a).start for name, a in assets}, result.sweeps
    height = heights(AssetTexels(asset))[:, 0].abs()
    seen = (height > 0.1) & (height < 0.8)
    error = lambda name: (values[name] - values["true"])[seen, :3].abs().mean().item()
    assert error("found") < 0.25 * error("wrong")
    assert values["found"][seen & (values["true"][:, 3] > 0.5), 3].mean() > 0.54  # 0.7 in truth, 0.5 at the start
    assert values["found"][seen, 4].mean() < 0.1  # no metal is invented
    assert sweeps[-1].error < 0.03 * sweeps[0].error
    np.testing.assert_allclose(result.light, sky(), rtol=1e-5)


def test_a_wrong_light_comes_nearer_to_the_true_one(painted, monkeypatch):
    asset, data = painted
    grey = np.full_like(sky(), 0.8)
    monkeypatch.setattr(fit_module, "ANCHOR", 1e4)
    settings = FitSettings(sweeps=8, sweep_share=1.0, pixels=1000, directions=16, outline=False)
    result = refine(data, asset, grey, settings)
    light, sweeps = result.light, result.sweeps
    cosine = np.sin((np.arange(16) + 0.5) * np.pi / 16)[:, None, None]
    apart = lambda map_: (np.abs(np.log(map_) - np.log(sky())) * cosine).mean()
    assert apart(light) < 0.6 * apart(grey) and sweeps[-1].error < 0.1 * sweeps[0].error
    row, column = np.unravel_index(light.mean(2).argmax(), light.shape[:2])
    assert 2 <= row <= 5 and 5 <= column <= 9  # the lamp


def test_saturated_pixels_ask_for_no_less_light(painted):
    asset, data = painted
    white = replace(data, images=np.concatenate([np.ones_like(data.images[..., :3]), data.images[..., 3:]], -1))
    fit = Refinement(white, asset, 40 * sky(), FitSettings(pixels=200))
    assert abs(fit.gather(fit.surface())) < 1e-12
    assert fit.equations.curvature.abs().max() < 1e-12


def test_a_light_that_is_no_number_ends_the_fit(painted, monkeypatch):
    """In the last sweep as in any other: no batch after it would notice."""
    asset, data = painted
    fit = Refinement(data, asset, sky(), FitSettings(sweep_share=0.05, pixels=200))
    add = fit.light_equations.add
    monkeypatch.setattr(fit.light_equations, "add", lambda rows, sky, residual: add(rows, sky, residual * float("nan")))
    with pytest.raises(RuntimeError, match="light after .* is nan"):
        fit.sweep()


def test_held_out_pixels_decide_whether_colours_pull(painted, monkeypatch):
    """Until a step without the pull leaves them clearly smaller errors; a continued fit goes on without it."""
    asset, data = painted
    fit = Refinement(data, asset, sky(), FitSettings(sweep_share=0.05, pixels=200))
    pulls = calls(monkeypatch, NormalEquations, "step", lambda self, unknowns, usual: usual is not None)
    errors = np.array([1.0, 1.1, 0.9, 1.0])
    alike, half = errors[[1, 0, 2, 3]], 0.995 * errors  # no clear difference; half a percent
    held = iter([errors, alike, errors, half, errors, errors + 1.0, errors, errors])
    monkeypatch.setattr(fit, "held_errors", lambda: next(held))
    assert all(np.array_equal(fit.sweep()[1], errors) for _ in range(5))
    judged = [True, False]
    assert pulls == [*judged, *judged, True, *judged, False] and not fit.is_like
    other = Refinement(data, asset, sky(), fit.settings)
    other.restore(fit.state())
    assert not other.is_like


def test_slope_of_srgb():
    x = torch.linspace(0.02, 1, 50, dtype=torch.float64)
    numeric = (linear_to_srgb((x + 1e-6).numpy()) - linear_to_srgb((x - 1e-6).numpy())) / 2e-6
    np.testing.assert_allclose(srgb_slope(x).numpy(), numeric, rtol=1e-3)


@pytest.mark.parametrize(("height", "fitted"), [(128, 128), (512, 256), (96, 32), (8, 8), (7, 0)])
def test_fitted_heights(height, fitted):
    assert fitting_height(height) == fitted


def test_an_asset_of_another_form_is_refused(ball):
    for wrong in (
        replace(ball, uv=None),
        replace(ball, materials=ball.materials * 2),
        with_textures(ball, normal_texture=None),
        with_textures(ball, albedo_texture=np.ones((8, 8, 3), np.float32)),
        replace(ball, materials=[replace(ball.materials[0], roughness=0.5)]),
    ):
        with pytest.raises(ValueError, match="asset"):
            AssetTexels(wrong)


def test_photos_that_show_nothing_of_the_asset_are_refused(painted):
    asset, data = painted
    elsewhere = replace(asset, vertices=asset.vertices + np.float32([50, 0, 0]))
    with pytest.raises(InputError, match="shows the asset"):
        refine(data, elsewhere, sky(), FitSettings(sweeps=1, pixels=64, outline=False))
    empty = replace(data, images=np.zeros_like(data.images))
    with pytest.raises(InputError, match="no pixel"):
        refine(empty, asset, sky(), FitSettings(sweeps=1, pixels=64))
    full = replace(data, images=np.ones_like(data.images))
    assert fit_outline(full, asset) == (asset, [])  # masks without edges say nothing of the outline


def test_the_command_writes_an_asset_and_says_what_is_wrong(tmp_path, capsys, painted, data):
    run = tmp_path / "run"
    run.mkdir()
    assert "mesh.glb" in refused(capsys, "refine", run, "--data", data)
    asset = replace(painted[0], vertices=0.8 * painted[0].vertices)
    write_glb(run / "mesh.glb", asset)
    assert "environment.exr" in refused(capsys, "refine", run, "--data", data)
    write_environment(run, sky(32))
    assert main(["refine", str(run), "--data", str(data), "--sweeps", "0"]) == BAD_INPUT
    assert not (run / "refined").exists()
    assert main(["refine", str(run), "--data", str(data), "--sweeps", "1"]) == DONE
    new = read_asset(run / "refined" / "mesh.glb")
    assert new.materials[0].albedo_texture.shape == (SIZE, SIZE, 3)
    assert (run / "refined" / "environment.exr").is_file() and (run / "refined" / "refinement.json").is_file()


def test_a_sweep_has_no_more_pixels_than_it_may(painted, monkeypatch):
    asset, data = painted
    fit = Refinement(data, asset, sky(), FitSettings(light_step=0.0, pixels=100, sweep_share=1.0))
    assert len(fit.pixels) > 600
    monkeypatch.setattr(fit_module, "SWEEP_PIXELS", 300)
    fit.sweep()
    assert fit.n_batches == 3


def test_a_patch_is_two_pixels_wide(painted):
    """Texels share the ball's area of 4 pi; a pixel is 3.4 / 60 wide at its middle."""
    asset = textured(trimesh.creation.icosphere(subdivisions=3), 256)
    edge = np.sqrt(4 * np.pi / len(AssetTexels(asset).index))
    pixel = texels_per_pixel(painted[1], asset)
    assert pixel == pytest.approx(3.4 / 60 / edge, rel=0.05)
    assert patch_width(pixel) == round(2 * pixel) and patch_width(0.1) == 1
