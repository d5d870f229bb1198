// Contact points of spheres and capsules with one another, and of all solids with half-spaces.
//
// Two capsules touch at the nearest points p and q of their cores. Where the cores lie flat on one
// another, the nearest points are anywhere along the overlap and would jump; the two ends of the
// overlap replace them. In between, two points slide from the ends to the nearest points,
//
//     p_k = p + w (e_k - p),  k = 0, 1,
//
// where w falls from 1 below the angle `lying` to 0 above the angle `crossing`, where one point is
// left. The gap of every point is that of the surfaces there. The least gap exceeds the solids'
// distance by at most (w L sin)^2 / 8 d, for cores at the distance d that overlap by L.
#pragma once

#include "fantoccini/collision/solids.hpp"

FAN_LOOPS_BEGIN

namespace fan {

// A point of each of two cores.
struct PointPair {
  double p[3], q[3];
};

// (1 - w) a + w b
FAN_FN PointPair between_pairs(const PointPair& a, const PointPair& b, double w) {
  PointPair out;
  for (int k = 0; k < 3; ++k) {
    out.p[k] = a.p[k] + w * (b.p[k] - a.p[k]);
    out.q[k] = a.q[k] + w * (b.q[k] - a.q[k]);
  }
  return out;
}

// Sets `normal` to the unit vector along p - q if the points are apart. Returns whether they are.
FAN_FN bool aim(const PointPair& pair, double* normal) {
  double apart[3];
  difference3(pair.p, pair.q, apart);
  if (!unit3(apart, TouchTolerances::tiny)) return false;
  copy3(apart, normal);
  return true;
}

// Parts of a core.
enum CorePart { FIRST_END, SECOND_END, MIDDLE };

// A segment with its direction u, a unit vector; a point has none.
struct Core {
  double a[3], b[3], u[3], length;

  FAN_FN Core(const double* from, const double* to) {
    difference3(to, from, u);
    length = length3(u);
    const bool point = !unit3(u, TouchTolerances::tiny);
    if (point) length = 0.0;
    for (int k = 0; k < 3; ++k) {
      if (point) u[k] = 0.0;
      a[k] = from[k];
      b[k] = to[k];
    }
  }

  // The point of the core's line nearest to x.
  FAN_FN void project(const double* x, double* out) const {
    double r[3];
    difference3(x, a, r);
    along3(a, dot3(r, u), u, out);
  }

  // Finds the point of the core nearest to x. Returns the part of the core on which it lies.
  FAN_FN CorePart nearest(const double* x, double* out) const {
    double r[3];
    difference3(x, a, r);
    const double at = dot3(r, u);
    along3(a, clamped(at, 0.0, length), u, out);
    return !(at > 0.0) ? FIRST_END : at < length ? MIDDLE : SECOND_END;
  }
};

// Whether the part of a core with the point p is nearest to a point in the direction n from p, with
// a tolerance relative to the core's length and to a unit vector.
FAN_FN bool is_nearest_part(
    const Core& core, CorePart part, const double* p, const double* n, double most) {
  if (!(core.length > 0.0)) return true;
  if (part != MIDDLE) return (part == FIRST_END ? 1.0 : -1.0) * dot3(core.u, n) >= -most;
  double from[3];
  difference3(p, core.a, from);
  const double at = dot3(from, core.u);
  return at >= -most * core.length && at <= (1.0 + most) * core.length;
}

// Finds the nearest points of the lines of two cores; with `inside`, only if they lie inside both.
// `out` is unchanged for parallel lines. Returns whether they were found.
FAN_FN bool lines_nearest(const Core& x, const Core& y, PointPair& out, bool inside = false) {
  double w[3], across[3];
  difference3(x.a, y.a, w);
  cross(x.u, y.u, across);
  const double uv = dot3(x.u, y.u), wu = dot3(w, x.u), wv = dot3(w, y.u),
               square = dot3(across, across);
  if (!(square > DistanceTolerances::min_determinant)) return false;
  const double s = (uv * wv - wu) / square, t = (wv - uv * wu) / square;
  if (inside && !(s > 0.0 && s < x.length && t > 0.0 && t < y.length)) return false;
  along3(x.a, s, x.u, out.p);
  along3(y.a, t, y.u, out.q);
  return true;
}

// The nearest points of two cores: at an end, or where the lines' nearest points lie inside both.
// Also finds the parts on which they lie.
FAN_FN PointPair nearest_points(const Core& x, const Core& y, CorePart* x_part, CorePart* y_part) {
  PointPair best{}, tried;
  double least = DistanceTolerances::max_distance;
  const auto take = [&](CorePart of_x, CorePart of_y) {
    double apart[3];
    difference3(tried.p, tried.q, apart);
    const double square = dot3(apart, apart);
    if (!(square < least)) return;
    least = square;
    best = tried;
    *x_part = of_x;
    *y_part = of_y;
  };
  for (const CorePart end : {FIRST_END, SECOND_END}) {
    copy3(end == FIRST_END ? x.a : x.b, tried.p);
    const CorePart of_y = y.nearest(tried.p, tried.q);
    take(end, of_y);
    if (x.length == 0.0) return best;
  }
  for (const CorePart end : {FIRST_END, SECOND_END}) {
    copy3(end == FIRST_END ? y.a : y.b, tried.q);
    const CorePart of_x = x.nearest(tried.q, tried.p);
    take(of_x, end);
    if (y.length == 0.0) return best;
  }
  if (lines_nearest(x, y, tried, true)) take(MIDDLE, MIDDLE);
  return best;
}

FAN_FN PointPair nearest_points(const Core& x, const Core& y) {
  CorePart of_x, of_y;
  return nearest_points(x, y, &of_x, &of_y);
}

// The pairs of points at both ends of the overlap of two cores, projected on their mean direction,
// and their flatness: 0 where they cross or do not overlap.
struct Overlap {
  PointPair ends[2];
  bool of_x[2] = {};  // whether an end is the first core's
  double flat = 0.0;

  FAN_FN Overlap(const Core& x, const Core& y) : ends{} {
    double across[3];
    cross(x.u, y.u, across);
    const double sine = length3(across), shorter = x.length < y.length ? x.length : y.length;
    if (!(shorter > 0.0) || sine > TouchTolerances::crossing) return;
    const double side = dot3(x.u, y.u) > 0.0 ? 1.0 : -1.0;
    double m[3];
    along3(x.u, side, y.u, m);
    unit3(m, 0.0);
    const double* y_low = side > 0.0 ? y.a : y.b;
    const double* y_high = side > 0.0 ? y.b : y.a;
    const double low = fmax(dot3(x.a, m), dot3(y_low, m));
    const double high = fmin(dot3(x.b, m), dot3(y_high, m));
    const double full = TouchTolerances::min_overlap * shorter;
    if (!(high > low)) return;
    flat = flatness(sine) * clamped((high - low) / full, 0.0, 1.0);
    of_x[0] = low == dot3(x.a, m);
    of_x[1] = high == dot3(x.b, m);
    for (int k = 0; k < 2; ++k) {
      at(x, m, k == 0 ? low : high, ends[k].p);
      at(y, m, k == 0 ? low : high, ends[k].q);
    }
  }

 private:
  // The point of a core at a height along m.
  FAN_FN static void at(const Core& x, const double* m, double height, double* out) {
    along3(x.a, clamped((height - dot3(x.a, m)) / dot3(x.u, m), 0.0, x.length), x.u, out);
  }
};

// A direction for cores that meet: perpendicular to both, away from the second's middle. It is
// arbitrary for two points, and for lines that meet at their middles.
FAN_FN void meeting_normal(const Core& x, const Core& y, double* normal) {
  cross(x.u, y.u, normal);
  if (!unit3(normal, TouchTolerances::lying)) {
    const double* u = x.length > 0.0 ? x.u : y.u;
    int k = 0;
    for (int c = 1; c < 3; ++c) k = fabs(u[c]) < fabs(u[k]) ? c : k;
    double axis[3];
    axis3(k, 1.0, axis);
    along3(axis, -u[k], u, normal);
    unit3(normal, 0.0);
  }
  double apart[3];
  for (int k = 0; k < 3; ++k) apart[k] = x.a[k] + x.b[k] - y.a[k] - y.b[k];
  const double side = dot3(apart, normal) < 0.0 ? -1.0 : 1.0;
  for (int k = 0; k < 3; ++k) normal[k] *= side;
}

// Adds the points of spheres and capsules: feature 0, and 1 where two points are needed.
FAN_FN void touch_segments(const PlacedSolid& x, const PlacedSolid& y, Touches& to) {
  const Core first(x.a, x.b), second(y.a, y.b);
  CorePart of_x, of_y;
  const PointPair nearest = nearest_points(first, second, &of_x, &of_y);
  double normal[3];
  const bool apart = aim(nearest, normal);
  if (!apart) meeting_normal(first, second, normal);
  const int parts = 3 * of_x + of_y, region = apart ? lasting_regions + parts : 0;
  if (first.length == 0.0 || second.length == 0.0)
    return to.add(nearest.p, nearest.q, normal, 0, region);
  const Overlap overlap(first, second);
  if (overlap.flat == 0.0) return to.add(nearest.p, nearest.q, normal, 0, region);
  for (int k = 0; k < 2; ++k) {
    const PointPair pair = between_pairs(nearest, overlap.ends[k], overlap.flat);
    aim(pair, normal);
    to.add(pair.p, pair.q, normal, k, 2 * (overlap.flat < 1.0 ? 1 + parts : 0) + overlap.of_x[k]);
  }
}

// Adds the point below p of a solid, on the plane of a half-space. All points of a flat sole thus
// lie in one plane whatever their gaps: a sole that closes them can stick at all of them.
FAN_FN void add_above(const double* p, const PlacedSolid& plane, int feature, Touches& to) {
  double from[3], q[3];
  difference3(p, plane.a, from);
  along3(p, -dot3(from, plane.b), plane.b, q);
  to.add(p, q, plane.b, feature, 0, true);
}

// Adds the corners of the face most nearly opposed to the half-space. Bit k of a feature is the
// side of axis k.
FAN_FN void touch_plane_by_box(const PlacedSolid& box, const PlacedSolid& plane, Touches& to) {
  double up[3];
  into_axes(box.R, plane.b, up);
  int face = 0;
  for (int k = 1; k < 3; ++k) face = fabs(up[k]) > fabs(up[face]) ? k : face;
  const int side = up[face] > 0.0 ? 0 : 1;
  // Half edges in the world; the one perpendicular to the face points towards it.
  double edge[3][3];
  for (int k = 0; k < 3; ++k) {
    const double half = k == face && side == 0 ? -box.half[k] : box.half[k];
    for (int c = 0; c < 3; ++c) edge[k][c] = half * box.R[3 * k + c];
  }
  const int first = face == 0 ? 1 : 0, second = face == 2 ? 1 : 2;
  for (int j = 0; j < 4; ++j) {
    double p[3];
    along3(box.a, 1.0, edge[face], p);
    along3(p, j & 1 ? 1.0 : -1.0, edge[first], p);
    along3(p, j & 2 ? 1.0 : -1.0, edge[second], p);
    add_above(p, plane, (side << face) | ((j & 1) << first) | ((j >> 1) << second), to);
  }
}

FAN_FN void touch_plane_by_ellipsoid(const PlacedSolid& x, const PlacedSolid& plane, Touches& to) {
  double up[3], p[3], centre[3], square = 0.0;
  into_axes(x.R, plane.b, up);
  for (int k = 0; k < 3; ++k) square += up[k] * up[k] * x.half[k] * x.half[k];
  const double reach = sqrt(square), least = DistanceTolerances::min_length;
  for (int k = 0; k < 3; ++k) up[k] *= -x.half[k] * x.half[k] / (reach > least ? reach : least);
  out_of_axes(x.R, up, p);
  centre3(x, centre);
  along3(centre, 1.0, p, p);
  add_above(p, plane, 0, to);
}

FAN_FN void touch_plane(const PlacedSolid& x, const PlacedSolid& plane, Touches& to) {
  if (x.kind == BOX) return touch_plane_by_box(x, plane, to);
  if (is_ellipsoid(x)) return touch_plane_by_ellipsoid(x, plane, to);
  add_above(x.a, plane, 0, to);
  if (Core(x.a, x.b).length > 0.0) add_above(x.b, plane, 1, to);
}

}  // namespace fan

FAN_LOOPS_END
