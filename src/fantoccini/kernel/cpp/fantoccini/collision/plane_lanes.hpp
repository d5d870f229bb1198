// Boxes, capsules, spheres and ellipsoids of a bundle of lanes against a standing half-space:
// touch_plane() of capsules.hpp in all lanes at once. Masks select the face of a box that is most
// nearly opposed to the half-space.
#pragma once

#include "fantoccini/collision/capsules.hpp"
#include "fantoccini/math/lanes.hpp"

namespace fan {

// Whether touch_plane_lanes() has points for a solid.
FAN_FN bool has_points_in_lanes(const Solid& x) { return x.kind == BOX || x.kind == SEGMENT; }

// A link's point in the world, from the link's pose (12 numbers).
template <class Real>
FAN_FN void carry_in_lanes(const Real* pose, const double* own, Real* out) {
  FAN_UNROLL for (int c = 0; c < 3; ++c) out[c] =
      pose[9 + c] + pose[c] * own[0] + pose[3 + c] * own[1] + pose[6 + c] * own[2];
}

// Likewise an axis; returns its component along n.
template <class Real>
FAN_FN Real axis_in_lanes(const Real* pose, const double* own, const double* n, Real* out) {
  Real along = Real(0.0);
  FAN_UNROLL for (int c = 0; c < 3; ++c) {
    out[c] = pose[c] * own[0] + pose[3 + c] * own[1] + pose[6 + c] * own[2];
    along += out[c] * n[c];
  }
  return along;
}

// Calls add(feature, point, gap, lanes) for every point of x, in the frame of its posed link, with
// a gap below the margin in any of the lanes.
template <class Real, class Mask, class Add>
FAN_FN void touch_plane_lanes(
    const Solid& x, const Real* pose, const Solid& plane, const Real& margin, const Mask& lanes,
    const Add& add) {
  const auto above = [&](int feature, const Real* p, const Mask& where) {
    const double* n = plane.b;
    Real height = Real(0.0), point[3];
    FAN_UNROLL for (int c = 0; c < 3; ++c) height += (p[c] - plane.a[c]) * n[c];
    const Real gap = height - (inflation(x) + plane.radius);
    const Mask here = where && gap < margin;
    if (!any(here)) return;
    const Real down = height - plane.radius;
    FAN_UNROLL for (int c = 0; c < 3; ++c) point[c] = p[c] - down * n[c];
    add(feature, point, gap, here);
  };
  Real at[3];
  if (is_ellipsoid(x)) {
    using std::sqrt;
    const double least = DistanceTolerances::min_length;
    double centre[3];
    for (int c = 0; c < 3; ++c) centre[c] = 0.5 * (x.a[c] + x.b[c]);
    carry_in_lanes(pose, centre, at);
    Real axis[9], up[3], square = Real(0.0);
    for (int k = 0; k < 3; ++k) {
      up[k] = axis_in_lanes(pose, x.R + 3 * k, plane.b, axis + 3 * k);
      square += up[k] * up[k] * (x.half[k] * x.half[k]);
    }
    const Real reach = sqrt(square),
               by = Real(1.0) / select(reach > Real(least), reach, Real(least));
    for (int k = 0; k < 3; ++k)
      for (int c = 0; c < 3; ++c) at[c] -= (x.half[k] * x.half[k]) * (up[k] * by) * axis[3 * k + c];
    return above(0, at, lanes);
  }
  carry_in_lanes(pose, x.a, at);
  if (x.kind == SEGMENT) {
    above(0, at, lanes);
    if (!(Core(x.a, x.b).length > 0.0)) return;
    carry_in_lanes(pose, x.b, at);
    return above(1, at, lanes);
  }
  using std::abs;
  Real edge[9], up[3];  // half edges, and their heights
  for (int k = 0; k < 3; ++k) {
    up[k] = axis_in_lanes(pose, x.R + 3 * k, plane.b, edge + 3 * k);
    for (int c = 0; c < 3; ++c) edge[3 * k + c] = x.half[k] * edge[3 * k + c];
  }
  const Mask second = abs(up[1]) > abs(up[0]);
  const Mask third = abs(up[2]) > select(second, Real(abs(up[1])), Real(abs(up[0])));
  const Mask is_face[3] = {!second && !third, second && !third, third};
  for (int corner = 0; corner < 8; ++corner) {
    Mask on_face = Real(0.0) > Real(1.0);
    Real p[3] = {at[0], at[1], at[2]};
    for (int k = 0; k < 3; ++k) {
      const bool ahead = corner >> k & 1;
      const Mask goes_down = ahead ? !(up[k] > Real(0.0)) : up[k] > Real(0.0);
      on_face = on_face || (is_face[k] && goes_down);
      for (int c = 0; c < 3; ++c) p[c] = ahead ? p[c] + edge[3 * k + c] : p[c] - edge[3 * k + c];
    }
    const Mask where = lanes && on_face;
    if (any(where)) above(corner, p, where);
  }
}

}  // namespace fan
