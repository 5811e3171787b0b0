// Marching rays through an occupancy grid.
#pragma once

#include <vector>

#include "splitnerf/group.h"
#include "splitnerf/vec.h"

namespace splitnerf {

// The state of a cell of the occupancy grid. An opaque cell is so deep inside that nothing behind it is visible; a ray
// ends at such a cell.
enum class Cell : uint8_t { kEmpty = 0, kOccupied = 1, kOpaque = 2 };

inline constexpr int kBlockCells = 8;  // along an edge of a block of cells

// Cells [x][y][z], and a flag for each block of cells that contains a cell that is not empty: rays cross the other
// blocks in one step.
struct OccupancyView {
  const uint8_t *cells, *blocks;
  int resolution, n_blocks;  // along an edge

  SPLITNERF_HD static int64_t at(int x, int y, int z, int n) { return (static_cast<int64_t>(x) * n + y) * n + z; }
  SPLITNERF_HD bool empty_block(const int* cell) const {
    return !blocks[at(cell[0] / kBlockCells, cell[1] / kBlockCells, cell[2] / kBlockCells, n_blocks)];
  }
  SPLITNERF_HD Cell cell(const int* cell) const {
    return static_cast<Cell>(cells[at(cell[0], cell[1], cell[2], resolution)]);
  }
};

inline int blocks_along(int resolution) { return (resolution + kBlockCells - 1) / kBlockCells; }

// Finds the blocks [blocks_along^3] of a grid.
inline void find_occupied_blocks(const uint8_t* cells, int resolution, uint8_t* blocks) {
  const int n_blocks = blocks_along(resolution), padded = n_blocks * kBlockCells;
  // Of the cells along z in each block of x and y.
  std::vector<uint8_t> columns(size_t(n_blocks) * n_blocks * padded);
  for (int x = 0; x < resolution; ++x) {
    for (int y = 0; y < resolution; ++y) {
      const uint8_t* row = cells + OccupancyView::at(x, y, 0, resolution);
      uint8_t* column = &columns[OccupancyView::at(x / kBlockCells, y / kBlockCells, 0, n_blocks) * kBlockCells];
      for (int z = 0; z < resolution; ++z) column[z] |= row[z];
    }
  }
  for (size_t i = 0; i < columns.size() / kBlockCells; ++i) blocks[i] = 0;
  for (size_t i = 0; i < columns.size(); ++i) blocks[i / kBlockCells] |= columns[i];
}

// A grid, which it does not own, with its blocks.
class OccupancyCells {
 public:
  OccupancyCells(const uint8_t* cells, int resolution) {
    const int n_blocks = blocks_along(resolution);
    blocks_.resize(size_t(n_blocks) * n_blocks * n_blocks);
    find_occupied_blocks(cells, resolution, blocks_.data());
    view_ = {cells, blocks_.data(), resolution, n_blocks};
  }
  OccupancyCells(const OccupancyCells&) = delete;
  OccupancyCells& operator=(const OccupancyCells&) = delete;

  const OccupancyView& view() const { return view_; }

 private:
  std::vector<uint8_t> blocks_;
  OccupancyView view_;
};

struct MarchOptions {
  float box;            // half size of the cube [-box, box]^3 that the grid covers
  float step;           // length of one sample, scene units
  int64_t max_samples;  // of one ray
};

// Index range along one axis of a direction that may be zero: t where the ray is inside the slab.
template <class T> SPLITNERF_HD void clip_slab(T origin, T direction, T box, T& t_near, T& t_far) {
  if (direction == T(0)) {
    if (std::abs(origin) > box) t_far = T(-1);
    return;
  }
  const T inv = T(1) / direction, t0 = (-box - origin) * inv, t1 = (box - origin) * inv;
  t_near = max_of(t_near, min_of(t0, t1));
  t_far = min_of(t_far, max_of(t0, t1));
}

// The samples of one ray: number k is [lattice + k step, lattice + (k + 1) step], and counts where its midpoint
// stands in the box. jitter in [0, 1) shifts the lattice.
template <class T> struct RayLattice {
  Vec3<T> origin, direction, inverse_direction;
  T t_near, t_far, lattice, step, inverse_step;
  int64_t n_steps;  // 0: the ray misses the box

  SPLITNERF_HD RayLattice(Vec3<T> o, Vec3<T> d, T jitter, const MarchOptions& options)
      : origin(o), direction(d), inverse_direction{T(1) / d.x, T(1) / d.y, T(1) / d.z}, t_near(T(0)),
        t_far(T(INFINITY)), lattice(T(0)), step(T(options.step)), inverse_step(T(1) / step), n_steps(0) {
    if (!(dot(o, o) + dot(d, d) < T(INFINITY))) return;  // a ray that is not finite meets nothing
    for (int axis = 0; axis < 3; ++axis) clip_slab(o[axis], d[axis], T(options.box), t_near, t_far);
    if (!(t_near < t_far) || !(t_far < T(INFINITY))) return;
    n_steps = static_cast<int64_t>(std::ceil((t_far - t_near) * inverse_step)) + 1;
    lattice = t_near + (jitter - T(1)) * step;
  }
  SPLITNERF_HD T start(int64_t k) const { return lattice + T(k) * step; }
  SPLITNERF_HD Vec3<T> middle(int64_t k) const { return origin + direction * (start(k) + T(0.5) * step); }
};

// The state at the midpoint of one sample: an occupied cell, an empty cell, or the end of the ray. Empty blocks and
// cells are crossed in one step: `next` is the first midpoint behind the exit.
struct MarchStep {
  Cell cell;  // kOpaque: the ray ends before this sample
  int64_t next;
};
template <class T>
SPLITNERF_HD MarchStep march_step(const RayLattice<T>& ray, const OccupancyView& grid, const MarchOptions& options,
                                  int64_t k) {
  const T box = T(options.box), cell_size = T(2) * box / T(grid.resolution),
          cells_per_unit = T(0.5) * T(grid.resolution) / box;
  const Vec3<T>&o = ray.origin, &d = ray.direction;
  if (k >= ray.n_steps) return {Cell::kOpaque, k};
  const T t_mid = ray.start(k) + T(0.5) * ray.step;
  if (t_mid <= ray.t_near) return {Cell::kEmpty, k + 1};
  if (t_mid >= ray.t_far) return {Cell::kOpaque, k};
  int cell[3];
  for (int axis = 0; axis < 3; ++axis)
    cell[axis] = clamp(static_cast<int>((o[axis] + t_mid * d[axis] + box) * cells_per_unit), 0, grid.resolution - 1);
  int size = kBlockCells;  // of what is crossed
  if (!grid.empty_block(cell)) {
    const Cell state = grid.cell(cell);
    if (state == Cell::kOpaque || state == Cell::kOccupied) return {state, k + 1};
    size = 1;
  }
  T t_exit = ray.t_far;
  for (int axis = 0; axis < 3; ++axis) {
    if (d[axis] == T(0)) continue;
    const int face = cell[axis] / size * size + (d[axis] > T(0) ? size : 0);
    t_exit = min_of(t_exit, (T(face) * cell_size - box - o[axis]) * ray.inverse_direction[axis]);
  }
  return {Cell::kEmpty,
          max_of(k + 1, static_cast<int64_t>(std::ceil((t_exit - ray.lattice) * ray.inverse_step - T(0.5))))};
}

// The first sample from k on whose midpoint lies in an occupied cell; -1 if the ray ends before.
template <class T>
SPLITNERF_HD int64_t next_occupied(const RayLattice<T>& ray, const OccupancyView& grid, const MarchOptions& options,
                                   int64_t k) {
  for (;;) {
    const MarchStep step = march_step(ray, grid, options, k);
    if (step.cell == Cell::kOccupied) return k;
    if (step.cell == Cell::kOpaque) return -1;
    k = step.next;
  }
}

// Bit i: whether thread i's sample stands in an occupied cell, and none before it ends the ray. The threads hold the cells of
// neighbouring samples, in order.
struct OccupiedSamples {
  uint32_t bits;
  bool ended;
};
template <class Group> SPLITNERF_HD OccupiedSamples occupied_samples(const Group& group, Cell cell) {
  const uint32_t ended = group.ballot(cell == Cell::kOpaque);
  const uint32_t in_front = ended ? (ended & -ended) - 1 : ~0u;  // bits below the lowest
  return {group.ballot(cell == Cell::kOccupied) & in_front, ended != 0};
}

// Calls emit(i, t_start, t_end) for each sample in an occupied cell, front to back; i counts them. Returns their
// number.
// Each thread of the group tests one of as many neighbouring samples; the occupied ones are packed in order.
template <class T, class Group, class Emit>
SPLITNERF_HD int64_t march_ray(const Group& group, Vec3<T> o, Vec3<T> d, T jitter, const OccupancyView& grid,
                               const MarchOptions& options, Emit emit) {
  const RayLattice<T> ray(o, d, jitter, options);
  int64_t n = 0;
  for (int64_t first = 0; first < ray.n_steps && n < options.max_samples;) {
    const int64_t k = first + group.lane();
    const MarchStep step = march_step(ray, grid, options, k);
    const OccupiedSamples occupied = occupied_samples(group, step.cell);
    const uint32_t mine = 1u << group.lane();
    const int64_t i = n + count_bits(occupied.bits & (mine - 1));
    if (occupied.bits & mine && i < options.max_samples) emit(i, ray.start(k), ray.start(k) + ray.step);
    n = min_of(n + count_bits(occupied.bits), options.max_samples);
    if (occupied.ended) break;
    first = group.last(step.next);
  }
  return n;
}

}  // namespace splitnerf
