"""The operators of SplitNeRF: ``torch.ops.splitnerf.*`` with typed, documented wrappers.

Each raises ValueError where a shape, dtype, number or name does not fit; the message names the operator and the argument.
"""

from splitnerf.ops.light import (
    SparseMap,
    fibonacci_directions,
    light_averages,
    light_filters,
    light_lookup,
    light_prior,
    light_sum_of_levels,
    prefilter_light,
    sample_ggx_lobe,
    sh_projection,
    sparse_product,
    zonal_factors,
)
from splitnerf.ops.rays import (
    CELL_EMPTY,
    CELL_OCCUPIED,
    CELL_OPAQUE,
    EdgeRuns,
    PackedSamples,
    PixelList,
    ShadingSubset,
    composite,
    draw_rays,
    march_rays,
    read_pixels,
    spread_samples,
    surface_weights,
)
from splitnerf.ops.sdf import (
    HashGrid,
    HashGridSpec,
    SdfNetwork,
    growth_for,
    hash_encode,
    sample_rays,
    sdf_field,
    sdf_values,
)
from splitnerf.ops.shading import (
    FRESNEL_MODES,
    QUERIES,
    LightSums,
    brdf_lut,
    light_queries,
    linear_to_srgb,
    monte_carlo_light,
    shade_sums,
    split_sum_shade,
    srgb_to_linear,
    summed_correction,
    summed_light,
)
from splitnerf.ops.training import AdamW, gradient_losses, pixel_losses, quadratic_entropy
from splitnerf.ops.visibility import (
    IncomingLight,
    MeshScene,
    TexturedSurface,
    VisibilityCache,
    cached_occlusion,
    cached_visibility,
    incoming_light,
    occlusion_factors,
    visibility_bits,
)
