// Meshes that the tests trace.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "splitnerf/scene.h"

namespace splitnerf {

struct TestMesh {
  std::vector<float> vertices;
  std::vector<int32_t> triangles;
};

inline Scene make_scene(const TestMesh& mesh) {
  return Scene(mesh.vertices.data(), int64_t(mesh.vertices.size() / 3), mesh.triangles.data(),
               int64_t(mesh.triangles.size() / 3));
}

// [-1, 1]^3; vertex k has its coordinates' signs in the bits of k.
inline TestMesh cube_mesh() {
  TestMesh mesh;
  for (int k = 0; k < 8; ++k) {
    for (int axis = 0; axis < 3; ++axis) mesh.vertices.push_back(k >> axis & 1 ? 1.f : -1.f);
  }
  for (int axis = 0; axis < 3; ++axis) {
    const int a = 1 << (axis + 1) % 3, b = 1 << (axis + 2) % 3;
    for (int base : {0, 1 << axis}) {
      for (int corner : {base, base + a, base + a + b, base, base + a + b, base + b}) mesh.triangles.push_back(corner);
    }
  }
  return mesh;
}

// Unit sphere; its vertices are its normals.
inline TestMesh sphere_mesh(int rings, int segments) {
  TestMesh mesh;
  for (int i = 0; i <= rings; ++i) {
    for (int j = 0; j < segments; ++j) {
      const double theta = kPi * i / rings, phi = 2 * kPi * j / segments;
      for (double x : {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)}) {
        mesh.vertices.push_back(static_cast<float>(x));
      }
    }
  }
  for (int i = 0; i < rings; ++i) {
    for (int j = 0; j < segments; ++j) {
      const int a = i * segments + j, b = i * segments + (j + 1) % segments;
      for (int v : {a, a + segments, b + segments}) mesh.triangles.push_back(v);
      for (int v : {a, b + segments, b}) mesh.triangles.push_back(v);
    }
  }
  return mesh;
}

// Adds the parallelogram corner, corner + e1, corner + e1 + e2, corner + e2.
inline void add_quad(TestMesh& mesh, Vec3<float> corner, Vec3<float> e1, Vec3<float> e2) {
  const int first = static_cast<int>(mesh.vertices.size() / 3);
  for (const Vec3<float> p : {corner, corner + e1, corner + e1 + e2, corner + e2}) {
    for (int c = 0; c < 3; ++c) mesh.vertices.push_back(p[c]);
  }
  for (int k : {0, 1, 2, 0, 2, 3}) mesh.triangles.push_back(first + k);
}

}  // namespace splitnerf
