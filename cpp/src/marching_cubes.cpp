// Marching cubes on sparse blocks: vertices are numbered block by block, so that each is made once.
#include "splitnerf/marching_cubes.h"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "splitnerf/parallel.h"

namespace splitnerf {
namespace {

constexpr int B = kMeshBlock;
constexpr int W = B + 1;  // nodes along the edge of a block with its neighbours' first layer
constexpr double kKeepFromEnds = 1e-3;

struct BlockPosition {
  int x, y, z;
};

int64_t flat(const BlockGrid& grid, BlockPosition p) {
  return (int64_t(p.x) * grid.n_blocks + p.y) * grid.n_blocks + p.z;
}

BlockPosition position(const BlockGrid& grid, int64_t i) {
  const int64_t n = grid.n_blocks;
  return {int(i / (n * n)), int(i / n % n), int(i % n)};
}

// Whether the 27 blocks about an inner one are the same, by their 9 runs along z.
bool uniform(const BlockGrid& grid, BlockPosition p) {
  if (std::min({p.x, p.y, p.z}) < 1 || std::max({p.x, p.y, p.z}) + 1 >= grid.n_blocks) return false;
  const int32_t row = grid.index[flat(grid, p)];
  bool same = true;
  for (int dx = -1; dx <= 1; ++dx)
    for (int dy = -1; dy <= 1; ++dy) {
      const int32_t* run = grid.index + flat(grid, {p.x + dx, p.y + dy, p.z});
      same = same & (run[-1] == row) & (run[0] == row) & (run[1] == row);
    }
  return same;
}

// Calls f(flat index, offset) for the neighbours inside the grid, offsets in {lowest, .., 1}^3 but not 0.
template <class F> void for_neighbours(const BlockGrid& grid, BlockPosition p, int lowest, F&& f) {
  for (int dx = lowest; dx <= 1; ++dx)
    for (int dy = lowest; dy <= 1; ++dy)
      for (int dz = lowest; dz <= 1; ++dz) {
        const BlockPosition q{p.x + dx, p.y + dy, p.z + dz};
        const bool in_grid = std::min({q.x, q.y, q.z}) >= 0 && std::max({q.x, q.y, q.z}) < grid.n_blocks;
        if (in_grid && (dx || dy || dz)) f(flat(grid, q), dx, dy, dz);
      }
}

// Whether one of the block's nodes on the side of the offset has the other sign.
bool touches_other_sign(const float* values, bool inside, int dx, int dy, int dz) {
  const auto first = [](int d) { return d > 0 ? B - 1 : 0; };
  const auto last = [](int d) { return d < 0 ? 0 : B - 1; };
  for (int x = first(dx); x <= last(dx); ++x)
    for (int y = first(dy); y <= last(dy); ++y)
      for (int z = first(dz); z <= last(dz); ++z)
        if ((values[(x * B + y) * B + z] < 0) != inside) return true;
  return false;
}

// Numbers of the vertices on the edges that start at a block's nodes.
struct BlockVertices {
  int32_t first = 0;
  uint64_t crossed[3] = {};  // bit per node
  int count() const { return number(3, 0) - first; }
  int32_t number(int axis, int node) const {
    int32_t n = first;
    for (int a = 0; a < axis; ++a) n += __builtin_popcountll(crossed[a]);
    return axis < 3 ? n + __builtin_popcountll(crossed[axis] & ((uint64_t(1) << node) - 1)) : n;
  }
};

class Mesher {
 public:
  Mesher(const BlockGrid& grid, double origin, double spacing) : grid_(grid), origin_(origin), spacing_(spacing) {
    const int64_t total = int64_t(grid.n_blocks) * grid.n_blocks * grid.n_blocks;
    for (int64_t i = 0; i < total; ++i)
      if (grid.index[i] >= 0) rows_.push_back(i);
    std::sort(rows_.begin(), rows_.end(), [&](int64_t a, int64_t b) { return grid.index[a] < grid.index[b]; });
    vertices_.resize(rows_.size());
    n_triangles_.assign(rows_.size() + 1, 0);
  }

  TriangleMesh run() {
    const int64_t n = int64_t(rows_.size());
    parallel_for(n, 256, [&](int64_t begin, int64_t end) {
      for (int64_t row = begin; row < end; ++row) count(row);
    });
    int64_t n_vertices = 0;
    for (int64_t row = 0; row < n; ++row) {
      vertices_[row].first = int32_t(n_vertices);
      n_vertices += vertices_[row].count();
      if (n_vertices > std::numeric_limits<int32_t>::max())
        throw std::length_error("marching_cubes: too many vertices");
      n_triangles_[row + 1] += n_triangles_[row];
    }
    TriangleMesh mesh;
    mesh.vertices.resize(3 * size_t(n_vertices));
    mesh.triangles.resize(3 * size_t(n_triangles_[n]));
    parallel_for(n, 256, [&](int64_t begin, int64_t end) {
      for (int64_t row = begin; row < end; ++row) fill(row, mesh);
    });
    return mesh;
  }

 private:
  // The 5^3 values of a block and its neighbours' first layer, NaN where there are none.
  struct Window {
    float values[W * W * W];
    int32_t rows[8];  // by the offset's bits, negative where the block has no values
    float at(int x, int y, int z) const { return values[(x * W + y) * W + z]; }
  };

  Window window(int64_t row) const {
    Window out;
    const BlockPosition p = position(grid_, rows_[row]);
    std::fill_n(out.rows, 8, kOutsideBlock);
    out.rows[0] = int32_t(row);
    for_neighbours(grid_, p, 0,
                   [&](int64_t i, int dx, int dy, int dz) { out.rows[dx + 2 * dy + 4 * dz] = grid_.index[i]; });
    for (int x = 0; x < W; ++x)
      for (int y = 0; y < W; ++y)
        for (int z = 0; z < W; ++z) {
          const int32_t from = out.rows[x / B + 2 * (y / B) + 4 * (z / B)];
          out.values[(x * W + y) * W + z] =
              from < 0 ? std::numeric_limits<float>::quiet_NaN()
                       : grid_.values[int64_t(from) * kMeshBlockNodes + (x % B * B + y % B) * B + z % B];
        }
    return out;
  }

  // The case of a cell, 0 (nothing) where a node has no value.
  static int cell_case(const Window& w, int x, int y, int z) {
    int inside = 0;
    for (int corner = 0; corner < 8; ++corner) {
      const float value = w.at(x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2));
      if (value != value) return 0;
      inside |= int(value < 0) << corner;
    }
    return inside;
  }

  void count(int64_t row) {
    const Window w = window(row);
    for (int x = 0; x < B; ++x)
      for (int y = 0; y < B; ++y)
        for (int z = 0; z < B; ++z) {
          const int node = (x * B + y) * B + z;
          const float here = w.at(x, y, z);
          const float there[3] = {w.at(x + 1, y, z), w.at(x, y + 1, z), w.at(x, y, z + 1)};
          for (int axis = 0; axis < 3; ++axis)
            if (there[axis] == there[axis] && (here < 0) != (there[axis] < 0))
              vertices_[row].crossed[axis] |= uint64_t(1) << node;
          n_triangles_[row + 1] += cube_cases()[cell_case(w, x, y, z)].n_triangles;
        }
  }

  void fill(int64_t row, TriangleMesh& mesh) const {
    const Window w = window(row);
    const BlockPosition p = position(grid_, rows_[row]);
    int32_t* triangle = &mesh.triangles[0] + 3 * n_triangles_[row];
    for (int x = 0; x < B; ++x)
      for (int y = 0; y < B; ++y)
        for (int z = 0; z < B; ++z) {
          const int node = (x * B + y) * B + z;
          for (int axis = 0; axis < 3; ++axis) {
            if (!(vertices_[row].crossed[axis] >> node & 1)) continue;
            const double a = w.at(x, y, z), b = w.at(x + (axis == 0), y + (axis == 1), z + (axis == 2));
            double at[3] = {double(p.x * B + x), double(p.y * B + y), double(p.z * B + z)};
            at[axis] += std::clamp(a / (a - b), kKeepFromEnds, 1 - kKeepFromEnds);
            float* out = &mesh.vertices[0] + 3 * size_t(vertices_[row].number(axis, node));
            for (int c = 0; c < 3; ++c) out[c] = float(origin_ + spacing_ * at[c]);
          }
          const CubeCase& cell = cube_cases()[cell_case(w, x, y, z)];
          for (int i = 0; i < 3 * cell.n_triangles; ++i) *triangle++ = vertex(w, x, y, z, cube_edges()[cell.edges[i]]);
        }
  }

  int32_t vertex(const Window& w, int x, int y, int z, const CubeEdge& edge) const {
    x += edge.from & 1;
    y += edge.from >> 1 & 1;
    z += edge.from >> 2;
    const int32_t row = w.rows[x / B + 2 * (y / B) + 4 * (z / B)];
    return vertices_[row].number(edge.axis, (x % B * B + y % B) * B + z % B);
  }

  BlockGrid grid_;
  double origin_, spacing_;
  std::vector<int64_t> rows_;  // the flat index of each row's block
  std::vector<BlockVertices> vertices_;
  std::vector<int64_t> n_triangles_;
};

}  // namespace

std::vector<int64_t> blocks_to_open(const BlockGrid& grid) {
  const int64_t total = int64_t(grid.n_blocks) * grid.n_blocks * grid.n_blocks;
  std::vector<int64_t> found;
  for (int64_t i = 0; i < total; ++i) {
    const int32_t row = grid.index[i];
    const BlockPosition p = position(grid, i);
    if (row < 0 && uniform(grid, p)) continue;
    for_neighbours(grid, p, -1, [&](int64_t other, int dx, int dy, int dz) {
      const int32_t there = grid.index[other];
      if (there >= 0) return;
      if (row < 0) {
        if (row != there) found.push_back(other);
      } else if (touches_other_sign(grid.values + int64_t(row) * kMeshBlockNodes, there == kInsideBlock, dx, dy, dz)) {
        found.push_back(other);
      }
    });
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

TriangleMesh marching_cubes(const BlockGrid& grid, double origin, double spacing) {
  return Mesher(grid, origin, spacing).run();
}

}  // namespace splitnerf
