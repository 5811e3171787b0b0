"""The operators of SplitNeRF: ``torch.ops.splitnerf.*`` with typed, documented wrappers.

These are the ones to begin with; all stand in :mod:`splitnerf.ops.sdf`, `rays`, `shading`, `light`, `visibility` and `training`. Each
raises ValueError where a shape, dtype, number or name does not fit, TypeError where a tensor or a number is needed; the message
names the operator and the argument. Where arguments are [n, ...] for n points, n may be any leading dimensions in their place.
"""

from splitnerf.ops.light import fibonacci_directions, prefilter_light
from splitnerf.ops.rays import composite, march_rays, surface_weights
from splitnerf.ops.sdf import HashGrid, HashGridSpec, hash_encode, sdf_field
from splitnerf.ops.shading import light_queries, linear_to_srgb, split_sum_shade
from splitnerf.ops.training import AdamW
from splitnerf.ops.visibility import MeshScene, occlusion_factors

__all__ = [
    "AdamW",
    "HashGrid",
    "HashGridSpec",
    "MeshScene",
    "composite",
    "fibonacci_directions",
    "hash_encode",
    "light_queries",
    "linear_to_srgb",
    "march_rays",
    "occlusion_factors",
    "prefilter_light",
    "sdf_field",
    "split_sum_shade",
    "surface_weights",
]
