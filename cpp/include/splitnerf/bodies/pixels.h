// Where a training step looks: rays through drawn pixels, and points of the rays' samples.
#pragma once

#include "splitnerf/trigonometry.h"
#include "splitnerf/vec.h"

namespace splitnerf {

// Pixels of a stack of photos in their order, as runs of neighbours: pixel number `rank` of the list is rank + shift of the first run
// whose `last`, the number of pixels up to its end, is larger. Without runs the list holds all pixels.
struct PixelList {
  const int64_t *last, *shift;
  int64_t n_runs, count;

  SPLITNERF_HD int64_t operator[](int64_t rank) const {
    if (n_runs == 0) return rank;
    int64_t low = 0, high = n_runs - 1;
    while (low < high) {
      const int64_t middle = (low + high) / 2;
      if (last[middle] > rank) {
        high = middle;
      } else {
        low = middle + 1;
      }
    }
    return rank + shift[low];
  }
};

// A ray through one pixel of each of n_near equal parts of one list, then of the other parts of another list.
// matrices [views, 3, 3]: from (x, y, 1) to directions; the middle of a pixel is (column + 1/2, row + 1/2).
template <class T> struct DrawRaysBody {
  int64_t n, n_near;
  PixelList near, anywhere;
  int64_t n_views, height, width;
  const T *random, *matrices, *origins;
  T *rays_o, *rays_d;
  int64_t *view, *index;

  SPLITNERF_HD void operator()(int64_t i) const {
    const bool is_near = i < n_near;
    const PixelList& list = is_near ? near : anywhere;
    const auto part = double(is_near ? i : i - n_near), parts = double(is_near ? n_near : n - n_near);
    const auto rank = static_cast<int64_t>((part + double(random[i])) / parts * double(list.count));
    const int64_t pixel =
        clamp<int64_t>(list[clamp<int64_t>(rank, 0, list.count - 1)], 0, n_views * height * width - 1);
    const int64_t row = pixel / width, photo = row / height;
    const Vec3<T> at{T(pixel - row * width) + T(0.5), T(row - photo * height) + T(0.5), T(1)};
    const T* m = matrices + 9 * photo;
    store3(rays_d + 3 * i, normalize(Vec3<T>{dot(load3(m), at), dot(load3(m + 3), at), dot(load3(m + 6), at)}));
    store3(rays_o + 3 * i, load3(origins + 3 * photo));
    view[i] = photo;
    index[i] = pixel;
  }
};
SPLITNERF_ON_GPU(DrawRaysBody);

// Pixels of which a photo's colour is compared whole, as runs of neighbours: those numbered starts[r] to ends[r] - 1, whose colours
// without the object are in `behind` [n, 3] from number starts[r] + shift[r] on.
struct EdgeRuns {
  const int64_t *starts, *ends, *shift;
  const uint8_t* behind;
  int64_t n_runs, n_behind;

  // The number of a pixel in `behind`, or -1.
  SPLITNERF_HD int64_t find(int64_t pixel) const {
    int64_t low = 0, high = n_runs;  // the first run that starts later
    while (low < high) {
      const int64_t middle = (low + high) / 2;
      if (starts[middle] > pixel) {
        high = middle;
      } else {
        low = middle + 1;
      }
    }
    if (low == 0 || pixel >= ends[low - 1]) return -1;
    return clamp<int64_t>(pixel + shift[low - 1], 0, n_behind - 1);
  }
};

// What photos show at pixels, from their codes [n_pixels, 4]: bytes, words of 16 bits (given as signed ones), or floats.
template <class T, class Code> struct ReadPixelsBody {
  const Code* codes;
  int64_t n_pixels, n_views;
  EdgeRuns edges;
  const int64_t *index, *view;
  const T *exposures, *backgrounds;
  T *target, *exposure, *background;
  bool* whole;

  SPLITNERF_HD static T value(uint8_t code) { return T(code) * T(1. / 255); }
  SPLITNERF_HD static T value(int16_t code) { return T(static_cast<uint16_t>(code)) * T(1. / 65535); }
  SPLITNERF_HD static T value(float code) { return T(code); }
  SPLITNERF_HD void operator()(int64_t i) const {
    const int64_t pixel = clamp<int64_t>(index[i], 0, n_pixels - 1), photo = clamp<int64_t>(view[i], 0, n_views - 1);
    const int64_t edge = edges.find(pixel);
    for (int k = 0; k < 4; ++k) target[4 * i + k] = value(codes[4 * pixel + k]);
    store3(exposure + 3 * i, load3(exposures + 3 * photo));
    for (int k = 0; k < 3; ++k)
      background[3 * i + k] = edge < 0 ? backgrounds[3 * i + k] : value(edges.behind[3 * edge + k]);
    whole[i] = edge >= 0;
  }
};
template <class T> using ReadBytesBody = ReadPixelsBody<T, uint8_t>;
template <class T> using ReadWordsBody = ReadPixelsBody<T, int16_t>;
template <class T> using ReadFloatsBody = ReadPixelsBody<T, float>;
SPLITNERF_ON_GPU(ReadBytesBody);
SPLITNERF_ON_GPU(ReadWordsBody);
SPLITNERF_ON_GPU(ReadFloatsBody);

}  // namespace splitnerf
