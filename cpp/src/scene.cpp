// Scene on Embree.
#include "splitnerf/scene.h"

#include <cmath>
#include <stdexcept>
#include <string>

#include "embree_compat.h"
#include "scene_impl.h"
#include "splitnerf/parallel.h"

namespace splitnerf {
namespace {

constexpr int64_t kPacket = 16;
constexpr int64_t kPacketsPerTask = 256;

const char* error_name(RTCError error) {
  switch (error) {
    case RTC_ERROR_NONE:
      return "no error";
    case RTC_ERROR_INVALID_ARGUMENT:
      return "invalid argument";
    case RTC_ERROR_INVALID_OPERATION:
      return "invalid operation";
    case RTC_ERROR_OUT_OF_MEMORY:
      return "out of memory";
    case RTC_ERROR_UNSUPPORTED_CPU:
      return "unsupported CPU (SSE2 is required)";
    case RTC_ERROR_CANCELLED:
      return "cancelled";
    default:
      return "unknown error";
  }
}

// Embree keeps the first error of each thread until it is asked for.
void check(RTCDevice device, const char* what) {
  const RTCError error = rtcGetDeviceError(device);
  if (error != RTC_ERROR_NONE) throw std::runtime_error(std::string("Embree: ") + what + ": " + error_name(error));
}

// One device for the process, never released: it holds Embree's own threads.
RTCDevice shared_device() {
  static const RTCDevice device = [] {
    const RTCDevice created = rtcNewDevice(nullptr);
    if (!created) check(nullptr, "rtcNewDevice failed");
    return created;
  }();
  return device;
}

RTCScene embree_scene(const std::shared_ptr<void>& tracer) { return static_cast<RTCScene>(tracer.get()); }

// The direction, with 0 for components under 1e-12 of its largest one. Of a packet that holds a component of about 1e-22, as
// rounding leaves in the place of 0, Embree 3.13 loses most hits, those of the other rays too.
Vec3<float> without_traces(Vec3<float> d) {
  const float least = 1e-12f * max_of(std::fabs(d.x), max_of(std::fabs(d.y), std::fabs(d.z)));
  const auto kept = [least](float x) { return std::fabs(x) < least ? 0.f : x; };
  return {kept(d.x), kept(d.y), kept(d.z)};
}

RTCRay make_ray(Vec3<float> origin, Vec3<float> direction, float t_far) {
  direction = without_traces(direction);
  RTCRay ray{};
  ray.org_x = origin.x;
  ray.org_y = origin.y;
  ray.org_z = origin.z;
  ray.dir_x = direction.x;
  ray.dir_y = direction.y;
  ray.dir_z = direction.z;
  ray.tfar = t_far;
  ray.mask = ~0u;
  return ray;
}

// Masks a lane of a packet out. Without AVX-512, Embree 3.13 traces lanes whose `valid` is 0 too: their segment is made empty.
void mask_out(RTCRay16& rays, int* valid, int k) { valid[k] = 0, rays.tnear[k] = 1.f, rays.tfar[k] = 0.f; }

// Fills a packet from the rays first, first + 1, ... and returns how many there were; lanes past the
// end repeat the last ray, masked out like rays that cannot be traced.
int load_packet(const float* origins, const float* directions, int64_t first, int64_t n_rays, float t_far,
                RTCRay16& rays, int* valid) {
  const int count = static_cast<int>(min_of(kPacket, n_rays - first));
  for (int k = 0; k < kPacket; ++k) {
    const int64_t i = first + min_of(k, count - 1);
    Vec3<float> o = load3(origins + i * 3), d = load3(directions + i * 3);
    const bool traced = can_be_traced(o, d, t_far);
    if (!traced) o = {0.f, 0.f, 0.f}, d = {0.f, 0.f, 1.f};
    d = without_traces(d);
    rays.org_x[k] = o.x, rays.org_y[k] = o.y, rays.org_z[k] = o.z;
    rays.dir_x[k] = d.x, rays.dir_y[k] = d.y, rays.dir_z[k] = d.z;
    rays.tnear[k] = 0.f, rays.tfar[k] = t_far;
    rays.mask[k] = ~0u;
    rays.flags[k] = 0;
    valid[k] = -1;
    if (k >= count || !traced) mask_out(rays, valid, k);
  }
  return count;
}

}  // namespace

Scene::Scene(const float* vertices, int64_t n_vertices, const int32_t* triangles, int64_t n_triangles)
    : impl_(std::make_unique<Impl>(vertices, n_vertices, triangles, n_triangles)) {
  const RTCDevice device = shared_device();
  const RTCScene scene = rtcNewScene(device);
  check(device, "rtcNewScene");
  impl_->tracer = std::shared_ptr<void>(scene, [](void* p) { rtcReleaseScene(static_cast<RTCScene>(p)); });
  // Robust: rays through shared edges and vertices never slip between the triangles.
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
  rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);

  const RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  check(device, "rtcNewGeometry");
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, impl_->vertices.data(), 0,
                             3 * sizeof(float), static_cast<size_t>(n_vertices));
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, impl_->triangles.data(), 0,
                             3 * sizeof(int32_t), static_cast<size_t>(n_triangles));
  rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_HIGH);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene, geometry);
  rtcReleaseGeometry(geometry);  // the scene keeps its own reference
  check(device, "attaching the triangles");
  rtcCommitScene(scene);
  check(device, "building the acceleration structure");
}

void Scene::trace_visibility(const float* origins, const float* directions, int64_t n_rays, float t_far,
                             uint8_t* visible) const {
  const RTCScene scene = embree_scene(impl_->tracer);
  parallel_for((n_rays + kPacket - 1) / kPacket, kPacketsPerTask, [&](int64_t begin, int64_t end) {
    alignas(64) RTCRay16 rays{};
    alignas(64) int valid[kPacket];
    for (int64_t packet = begin; packet < end; ++packet) {
      const int64_t first = packet * kPacket;
      const int count = load_packet(origins, directions, first, n_rays, t_far, rays, valid);
      embree::occluded16(valid, scene, &rays);
      // Embree marks an occluded ray by tfar = -infinity.
      for (int k = 0; k < count; ++k) visible[first + k] = valid[k] == 0 || !(rays.tfar[k] < 0.f);
    }
  });
}

void Scene::trace_fan(Vec3<float> origin, const float* x, const float* y, const float* z, int64_t n,
                      const int32_t* active, int32_t* visible) const {
  const RTCScene scene = embree_scene(impl_->tracer);
  alignas(64) RTCRay16 rays{};
  alignas(64) int valid[kPacket];
  const bool starts = fits(origin);
  if (!starts) origin = {0.f, 0.f, 0.f};
  for (int k = 0; k < kPacket; ++k) {
    rays.org_x[k] = origin.x, rays.org_y[k] = origin.y, rays.org_z[k] = origin.z;
    rays.mask[k] = ~0u;
  }
  for (int64_t first = 0; first < n; first += kPacket) {
    for (int k = 0; k < kPacket; ++k) {
      Vec3<float> d{x[first + k], y[first + k], z[first + k]};
      const bool traced = starts && fits(d);
      d = traced ? without_traces(d) : Vec3<float>{0.f, 0.f, 1.f};
      rays.dir_x[k] = d.x, rays.dir_y[k] = d.y, rays.dir_z[k] = d.z;
      rays.tnear[k] = 0.f, rays.tfar[k] = INFINITY, valid[k] = -1;
      if (!traced || !active[first + k]) mask_out(rays, valid, k);
    }
    embree::occluded16(valid, scene, &rays);
    for (int k = 0; k < kPacket; ++k) visible[first + k] = rays.tfar[k] < 0.f ? 0 : -1;
  }
}

void Scene::trace_closest(const float* origins, const float* directions, int64_t n_rays, float t_far, Hit* hits) const {
  const RTCScene scene = embree_scene(impl_->tracer);
  parallel_for((n_rays + kPacket - 1) / kPacket, kPacketsPerTask, [&](int64_t begin, int64_t end) {
    alignas(64) RTCRayHit16 query{};
    alignas(64) int valid[kPacket];
    for (int64_t packet = begin; packet < end; ++packet) {
      const int64_t first = packet * kPacket;
      const int count = load_packet(origins, directions, first, n_rays, t_far, query.ray, valid);
      for (int k = 0; k < kPacket; ++k) query.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
      embree::intersect16(valid, scene, &query);
      for (int k = 0; k < count; ++k) {
        const bool hit = query.hit.geomID[k] != RTC_INVALID_GEOMETRY_ID;
        hits[first + k] =
            hit ? Hit{query.ray.tfar[k], query.hit.primID[k], query.hit.u[k], query.hit.v[k]} : Hit{-1.f, 0, 0.f, 0.f};
      }
    }
  });
}

Hit Scene::trace_closest(Vec3<float> origin, Vec3<float> direction, float t_far) const {
  if (!can_be_traced(origin, direction, t_far)) return {-1.f, 0, 0.f, 0.f};
  RTCRayHit query{};
  query.ray = make_ray(origin, direction, t_far);
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  embree::intersect1(embree_scene(impl_->tracer), &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {-1.f, 0, 0.f, 0.f};
  return {query.ray.tfar, query.hit.primID, query.hit.u, query.hit.v};
}

bool Scene::occluded(Vec3<float> origin, Vec3<float> direction, float t_far) const {
  if (!can_be_traced(origin, direction, t_far)) return false;
  RTCRay ray = make_ray(origin, direction, t_far);
  embree::occluded1(embree_scene(impl_->tracer), &ray);
  return ray.tfar < 0.f;
}

const char* embree_version() {
  static const std::string version = [] {
    const RTCDevice device = shared_device();
    const auto part = [&](RTCDeviceProperty p) { return std::to_string(rtcGetDeviceProperty(device, p)); };
    return part(RTC_DEVICE_PROPERTY_VERSION_MAJOR) + "." + part(RTC_DEVICE_PROPERTY_VERSION_MINOR) + "." +
           part(RTC_DEVICE_PROPERTY_VERSION_PATCH);
  }();
  return version.c_str();
}

}  // namespace splitnerf
