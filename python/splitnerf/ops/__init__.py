"""The operators of SplitNeRF: ``torch.ops.splitnerf.*`` with typed, documented wrappers."""

from splitnerf.ops.adamw import AdamW, adamw_step_
from splitnerf.ops.corrections import add_corrections, wide_lobes
from splitnerf.ops.hash_grid import HashGrid, HashGridSpec, growth_for, hash_encode, hash_encode_jacobian
from splitnerf.ops.incoming_light import IncomingLight, TexturedSurface, incoming_light
from splitnerf.ops.light import fibonacci_directions, prefilter_light, sample_ggx_lobe
from splitnerf.ops.light_losses import light_prior, log_chroma
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
from splitnerf.ops.losses import (
    gradient_losses,
    material_losses,
    pixel_losses,
    quadratic_entropy,
)
from splitnerf.ops.materials import material_network
from splitnerf.ops.monte_carlo import (
    LightSums,
    monte_carlo_light,
    sample_bsdf,
    shade_sums,
    specular_share,
    summed_correction,
    summed_light,
)
from splitnerf.ops.occlusion import MeshScene, occlusion_factors, trace_visibility
from splitnerf.ops.pixels import EdgeRuns, PixelList, draw_rays, place_samples, probe_points, read_pixels
from splitnerf.ops.rays import (
    CELL_EMPTY,
    CELL_OCCUPIED,
    CELL_OPAQUE,
    PackedSamples,
    ShadingSubset,
    composite,
    march_rays,
    neus_weights,
    sharpness,
    spread_samples,
    surface_weights,
)
from splitnerf.ops.rows import clear_unless, take_rows
from splitnerf.ops.sdf import SdfNetwork, sample_rays, sdf_field, sdf_values
from splitnerf.ops.shading import FRESNEL_MODES, QUERIES, brdf_lut, light_queries, query_direction, split_sum_shade
from splitnerf.ops.srgb import linear_to_srgb, srgb_to_linear
from splitnerf.ops.step_numbers import step_numbers
from splitnerf.ops.visibility import VisibilityCache, cached_occlusion, cached_visibility, visibility_bits

__all__ = [
    "AdamW", "CELL_EMPTY", "CELL_OCCUPIED", "CELL_OPAQUE", "EdgeRuns", "FRESNEL_MODES", "HashGrid", "HashGridSpec",
    "IncomingLight", "LightSums", "MeshScene", "PackedSamples", "PixelList", "QUERIES", "SdfNetwork", "ShadingSubset",
    "SparseMap", "TexturedSurface", "VisibilityCache", "adamw_step_", "add_corrections", "brdf_lut", "cached_occlusion", "cached_visibility",
    "clear_unless", "composite", "draw_rays", "fibonacci_directions", "gradient_losses", "growth_for", "hash_encode", "hash_encode_jacobian",
    "incoming_light", "light_averages", "light_filters", "light_lookup", "light_prior", "light_queries",
    "light_sum_of_levels", "linear_to_srgb", "log_chroma", "march_rays", "material_losses", "material_network", "monte_carlo_light",
    "neus_weights", "occlusion_factors", "pixel_losses", "place_samples", "prefilter_light", "probe_points",
    "quadratic_entropy", "query_direction", "read_pixels", "sample_bsdf", "sample_ggx_lobe", "sample_rays", "sdf_field",
    "sdf_values", "sh_projection", "shade_sums", "sharpness", "sparse_product", "specular_share", "split_sum_shade",
    "spread_samples", "srgb_to_linear", "step_numbers", "summed_correction", "summed_light", "surface_weights", "take_rows",
    "trace_visibility", "visibility_bits", "wide_lobes", "zonal_factors",
]  # fmt: skip
