"""The operators of SplitNeRF: ``torch.ops.splitnerf.*`` with typed, documented wrappers."""

from splitnerf.ops.hash_grid import HashGrid, HashGridSpec, growth_for, hash_encode, hash_encode_jacobian
from splitnerf.ops.light import fibonacci_directions, prefilter_light, sample_ggx_lobe
from splitnerf.ops.monte_carlo import LightSums, monte_carlo_light, sample_bsdf
from splitnerf.ops.occlusion import MeshScene, occlusion_factors, trace_visibility
from splitnerf.ops.rays import (
    CELL_EMPTY,
    CELL_OCCUPIED,
    CELL_OPAQUE,
    PackedSamples,
    composite,
    march_rays,
    neus_weights,
)
from splitnerf.ops.shading import FRESNEL_MODES, QUERIES, brdf_lut, query_direction, split_sum_shade
from splitnerf.ops.visibility import VisibilityCache, cached_occlusion, visibility_bits

__all__ = [
    "CELL_EMPTY", "CELL_OCCUPIED", "CELL_OPAQUE", "FRESNEL_MODES", "QUERIES", "HashGrid", "HashGridSpec", "LightSums",
    "MeshScene", "PackedSamples", "VisibilityCache", "brdf_lut", "cached_occlusion", "composite", "fibonacci_directions",
    "growth_for", "hash_encode", "hash_encode_jacobian", "march_rays", "monte_carlo_light", "neus_weights",
    "occlusion_factors", "prefilter_light", "query_direction", "sample_bsdf", "sample_ggx_lobe", "split_sum_shade",
    "trace_visibility", "visibility_bits",
]  # fmt: skip
