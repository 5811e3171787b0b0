"""The scene as one module: surface, materials, occlusion and light, and how they make radiance."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn

from splitnerf.config import Config
from splitnerf.fields import LightMlp, LightPyramid, MaterialHead, OcclusionHead, SdfField
from splitnerf.fields.sdf import SdfSample, sharpness
from splitnerf.ops import HashGridSpec, query_direction, split_sum_shade


class ShadedPoints(NamedTuple):
    """Materials, occlusion and outgoing light of points.

    Attributes:
        radiance: [n, 3] linear, towards the camera.
        albedo: [n, 3] linear.
        roughness, metallic: [n, 1].
        occlusion_d, occlusion_s: [n, 1] or [n, 3], 1 = open.
        lobe_dirs: [n, 3], where the light was asked for the specular lobe.
    """

    radiance: Tensor
    albedo: Tensor
    roughness: Tensor
    metallic: Tensor
    occlusion_d: Tensor
    occlusion_s: Tensor
    lobe_dirs: Tensor


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
        self.sdf_field = SdfField(spec, config.box, config.sdf_width, config.sdf_outputs, config.sphere_radius)
        n_inputs = config.sdf_outputs + (3 + spec.n_outputs if config.head_inputs == "grid" else 0)
        self.material = MaterialHead(
            n_inputs, config.material_width, config.material_layers, config.initial_roughness
        )
        self.occlusion = (
            OcclusionHead(
                n_inputs, config.occlusion_width, config.occlusion_layers, config.occlusion_channels,
                config.occlusion_directional,
            )  # fmt: skip
            if config.occlusion == "mlp"
            else None
        )
        self.light = (
            LightPyramid(config.light_resolution)
            if config.light == "pyramid"
            else LightMlp(
                config.light_width, config.light_layers, config.light_direction_frequencies,
                config.light_roughness_frequencies, config.light_activation,
            )  # fmt: skip
        )
        self.variance = nn.Parameter(torch.tensor(config.initial_variance))
        self.occlusion_ready = False  # until the first mesh was traced the occlusion factors are 1

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
        self, positions: Tensor, outputs: Tensor, features: Tensor, normals: Tensor, view_dirs: Tensor
    ) -> ShadedPoints:
        """Outgoing radiance of points towards the camera.

        Args:
            positions: [n, 3].
            outputs, features: [n, 13] and [n, C] of the SDF there.
            normals, view_dirs: [n, 3] unit; view_dirs point to the camera.

        Source: SplitNeRF Eq. (6)-(10), (17).
        """
        c = self.config
        inputs = self.head_inputs(positions, outputs, features)
        albedo, roughness, metallic = self.material(inputs)
        lobe_dirs = query_direction(normals, view_dirs, roughness, c.query)
        n = len(normals)
        facing = torch.where((normals * view_dirs).sum(-1, keepdim=True) < 0, -normals, normals)
        light = self.light(torch.cat([lobe_dirs, facing]), torch.cat([roughness, torch.ones_like(roughness)]))
        if self.occlusion is not None and self.occlusion_ready:
            occlusion_d, occlusion_s = self.occlusion(inputs, lobe_dirs.detach(), roughness.detach())
        else:
            occlusion_d = occlusion_s = torch.ones_like(roughness).expand(-1, c.occlusion_channels)
        radiance = split_sum_shade(
            normals, view_dirs, albedo, roughness, metallic, light[:n], light[n:], occlusion_s, occlusion_d,
            c.fresnel_mode, c.compensate,
        )  # fmt: skip
        return ShadedPoints(radiance, albedo, roughness, metallic, occlusion_d, occlusion_s, lobe_dirs)
