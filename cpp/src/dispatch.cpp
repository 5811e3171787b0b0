#include <cstdlib>
#include <stdexcept>
#include <string>

#include "splitnerf/kernels.h"

namespace splitnerf {

#define SPLITNERF_DECLARE(isa)       \
  namespace isa {                    \
  Kernels<float> kernels_float32();  \
  Kernels<double> kernels_float64(); \
  }
SPLITNERF_DECLARE(base)
#ifdef SPLITNERF_HAS_X86_KERNELS
SPLITNERF_DECLARE(avx2)
SPLITNERF_DECLARE(avx512)
#endif
#undef SPLITNERF_DECLARE

namespace {

enum class Isa { kBase, kAvx2, kAvx512 };

Isa best_isa() {
#ifdef SPLITNERF_HAS_X86_KERNELS
  __builtin_cpu_init();
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  if (avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl"))
    return Isa::kAvx512;
  if (avx2) return Isa::kAvx2;
#endif
  return Isa::kBase;
}

Isa chosen_isa() {
  const Isa best = best_isa();
  const char* wish = std::getenv("SPLITNERF_ISA");
  if (!wish) return best;
  const std::string name = wish;
  const Isa isa = name == "avx512" ? Isa::kAvx512 : name == "avx2" ? Isa::kAvx2 : Isa::kBase;
  if ((isa == Isa::kBase && name != "base") || isa > best)
    throw std::runtime_error("SPLITNERF_ISA=" + name + ": this build and processor take base" +
                             (best >= Isa::kAvx2 ? ", avx2" : "") + (best >= Isa::kAvx512 ? ", avx512" : ""));
  return isa;
}

template <class T> Kernels<T> load_kernels();

#ifdef SPLITNERF_HAS_X86_KERNELS
#define SPLITNERF_SELECT(function)                           \
  switch (chosen_isa()) {                                    \
    case Isa::kAvx512: return avx512::function();            \
    case Isa::kAvx2: return avx2::function();                \
    case Isa::kBase: break;                                  \
  }                                                          \
  return base::function();
#else
#define SPLITNERF_SELECT(function) \
  chosen_isa();                    \
  return base::function();
#endif
template <> Kernels<float> load_kernels<float>() { SPLITNERF_SELECT(kernels_float32) }
template <> Kernels<double> load_kernels<double>() { SPLITNERF_SELECT(kernels_float64) }
#undef SPLITNERF_SELECT

}  // namespace

template <class T> const Kernels<T>& kernels() {
  static const Kernels<T> chosen = load_kernels<T>();
  return chosen;
}
template const Kernels<float>& kernels<float>();
template const Kernels<double>& kernels<double>();

}  // namespace splitnerf
