// Boxes, capsules and spheres of a bundle of lanes against a half-space that stands: touch_plane() of
// touch_segments.hpp in all lanes at once. The face of a box that looks most into the half-space is
// chosen by masks.
#pragma once

#include "lanes.hpp"
#include "touch_segments.hpp"

namespace fan {

// Whether touch_plane_lanes() has points for a solid.
FAN_FN bool has_points_in_lanes(const Solid& x) {
  return x.kind == BOX || (x.kind == SEGMENT && !is_ellipsoid(x));
}

// A link's point in the world, from the link's pose (12 numbers).
template <class Real>
FAN_FN void carry_in_lanes(const Real* pose, const double* own, Real* out) {
  FAN_UNROLL for (int c = 0; c < 3; ++c)
    out[c] = pose[9 + c] + pose[c] * own[0] + pose[3 + c] * own[1] + pose[6 + c] * own[2];
}

// Calls add(feature, point, gap, lanes) for every point of x, in the frame of a link that is posed,
// that has a gap below the margin in some of the lanes.
template <class Real, class Mask, class Add>
FAN_FN void touch_plane_lanes(
    const Solid& x, const Real* pose, const Solid& plane, const Real& margin, const Mask& lanes,
    const Add& add) {
  const auto above = [&](int feature, const Real* p, const Mask& where) {
    const double* n = plane.b;
    Real height = Real(0.0), point[3];
    FAN_UNROLL for (int c = 0; c < 3; ++c) height += (p[c] - plane.a[c]) * n[c];
    const Real gap = height - (x.radius + plane.radius);
    const Mask here = where && gap < margin;
    if (!any(here)) return;
    const Real down = 0.5 * (height + (x.radius - plane.radius));
    FAN_UNROLL for (int c = 0; c < 3; ++c) point[c] = p[c] - down * n[c];
    add(feature, point, gap, here);
  };
  Real at[3];
  carry_in_lanes(pose, x.a, at);
  if (x.kind == SEGMENT) {
    above(0, at, lanes);
    if (!(Core(x.a, x.b).length > 0.0)) return;
    carry_in_lanes(pose, x.b, at);
    return above(1, at, lanes);
  }
  using std::abs;
  Real edge[9], up[3];  // half edges; how far they go up
  for (int k = 0; k < 3; ++k) {
    const double* own = x.R + 3 * k;
    up[k] = Real(0.0);
    for (int c = 0; c < 3; ++c) {
      const Real along = pose[c] * own[0] + pose[3 + c] * own[1] + pose[6 + c] * own[2];
      up[k] += along * plane.b[c];
      edge[3 * k + c] = x.half[k] * along;
    }
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
