"""The inputs with which the self-test asks every operator.

An argument has the value that :func:`usual` gives its name,
or the operator's own in :data:`OWN`. They are the same numbers in
float32 and in float64, on every device.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np
import torch
from splitnerf import _core
from splitnerf.ops import HashGridSpec, MeshScene
from splitnerf.ops.light import sh_projection, zonal_factors
from splitnerf.ops.shading import brdf_lut
from torch import Tensor

N = 38  # points: two full vectors of 16 and a rest
SPEC = HashGridSpec(n_levels=2, n_features=2, base_resolution=4, growth=2.0, log2_table_size=7)
RAYS = torch.tensor([0, 16, 16, N])  # where the samples of three rays begin and end; the second has none

# The arguments to which an operator has a gradient.
DIFFERENTIABLE = {
    "composite": "weights values opacity",
    "gradient_losses": "gradients",
    "hash_encode": "positions table",
    "interpolate": "values",
    "light_lookup": "directions roughness levels sh",
    "light_prior": "texels",
    "light_queries": "normals roughness",
    "linear_to_srgb": "linear",
    "monte_carlo_light": "normals roughness radiance",
    "pixel_losses": "mean opacity",
    "prefilter_light": "light",
    "sdf_field": "table hidden hidden_length hidden_bias out out_length out_bias",
    "shade_sums": "normals view_dirs albedo roughness metallic sums other",
    "sparse_product": "values",
    "split_sum_shade": "normals view_dirs albedo roughness metallic specular diffuse occlusion_s occlusion_d",
    "summed_light": "normals roughness radiance",
    "surface_weights": "sdf gradient s",
}


def pattern(*shape: int) -> Tensor:
    """Numbers between 0.5 and 1.5, no two alike."""
    return 1 + 0.5 * torch.sin(torch.arange(math.prod(shape), dtype=torch.float32)).reshape(shape)


def sphere(n: int) -> Tensor:
    """[n, 3] evenly spread unit directions, from +z to -z; none lies on an axis or between two."""
    turn = torch.tensor([[math.cos(1), math.sin(1), 0.0], [-math.sin(1), math.cos(1), 0.0], [0.0, 0.0, 1.0]])
    return torch.tensor(_core.fibonacci_sphere(n), dtype=torch.float32) @ turn


def axis(x: float, y: float, z: float, n: int = N) -> Tensor:
    """[n, 3] copies of a vector."""
    return torch.tensor([[x, y, z]]).repeat(n, 1)


@cache
def square() -> MeshScene:
    """A square around the z axis; as it stands, a face of a cube around the origin."""
    corners = np.array([(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)], np.float32)
    return MeshScene(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32))


def usual() -> dict[str, object]:
    """What arguments of these names are."""
    views = torch.nn.functional.normalize(sphere(N) + 0.8 * sphere(N).flip(0), dim=1)
    network = dict(
        hidden=pattern(5, 7) - 1, hidden_bias=pattern(5), out=pattern(3, 5) - 1, out_bias=pattern(3), beta=2.0
    )
    grid = dict(zip(("n_levels", "base_resolution", "growth", "log2_table_size", "n_active"), SPEC.arguments(2)))
    cached = dict(
        vertices=torch.zeros(1, 3),
        vertex_normals=axis(0.0, 0.0, 1.0, 1),
        starts=torch.tensor([[0, 1]], dtype=torch.int32),
        order=torch.tensor([[0]], dtype=torch.int32),
        radius=1.0,
        hits=torch.zeros(1, 64, dtype=torch.int32),
        bits=torch.tensor([[[0xFFFF, 0], [-0x10000, 0]]], dtype=torch.int32),
    )
    return (
        network
        | grid
        | cached
        | dict(
            normals=sphere(N),
            view_dirs=views,
            lobe_dirs=views,
            roughness=torch.linspace(0.05, 1, N)[:, None],
            lut=brdf_lut(),
            metallic=torch.linspace(0.9, 0.1, N)[:, None],
            albedo=0.6 * pattern(N, 3),
            mean=True,
            compensate=True,
            fresnel_mode=0,
            specular=pattern(N, 3),
            diffuse=2 * pattern(N, 3),
            occlusion_s=0.6 * pattern(N, 1),
            occlusion_d=0.5 * pattern(N, 1),
            indirect_s=0.3 * pattern(N, 3),
            indirect_d=0.1 * pattern(N, 3),
            other=pattern(N, 3),
            share=0.6 * pattern(N),
            sums=pattern(N, 4, 3) * torch.tensor([1.0, 0.1, 0.8, 0.05])[:, None],
            offsets=RAYS,
            s=torch.tensor(8.0),
            positions=0.52 + 0.45 * sphere(N),
            table=pattern(SPEC.n_entries, 2),
            box=1.5,
            directions=sphere(64),
            radiance=pattern(64, 3),
            weights=0.05 * pattern(N),
            opacity=0.6 * pattern(N),
            index=torch.arange(N).flip(0),
            jitter=torch.zeros(N),
            step=0.1,
            min_transmittance=0.0,
            light_dirs=sphere(256),
            light=pattern(256, 3),
            n_samples=64,
            seed=0,
            linear=pattern(N) - 0.5,
            srgb=pattern(N) - 0.5,
            texels=2 * pattern(N, 3) - 2,
            level_sizes=[4, N - 4],
            x=pattern(N, 4),
            values=pattern(5, 3),
            first=torch.arange(N) % 4,
            second=torch.arange(N) % 4 + 1,
            min_roughness=0.2,
            rays_o=axis(0.0, 0.0, 3.0),
            rays_d=axis(0.0, 0.0, -1.0),
            max_samples=64,
            environment=pattern(4, 8, 3),
            scene=square().handle,
        )
    )


def cells() -> Tensor:
    """A third empty, one occupied, one opaque."""
    return torch.tensor([0, 1, 2], dtype=torch.uint8)[:, None, None].repeat(1, 3, 3)


def ahead() -> Tensor:
    """Distances along rays that cross a flat surface at a right angle."""
    return torch.cat([0.8 - 0.1 * torch.arange(16), 1.0 - 0.1 * torch.arange(22)])


def camera() -> dict:
    """One photo of a row, half of whose pixels is listed."""
    half = N // 2
    return dict(
        random=torch.full((N,), 0.5),
        n_near=half,
        near_last=torch.tensor([half]),
        near_shift=torch.tensor([0]),
        near_count=half,
        known_last=torch.tensor([N - half]),
        known_shift=torch.tensor([half]),
        known_count=N - half,
        matrices=torch.eye(3)[None],
        origins=torch.tensor([[1.0, 2.0, 3.0]]),
        height=1,
        width=N,
    )


def photo() -> dict:
    """Bytes of two photos in turn; every pixel from the fifth on has a colour of its own behind it."""
    codes = torch.arange(4 * N, dtype=torch.uint8).reshape(N, 4)
    return dict(
        codes=codes,
        index=torch.arange(N),
        view=torch.arange(N) % 2,
        exposures=pattern(2, 3),
        backgrounds=pattern(N, 3),
        edge_starts=torch.tensor([4]),
        edge_ends=torch.tensor([N]),
        edge_shift=torch.tensor([-4]),
        edge_behind=codes[4:, :3].contiguous() + 90,
    )


def sphere_light() -> dict:
    """A map of 8 x 8 texels, and its harmonics from a roughness of 0.5 on."""
    levels = pattern(64, 3)
    return dict(
        directions=sphere(N),
        roughness=torch.linspace(0.01, 1.1, N)[:, None],
        levels=levels,
        sh=sh_projection(8, True).float() @ levels,
        resolutions=torch.tensor([8]),
        nodes=torch.tensor([0.1, 0.5], dtype=torch.float64),
        zonal=zonal_factors(0.5, 5).float(),
    )


def matrix() -> dict:
    """((1, 2), (0, 3)) and its transpose."""
    return dict(
        offsets=torch.tensor([0, 2, 3]),
        columns=torch.tensor([0, 1, 1], dtype=torch.int32),
        weights=torch.tensor([1.0, 2.0, 3.0]),
        places=torch.arange(2, dtype=torch.int32)[:, None],
        images=torch.arange(2, dtype=torch.int32)[:, None],
        transposed_offsets=torch.tensor([0, 1, 3]),
        transposed_columns=torch.tensor([0, 0, 1], dtype=torch.int32),
        transposed_weights=torch.tensor([1.0, 2.0, 3.0]),
        transposed_places=torch.arange(2, dtype=torch.int32)[:, None],
        transposed_images=torch.arange(2, dtype=torch.int32)[:, None],
        values=pattern(2, 3),
    )


def mirror() -> dict:
    """A point before a square, which is a rough white mirror."""
    return dict(
        positions=torch.zeros(1, 3),
        geometric_normals=axis(0.0, 0.0, 1.0, 1),
        normals=axis(0.0, 0.0, 1.0, 1),
        view_dirs=axis(0.6, 0.0, 0.8, 1),
        albedo=axis(0.5, 0.6, 0.7, 1),
        roughness=torch.full((1, 1), 0.8),
        metallic=torch.full((1, 1), 0.3),
        vertex_normals=axis(0.0, 0.0, -1.0, 4),
        tangents=torch.tensor([[1.0, 0.0, 0.0, 1.0]]).repeat(4, 1),
        uv=torch.zeros(4, 2),
        albedo_map=torch.ones(1, 1, 3),
        roughness_metallic_map=torch.tensor([[[0.5, 0.5]]]),
        normal_map=torch.tensor([[[0.0, 0.0, 1.0]]]),
        n_directions=256,
        max_bounces=3,
        clamp_indirect=0.0,
    )


def optimiser() -> dict:
    """One step of two parameters."""
    params, grads = ([x(N), x(5)] for x in (pattern, lambda n: pattern(n) - 1))
    return dict(
        params=params,
        grads=grads,
        exp_avgs=[0.1 * p for p in params],
        exp_avg_sqs=[0.2 * p for p in params],
        lrs=[0.1, 0.2],
        beta1=0.9,
        beta2=0.99,
        eps=1e-15,
        weight_decays=[0.5, 0.0],
        steps=[1, 3],
        sparse=[False, True],
        copies=[torch.zeros(5).half()],
        copied=[1],
        allowed=None,
    )


OWN: dict[str, Callable[[], dict[str, object]]] = {
    "adamw_steps_": optimiser,
    "cached_occlusion": lambda: dict(
        positions=0.2 * sphere(N),
        normals=axis(0.0, 0.0, 1.0),
        lobe_dirs=axis(0.0, 0.0, 1.0),
        radiance=pattern(1, 3),
        light=pattern(64, 3),
    ),
    "cached_visibility": lambda: dict(positions=0.2 * sphere(N), normals=axis(0.0, 0.0, 1.0), radiance=pattern(1, 3)),
    "composite": lambda: dict(values=pattern(N, 3), opacity=pattern(3), least_opacity=0.75),
    "draw_rays": camera,
    "gradient_losses": lambda: dict(
        gradients=pattern(N, 3) - 0.8, weights=pattern(16), beside=torch.arange(N - 16) % 16
    ),
    "incoming_light": mirror,
    "light_lookup": sphere_light,
    "march_rays": lambda: dict(
        rays_o=torch.cat([torch.full((N, 1), -3.0), pattern(N, 2) - 1], 1), rays_d=axis(1.0, 0.0, 0.0), cells=cells()
    ),
    "monte_carlo_light": lambda: dict(
        light_dirs=sphere(32)[:16].repeat(N, 1, 1), pdf=pattern(N, 16), radiance=pattern(N, 16, 3)
    ),
    "occlusion_factors": lambda: dict(positions=0.3 * sphere(N), n_diffuse_rays=64, n_specular_rays=64, offset=0.0125),
    "pixel_losses": lambda: dict(
        mean=0.1 * pattern(N, 3),
        opacity=0.5 * pattern(N),
        target=0.6 * pattern(N, 4),
        background=0.4 * pattern(N, 3),
        whole=torch.arange(N) % 2 == 1,
        exposure=pattern(N, 3),
        linear=True,
    ),
    "prefilter_light": lambda: dict(query_dirs=sphere(N), roughness=torch.full((N, 1), 0.5)),
    "read_pixels": photo,
    "sample_ggx_lobe": lambda: dict(axes=sphere(N)),
    "sample_rays": lambda: dict(
        cells=torch.ones(2, 2, 2, dtype=torch.uint8),
        table=torch.zeros(SPEC.n_entries, 2),
        hidden=torch.tensor([[0.0, 0.0, 1.0] + 4 * [0.0]]),
        hidden_bias=torch.zeros(1),
        out=torch.ones(1, 1),
        out_bias=torch.zeros(1),
        beta=1.0,
        s=10.0,
        anneal=1.0,
        min_weight=0.0,
        reach=10.0,
        lipschitz=1.25,
        capacity=30 * N + 1,
    ),
    "sdf_field": lambda: dict(
        positions=2.7 * (sphere(N) / 6), hidden_length=1 + pattern(5, 1), out_length=1 + pattern(3, 1), stored=None
    ),
    "sdf_values": lambda: dict(positions=sphere(N)),
    "sparse_product": matrix,
    "spread_samples": lambda: dict(
        weights=torch.tensor([2.0, 0.0, 0.0, 1.0]).repeat(N),
        t=torch.tensor([0.0, 1.0, 2.0, 4.0]).repeat(N),
        offsets=4 * torch.arange(N + 1),
        phase=torch.full((N,), 0.5),
        gap=10.0,
        per_ray=2,
    ),
    "summed_light": lambda: dict(solid_angles=pattern(64), visible=0.5 * pattern(N, 64), sent=pattern(N, 64, 3)),
    "surface_weights": lambda: dict(
        sdf=ahead() - 0.05,
        gradient=pattern(N, 3).flip(0),
        rays_d=axis(0.0, 0.0, -1.0, 3),
        step=torch.tensor(0.1),
        anneal=torch.tensor(1.0),
        n_samples=-1,
    ),
    "vertex_grids": lambda: dict(
        vertices=torch.cat([axis(0.0, 0.0, 0.0, 16), axis(5.0, 6.0, 7.0, N - 16)]), radius=0.1, n_levels=3
    ),
    "visibility_bits": lambda: dict(
        positions=torch.zeros(1, 3), normals=axis(0.0, 0.0, 1.0, 1), offset=0.0, with_hits=True
    ),
}
