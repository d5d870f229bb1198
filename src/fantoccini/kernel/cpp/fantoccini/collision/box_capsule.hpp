// Contact points of capsules with boxes.
//
// A capsule whose core is outside the box touches it at the nearest points. Where their direction
// is nearly a face's normal, the two ends of the part of the core above the face replace them, as
// for capsules that lie on one another (capsules.hpp); where the core lies along an edge, the two
// ends of their overlap do. A core that runs into the box leaves it in the direction of least
// depth: a face normal or a product of edges.
#pragma once

#include "fantoccini/collision/capsules.hpp"

namespace fan {

struct BoxTolerances {
  static constexpr double core = 1e-10;       // m: a core this near meets the box
  static constexpr double edge_share = 0.95;  // an edge wins below this share of a face's depth
  static constexpr double same_face = 1e-4;   // relative to the size: flat below it
  static constexpr double same_slope = 1e-5;  // likewise, of heights
  static constexpr double rounding = 1e-9;    // relative to the size
};

// Sign of a coordinate: 1 or -1.
FAN_FN double side_of(double x) { return x < 0.0 ? -1.0 : 1.0; }

FAN_FN int largest_of(const double* x) {
  int best = 0;
  for (int k = 1; k < 3; ++k) best = fabs(x[k]) > fabs(x[best]) ? k : best;
  return best;
}

FAN_FN int smallest_of(const double* x) {
  int best = 0;
  for (int k = 1; k < 3; ++k) best = fabs(x[k]) < fabs(x[best]) ? k : best;
  return best;
}

// Number of the stretch (0, 1, 2) in which a value of flatness lies.
FAN_FN int stretch_of(double flat) { return flat <= 0.0 ? 0 : flat < 1.0 ? 1 : 2; }

// The edge along axis k of a box about the origin that lies farthest in a direction.
FAN_FN Core edge_towards(const double* direction, const double* half, int k) {
  double a[3], b[3];
  for (int c = 0; c < 3; ++c) {
    b[c] = c == k ? half[c] : side_of(direction[c]) * half[c];
    a[c] = c == k ? -half[c] : b[c];
  }
  return Core(a, b);
}

// The ends of the part of a core that lies above a face of a box about the origin, and the points
// below them on the face. The part always contains the core's point at `nearest`, so that a core
// that stands on the face's edge keeps its foot.
struct FaceClip {
  PointPair ends[2];
  bool exists;

  FAN_FN FaceClip(const Core& core, const double* half, int face, double side, double nearest)
      : ends{} {
    double low = 0.0, high = core.length;
    exists = true;
    for (int k = 0; k < 3; ++k) {
      if (k == face) continue;
      if (fabs(core.u[k]) > DistanceTolerances::min_length) {
        const double middle = -core.a[k] / core.u[k], reach = half[k] / fabs(core.u[k]);
        low = fmax(low, middle - reach);
        high = fmin(high, middle + reach);
      } else {
        exists = exists && fabs(core.a[k]) <= half[k];
      }
    }
    exists = exists && low <= high;
    for (int k = 0; k < 2; ++k) {
      along3(core.a, k == 0 ? fmin(low, nearest) : fmax(high, nearest), core.u, ends[k].p);
      for (int c = 0; c < 3; ++c)
        ends[k].q[c] = c == face ? side * half[c] : clamped(ends[k].p[c], -half[c], half[c]);
    }
  }
};

// Direction in which a core that meets a box about the origin leaves it.
struct WayOut {
  double normal[3], gap = -DistanceTolerances::max_distance;
  int axis = 0;
  bool by_edge = false;

  FAN_FN WayOut(const Core& core, const double* half) {
    for (int k = 0; k < 3; ++k)
      for (const double side : {1.0, -1.0}) {
        double n[3];
        axis3(k, side, n);
        take(n, fmin(side * core.a[k], side * core.b[k]) - half[k], k, false);
      }
    const double by_face = gap;
    for (int k = 0; k < 3; ++k) {
      double n[3], edge[3];
      axis3(k, 1.0, edge);
      cross(core.u, edge, n);
      if (!unit3(n, TouchTolerances::lying)) continue;
      const double height = dot3(n, core.a), side = side_of(height);
      double reach = 0.0;
      for (int c = 0; c < 3; ++c) {
        n[c] *= side;
        reach += half[c] * fabs(n[c]);
      }
      const double axis_gap = fabs(height) - reach;
      if (axis_gap > BoxTolerances::edge_share * by_face) take(n, axis_gap, k, true);
    }
  }

 private:
  FAN_FN void take(const double* n, double axis_gap, int k, bool edge) {
    if (!(axis_gap > gap)) return;
    gap = axis_gap;
    axis = k;
    by_edge = edge;
    for (int c = 0; c < 3; ++c) normal[c] = n[c];
  }
};

FAN_FN void touch_box_inside(const Core& core, const double* half, double at, Touches& to) {
  const WayOut out(core, half);
  if (out.by_edge) {
    const PointPair pair = nearest_points(core, edge_towards(out.normal, half, out.axis));
    return to.add(pair.p, pair.q, out.normal, 0);
  }
  const FaceClip face(core, half, out.axis, out.normal[out.axis], at);
  if (face.exists) {
    for (int k = 0; k < (core.length > 0.0 ? 2 : 1); ++k)
      to.add(face.ends[k].p, face.ends[k].q, out.normal, k);
    return;
  }
  // A core that meets a corner of the box.
  const double* end = dot3(core.a, out.normal) < dot3(core.b, out.normal) ? core.a : core.b;
  double q[3];
  along3(end, -out.gap, out.normal, q);
  to.add(end, q, out.normal, 0);
}

// The core's point at arc length `at` is nearest to the box, in the direction `normal`.
FAN_FN void touch_box_outside(
    const Core& core, const double* half, double at, const PointPair& nearest, const double* normal,
    Touches& to) {
  const int face = largest_of(normal), edge = smallest_of(normal);
  const double side = side_of(normal[face]);
  double tilt[3];
  copy3(normal, tilt);
  tilt[face] = 0.0;
  const FaceClip clip(core, half, face, side, at);
  const double on_face = clip.exists && core.length > 0.0 ? flatness(length3(tilt)) : 0.0;
  const Overlap on_edge(core, edge_towards(normal, half, edge));
  const CorePart part = at <= 0.0 ? FIRST_END : at >= core.length ? SECOND_END : MIDDLE;
  const int shape = 3 * (3 * stretch_of(on_face) + stretch_of(on_edge.flat)) + part;
  if (on_face == 0.0 && on_edge.flat == 0.0)
    return to.add(
        nearest.p, nearest.q, normal, 0, lasting_regions + 27 * part + region_of_box(normal));
  for (int k = 0; k < 2; ++k) {
    PointPair pair = between_pairs(nearest, on_edge.ends[k], on_edge.flat);
    pair = between_pairs(pair, clip.ends[k], on_face);
    double n[3];
    copy3(normal, n);
    aim(pair, n);
    const int own = clip.ends[k].p[0] == nearest.p[0] && clip.ends[k].p[1] == nearest.p[1];
    to.add(pair.p, pair.q, n, k, 27 * (2 * shape + own) + region_of_box(n));
  }
}

// Transforms the points from the n-th on from a box's frame to the world.
FAN_FN void place_touches(const PlacedSolid& box, int n, Touches& to) {
  for (; n < to.n; ++n) {
    double point[3], normal[3];
    out_of_axes(box.R, to.out[n].point, point);
    out_of_axes(box.R, to.out[n].normal, normal);
    along3(box.a, 1.0, point, to.out[n].point);
    copy3(normal, to.out[n].normal);
  }
}

// A sphere or capsule x and a box: feature 0, and 1 where two points are needed.
FAN_FN void touch_box_by_segment(const PlacedSolid& x, const PlacedSolid& box, Touches& to) {
  double a[3], b[3], from[3];
  difference3(x.a, box.a, from);
  into_axes(box.R, from, a);
  difference3(x.b, box.a, from);
  into_axes(box.R, from, b);
  const Core core(a, b);
  PointPair nearest;
  const double at = nearest_to_box(core.a, core.b, box.half) * core.length;
  along3(core.a, at, core.u, nearest.p);
  for (int k = 0; k < 3; ++k) nearest.q[k] = clamped(nearest.p[k], -box.half[k], box.half[k]);
  double normal[3];
  difference3(nearest.p, nearest.q, normal);
  if (unit3(normal, BoxTolerances::core))
    touch_box_outside(core, box.half, at, nearest, normal, to);
  else touch_box_inside(core, box.half, at, to);
  place_touches(box, 0, to);
}

}  // namespace fan
