"""The inputs of each operator, for all tests and benchmarks that call every one of them.

A new operator has one line in :data:`CASES`. What a line needs stands above it, family by family; tests of a single operator
take their inputs from here as well.
"""

import functools

import torch
import trimesh
from mesh_shapes import OFFSET, between, cache_of, corners, grid_mesh, lattice, scene_of
from op_checks import as_tuple, generator, lib, rand, unit
from splitnerf.fields.surface import SdfField
from splitnerf.ops import HashGridSpec, MeshScene, fibonacci_directions
from splitnerf.ops.light import light_filters, zonal_factors
from splitnerf.ops.rays import CELL_OCCUPIED, CELL_OPAQUE, PackedSamples
from splitnerf.ops.shading import brdf_lut
from splitnerf_tools.bench import subjects
from torch.utils._pytree import tree_map

# ---- rays: drawn pixels, samples along rays, their weights and colours ----

OFFSETS = [0, 9, 9, 10, 24]  # one ray without samples


def composite_inputs(device, dtype) -> tuple:
    weights = torch.rand(OFFSETS[-1], generator=generator(1), dtype=torch.float64)
    values = torch.randn(OFFSETS[-1], 4, generator=generator(2), dtype=torch.float64)
    return weights.to(device, dtype), values.to(device, dtype), torch.tensor(OFFSETS, device=device)


def march_inputs(device, dtype, n: int = 40) -> tuple:
    """Arguments of ``march_rays``: cameras inside and outside the box, some rays parallel to an axis."""
    draw = generator(3)
    origins = unit(torch.randn(n, 3, generator=draw, dtype=torch.float64))
    origins *= 1 + 2 * torch.rand(n, 1, generator=draw, dtype=torch.float64)
    directions = unit(torch.randn(n, 3, generator=draw, dtype=torch.float64) * 0.4 - origins)
    directions[::8] = torch.tensor([0.0, 0.0, -1.0], dtype=torch.float64)
    jitter = torch.rand(n, generator=draw, dtype=torch.float64)
    cells = torch.randint(0, 12, (7, 7, 7), generator=draw)
    cells = torch.where(cells == 11, CELL_OPAQUE, torch.where(cells > 5, CELL_OCCUPIED, 0)).to(torch.uint8)
    return *(x.to(device, dtype) for x in (origins, directions, jitter)), cells.to(device), 1.5, 0.03, 64


def draw_inputs(dtype, n: int = 300) -> tuple:
    """Arguments of ``draw_rays``: a third of the rays near the runs of two of three photos of 8 x 11 pixels."""
    last, shift = torch.tensor([4, 5, 40]), torch.tensor([10, 30, 200])
    matrices = torch.randn(3, 3, 3, generator=generator(1), dtype=torch.float64)
    none = torch.empty(0, dtype=torch.int64)
    cameras = matrices.to(dtype), torch.arange(9.0, dtype=dtype).view(3, 3)
    return rand(n, dtype=dtype), n // 3, last, shift, 40, none, none, 3 * 8 * 11, *cameras, 8, 11


def read_inputs(dtype, n: int = 300) -> tuple:
    """Arguments of ``read_pixels``: three photos of 40 pixels as words, and two runs of pixels at edges."""
    draw = generator(8)
    codes = torch.randint(-(2**15), 2**15, (120, 4), generator=draw).to(torch.int16)
    index = torch.randint(120, (n,), generator=draw)
    behind = torch.randint(256, (46, 3), generator=draw).to(torch.uint8)
    edges = torch.tensor([3, 60]), torch.tensor([9, 100]), torch.tensor([-3, -54]), behind
    return codes, index, index // 40, rand(3, 3, seed=9, dtype=dtype), rand(n, 3, seed=10, dtype=dtype), *edges


def composite_case(dtype) -> tuple:
    """Arguments of ``composite`` with the rays' opacities, of which one is less than the least."""
    return *composite_inputs("cpu", dtype), torch.tensor([0.9, 0.5, 0.01, 0.7], dtype=dtype), 0.1


def surface_inputs(dtype=torch.float64) -> tuple:
    """Samples of 50 rays around a surface, some seen from behind, one with next to no gradient."""
    _, samples, _ = packed_samples()
    n, g = int(samples.offsets[-1]), generator(8)
    sdf = 0.2 * torch.randn(n, generator=g, dtype=torch.float64)
    gradient = torch.randn(n, 3, generator=g, dtype=torch.float64)
    gradient[5] *= 1e-5
    rays_d = unit(torch.randn(50, 3, generator=g, dtype=torch.float64))
    s = torch.tensor(12.0, dtype=torch.float64)
    return *(x.to(dtype) for x in (sdf, gradient, rays_d, s)), samples.offsets


def surface_case(dtype) -> tuple:
    """Arguments of ``surface_weights``: the distances are the first of three columns, and behind the samples there are others."""
    sdf, gradient, rays_d, s, offsets = surface_inputs(dtype)
    n = len(sdf)
    outputs = torch.cat([torch.stack([sdf, sdf + 1, sdf + 2], 1), rand(70, 3, seed=11, dtype=dtype)])
    gradient = torch.cat([gradient, rand(70, 3, seed=12, dtype=dtype)])
    return outputs, gradient, rays_d, s, offsets, *torch.tensor([0.1, 0.4], dtype=dtype).unbind(), 1e-3, n


def packed_samples(dtype=torch.float64, seed: int = 4) -> tuple:
    """Weights and samples of 50 rays, the third without samples and the fifth without weight."""
    g = generator(seed)
    counts = torch.randint(1, 12, (50,), generator=g)
    counts[2] = 0
    offsets = torch.cat([torch.zeros(1, dtype=torch.int64), counts.cumsum(0)])
    n = int(offsets[-1])
    rays = torch.repeat_interleave(torch.arange(50), counts)
    starts = torch.rand(n, generator=g, dtype=torch.float64).cumsum(0)
    weights = torch.rand(n, generator=g, dtype=torch.float64) ** 4
    weights[rays == 4] = 0
    phase = torch.rand(50, generator=g, dtype=torch.float64)
    samples = PackedSamples(rays, starts.to(dtype), (starts + 0.1).to(dtype), offsets)
    return weights.to(dtype), samples, phase.to(dtype)


def sums_inputs(n: int = 6, dtype=torch.float64, seed: int = 0) -> tuple:
    g = generator(seed)

    def rand(columns: int, lo: float, hi: float) -> torch.Tensor:
        return lo + (hi - lo) * torch.rand(n, columns, generator=g, dtype=dtype)

    normals = unit(torch.randn(n, 3, generator=g, dtype=dtype))
    view_dirs = unit(normals + 0.7 * unit(torch.randn(n, 3, generator=g, dtype=dtype)))
    normals[1::4] *= -1  # which face away from the viewer
    sums = [rand(3, 0.5, 2.0), rand(3, 0.0, 0.3), rand(3, 0.1, 2.0), rand(3, 0.02, 0.5)]
    return normals, view_dirs, rand(3, 0.05, 0.9), rand(1, 0.1, 0.9), rand(1, 0.1, 0.9), torch.stack(sums, 1)


def mixed_sums_inputs(n: int, dtype, compensate: bool = True) -> tuple:
    """Arguments of ``shade_sums`` with another radiance and a share."""
    return *sums_inputs(n, dtype), brdf_lut(), compensate, rand(n, 3, seed=7, dtype=dtype), rand(n, seed=8, dtype=dtype)


# ---- shading by the split sum ----


def query_inputs(device, dtype, mean: bool = True, n: int = 7) -> tuple:
    """Arguments of ``light_queries``; some normals face away from the viewer."""
    normals, views = (unit(torch.randn(n, 3, generator=generator(i), dtype=torch.float64)) for i in (0, 1))
    roughness = torch.rand(n, 1, generator=generator(2), dtype=torch.float64) * 0.8 + 0.1
    return *(x.to(device, dtype) for x in (normals, views, roughness)), brdf_lut(device), mean


def split_sum_inputs(device, dtype, mode: int = 0, compensate: bool = False, channels: int = 1, n: int = 7) -> tuple:
    """Arguments of ``split_sum_shade`` without indirect light."""
    normals, views, roughness, lut, _ = query_inputs(device, dtype, n=n)
    draw = generator(3)
    rest = [torch.rand(n, k, generator=draw, dtype=torch.float64) for k in (3, 1, 3, 3, channels, channels)]
    albedo, metallic, specular, diffuse, occlusion_s, occlusion_d = (x.to(device, dtype) for x in rest)
    points = normals, views, albedo, roughness, metallic
    return *points, 3 * specular, 2 * diffuse, occlusion_s, occlusion_d, lut, mode, compensate, None, None


def indirect_inputs(dtype, mode: int = 0, channels: int = 3, n: int = 300, stacked: bool = False) -> tuple:
    """Arguments of ``split_sum_shade`` with indirect light; `stacked`: the light's answers in one tensor."""
    inputs = split_sum_inputs("cpu", dtype, mode, True, channels, n)
    points, (specular, diffuse), rest = inputs[:5], inputs[5:7], inputs[7:12]
    light = (torch.cat([specular, diffuse]), None) if stacked else (specular, diffuse)
    indirect = (rand(n, 3, seed=seed, dtype=dtype) for seed in (11, 12))
    return *points, *light, *rest, *indirect


# ---- the hash grid ----

HASH_SPEC = HashGridSpec(n_levels=3, n_features=2, base_resolution=3, growth=1.9, log2_table_size=7)


def hash_inputs(device, dtype, n: int = 9) -> tuple:
    """Arguments of ``hash_encode``: points off the cells' faces, some outside, and one closed level."""
    positions = torch.rand(n, 3, generator=generator(), dtype=torch.float64) * 1.1 - 0.05
    table = torch.rand(HASH_SPEC.n_entries, 2, generator=generator(1), dtype=torch.float64) * 2 - 1
    return positions.to(device, dtype), table.to(device, dtype), *HASH_SPEC.arguments(2)


# ---- the light filtered over given directions ----


def prefilter_inputs(device, dtype, n_queries: int = 6, n_lights: int = 40) -> tuple:
    """Arguments of ``prefilter_light``: a lattice of lights, so that every lobe meets some."""
    queries = unit(torch.randn(n_queries, 3, generator=generator(), dtype=torch.float64))
    roughness = torch.rand(n_queries, 1, generator=generator(1), dtype=torch.float64) * 0.8 + 0.2
    lights = fibonacci_directions(n_lights, generator(2), torch.float64)
    light = torch.rand(n_lights, 3, generator=generator(3), dtype=torch.float64) * 5
    return tuple(x.to(device, dtype) for x in (queries, roughness, lights, light))


def prefilter_backward_inputs(device, dtype) -> tuple:
    queries, roughness, lights, light = prefilter_inputs(device, dtype)
    total = lib.prefilter_light(queries, roughness, lights, light)[1]
    return queries, roughness, total, torch.randn(6, 3, generator=generator(4)).to(device, dtype), lights


# ---- the light as a pyramid ----

LIGHT_NODES = (0.05, 0.2, 0.4, 0.5)
LIGHT_RESOLUTIONS = (16, 8, 4)
LIGHT_ROUGHNESS = (0.0, 0.03, 0.1, 0.31, 0.43, 0.49, 0.55, 0.8, 0.97)


def octahedral_directions(n: int) -> torch.Tensor:
    """[n^2, 3] unit float64 directions of the texel centres."""
    return torch.from_numpy(subjects.octahedral_directions(n))


def lookup_inputs(dtype=torch.float64, n: int = 18) -> tuple:
    directions = unit(torch.randn(n, 3, generator=generator(1), dtype=torch.float64))
    roughness = torch.tensor(LIGHT_ROUGHNESS, dtype=torch.float64).repeat(n)[:n, None]
    levels = torch.rand(sum(r * r for r in LIGHT_RESOLUTIONS), 3, generator=generator(2), dtype=torch.float64) + 0.1
    sh = torch.randn(169, 3, generator=generator(3), dtype=torch.float64) * 0.1
    sh[0] = 4.0
    zonal = zonal_factors(LIGHT_NODES[-1], 33)
    floats = (x.to(dtype) for x in (directions, roughness, levels, sh))
    return (*floats, torch.tensor(LIGHT_RESOLUTIONS), torch.tensor(LIGHT_NODES, dtype=torch.float64), zonal.to(dtype))


# ---- losses ----


def pixel_inputs(n: int = 60, dtype=torch.float64) -> tuple:
    """Colours up to 1.6, some below 0; opacities beyond both bounds of the mask's; some channels clipped by the photo; exposures
    from 0.8 to 1.2."""
    target = rand(n, 4, seed=3)
    target[::7, :2] = 1.0
    parts = 1.7 * rand(n, 3) - 0.1, 1.004 * rand(n, seed=1) - 0.002, target, rand(n, 3, seed=4)
    exposure = 0.8 + 0.4 * rand(n, 3, seed=5)
    return *(part.to(dtype) for part in parts), torch.arange(n) % 3 == 1, exposure.to(dtype)


def field_gradients(dtype=torch.float64) -> tuple:
    g = torch.randn(40, 3, generator=generator(), dtype=torch.float64)
    g[30:] = g[[4, 4, 9, 2, 0, 11, 19, 7, 7, 3]] + 0.4 * torch.randn(10, 3, generator=generator(1), dtype=torch.float64)
    beside = torch.tensor([4, 4, 9, 2, 0, 11, 19, 7, 7, 5])  # the last one's neighbour is somewhere else
    return g.to(dtype), rand(20, seed=2, dtype=dtype), beside


# ---- light over drawn and over shared directions ----


def drawn_inputs(n: int = 5, k: int = 6, dtype=torch.float64, seed: int = 0) -> tuple:
    g = generator(seed)
    normals = unit(torch.randn(n, 3, generator=g, dtype=dtype))
    view_dirs = unit(normals + 0.7 * unit(torch.randn(n, 3, generator=g, dtype=dtype)))
    roughness = 0.2 + 0.7 * torch.rand(n, 1, generator=g, dtype=dtype)
    directions = unit(normals[:, None] + torch.randn(n, k, 3, generator=g, dtype=dtype))  # some from below
    pdf = 0.1 + torch.rand(n, k, generator=g, dtype=dtype)
    normals[1::4] *= -1  # which face away from the viewer
    return normals, view_dirs, roughness, directions, pdf, torch.rand(n, k, 3, generator=g, dtype=dtype)


def shared_inputs(n: int = 5, k: int = 24, dtype=torch.float64, with_sent: bool = True) -> tuple:
    g = generator(8)
    normals, view_dirs, roughness = (x.to(dtype) for x in drawn_inputs(n)[:3])
    directions = unit(torch.randn(k, 3, generator=g, dtype=torch.float64)).to(dtype)
    solid_angles, radiance, visible, sent = (
        torch.rand(*shape, generator=g, dtype=torch.float64).to(dtype)
        for shape in ((k,), (k, 3), (n, k), (n if with_sent else 0, k, 3))
    )
    return normals, view_dirs, roughness, directions, solid_angles, radiance, visible, sent


# ---- the distance field ----

BOX, STEP = 1.5, 0.02
SDF_SPEC = HashGridSpec(n_levels=3, n_features=2, base_resolution=4, growth=1.7, log2_table_size=9)


def bumpy_field(scale: float = 0.02) -> SdfField:
    torch.manual_seed(0)
    field = SdfField(SDF_SPEC, BOX, width=32, radius=0.7).double()
    with torch.no_grad():
        field.grid.table.copy_(scale * torch.randn(field.grid.table.shape, generator=generator(), dtype=torch.float64))
        field.hidden_direction[:, 3:] = torch.randn(32, SDF_SPEC.n_outputs, generator=generator(1), dtype=torch.float64)
        field.hidden_length.copy_(field.hidden_direction.norm(dim=1, keepdim=True))
    return field


def field_rays(n: int = 200, dtype=torch.float64) -> tuple:
    g = generator(2)
    origins = 3 * unit(torch.randn(n, 3, generator=g, dtype=dtype))
    directions = unit(0.9 * torch.rand(n, 3, generator=g, dtype=dtype) - 0.45 - origins)
    return origins, directions, torch.rand(n, generator=g, dtype=dtype)


def full_cells(resolution: int = 12) -> torch.Tensor:
    return torch.full((resolution,) * 3, CELL_OCCUPIED, dtype=torch.uint8)


def sampling_settings(**changes) -> dict:
    return dict(step=STEP, s=60.0, min_weight=0.01, min_transmittance=0.0, reach=10.0, lipschitz=1.25) | changes


def sample_rays_inputs(dtype=torch.float64) -> tuple:
    network = bumpy_field().to(dtype).network()._replace(n_active=2)
    s, anneal, min_weight, min_transmittance, reach, lipschitz = 60.0, 1.0, 0.01, 1e-3, 0.1, 1.25
    rules = STEP, 64, s, anneal, min_weight, min_transmittance, reach, lipschitz, 0
    return *field_rays(12, dtype), full_cells(), *network.arguments(), *rules


def sdf_field_inputs(n: int = 7, dtype=torch.float64) -> tuple:
    """Arguments of ``sdf_field``: points off the cells' faces, some outside, and one closed level."""
    g = generator(5)

    def randn(*shape: int) -> torch.Tensor:
        return torch.randn(*shape, generator=g, dtype=torch.float64).to(dtype)

    beta_scale = 0.02  # around the bend of softplus_100
    positions, table = 0.7 * randn(n, 3), randn(SDF_SPEC.n_entries, 2)
    hidden = randn(10, 9), beta_scale * (2 + randn(10, 1)), beta_scale * randn(10)
    out = randn(4, 10), 2 + randn(4, 1), randn(4)
    return positions, table, *hidden, *out, 100.0, *SDF_SPEC.arguments(2), BOX


# ---- cached visibility ----


def cached_occlusion_inputs(dtype, n: int = 9, with_hits: bool = True) -> tuple:
    mesh = grid_mesh(2.0, 5) + trimesh.creation.icosphere(1, 0.5).apply_translation((0, 0, 0.6))
    cache = cache_of(mesh, 64, with_hits=with_hits)
    x, normals = (t[:n].to(dtype) for t in between(mesh, 9))
    lobes = unit(normals + 0.3 * unit(torch.randn(9, 3, generator=generator(1)))[:n].to(dtype))
    roughness = torch.rand(9, 1, generator=generator(2))[:n].to(dtype)
    radiance = torch.rand(len(cache.vertices) if with_hits else 0, 3, generator=generator(3)).to(dtype)
    light = torch.rand(64, 3, generator=generator(4)).to(dtype)
    grids = cache.vertices.to(dtype), cache.normals.to(dtype), cache.starts, cache.order, cache.radius
    return x, normals, lobes, roughness, *grids, cache.bits, cache.hits, radiance, cache.directions.to(dtype), light


def cached_visibility_inputs(dtype, with_hits: bool = True) -> tuple:
    inputs = cached_occlusion_inputs(dtype, with_hits=with_hits)
    return (*inputs[:2], *inputs[4:13])


# ---- rays of meshes, float32 ----


@functools.cache
def floor_under_a_ball() -> MeshScene:
    return scene_of(grid_mesh(2.0, 5) + trimesh.creation.icosphere(1, 0.5).apply_translation((0, 0, 0.6)))


def traced_points(n: int = 9) -> tuple:
    """Points of the floor, normals and the axes of lobes around them."""
    points, normals = (x.contiguous() for x in between(grid_mesh(2.0, 5), n))
    return points, normals, unit(normals + 0.3 * unit(rand(n, 3, seed=1, dtype=torch.float32) - 0.5))


def occlusion_inputs() -> tuple:
    roughness, sky = (rand(*k, dtype=torch.float32) for k in ((9, 1), (8, 16, 3)))
    return floor_under_a_ball().handle, *traced_points(), roughness, sky, 16, 16, OFFSET, 3


def incoming_inputs() -> tuple:
    """Arguments of ``incoming_light``: every texture varies."""
    (points, normals, views), n = traced_points(), len(trimesh.creation.icosphere(1).vertices) + 36
    materials = (rand(9, k, seed=k, dtype=torch.float32) for k in (3, 1, 1))
    maps = (rand(4, 4, k, seed=k, dtype=torch.float32) for k in (3, 2, 3))
    up, along = torch.tensor([0.0, 0, 1]).repeat(n, 1), torch.tensor([1.0, 0, 0, 1]).repeat(n, 1)
    surface, sky = (up, along, rand(n, 2, dtype=torch.float32)), rand(8, 16, 3, dtype=torch.float32)
    return floor_under_a_ball().handle, points, normals, normals, views, *materials, *surface, *maps, sky, 4, 2, 0.0, 3


# ---- every operator ----


def spread_inputs(dtype) -> tuple:
    weights, samples, phase = packed_samples(dtype)
    return weights, samples.middles, samples.offsets, phase, 0.5, 2


def ones_like_outputs(op: str, inputs: tuple) -> tuple:
    """Gradients to an operator's outputs, no two alike."""
    outputs = as_tuple(getattr(lib, op)(*inputs))
    return tuple(
        torch.randn(x.shape, generator=generator(i), dtype=torch.float64).to(x.dtype) for i, x in enumerate(outputs)
    )


def sparse_inputs(dtype) -> tuple:
    matrix = light_filters(8, [(8, 0.3)]).to(dtype)
    return *matrix.rows, *matrix.transposed, torch.rand(64, 3, generator=generator(), dtype=torch.float64).to(dtype)


def interpolation(dtype) -> tuple:
    first = torch.tensor([0, 0, 1, 2, 2, 4])
    share = torch.rand(6, generator=generator(), dtype=torch.float64).to(dtype)
    values = torch.randn(5, 4, generator=generator(1), dtype=torch.float64).to(dtype)
    return values, first, first.clamp(max=3) + 1, share


def interpolation_backward(dtype) -> tuple:
    values, first, second, share = interpolation(dtype)
    return torch.randn(6, 4, generator=generator(2), dtype=torch.float64).to(dtype), first, second, share, values


def with_gradients(op: str, inputs: tuple, *between: int) -> tuple:
    """The inputs of the backward pass: those of the forward one, some of its outputs, the gradients to all of them."""
    outputs = as_tuple(getattr(lib, op)(*inputs))
    return *inputs, *(outputs[i] for i in between), *ones_like_outputs(op, inputs)


def hash_backward(op: str, dtype, first: int) -> tuple:
    """positions (and from `first` = 2 the table), the gradients, the grid's numbers."""
    inputs = hash_inputs("cpu", dtype, 200)
    return *inputs[:first], *ones_like_outputs(op, inputs), *inputs[2:]


# The inputs of each operator by its name, on the CPU, in the dtype asked for.
CASES = {
    "hash_encode": lambda t: hash_inputs("cpu", t, 200),
    "hash_encode_backward": lambda t: hash_backward("hash_encode", t, 1),
    "hash_encode_backward_positions": lambda t: hash_backward("hash_encode", t, 2),
    "light_queries": lambda t: query_inputs("cpu", t, True, 300),
    "light_queries_backward": lambda t: with_gradients("light_queries", query_inputs("cpu", t, True, 300)),
    "split_sum_shade": indirect_inputs,
    "split_sum_shade_backward": lambda t: with_gradients("split_sum_shade", indirect_inputs(t, 1, 1, stacked=True)),
    "prefilter_light": lambda t: prefilter_inputs("cpu", t, 100, 900),
    "prefilter_light_backward": lambda t: prefilter_backward_inputs("cpu", t),
    "sample_ggx_lobe": lambda t: (*prefilter_inputs("cpu", t, 50)[:2], 70, 3),
    "sparse_product": sparse_inputs,
    "light_lookup": lambda t: lookup_inputs(t, 300),
    "light_lookup_backward": lambda t: with_gradients("light_lookup", lookup_inputs(t, 300)),
    "monte_carlo_light": lambda t: drawn_inputs(40, 70, t),
    "monte_carlo_light_backward": lambda t: with_gradients("monte_carlo_light", drawn_inputs(40, 70, t)),
    "summed_light": lambda t: shared_inputs(40, dtype=t),
    "summed_light_backward": lambda t: with_gradients("summed_light", shared_inputs(40, dtype=t)),
    "shade_sums": lambda t: mixed_sums_inputs(300, t),
    "shade_sums_backward": lambda t: with_gradients("shade_sums", mixed_sums_inputs(300, t)),
    "linear_to_srgb": lambda t: (rand(40, 7, dtype=t),),
    "linear_to_srgb_backward": lambda t: (rand(40, 7, dtype=t), rand(40, 7, seed=1, dtype=t)),
    "srgb_to_linear": lambda t: (rand(40, 7, dtype=t),),
    "pixel_losses": lambda t: (*pixel_inputs(600, t), True),
    "pixel_losses_backward": lambda t: with_gradients("pixel_losses", (*pixel_inputs(600, t), True)),
    "gradient_losses": field_gradients,
    "gradient_losses_backward": lambda t: with_gradients("gradient_losses", field_gradients(t), 1)[:-1],
    "quadratic_entropy": lambda t: (rand(70, 11, dtype=t),),
    "light_prior": lambda t: (3 * rand(336, 3, dtype=t) - 1, [16, 64, 256]),
    "light_prior_backward": lambda t: with_gradients("light_prior", CASES["light_prior"](t)),
    "draw_rays": draw_inputs,
    "read_pixels": read_inputs,
    "march_rays": lambda t: march_inputs("cpu", t, 300),
    "surface_weights": surface_case,
    "surface_weights_backward": lambda t: with_gradients("surface_weights", surface_case(t), 1),
    "composite": composite_case,
    "composite_backward": lambda t: with_gradients("composite", composite_case(t)),
    "spread_samples": spread_inputs,
    "sample_rays": sample_rays_inputs,
    "sdf_field": lambda t: sdf_field_inputs(150, t),
    "sdf_field_backward": lambda t: with_gradients("sdf_field", sdf_field_inputs(150, t)),
    "sdf_values": lambda t: (sample_rays_inputs(t)[0], *sample_rays_inputs(t)[4:16]),
    "cached_occlusion": cached_occlusion_inputs,
    "cached_visibility": cached_visibility_inputs,
    "interpolate": interpolation,
    "interpolate_backward": interpolation_backward,
}
# Those that are worked out on the CPU alone: by Embree, or once a mesh.
ON_THE_CPU_ALONE = {
    "occlusion_factors": lambda _: occlusion_inputs(),
    "incoming_light": lambda _: incoming_inputs(),
    "visibility_bits": lambda _: (floor_under_a_ball().handle, *traced_points()[:2], lattice(64), OFFSET, True),
    "vertex_grids": lambda _: (corners(grid_mesh(2.0, 5))[0], 0.4, 3),
}
EVERY = CASES | ON_THE_CPU_ALONE
OPERATORS = {*EVERY, "adamw_steps_"}  # the last one has no outputs: see test_ops_adamw.py

# Which samples there are depends on roundings: the truth is the CPU's own in the same dtype.
ROUNDED_ALIKE = {"march_rays", "spread_samples", "sample_rays"}
STAY_ON_THE_CPU = {"light_lookup": (4, 5), "light_lookup_backward": (4, 5)}  # resolutions and nodes


def moved(op: str, inputs: tuple, device: str) -> tuple:
    """The inputs on a device, but for those that an operator reads on the CPU."""
    stay = STAY_ON_THE_CPU.get(op, ())
    there = tree_map(lambda x: x.to(device) if isinstance(x, torch.Tensor) else x, inputs)
    return tuple(x if i in stay else y for i, (x, y) in enumerate(zip(inputs, there)))


def truth(inputs: tuple) -> tuple:
    """The same numbers in float64, but the table of the split sum, which is float32."""
    is_table = lambda x: x.shape == (32, 32, 4)
    doubled = lambda x: x.double() if x.is_floating_point() and not is_table(x) else x
    return tree_map(lambda x: doubled(x) if isinstance(x, torch.Tensor) else x, inputs)


# Largest error of an operator's results, relative to the largest number of each.
TOLERANCE = {torch.float64: 1e-11, torch.float32: 2e-5}


def check_against_the_cpu(op: str, dtype: torch.dtype, device: str) -> None:
    """Raises AssertionError where the operator on a device is farther from the CPU in float64 than :data:`TOLERANCE`."""
    inputs = CASES[op](dtype)
    expected = as_tuple(getattr(lib, op)(*(inputs if op in ROUNDED_ALIKE else truth(inputs))))
    for got, x in zip(as_tuple(getattr(lib, op)(*moved(op, inputs, device))), expected):
        assert got.device.type == device and got.shape == x.shape, f"{op}: {list(got.shape)} on {got.device}"
        scale = float(x.double().abs().max()) if x.numel() else 1.0
        torch.testing.assert_close(got.cpu().double(), x.double(), rtol=0, atol=TOLERANCE[dtype] * max(scale, 1e-30))
