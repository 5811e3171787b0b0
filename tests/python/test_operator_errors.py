"""Every operator with arguments that do not fit: the message names operator and argument."""

import numpy as np
import pytest
import torch
from op_cases import EVERY
from op_checks import arguments_of, lib
from splitnerf import ops
from splitnerf.ops import MeshScene
from torch.utils._pytree import tree_flatten, tree_map

# Arguments of any number of rows.
FREE = "positions random x zonal linear srgb gradients beside edge_behind vertices light_dirs".split()
FREE += "radiance environment albedo_map roughness_metallic_map normal_map".split()


@pytest.mark.parametrize("name", EVERY)
def test_a_tensor_of_another_shape_or_dtype_is_named(name):
    """With one more dimension, or of a dtype that no operator takes: operator and argument stand in the message. A row less
    is refused too, as another argument's or its own."""
    inputs, unread = EVERY[name](torch.float32), {"interpolate_backward": ("shaded",)}.get(name, ())
    for i, (argument, x) in enumerate(zip(arguments_of(name), inputs)):
        if not isinstance(x, torch.Tensor) or argument in unread:
            continue
        any_shape = name.startswith(("linear_to_srgb", "srgb_to_linear"))
        for wrong in ([] if any_shape else [x[None, None]]) + [x.to(torch.complex64), x.to(torch.bfloat16)]:
            changed = (*inputs[:i], wrong, *inputs[i + 1 :])
            with pytest.raises(ValueError, match=name) as error:
                getattr(lib, name)(*changed)
            assert argument in str(error.value), f"{argument} is missing in {error.value}"
        if argument not in FREE and x.dim() and len(x) > 1:
            with pytest.raises(ValueError, match=name):
                getattr(lib, name)(*inputs[:i], x[:-1], *inputs[i + 1 :])


def without(x: torch.Tensor, rows: int = 1) -> torch.Tensor:
    return x[: len(x) - rows]


# An operator, the positions of arguments, what takes their place, and words of the message.
ERRORS = [
    ("hash_encode", 2, lambda n: 33, "n_levels must be in [1, 32], got 33"),
    ("hash_encode", 3, lambda n: 0, "base_resolution must be at least 1, got 0"),
    ("hash_encode", 4, lambda n: 0.5, "growth must be at least 1, got 0.5"),
    ("hash_encode", 5, lambda n: 31, "log2_table_size must be in [1, 30], got 31"),
    ("hash_encode", 6, lambda n: 4, "n_active must be in [0, n_levels], got 4"),
    ("sdf_field", 8, lambda beta: 0.0, "beta and box must be positive"),
    ("sdf_field", 13, lambda n: 4, "n_active must be in [0, n_levels], got 4"),
    ("march_rays", 4, lambda box: -1.0, "box"),
    ("march_rays", 5, lambda step: 0.0, "step"),
    ("march_rays", 4, lambda box: float(1 << 40), "box must be at most 2^20 steps"),  # which would take for ever
    ("sparse_product", 0, lambda offsets: offsets - 1, "offsets must ascend within [0, "),
    ("sparse_product", 0, lambda offsets: offsets + 1, "offsets must ascend within [0, "),
    ("sparse_product", 0, lambda offsets: offsets.flip(0), "offsets must ascend within [0, "),
    ("sparse_product", 1, lambda columns: columns + 1, "columns must hold numbers in [0, 64)"),
    ("sparse_product", 1, lambda columns: columns - 1, "columns must hold numbers in [0, 64)"),
    ("surface_weights", 4, lambda offsets: offsets + 1, "offsets must rise from 0"),
    ("surface_weights", 4, lambda offsets: offsets[:0], "offsets must be"),
    ("surface_weights", 4, lambda offsets: offsets.flip(0), "offsets must rise from 0"),
    ("surface_weights", 5, lambda step: 0 * step, "step must be positive"),
    ("surface_weights", 8, lambda n: n + 71, "n_samples must be at most the number of points"),
    ("composite", 2, lambda offsets: offsets + 1, "offsets must rise from 0"),
    ("composite", 4, lambda least: 0.0, "least_opacity must be positive"),
    ("spread_samples", 3, lambda phase: phase + 1, "phase must be in [0, 1)"),
    ("spread_samples", 4, lambda gap: 0.0, "gap must be positive"),
    ("spread_samples", 5, lambda n: -1, "per_ray must be in [0, 2^20)"),
    ("interpolate", 1, lambda first: first + 9, "first must be in [0, 5)"),
    ("interpolate", 2, lambda second: second - 9, "second must be in [0, 5)"),
    ("split_sum_shade", 6, lambda diffuse: None, "specular must be [600, 3] float32"),
    ("split_sum_shade", 10, lambda mode: 2, "fresnel_mode must be 0 (exact) or 1 (paper), got 2"),
    ("light_queries", 3, lambda lut: lut[1:], "lut must be [32, 32, 4]"),
    ("shade_sums", 9, lambda share: None, "both or neither"),
    ("summed_light", 7, without, "sent must hold as many points as normals, or none"),
    ("gradient_losses", 2, lambda beside: beside + 15, "beside must hold indices of weights"),
    ("gradient_losses", 0, lambda g: g[:25], "samples and their neighbours"),
    ("quadratic_entropy", 0, lambda x: x[:0], "x must hold at least one point"),
    ("light_prior", 1, lambda sizes: [], "level_sizes must hold 1 to 16 numbers"),
    ("light_prior", 1, lambda sizes: [1] * 17, "level_sizes must hold 1 to 16 numbers"),
    ("light_prior", 1, lambda sizes: [336, 0], "level_sizes must be positive"),
    ("light_prior", 1, lambda sizes: [3, 4], "level_sizes must sum to the number of texels"),
    ("prefilter_light", (2, 3), lambda x: x[:0], "light_dirs must hold at least one"),
    ("sample_ggx_lobe", 2, lambda n: 0, "n_samples must be in [1, 2^20]"),
    ("sparse_product", 3, lambda places: places[:, :2], "places must have 1 or 4 columns"),
    ("sparse_product", 3, lambda places: places - 1, "places must hold numbers in [0, 64)"),
    ("sparse_product", 4, lambda images: images + 1, "images must hold numbers in [0, 64)"),
    ("light_lookup", (4, 5), lambda x: without(x, 3), "levels"),
    ("light_lookup", 5, lambda nodes: nodes.flip(0), "nodes must ascend"),
    ("sample_rays", 7, lambda out: out[:, :3], "out must be [n, 32]"),
    ("sample_rays", 16, lambda step: 0.0, "step"),
    ("sample_rays", 24, lambda capacity: -1, "capacity must not be negative"),
    ("draw_rays", 1, lambda n: 301, "n_near must be from 0 to the number of rays"),
    ("draw_rays", 4, lambda count: 0, "near has runs without pixels"),
    ("draw_rays", 7, lambda count: 0, "known has no pixels"),
    ("draw_rays", 10, lambda height: 0, "height and width"),
    ("draw_rays", (8, 9), lambda x: x[:0], "there are no views"),
    ("read_pixels", 0, lambda codes: codes.int(), "codes must be uint8, int16 or float32"),
    ("read_pixels", 0, lambda codes: codes[:, :3], "codes"),
    ("read_pixels", 0, lambda codes: codes[:0], "there are no photos"),
    ("read_pixels", 1, lambda index: index + 1, "index must hold numbers of pixels"),
    ("read_pixels", 2, lambda view: view + 1, "view must hold numbers of photos"),
    ("cached_occlusion", 7, lambda order: order + 1, "order"),
    ("cached_occlusion", 11, lambda radiance: radiance[:, :2], "radiance"),
    ("cached_visibility", (2, 3, 5, 7, 8, 9), lambda x: x[:, :0] if len(x) == 4 else x[:0], "must hold at least one"),
    ("vertex_grids", 1, lambda radius: 0.0, "radius"),
    ("occlusion_factors", 5, lambda sky: sky[:0], "at least one texel"),
    ("occlusion_factors", 6, lambda n: 0, "n_specular_rays must be in [1, 2^20]"),
    *(
        ("incoming_light", i, lambda x: x[..., :1], name)
        for i, name in ((11, "albedo_map"), (12, "roughness_metallic_map"), (13, "normal_map"))
    ),
    *(("incoming_light", i, lambda x: x[:0], "must not be empty") for i in (11, 12, 13, 14)),
    *(
        ("incoming_light", i, lambda x: x + torch.nan, f"{name} must be finite")
        for i, name in zip((8, 9, 10, 13, 14), ("normals", "tangents", "uv", "normal textures", "environment radiance"))
    ),
    *(
        ("incoming_light", i, lambda x, more=more: x + more, name)
        for i, name in ((11, "albedo"), (12, "roughness and metallic"))
        for more in (torch.nan, 1.5)
    ),
    ("incoming_light", 14, lambda sky: -sky, "not negative"),
    *(("incoming_light", 15, lambda _, n=n: n, "n_directions must be in [2, 65536]") for n in (1, 1 << 17)),
    *(("incoming_light", 16, lambda _, n=n: n, "max_bounces must be in [0, 64]") for n in (-1, 65)),
    *(("incoming_light", 17, lambda _, x=x: x, "clamp_indirect must not be negative") for x in (-1.0, torch.nan)),
]


@pytest.mark.parametrize(("name", "position", "change", "words"), ERRORS)
def test_what_does_not_fit_is_named(name, position, change, words):
    inputs = list(EVERY[name](torch.float32))
    for i in np.atleast_1d(position):
        inputs[i] = change(inputs[i])
    with pytest.raises(ValueError, match=name) as error:
        getattr(lib, name)(*inputs)
    assert words in str(error.value)


@pytest.mark.parametrize("name", ["occlusion_factors", "incoming_light", "visibility_bits"])
def test_a_released_scene_raises(name):
    handle = MeshScene(np.eye(3), np.array([[0, 1, 2]])).handle
    with pytest.raises(IndexError, match=str(handle)):
        getattr(lib, name)(handle, *EVERY[name](torch.float32)[1:])


# ---- the front page ----

X, ONE = torch.tensor([[0.0, 0.0, 1.0]]), torch.ones(1, 1)
POINT = {"normals": X, "view_dirs": X, "albedo": X, "roughness": ONE, "metallic": ONE, "specular": X, "diffuse": X}
shaded, asked = lambda **others: ops.split_sum_shade(**POINT | others), ops.light_queries


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: shaded(roughness=0.5), "split_sum_shade: roughness must be a tensor, got float"),
        (lambda: shaded(normals=[0, 0, 1]), "split_sum_shade: normals must be a tensor, got list"),
        (lambda: shaded(diffuse=1), "split_sum_shade: diffuse must be a tensor, got int"),
        (lambda: asked(X, None, ONE), "light_queries: view_dirs must be a tensor, got NoneType"),
        (lambda: asked(X, X.to_sparse(), ONE), "light_queries: view_dirs must be dense, got torch.sparse_coo"),
        (lambda: ops.linear_to_srgb(np.ones(3)), "linear_to_srgb: linear must be a tensor, got ndarray"),
        (
            lambda: ops.occlusion_factors(X, X, X, lobe_dirs=X, roughness=ONE, environment=X),
            "occlusion_factors: scene must be a MeshScene, got Tensor",
        ),
        (lambda: ops.light.sample_ggx_lobe(X, ONE, 2.5), "sample_ggx_lobe: n_samples must be of type int, got float"),
        (lambda: shaded(compensate="no"), "split_sum_shade: compensate must be of type bool, got str"),
    ],
)
def test_an_argument_of_another_type_is_named_in_one_line(call, words):
    with pytest.raises(TypeError) as error:
        call()
    assert str(error.value) == words


def test_want_of_memory_is_said():
    """13 PB of directions."""
    with pytest.raises(MemoryError, match="^sample_ggx_lobe: aten::new_empty failed, as a rule for want of memory$"):
        ops.light.sample_ggx_lobe(X.expand(1 << 20, 3), ONE.expand(1 << 20, 1), 1 << 20)


def test_what_is_missing_or_unknown_is_named_by_python():
    for wrong in ({}, POINT | {"colour": X}):
        with pytest.raises(TypeError, match=r"split_sum_shade\(\) (missing|got an unexpected)"):
            ops.split_sum_shade(**wrong)


def batches(*shape: int) -> torch.Tensor:
    return torch.rand(2, 5, *shape, generator=torch.Generator().manual_seed(len(shape)))


SPEC = ops.HashGridSpec(n_levels=2, log2_table_size=6)
SCENE = ops.MeshScene(np.eye(3), np.array([[0, 1, 2]]))
SHADE = {name: batches(1 if name in ("roughness", "metallic") else 3) for name in ops.shading.SHADED}
SUMS = ops.shading.LightSums(*(batches(3) for _ in range(4)))
LIGHT = {"light_dirs": ops.fibonacci_directions(64), "light": torch.ones(64, 3)}
IN_BATCHES = {
    "hash_encode": (ops.hash_encode, {"positions": batches(3)}, {"table": torch.rand(SPEC.n_entries, 2), "spec": SPEC}),
    "light_queries": (ops.light_queries, {k: SHADE[k] for k in ("normals", "view_dirs", "roughness")}, {}),
    "split_sum_shade": (ops.split_sum_shade, SHADE, {}),
    "shade_sums": (ops.shading.shade_sums, {k: SHADE[k] for k in ops.shading.SHADED[:5]} | {"sums": SUMS}, {}),
    "prefilter_light": (ops.prefilter_light, {"query_dirs": batches(3), "roughness": batches(1)}, LIGHT),
    "sample_ggx_lobe": (ops.light.sample_ggx_lobe, {"axes": batches(3), "roughness": batches(1)}, {"n_samples": 3}),
    "occlusion_factors": (
        ops.occlusion_factors,
        {name: batches(3) for name in ("positions", "normals", "lobe_dirs")} | {"roughness": batches(1)},
        {"scene": SCENE, "environment": torch.ones(2, 4, 3)},
    ),
}


@pytest.mark.parametrize("name", IN_BATCHES)
def test_points_may_have_leading_dimensions(name):
    """[2, 5, 3] gives what [10, 3] gives, in that shape; two results a point stand one after the other in the first."""
    call, points, rest = IN_BATCHES[name]
    flat = tree_map(lambda x: x.flatten(0, 1), points)
    found, expected = (tree_flatten(call(**given, **rest))[0] for given in (points, flat))
    for a, b in zip(found, expected, strict=True):
        assert a.shape[1] == 5 and torch.equal(a.flatten(0, 1), b)
    if len(points) == 1:
        return
    last = next(reversed(points))
    other = tree_map(lambda x: x.transpose(0, 1), points[last])
    with pytest.raises(ValueError, match=rf"{name}: {last} must begin with \[2, 5\], got \[5, 2, \d\]"):
        call(**points | {last: other}, **rest)


def test_the_answers_to_queries_may_be_stacked_in_batches():
    stacked = {k: x for k, x in SHADE.items() if k != "diffuse"}
    stacked["specular"] = torch.cat([SHADE["specular"], SHADE["diffuse"]])
    assert torch.equal(ops.split_sum_shade(**stacked), ops.split_sum_shade(**SHADE))


def test_no_occlusion_means_open():
    opened = {k: x for k, x in SHADE.items() if "occlusion" not in k}
    one = torch.ones(2, 5, 3)
    assert torch.equal(ops.split_sum_shade(**opened), ops.split_sum_shade(**opened, occlusion_s=one, occlusion_d=one))
    half = ops.split_sum_shade(**opened, occlusion_d=0.5 * one)
    assert torch.equal(half, ops.split_sum_shade(**opened, occlusion_s=one, occlusion_d=0.5 * one))
