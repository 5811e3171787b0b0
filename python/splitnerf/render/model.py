"""The scene as one module: surface, materials, occlusion and light, and how they make radiance."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn

from splitnerf.config import Config
from splitnerf.fields import (
    Light,
    LightMlp,
    LightPyramid,
    MaterialHead,
    Occlusion,
    OcclusionHead,
    OcclusionQuery,
    SdfField,
    VisibilityBits,
)
from splitnerf.fields.sdf import SdfSample, sharpness
from splitnerf.fields.visibility import TracedBits
from splitnerf.ops import HashGridSpec, MeshScene, query_direction, shade_sums, split_sum_shade, summed_light

START_BOUNCES = 3  # of indirect light on a new mesh
SUMMED_BAND = 0.15  # of roughness, in which the sum over directions takes the split sum's place


class ShadedPoints(NamedTuple):
    """Materials, occlusion and outgoing light of points.

    Attributes:
        radiance: [n, 3] linear, towards the camera.
        albedo: [n, 3] linear.
        roughness, metallic: [n, 1].
        occlusion_d, occlusion_s: [n, 1] or [n, 3], 1 = open.
        facing: [n, 3] the normals, turned to the viewer.
        lobe_dirs: [n, 3], where the light was asked for the specular lobe.
    """

    radiance: Tensor
    albedo: Tensor
    roughness: Tensor
    metallic: Tensor
    occlusion_d: Tensor
    occlusion_s: Tensor
    facing: Tensor
    lobe_dirs: Tensor


def make_light(config: Config) -> Light:
    """The light that the configuration names."""
    if config.light == "pyramid":
        return LightPyramid(config.light_resolution)
    return LightMlp(
        config.light_width, config.light_layers, config.light_direction_frequencies,
        config.light_roughness_frequencies, config.light_activation,
    )  # fmt: skip


def make_occlusion(config: Config, n_inputs: int) -> OcclusionHead | VisibilityBits | None:
    """What the setting ``occlusion`` names; None for ``off``."""
    c = config
    if c.occlusion == "mlp":
        return OcclusionHead(
            n_inputs, c.occlusion_width, c.occlusion_layers, c.occlusion_channels, c.occlusion_directional
        )
    if c.occlusion == "bits":
        return VisibilityBits(
            c.occlusion_directions, c.occlusion_offset, c.occlusion_channels, c.indirect, c.open_below
        )
    return None


def turned_to(normals: Tensor, view_dirs: Tensor) -> Tensor:
    """Normals [n, 3] on the viewer's side."""
    side = (normals.detach() * view_dirs).sum(-1, keepdim=True)
    return normals * torch.copysign(torch.ones_like(side), side)


class SceneModel(nn.Module):
    """All learned parts of a scene.

    Args:
        config: The run's settings.
    """

    def __init__(self, config: Config):
        super().__init__()
        self.config = config
        spec = HashGridSpec(
            config.n_levels, config.n_features, config.base_resolution, config.growth, config.log2_table_size
        )
        dtype = None if config.table_dtype == "float32" else getattr(torch, config.table_dtype)
        self.sdf_field = SdfField(spec, config.box, config.sdf_width, config.sdf_outputs, config.sphere_radius, dtype)
        n_inputs = config.sdf_outputs + (3 + spec.n_outputs if config.head_inputs == "grid" else 0)
        self.material = MaterialHead(
            n_inputs, config.material_width, config.material_layers, config.initial_roughness, config.min_roughness
        )
        self.occlusion = make_occlusion(config, n_inputs)
        self.light = make_light(config)
        self.variance = nn.Parameter(torch.tensor(config.initial_variance))
        self.occlusion_ready = False  # until the first mesh was traced the occlusion factors are 1

    @property
    def device(self) -> torch.device:
        """Where the parameters are."""
        return self.variance.device

    @property
    def s(self) -> Tensor:
        """Sharpness of the NeuS density."""
        return sharpness(self.variance)

    @property
    def s_value(self) -> float:
        """:attr:`s` as a number."""
        return float(self.s.detach())

    def open_levels(self, progress: float) -> None:
        """Opens hash-grid levels one after the other until ``levels_open_by`` of the run."""
        c = self.config
        share = min(1.0, progress / c.levels_open_by) if c.levels_open_by > 0 else 1.0
        self.sdf_field.grid.n_active = min(c.n_levels, c.start_levels + int(share * (c.n_levels - c.start_levels)))

    def surface(self, positions: Tensor) -> SdfSample:
        """The SDF, its features and gradient at positions [n, 3]."""
        if self.config.normals == "analytic":
            return self.sdf_field.sample(positions)
        return self.sdf_field.sample_finite_difference(positions)

    def head_inputs(self, positions: Tensor, outputs: Tensor, features: Tensor) -> Tensor:
        if self.config.head_inputs == "outputs":
            return outputs
        return torch.cat([outputs, positions, features], dim=1)

    def shade(
        self,
        positions: Tensor,
        outputs: Tensor,
        features: Tensor,
        normals: Tensor,
        view_dirs: Tensor,
        stretches: tuple[Tensor, Tensor] | None = None,
    ) -> ShadedPoints:
        """Outgoing radiance of points towards the camera.

        Args:
            positions: [n, 3].
            outputs, features: [n, 13] and [n, C] of the SDF there.
            normals, view_dirs: [n, 3] unit; view_dirs point to the camera.
            stretches: [k] the points whose cached visibility serves all of their stretch of a ray, and [n] the stretch of
                each point; None: each its own.

        Source: SplitNeRF Eq. (6)-(10), (17).
        """
        c = self.config
        inputs = self.head_inputs(positions, outputs, features)
        albedo, roughness, metallic = self.material(inputs)
        lobe_dirs = query_direction(normals, view_dirs, roughness, c.query)
        n, facing = len(normals), turned_to(normals, view_dirs)
        light = self.light(torch.cat([lobe_dirs, facing]), torch.cat([roughness, torch.ones_like(roughness)]))
        query = OcclusionQuery(inputs, positions - normals * outputs[:, :1], facing, lobe_dirs, roughness)
        occlusion = self.occlusion_factors(query, stretches if isinstance(self.occlusion, VisibilityBits) else None)
        light_s, light_d = light[:n], light[n:]
        factor_s, factor_d = occlusion.specular, occlusion.diffuse
        if occlusion.indirect_specular is not None:
            light_s = factor_s * light_s + occlusion.indirect_specular
            light_d = factor_d * light_d + occlusion.indirect_diffuse
            factor_s = factor_d = torch.ones_like(roughness)
        radiance = split_sum_shade(
            normals, view_dirs, albedo, roughness, metallic, light_s, light_d, factor_s, factor_d,
            c.fresnel_mode, c.compensate,
        )  # fmt: skip
        return ShadedPoints(radiance, albedo, roughness, metallic, occlusion.diffuse, occlusion.specular, facing, lobe_dirs)

    def summed_less_split(
        self, on_surface: Tensor, normals: Tensor, view_dirs: Tensor, points: ShadedPoints, among: Tensor,
        n_among: Tensor | None = None,
    ) -> tuple[Tensor, Tensor]:  # fmt: skip
        """What radiance gains without the split: the BRDF summed over the light from the bits' directions.

        The sum takes the split sum's place smoothly where lobes are wide enough for so few directions: at 256 of them
        between a roughness of .3 and .45. Narrower ones gain nothing.

        Args:
            on_surface: [n, 3].
            normals, view_dirs: [n, 3] unit.
            points: What :meth:`shade` gave for them.
            among: [k] int64, the points that are asked for.
            n_among: [] how many of these count; others gain 0, nobody looks at who gains something, and no GPU is waited for.
                None: all.

        Returns:
            at: [m] int64, those of the points that gain something; with ``n_among`` all of ``among``.
            gained: [m, 3].

        Source: SplitNeRF Eq. (4)-(6), by quadrature.
        """
        over = (points.roughness.detach()[among, 0] - self.occlusion.summed_from) / SUMMED_BAND + 0.5
        if n_among is None:
            wide = (over > 0).nonzero().squeeze(1)
            at, t = among[wide], over[wide, None].clamp(max=1.0)
        else:
            counts = torch.arange(len(among), device=among.device) < n_among
            at, t = among, (over * counts)[:, None].clamp(0.0, 1.0)
        taken = normals, points.albedo, points.roughness, points.metallic, points.radiance
        normals, albedo, roughness, metallic, split = (x.index_select(0, at) for x in taken)
        view_dirs = view_dirs[at]
        light = self.occlusion.cell_light(self.light)
        visible, sent = self.occlusion.visibility(on_surface[at], points.facing.detach()[at])
        sums = summed_light(
            normals, view_dirs, roughness, light.directions, light.solid_angles, light.radiance, visible, sent
        )
        radiance = shade_sums(normals, view_dirs, albedo, roughness, metallic, sums, self.config.compensate)
        return at, (radiance - split) * (t * t * (3.0 - 2.0 * t))

    @property
    def sums_light(self) -> bool:
        """Whether :meth:`summed_less_split` stands in for the split sum: once there is a mesh."""
        return self.config.shading == "summed" and self.occlusion_ready

    def occlusion_factors(self, query: OcclusionQuery, stretches: tuple[Tensor, Tensor] | None = None) -> Occlusion:
        """The factors at surface points, or of their stretches; 1 before the first mesh. The geometry gets no gradient."""
        if self.occlusion is None or not self.occlusion_ready:
            ones = torch.ones_like(query.roughness).expand(-1, self.config.occlusion_channels)
            return Occlusion(ones, ones)
        query = OcclusionQuery(query.inputs, *(part.detach() for part in query[1:]))
        if stretches is None:
            return self.occlusion(query)
        leaders, stretch = stretches
        answers = self.occlusion(OcclusionQuery(*(part[leaders] for part in query)))
        return Occlusion(*(None if part is None else part[stretch] for part in answers))

    def use_mesh(self, scene: MeshScene, vertices: Tensor, faces: Tensor, bits: TracedBits | None = None) -> None:
        """From now on occlusion factors count; bits are those of this mesh, and its light bounces a few times.

        Args:
            scene: The mesh below.
            vertices, faces: [n, 3], [m, 3], on the CPU.
            bits: What its vertices see, where somebody has traced it; None: it is traced now.
        """
        self.occlusion_ready = self.occlusion is not None
        if isinstance(self.occlusion, VisibilityBits):
            self.occlusion.take(bits or self.occlusion.traced(scene, vertices, faces))
            self.refresh_light()
            for _ in range(START_BOUNCES):
                self.refresh_indirect()

    def prepare(self) -> None:
        """Computes what follows from the parameters as they stand and is kept, so that no step does."""
        self.sdf_field.grid.stored()
        self.light.prepare()
        if self.sums_light:
            self.occlusion.cell_light(self.light)

    def refresh_light(self) -> None:
        """Hands the current light to the occlusion's weights, where these do not come from traced rays."""
        if isinstance(self.occlusion, VisibilityBits):
            self.occlusion.set_light(self.light)

    def refresh_indirect(self) -> None:
        """Shades the cached mesh anew, by the split sum, with the light that it sent so far. The view is the normal's."""
        if isinstance(self.occlusion, VisibilityBits):
            self.occlusion.refresh(self._radiance_along_normal)

    def _radiance_along_normal(self, positions: Tensor, normals: Tensor) -> Tensor:
        field = self.surface(positions)
        return self.shade(positions, field.outputs, field.features, normals, normals).radiance
