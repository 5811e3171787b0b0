// The few calls in which Embree 3 and Embree 4 differ.
#pragma once

#if SPLITNERF_EMBREE_MAJOR == 4
#include <embree4/rtcore.h>
#elif SPLITNERF_EMBREE_MAJOR == 3
#include <embree3/rtcore.h>
#else
#error "SPLITNERF_EMBREE_MAJOR must be 3 or 4"
#endif

namespace splitnerf::embree {

#if SPLITNERF_EMBREE_MAJOR == 4

inline void occluded16(const int* valid, RTCScene scene, RTCRay16* rays) { rtcOccluded16(valid, scene, rays); }
inline void occluded1(RTCScene scene, RTCRay* ray) { rtcOccluded1(scene, ray); }
inline void intersect1(RTCScene scene, RTCRayHit* ray) { rtcIntersect1(scene, ray); }
inline void intersect16(const int* valid, RTCScene scene, RTCRayHit16* rays) { rtcIntersect16(valid, scene, rays); }

#else

inline RTCIntersectContext default_context() {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  return context;
}
inline void occluded16(const int* valid, RTCScene scene, RTCRay16* rays) {
  RTCIntersectContext context = default_context();
  rtcOccluded16(valid, scene, &context, rays);
}
inline void occluded1(RTCScene scene, RTCRay* ray) {
  RTCIntersectContext context = default_context();
  rtcOccluded1(scene, &context, ray);
}
inline void intersect1(RTCScene scene, RTCRayHit* ray) {
  RTCIntersectContext context = default_context();
  rtcIntersect1(scene, &context, ray);
}
inline void intersect16(const int* valid, RTCScene scene, RTCRayHit16* rays) {
  RTCIntersectContext context = default_context();
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcIntersect16(valid, scene, &context, rays);
}

#endif

}  // namespace splitnerf::embree
