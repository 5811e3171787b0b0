"""The scene as one module: surface, materials, occlusion and light, and the shading that combines them."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from splitnerf.config import Config
from splitnerf.fields import (
    EvaluatedLight,
    Light,
    LightMlp,
    LightPyramid,
    MaterialHead,
    Occlusion,
    OcclusionHead,
    SdfField,
    SkyCells,
    VisibilityBits,
)
from splitnerf.fields.light import lobe_roughness, mean_over
from splitnerf.fields.surface import SdfSample
from splitnerf.ops import HashGridSpec, MeshScene, light_queries, split_sum_shade
from splitnerf.ops.rays import ShadingSubset
from splitnerf.ops.shading import summed_correction
from splitnerf.ops.visibility import cached_occlusion

ENVIRONMENT_ROWS = 128  # of the image of a trained light
MATERIAL = "albedo", "roughness", "metallic"
N_FEATURES = 2  # of a level of the hash grid
N_OUTPUTS = 13  # of the surface's network, the distance among them
HEAD_LAYERS = 2  # hidden layers of the networks of material and occlusion
TURNS = 16  # rotations of the light over which that of the cached occlusion is averaged
START_BOUNCES = 3  # bounces of indirect light on a new mesh
SHADED_CHUNK = {"cpu": 1 << 15, "cuda": 1 << 20}  # vertices or emitters of a mesh shaded at a time
SUMMED_BAND = 0.15  # width in roughness of the transition from the split sum to the sum over directions


class ShadedPoints(NamedTuple):
    """Materials, occlusion and outgoing radiance of points.

    Attributes:
        radiance: [n, 3] linear radiance towards the camera.
        normals: [n, 3] unit normals, as they were given.
        albedo: [n, 3] linear, in [0, 1].
        roughness, metallic: [n, 1] in [0, 1]; the roughness is perceptual.
        occlusion_d, occlusion_s: [n, 1] or [n, 3] occlusion factors in [0, 1], 1 = open.
        facing: [n, 3] unit normals, on the viewer's side.
        on_surface: [n, 3] the points moved on to the surface, scene units; no gradient.
    """

    radiance: Tensor
    normals: Tensor
    albedo: Tensor
    roughness: Tensor
    metallic: Tensor
    occlusion_d: Tensor
    occlusion_s: Tensor
    facing: Tensor
    on_surface: Tensor


def on_surface(positions: Tensor, normals: Tensor, sdf: Tensor) -> Tensor:
    """Points [n, 3] moved along their unit normals [n, 3] by their signed distances [n] on to the surface, scene units;
    no gradient."""
    return torch.addcmul(positions.detach(), normals.detach(), sdf.detach()[:, None], value=-1.0)


def sharpness(variance: Tensor) -> Tensor:
    return torch.exp((10.0 * variance).clamp(0.0, 9.0))


def wide_lobes(
    candidates: Tensor, roughness: Tensor, low: float, high: float, n_candidates: Tensor | None
) -> tuple[Tensor, Tensor]:
    """The points whose lobes are wide enough for a sum over directions, and the share [m], t^2 (3 - 2 t), by which it
    counts; t rises from 0 at roughness `low` to 1 at `high`. With `n_candidates`, the number of leading candidates that
    count, all stay and the others have a share of 0; else those with a share of 0 are left out."""
    t = ((roughness[:, 0].index_select(0, candidates) - low) / (high - low)).clamp(0, 1)
    share = t * t * (3 - 2 * t)
    if n_candidates is not None:
        counts = torch.arange(len(candidates), device=candidates.device) < n_candidates
        return candidates, torch.where(counts, share, 0)
    wide = share.nonzero()[:, 0]
    return candidates[wide], share[wide]


def make_light(config: Config) -> Light:
    """The light that the setting ``light.kind`` names."""
    if config.light.kind == "pyramid":
        return LightPyramid(config.light.resolution)
    c = config.constants
    frequencies = c.direction_frequencies, c.roughness_frequencies
    return LightMlp(c.light_width, c.light_layers, *frequencies, c.light_activation)


def grid_spec(config: Config) -> HashGridSpec:
    """The shape of the surface's hash grid."""
    c, coarsest = config.surface, config.constants.base_resolution
    return HashGridSpec(c.n_levels, N_FEATURES, coarsest, c.growth, c.log2_table_size)


class SceneModel(nn.Module):
    """All learned parts of a scene, and the visibility of its newest mesh.

    Attributes:
        occlusion: The network of occlusion factors; None where they are cached, or there are none.
        cells: The cells of the sky towards which visibility is cached; None where it is not.
        bits: The cached visibility of the newest mesh; None before the first one.
        turns: [views, 3, 3] the rotations of the photos' light, see :class:`splitnerf.data.dataset.Dataset`; None: it
            stands still.
        has_mesh: Whether there was a mesh yet. Before, and without occlusion, all factors are 1.
    """

    def __init__(self, config: Config):
        super().__init__()
        self.config, spec = config, grid_spec(config)
        c, kind = config.constants, config.occlusion.kind
        dtype = None if config.surface.table_dtype == "float32" else getattr(torch, config.surface.table_dtype)
        self.sdf_field = SdfField(spec, c.box, c.surface_width, N_OUTPUTS, c.sphere_radius, dtype)
        n_inputs = N_OUTPUTS + (3 + spec.n_outputs if config.materials.inputs == "grid" else 0)
        roughness = c.initial_roughness, c.min_roughness
        self.material = MaterialHead(n_inputs, c.materials_width, HEAD_LAYERS, *roughness)
        head = n_inputs, c.occlusion_width, HEAD_LAYERS, config.occlusion.channels
        self.occlusion = OcclusionHead(*head) if kind == "mlp" else None
        self.cells = SkyCells(c.occlusion_directions) if kind == "bits" else None
        self.bits: VisibilityBits | None = None
        self.has_mesh = False
        self.turns: Tensor | None = None
        self.light = make_light(config)
        self.variance = nn.Parameter(torch.tensor(c.initial_variance))

    @property
    def device(self) -> torch.device:
        """The device of the parameters."""
        return self.variance.device

    @property
    def s(self) -> Tensor:
        """Sharpness s = exp(10 v) [] of the NeuS density, in [1, e^9], 1 / scene units. Source: NeuS (Wang et al. 2021), section
        4.1, and its released code."""
        return sharpness(self.variance)

    @property
    def s_value(self) -> float:
        """:attr:`s` as a number, computed on the CPU."""
        return float(sharpness(self.variance.detach().cpu()))

    def open_levels(self, progress: float) -> None:
        """Opens the hash-grid levels of this progress: one after the other until ``levels_open_by`` of the run."""
        c, n_levels = self.config.constants, self.config.surface.n_levels
        share = min(1.0, progress / c.levels_open_by) if c.levels_open_by > 0 else 1.0
        self.sdf_field.grid.n_active = min(n_levels, c.start_levels + int(share * (n_levels - c.start_levels)))

    def surface(self, positions: Tensor) -> SdfSample:
        """The SDF's outputs, hash features and gradient at positions [n, 3], scene units."""
        if self.config.surface.normals == "analytic":
            return self.sdf_field.sample(positions)
        return self.sdf_field.sample_finite_difference(positions)

    def head_inputs(self, positions: Tensor, outputs: Tensor, features: Tensor) -> list[Tensor]:
        """The inputs of the material and occlusion heads, concatenated: by the setting ``materials.inputs`` the SDF's
        outputs alone, or with positions and hash features."""
        return [outputs] if self.config.materials.inputs == "outputs" else [outputs, positions, features]

    def evaluate_light(self) -> EvaluatedLight:
        """The evaluated light, valid until its parameters move."""
        light = self.light.evaluate()
        return light.with_cells(self.cells.light(light)) if self.config.shading.method == "summed" else light

    @property
    def is_unoccluded(self) -> bool:
        """Whether the mesh blocks so little that it counts as convex."""
        return self.bits is not None and self.bits.is_unoccluded

    def occlusion_at(
        self,
        inputs: list[Tensor],
        positions: Tensor,
        normals: Tensor,
        lobe_dirs: Tensor,
        roughness: Tensor,
        segments: ShadingSubset | None = None,
    ) -> Occlusion:
        """The occlusion factors at points [n, 3] of the surface; no gradient flows into the geometry. `inputs` are those of
        :meth:`head_inputs`, the other arguments as for :class:`splitnerf.fields.VisibilityBits`. With `segments`, the points as
        samples of rays, cached visibility is looked up once for each segment of a ray."""
        if self.bits is not None and not self.bits.is_unoccluded:
            return self.bits(positions, normals, lobe_dirs, roughness, segments)
        if self.occlusion is not None and self.has_mesh:
            return self.occlusion(inputs)
        ones = torch.ones_like(roughness).expand(-1, self.config.occlusion.channels)
        return Occlusion(ones, ones)

    def shade(
        self,
        light: EvaluatedLight,
        positions: Tensor,
        outputs: Tensor,
        features: Tensor,
        normals: Tensor,
        view_dirs: Tensor,
        segments: ShadingSubset | None = None,
    ) -> ShadedPoints:
        """Outgoing radiance of points towards the camera.

        Args:
            positions: [n, 3], scene units.
            outputs, features: [n, 13] and [n, C], the SDF's outputs and hash features at the positions.
            normals, view_dirs: [n, 3] unit; view_dirs point to the camera.
            segments: See :meth:`occlusion_at`.

        Source: SplitNeRF Eq. (6)-(10), (17).
        """
        c = self.config
        inputs = self.head_inputs(positions, outputs, features)
        _, roughness, _ = materials = self.material(*inputs)
        queries = light_queries(normals, view_dirs, roughness, c.shading.query)
        lobe_dirs, facing = queries[0].chunk(2)
        surface = on_surface(positions, normals, outputs[:, 0])
        o_d, o_s, i_d, i_s = self.occlusion_at(inputs, surface, facing, lobe_dirs, roughness, segments)
        shaded = split_sum_shade(
            normals,
            view_dirs,
            **dict(zip(MATERIAL, materials)),
            specular=light(*queries),
            occlusion_s=o_s,
            occlusion_d=o_d,
            fresnel_mode=c.shading.fresnel,
            compensate=c.shading.compensate,
            indirect_s=i_s,
            indirect_d=i_d,
        )
        return ShadedPoints(shaded, normals, *materials, o_d, o_s, facing, surface)

    def quadrature_correction(
        self,
        light: EvaluatedLight,
        view_dirs: Tensor,
        points: ShadedPoints,
        candidates: Tensor,
        n_candidates: Tensor | None = None,
    ) -> tuple[Tensor, Tensor]:
        """The difference between the radiance by quadrature and that by the split sum.

        The quadrature sums BRDF times light over the directions of the visibility bits. It replaces the split sum with
        a smooth transition in roughness, where the directions resolve the lobe: with 256 directions the transition is
        from roughness 0.3 to 0.45. Narrower lobes are not corrected.

        Args:
            view_dirs: [n, 3] unit, to the camera.
            points: The result of :meth:`shade` for the points.
            candidates: [k] int64, the indices of points that may be corrected.
            n_candidates: [] int64, the number of leading candidates that count. The others get a correction of 0, and
                m = k, so that the host need not wait for a GPU. None: all candidates count, and candidates with narrow
                lobes are left out of the result.

        Returns:
            at: [m] int64, the indices of the corrected points.
            correction: [m, 3] linear radiance to add.

        Source: SplitNeRF Eq. (4)-(6), by quadrature.
        """
        middle, half = self.cells.summed_from, 0.5 * SUMMED_BAND
        at, share = wide_lobes(candidates, points.roughness.detach(), middle - half, middle + half, n_candidates)
        places = (x.index_select(0, at) for x in (points.on_surface, points.facing.detach()))
        visible, sent = self.bits.visibility(*places)
        normals, views, *corrected = (
            x.index_select(0, at)
            for x in (points.normals, view_dirs, points.albedo, points.roughness, points.metallic, points.radiance)
        )
        return at, summed_correction(
            normals,
            views,
            **dict(zip((*MATERIAL, "split"), corrected)),
            share=share,
            directions=self.bits.cache.directions,
            solid_angles=light.cells.solid_angles,
            radiance=light.cells.radiance,
            visible=visible,
            sent=sent,
            compensate=self.config.shading.compensate,
        )

    def use_turns(self, turns: Tensor | None) -> None:
        """Sets the rotations [views, 3, 3] of the photos' light; None: it stands still. That of the cached occlusion is
        averaged over some of them."""
        self.turns = turns
        if self.cells is not None and turns is not None:
            self.cells.turns = turns[torch.linspace(0, len(turns) - 1, min(len(turns), TURNS)).long()]

    @property
    def sums_light(self) -> bool:
        """Whether :meth:`quadrature_correction` applies: with ``shading.method = summed``, from the first mesh on."""
        return self.config.shading.method == "summed" and self.has_mesh

    @torch.no_grad()
    def aims(self) -> Tensor | None:
        """The directions [k, 3] in which a mesh would be traced for the present light; None where none is traced."""
        return None if self.cells is None else self.cells.aims(self.light.evaluate())

    def trace(self, scene: MeshScene, vertices: Tensor, faces: Tensor, aims: Tensor | None) -> VisibilityBits | None:
        """The visibility of a mesh in directions of :meth:`aims`, on the CPU; None where none is cached. Another thread may
        call it."""
        c = self.config
        if aims is None:
            return None
        return VisibilityBits.trace(
            scene,
            vertices,
            faces,
            aims,
            offset=c.constants.occlusion_offset,
            n_channels=c.occlusion.channels,
            indirect=c.occlusion.indirect,
            open_below=c.constants.open_below,
        )

    def use_mesh(self, bits: VisibilityBits | None) -> None:
        """Switches to the visibility of a new mesh, and computes a few bounces of indirect light on it."""
        self.has_mesh = True
        if bits is not None:
            self.bits, light = bits.to(self.device), self.evaluate_light()
            self.weigh_occlusion(light)
            for _ in range(START_BOUNCES):
                self.refresh_indirect(light)

    @torch.no_grad()
    def weigh_occlusion(self, light: EvaluatedLight) -> None:
        """Takes over the light that weighs the cached occlusion factors."""
        if self.bits is not None:
            self.bits.light.copy_((light.cells or self.cells.light(light)).radiance)

    def materials_at(self, positions: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Albedo [n, 3], roughness [n, 1] and metallic [n, 1] at positions [n, 3], scene units."""
        field = self.surface(positions)
        return self.material(*self.head_inputs(positions, field.outputs, field.features))

    @torch.no_grad()
    def refresh_indirect(self, light: EvaluatedLight) -> None:
        """Shades the emitters of the mesh again, with the split sum. They receive the radiance of the refresh before, so that each
        call adds a bounce. An emitter reflects towards the one direction that it is seen from. Its specular light is the
        environment's, or that of the emitter that it sees in the mirror direction. Seen from behind it is black."""
        c, bits, chunk = self.config.shading, self.bits, SHADED_CHUNK[self.device.type]
        if bits is None or bits.emitters is None or bits.is_unoccluded:
            return
        g = light if self.cells.turns is None else mean_over(light, self.cells.turns)
        x, n = bits.cache.vertices, bits.cache.normals
        materials = [torch.cat(parts) for parts in zip(*map(self.materials_at, x.split(chunk)))]
        o_d, _, i_d, _ = cached_occlusion(
            bits.cache, x, n, lobe_dirs=n, roughness=materials[1], light=bits.light, radiance=bits.radiance
        )
        diffuse = o_d * g(n, torch.ones_like(n[:, :1])) + (0.0 if i_d is None else i_d)
        before = x.new_zeros(1, 3) if bits.radiance is None else F.pad(bits.radiance, (0, 0, 0, 1))
        blur = lobe_roughness(4.0 * math.pi / len(bits.light)) ** 4  # a ray stands for all of its cell
        parts = [x.new_zeros(0, 3)]
        for vertices, directions, mirrored, facing in zip(*(part.split(chunk) for part in bits.emitters)):
            normals, views = n[vertices], -bits.cache.directions[directions]
            material = {name: part[vertices] for name, part in zip(MATERIAL, materials)}
            roughness = material["roughness"]
            lobes = light_queries(normals, views, roughness)[0][: len(views)]
            sky = g(lobes, (roughness**4 + blur).sqrt().sqrt())
            seen = before[mirrored.clamp(max=len(before) - 1)]
            light_here = {"specular": torch.where(mirrored[:, None] < 0, sky, seen), "diffuse": diffuse[vertices]}
            how = {"fresnel_mode": c.fresnel, "compensate": c.compensate}
            parts.append(split_sum_shade(normals, views, **material, **light_here, **how) * facing)
        bits.set_radiance(torch.cat(parts))
