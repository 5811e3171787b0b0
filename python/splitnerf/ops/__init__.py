"""The operators of SplitNeRF: ``torch.ops.splitnerf.*`` with typed, documented wrappers."""

from splitnerf.ops.adamw import AdamW
from splitnerf.ops.hash_grid import HashGrid, HashGridSpec, growth_for, hash_encode
from splitnerf.ops.incoming_light import IncomingLight, TexturedSurface, incoming_light
from splitnerf.ops.light import fibonacci_directions, prefilter_light, sample_ggx_lobe
from splitnerf.ops.light_losses import light_prior
from splitnerf.ops.light_pyramid import (
    SparseMap,
    light_averages,
    light_filters,
    light_lookup,
    light_sum_of_levels,
    sh_projection,
    sparse_product,
    zonal_factors,
)
from splitnerf.ops.losses import gradient_losses, pixel_losses, quadratic_entropy
from splitnerf.ops.monte_carlo import LightSums, monte_carlo_light, shade_sums, summed_correction, summed_light
from splitnerf.ops.occlusion import MeshScene, occlusion_factors
from splitnerf.ops.pixels import EdgeRuns, PixelList, draw_rays, read_pixels
from splitnerf.ops.rays import (
    CELL_EMPTY,
    CELL_OCCUPIED,
    CELL_OPAQUE,
    PackedSamples,
    ShadingSubset,
    composite,
    march_rays,
    spread_samples,
    surface_weights,
)
from splitnerf.ops.sdf import SdfNetwork, sample_rays, sdf_field, sdf_values
from splitnerf.ops.shading import FRESNEL_MODES, QUERIES, brdf_lut, light_queries, split_sum_shade
from splitnerf.ops.srgb import linear_to_srgb, srgb_to_linear
from splitnerf.ops.visibility import VisibilityCache, cached_occlusion, cached_visibility, visibility_bits

__all__ = [
    "AdamW",
    "CELL_EMPTY",
    "CELL_OCCUPIED",
    "CELL_OPAQUE",
    "EdgeRuns",
    "FRESNEL_MODES",
    "HashGrid",
    "HashGridSpec",
    "IncomingLight",
    "LightSums",
    "MeshScene",
    "PackedSamples",
    "PixelList",
    "QUERIES",
    "SdfNetwork",
    "ShadingSubset",
    "SparseMap",
    "TexturedSurface",
    "VisibilityCache",
    "brdf_lut",
    "cached_occlusion",
    "cached_visibility",
    "composite",
    "draw_rays",
    "fibonacci_directions",
    "gradient_losses",
    "growth_for",
    "hash_encode",
    "incoming_light",
    "light_averages",
    "light_filters",
    "light_lookup",
    "light_prior",
    "light_queries",
    "light_sum_of_levels",
    "linear_to_srgb",
    "march_rays",
    "monte_carlo_light",
    "occlusion_factors",
    "pixel_losses",
    "prefilter_light",
    "quadratic_entropy",
    "read_pixels",
    "sample_ggx_lobe",
    "sample_rays",
    "sdf_field",
    "sdf_values",
    "sh_projection",
    "shade_sums",
    "sparse_product",
    "split_sum_shade",
    "spread_samples",
    "srgb_to_linear",
    "summed_correction",
    "summed_light",
    "surface_weights",
    "visibility_bits",
    "zonal_factors",
]
