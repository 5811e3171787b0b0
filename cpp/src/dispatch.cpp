#include <cstdlib>
#include <stdexcept>
#include <string>
#include <vector>

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

template <class T> Kernels<T> load_kernels(Isa isa);

#ifdef SPLITNERF_HAS_X86_KERNELS
#define SPLITNERF_SELECT(function) \
  switch (isa) {                   \
    case Isa::kAvx512:             \
      return avx512::function();   \
    case Isa::kAvx2:               \
      return avx2::function();     \
    case Isa::kBase:               \
      break;                       \
  }                                \
  return base::function();
#else
#define SPLITNERF_SELECT(function) \
  (void)isa;                       \
  return base::function();
#endif
template <> Kernels<float> load_kernels<float>(Isa isa) { SPLITNERF_SELECT(kernels_float32) }
template <> Kernels<double> load_kernels<double>(Isa isa) { SPLITNERF_SELECT(kernels_float64) }
#undef SPLITNERF_SELECT

template <class T> Kernels<T> wished_kernels() {
  const char* wish = std::getenv("SPLITNERF_ISA");
  if (!wish) return load_kernels<T>(best_isa());
  const std::vector<Kernels<T>> usable = usable_kernels<T>();
  std::string names;
  for (const Kernels<T>& set : usable) {
    if (set.name == std::string(wish)) return set;
    names += (names.empty() ? "" : ", ") + std::string(set.name);
  }
  throw std::runtime_error("SPLITNERF_ISA=" + std::string(wish) + ": this build and processor take " + names);
}

}  // namespace

template <class T> std::vector<Kernels<T>> usable_kernels() {
  std::vector<Kernels<T>> sets;
  for (int isa = 0; isa <= static_cast<int>(best_isa()); ++isa) sets.push_back(load_kernels<T>(static_cast<Isa>(isa)));
  return sets;
}
template std::vector<Kernels<float>> usable_kernels<float>();
template std::vector<Kernels<double>> usable_kernels<double>();

template <class T> const Kernels<T>& kernels() {
  static const Kernels<T> chosen = wished_kernels<T>();
  return chosen;
}
template const Kernels<float>& kernels<float>();
template const Kernels<double>& kernels<double>();

}  // namespace splitnerf
