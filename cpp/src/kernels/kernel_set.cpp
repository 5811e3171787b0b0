#include "kernel_set.h"

#define SPLITNERF_NAME_OF(isa) #isa
#define SPLITNERF_NAME(isa) SPLITNERF_NAME_OF(isa)

namespace splitnerf::SPLITNERF_ISA {

Kernels<float> kernels_float32() {
  return {SPLITNERF_NAME(SPLITNERF_ISA),
          hash_encode<float>,
          hash_scatter<float>,
          hash_scatter_along<float>,
          sdf_values<float>,
          sdf_layer<float>,
          sdf_layer_backward<float>,
          pair_likeness<float>,
          lobe_gather<float>,
          lobe_scatter<float>,
          visibility_horizon<float>,
          visibility_shares<float>,
          visibility_sums<float>,
          fan_directions<float>,
          fan_light<float>,
          split_sum_shade<float>,
          split_sum_shade_backward<float>,
          light_lookup<float>,
          light_lookup_backward<float>,
          sparse_product<float>,
          adamw_step<float>};
}

Kernels<double> kernels_float64() {
  return {SPLITNERF_NAME(SPLITNERF_ISA),
          hash_encode<double>,
          hash_scatter<double>,
          hash_scatter_along<double>,
          sdf_values<double>,
          sdf_layer<double>,
          sdf_layer_backward<double>,
          pair_likeness<double>,
          lobe_gather<double>,
          lobe_scatter<double>,
          visibility_horizon<double>,
          visibility_shares<double>,
          visibility_sums<double>,
          fan_directions<double>,
          fan_light<double>,
          split_sum_shade<double>,
          split_sum_shade_backward<double>,
          light_lookup<double>,
          light_lookup_backward<double>,
          sparse_product<double>,
          adamw_step<double>};
}

}  // namespace splitnerf::SPLITNERF_ISA
