// The 256 cases of marching cubes from first principles.
#include <limits>

#include "splitnerf/marching_cubes.h"

namespace splitnerf {
namespace {

int edge_between(int a, int b) {
  const auto& edges = cube_edges();
  for (int e = 0; e < 12; ++e)
    if ((edges[e].from == a && edges[e].to == b) || (edges[e].from == b && edges[e].to == a)) return e;
  return -1;
}

// The corners of the six faces, counter-clockwise seen from outside the cube.
std::array<std::array<int, 4>, 6> face_corners() {
  std::array<std::array<int, 4>, 6> faces{};
  for (int axis = 0; axis < 3; ++axis) {
    const int a = 1 << axis, b = 1 << (axis + 1) % 3, c = 1 << (axis + 2) % 3;
    faces[2 * axis] = {0, c, b + c, b};
    faces[2 * axis + 1] = {a, a + b, a + b + c, a + c};
  }
  return faces;
}

bool in_one_face(int e, int f) {
  const auto& edges = cube_edges();
  const int low = edges[e].from & edges[e].to & edges[f].from & edges[f].to;
  const int high = edges[e].from | edges[e].to | edges[f].from | edges[f].to;
  return low != 0 || high != 7;
}

double squared_distance(int e, int f) {
  const auto& edges = cube_edges();
  double total = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const auto middle = [&](int i) { return 0.5 * ((edges[i].from >> axis & 1) + (edges[i].to >> axis & 1)); };
    total += (middle(e) - middle(f)) * (middle(e) - middle(f));
  }
  return total;
}

// Splits the polygon loop[first..last] so that no diagonal lies in a face and the diagonals are short.
class Triangulation {
 public:
  explicit Triangulation(const std::vector<int>& loop) : loop_(loop), n_(int(loop.size())) {
    for (int span = 2; span < n_; ++span) {
      for (int i = 0; i + span < n_; ++i) {
        const int k = i + span;
        cost_[i][k] = std::numeric_limits<double>::max();
        for (int j = i + 1; j < k; ++j) {
          const double cost = cost_[i][j] + cost_[j][k] + diagonal(i, j) + diagonal(j, k);
          if (cost < cost_[i][k]) {
            cost_[i][k] = cost;
            apex_[i][k] = j;
          }
        }
      }
    }
  }

  void append(CubeCase& out) const { append(out, 0, n_ - 1); }

 private:
  double diagonal(int i, int j) const {
    if (j - i == 1) return 0;
    return squared_distance(loop_[i], loop_[j]) + (in_one_face(loop_[i], loop_[j]) ? 1e3 : 0);
  }
  void append(CubeCase& out, int i, int k) const {
    if (k - i < 2) return;
    const int j = apex_[i][k];
    append(out, i, j);
    const int corners[3] = {i, j, k};
    for (int c = 0; c < 3; ++c) out.edges[3 * out.n_triangles + c] = uint8_t(loop_[corners[c]]);
    ++out.n_triangles;
    append(out, j, k);
  }

  std::vector<int> loop_;
  int n_;
  double cost_[12][12] = {};
  int apex_[12][12] = {};
};

CubeCase build_case(int inside, const std::array<std::array<int, 4>, 6>& faces) {
  std::array<int, 12> next;
  next.fill(-1);
  const auto is_inside = [&](int corner) { return (inside >> corner & 1) != 0; };
  for (const auto& face : faces) {
    for (int i = 0; i < 4; ++i) {
      if (is_inside(face[i]) || !is_inside(face[(i + 1) % 4])) continue;
      int j = i + 1;  // the run's last corner
      while (is_inside(face[(j + 1) % 4])) ++j;
      next[edge_between(face[i], face[(i + 1) % 4])] = edge_between(face[j % 4], face[(j + 1) % 4]);
    }
  }
  CubeCase out;
  for (int start = 0; start < 12; ++start) {
    std::vector<int> loop;
    for (int e = start; next[e] >= 0;) {
      loop.push_back(e);
      const int following = next[e];
      next[e] = -1;
      e = following;
    }
    if (!loop.empty()) Triangulation(loop).append(out);
  }
  return out;
}

}  // namespace

const std::array<CubeEdge, 12>& cube_edges() {
  static const auto edges = [] {
    std::array<CubeEdge, 12> out{};
    int e = 0;
    for (int axis = 0; axis < 3; ++axis)
      for (int corner = 0; corner < 8; ++corner)
        if (!(corner >> axis & 1)) out[e++] = {axis, corner, corner | 1 << axis};
    return out;
  }();
  return edges;
}

const std::array<CubeCase, 256>& cube_cases() {
  static const auto cases = [] {
    std::array<CubeCase, 256> out{};
    const auto faces = face_corners();
    for (int inside = 0; inside < 256; ++inside) out[inside] = build_case(inside, faces);
    return out;
  }();
  return cases;
}

}  // namespace splitnerf
