"""The level of the light by what dielectrics reflect, and its tint by metals."""

import math

import pytest
import torch
from splitnerf.refinement.level import DIELECTRIC, at_level, level_of_light, rest_level, tint_of_light


def texture_values(albedo: torch.Tensor, metallic: torch.Tensor, rough: float = 0.3) -> torch.Tensor:
    """[m, 8] values of albedo [m] and metallic [m]."""
    roughness, normal = torch.full((len(albedo), 1), rough), torch.tensor([[0, 0, 1.0]]).expand(len(albedo), -1)
    return torch.cat([albedo[:, None].expand(-1, 3), roughness, metallic[:, None], normal], dim=1)


def faint_metals(factor: float) -> torch.Tensor:
    """[160, 8] values with F0 = factor * DIELECTRIC, from bright surfaces with a trace of metallic to dark metals."""
    metallic = torch.linspace(0.05, 1, 160)
    return texture_values(DIELECTRIC * (1 + (factor - 1) / metallic), metallic)


METAL = texture_values(torch.full((40,), 0.7), torch.full((40,), 0.95))


def radiances(values: torch.Tensor, light: float) -> tuple[torch.Tensor, torch.Tensor]:
    """[m, 3] what scatters and what reflects at normal incidence under a light."""
    albedo, metallic = values[:, :3], values[:, 4:5]
    return light * albedo * (1 - metallic), light * (DIELECTRIC * (1 - metallic) + albedo * metallic)


@pytest.mark.parametrize("factor", [1.3, 1.9])
def test_faint_metals_tell_that_the_light_is_too_dark(factor):
    assert level_of_light(torch.cat([faint_metals(factor), METAL])) == pytest.approx(factor, rel=1e-4)


def test_the_level_of_true_dielectrics_and_of_metals_alone_stays():
    dielectrics = texture_values(torch.linspace(0, 0.9, 50), torch.zeros(50))
    assert level_of_light(torch.cat([dielectrics, METAL])) == 1.0
    assert level_of_light(METAL) == 1.0
    assert level_of_light(torch.cat([faint_metals(1.9)[:4], METAL])) == 1.0  # too few to tell


def test_dark_metals_do_not_change_what_most_dielectrics_agree_on():
    """Dielectrics have one F0, dark metals have many: their median is beyond all dielectrics', and tells nothing."""
    dark = texture_values(torch.logspace(math.log10(0.06), math.log10(0.195), 400), torch.ones(400))
    assert level_of_light(torch.cat([faint_metals(1.3), dark])) == pytest.approx(1.3, rel=1e-3)
    assert level_of_light(torch.cat([dark, METAL.repeat(20, 1)])) == 1.0  # a third of all, and no tenth agrees


def test_rough_surfaces_tell_nothing_and_keep_their_metallic():
    """Clay that training took for a rough dark metal: what its lobe reflects is what clay scatters."""
    clay = texture_values(torch.full((90,), 0.18), torch.full((90,), 0.95), rough=0.6)
    assert level_of_light(torch.cat([clay, METAL])) == 1.0
    moved = at_level(clay, 1.5)
    torch.testing.assert_close(moved[:, :3], clay[:, :3] / 1.5)
    assert torch.equal(moved[:, 3:], clay[:, 3:])


def test_surfaces_look_the_same_at_another_level():
    faint, factor = faint_metals(1.9), 1.9
    moved = at_level(torch.cat([faint, METAL]), factor)
    assert (moved[: len(faint), 4] == 0).all() and (moved[len(faint) :, 4] == METAL[:, 4]).all()
    torch.testing.assert_close(radiances(moved[: len(faint)], factor), radiances(faint, 1.0))
    torch.testing.assert_close(moved[len(faint) :, :3] * factor, METAL[:, :3])
    assert (moved[:, [3, 5, 6, 7]] == torch.cat([faint, METAL])[:, [3, 5, 6, 7]]).all()
    assert level_of_light(moved) == 1.0


def test_a_lamp_that_mirrors_have_shown_darkens_what_scatters_and_leaves_the_rest_of_the_light():
    """Of a level that dielectrics ask for it explains the highlights: they become dielectrics, and metals stay."""
    faint, clay, gain = faint_metals(1.4), texture_values(torch.full((30,), 0.5), torch.zeros(30), rough=0.8), 1.25
    moved = at_level(torch.cat([faint, clay, METAL]), 1.4, gain)
    assert rest_level(1.4, gain) == 1.0 and rest_level(1.4, 1.0) == 1.4
    faint_now, clay_now, metal_now = moved.split([len(faint), len(clay), len(METAL)])
    assert (faint_now[:, 4] == 0).all()
    torch.testing.assert_close(radiances(faint_now, gain)[0], radiances(faint, 1.0)[0])
    torch.testing.assert_close(clay_now[:, :3], clay[:, :3] / gain)
    torch.testing.assert_close(metal_now[:, :3], METAL[:, :3] * (0.95 + 0.05 / gain))
    assert torch.equal(at_level(faint, 1.0, gain)[:, 3:], faint[:, 3:])


def metals(*colours: tuple[float, float, float]) -> torch.Tensor:
    """[30 n, 8] values of metals of n colours."""
    values = METAL[:30].repeat(len(colours), 1)
    values[:, :3] = torch.tensor(colours).repeat_interleave(30, 0)
    return values


STEEL, COPPER, RED = (0.56, 0.57, 0.58), (0.955, 0.638, 0.538), (0.6, 0.1, 0.1)


def test_much_grey_metal_tells_the_tint_of_the_light():
    tint = torch.tensor([1.25, 1.0, 0.8])
    paint = texture_values(torch.full((100,), 0.5), torch.zeros(100))
    seen = metals(STEEL, COPPER, RED)
    seen[:, :3] *= tint
    steel = torch.tensor(STEEL) / torch.tensor(STEEL).log().mean().exp()
    torch.testing.assert_close(tint_of_light(torch.cat([seen[:30], paint])), tint * steel)
    for values in (seen[30:], torch.cat([seen, paint]), paint):  # coloured, too few, none
        assert tint_of_light(values).tolist() == [1, 1, 1]


def test_metals_of_many_faint_colours_tell_no_tint():
    draw = torch.Generator().manual_seed(1)
    many = metals(*(0.5 * torch.exp(0.3 * torch.randn(40, 3, generator=draw))).tolist())
    assert tint_of_light(many).tolist() == [1, 1, 1]
