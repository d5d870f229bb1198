// Points shared by facets of two hulls, numbered by the features that touch there, as for two boxes
// (box_faces.hpp).
#pragma once

#include "fantoccini/collision/hull_axes.hpp"

namespace fan {

// Feature numbers of two hulls: a vertex of one with a facet of the other, two edges, or nearest
// points of other kinds.
struct HullFeatures {
  static constexpr int of_second = max_hull_vertices * max_hull_facets, edges = 2 * of_second;
  static constexpr int nearest = edges + max_hull_edges * max_hull_edges;

  FAN_FN static int vertex(bool of_first, int i, int facet) {
    return (of_first ? 0 : of_second) + max_hull_vertices * facet + i;
  }

  FAN_FN static int pair(int x_edge, int y_edge) {
    return edges + max_hull_edges * x_edge + y_edge;
  }
};

// A facet in its own axes or those of another: its corners, its normal, the directions of its
// sides, and for each side the direction in the adjacent facet that leads away from it.
struct HullFacetIn {
  int facet, n;
  double corners[max_hull_vertices][3], normal[3];
  // Unit directions of the sides in the plane of the first two axes, and their lengths there.
  double along[max_hull_vertices][2], length[max_hull_vertices];

  // `axes`: (9,) unit vectors in the world, the last one upwards; `origin`: their origin.
  FAN_FN HullFacetIn(const PlacedHull& hull, int f, const double* axes, const double* origin)
      : facet(f), n(hull.n_corners(f)), hull_(hull), axes_(axes) {
    double p[3], from[3];
    for (int k = 0; k < n; ++k) {
      hull.vertex(hull.corner(f, k), p);
      difference3(p, origin, from);
      into_axes(axes, from, corners[k]);
    }
    for (int k = 0; k < n; ++k) {
      for (int c = 0; c < 2; ++c) along[k][c] = next(k)[c] - corners[k][c];
      length[k] = sqrt(along[k][0] * along[k][0] + along[k][1] * along[k][1]);
      for (int c = 0; c < 2 && has_length(k); ++c) along[k][c] /= length[k];
    }
    hull.normal(f, p);
    into_axes(axes, p, normal);
  }

  FAN_FN const double* next(int k) const { return corners[k + 1 < n ? k + 1 : 0]; }

  FAN_FN bool has_length(int k) const { return length[k] > DistanceTolerances::min_length; }

  // Distance of x to the left of the line through side k, as seen from above; large for a side
  // without length.
  FAN_FN double left_of(int k, const double* x) const {
    if (!has_length(k)) return DistanceTolerances::max_distance;
    return along[k][0] * (x[1] - corners[k][1]) - along[k][1] * (x[0] - corners[k][0]);
  }

  // Whether m, in these axes, is a normal of the hull at the side k with the direction d: neither
  // of the two facets there extends in that direction.
  FAN_FN bool has_normal(int k, const double* d, const double* m) const {
    const int e = hull_.side(facet, k);
    const int other = hull_.edge(e)[2] == facet ? hull_.edge(e)[3] : hull_.edge(e)[2];
    double beside[3], p[3], inward[3];
    cross(normal, d, inward);
    if (dot3(m, inward) > BoxTolerances::rounding) return false;
    hull_.normal(other, p);
    into_axes(axes_, p, beside);
    cross(d, beside, inward);
    return dot3(m, inward) <= BoxTolerances::rounding;
  }

 private:
  const PlacedHull& hull_;
  const double* axes_;
};

// A vertex of the polygon that two facets share, the unit normal there, upwards, in the axes of the
// lower one, and its region; see HullSpot.
struct FacetSpot : HullSpot {
  double normal[3];
  CrossingRegion region;
};

// The polygon of the points of a facet, the upper, above another, the lower; see SharedPolygon.
class HullPolygon {
 public:
  FacetSpot spots[2 * max_hull_vertices];
  int n = 0;
  double tolerance;  // m: points nearer than this are merged

  FAN_FN HullPolygon(
      const PlacedHull& lower, int lower_facet, const PlacedHull& upper, int upper_facet,
      bool lower_is_first)
      : axes_(lower, lower_facet),
        low_(lower, lower_facet, axes_.R, axes_.origin),
        up_(upper, upper_facet, axes_.R, axes_.origin),
        lower_(lower),
        upper_(upper),
        lower_is_first_(lower_is_first) {
    const double across = sqrt(up_.normal[0] * up_.normal[0] + up_.normal[1] * up_.normal[1]);
    const bool flat = across < TouchTolerances::lying;
    const double size = fmin(lower.hull.outer, upper.hull.outer);
    tolerance = (flat ? BoxTolerances::same_face : BoxTolerances::rounding) * size;
    rounding_ = BoxTolerances::rounding * size;
    slope_ = flat ? BoxTolerances::same_slope : BoxTolerances::rounding;
    for (int k = 0; k < low_.n; ++k) low_carries_[k] = carries_lower(k);
    for (int k = 0; k < up_.n; ++k) up_carries_[k] = carries_upper(k);
    add_corners(true);
    for (int i = 0; i < low_.n; ++i) add_crossings(i);
    add_corners(false);
    n = pick_spots(spots, n, max_touches, size);
  }

  // The point of a vertex on the lower facet, the one above it, and the normal, upwards, in the
  // world.
  FAN_FN void place(const FacetSpot& spot, double* below, double* above, double* normal) const {
    const double local[3] = {spot.at[0], spot.at[1], 0.0};
    out_of_axes(axes_.R, local, below);
    along3(below, 1.0, axes_.origin, below);
    along3(below, spot.height, axes_.R + 6, above);
    out_of_axes(axes_.R, spot.normal, normal);
  }

 private:
  // Axes of the lower facet, the last along its normal, and a point of its plane.
  struct Axes {
    double R[9], origin[3];

    FAN_FN Axes(const PlacedHull& hull, int facet) {
      double local[9];
      axes_along(hull.local_normal(facet), local);
      for (int k = 0; k < 3; ++k) out_of_axes(hull.R, local + 3 * ((k + 1) % 3), R + 3 * k);
      along3(hull.at, hull.height(facet), R + 6, origin);
    }
  };

  FAN_FN void add(
      double x, double y, double height, const double* normal, int number,
      CrossingRegion region = CROSSING) {
    if (n == 2 * max_hull_vertices) return;
    const double near = 3.0 * tolerance;
    for (int i = 0; i < n; ++i)
      if (fabs(spots[i].at[0] - x) < near && fabs(spots[i].at[1] - y) < near) return;
    FacetSpot& to = spots[n++];
    to.at[0] = x;
    to.at[1] = y;
    to.height = height;
    to.number = number;
    to.region = region;
    copy3(normal, to.normal);
  }

  // Adds the corners of the first hull, then of the second, that carry load beyond the other's
  // edge, or those that do not.
  FAN_FN void add_corners(bool that_carry) {
    for (const bool of_upper : {!lower_is_first_, lower_is_first_}) {
      const int corners = of_upper ? up_.n : low_.n;
      for (int k = 0; k < corners; ++k) {
        if (of_upper && up_carries_[k] == that_carry) add_upper(k);
        if (!of_upper && low_carries_[k] == that_carry) add_lower(k);
      }
    }
  }

  // Whether no side of the upper facet slopes down from its corner k.
  FAN_FN bool carries_upper(int k) const {
    for (const int other : {k + 1 < up_.n ? k + 1 : 0, k > 0 ? k - 1 : up_.n - 1}) {
      double d[3];
      difference3(up_.corners[other], up_.corners[k], d);
      if (d[2] < 0.0 && d[2] < -slope_ * length3(d)) return false;
    }
    return true;
  }

  // Whether no side of the lower facet rises towards the upper one from its corner k.
  FAN_FN bool carries_lower(int k) const {
    for (const int other : {k + 1 < low_.n ? k + 1 : 0, k > 0 ? k - 1 : low_.n - 1}) {
      double d[3];
      difference3(low_.corners[other], low_.corners[k], d);
      const double up = -dot3(d, up_.normal);
      if (up > 0.0 && up > slope_ * length3(d)) return false;
    }
    return true;
  }

  // Distance outside the other facet up to which a corner counts as on it.
  FAN_FN double reach(bool carries) const { return carries ? tolerance : -rounding_; }

  // The upper facet's height above a point of the lower.
  FAN_FN double height(const double* x) const {
    const double *m = up_.normal, *p = up_.corners[0];
    return p[2] - (m[0] * (x[0] - p[0]) + m[1] * (x[1] - p[1])) / m[2];
  }

  FAN_FN bool is_steep() const { return !(-up_.normal[2] > DistanceTolerances::min_length); }

  FAN_FN void add_upper(int k) {
    const double *p = up_.corners[k], normal[3] = {0.0, 0.0, 1.0}, more = reach(up_carries_[k]);
    double x[2] = {p[0], p[1]};
    bool on = true;
    for (int i = 0; i < low_.n; ++i) {
      const double left = low_.left_of(i, p);
      if (!(left >= -more)) return;
      if (!(left < 0.0)) continue;
      // Slightly outside: the nearest point of the side.
      x[0] += left * low_.along[i][1];
      x[1] -= left * low_.along[i][0];
      on = false;
    }
    add(x[0], x[1], on || is_steep() ? p[2] : height(x), normal,
        HullFeatures::vertex(!lower_is_first_, upper_.corner(up_.facet, k), low_.facet));
  }

  // Whether a point of the lower facet is under the upper one, whose corners are clockwise there,
  // or outside it by at most `more`.
  FAN_FN bool is_under(const double* p, double more) const {
    bool any = false;
    for (int j = 0; j < up_.n; ++j) {
      if (!up_.has_length(j)) continue;
      if (!(-up_.left_of(j, p) >= -more)) return false;
      any = true;
    }
    return any;
  }

  // The corner touches the upper facet along its normal, unless that misses the facet, as it may
  // from a great depth.
  FAN_FN void add_lower(int k) {
    const double* p = low_.corners[k];
    if (is_steep() || !is_under(p, reach(low_carries_[k]))) return;
    const double up = height(p) - p[2];
    double normal[3], foot[3];
    for (int c = 0; c < 3; ++c) normal[c] = -up_.normal[c];
    along3(p, up * normal[2], normal, foot);
    const bool above = is_under(foot, tolerance);
    if (!above) axis3(2, 1.0, normal);
    add(p[0], p[1], height(p), normal,
        HullFeatures::vertex(lower_is_first_, lower_.corner(low_.facet, k), up_.facet),
        above ? CROSSING : ALONG);
  }

  // Adds the crossings of sides of the upper facet with side i of the lower.
  FAN_FN void add_crossings(int i) {
    double at_p = low_.left_of(i, up_.corners[0]);
    for (int j = 0; j < up_.n; ++j) {
      const double at_q = low_.left_of(i, up_.next(j));
      const double p_more = reach(up_carries_[j]);
      const double q_more = reach(up_carries_[j + 1 < up_.n ? j + 1 : 0]);
      if ((at_p < -p_more) != (at_q < -q_more) && at_p != at_q) add_crossing(i, j, at_p, at_q);
      at_p = at_q;
    }
  }

  // Adds the crossing with side j of the upper facet, whose ends lie at_p and at_q to the left.
  FAN_FN void add_crossing(int i, int j, double at_p, double at_q) {
    const double *a = low_.corners[i], *p = up_.corners[j];
    // By rounding, a corner inside of the lower facet's side may count as outside. The crossing of
    // an edge along that side is at the corner even then.
    double d[3];
    difference3(up_.next(j), p, d);
    const double more = 2.0 * tolerance / length3(d);
    const double t = clamped(at_p / (at_p - at_q), -more, 1.0 + more);
    const double x[2] = {p[0] + t * d[0], p[1] + t * d[1]};
    const double along = low_.along[i][0] * (x[0] - a[0]) + low_.along[i][1] * (x[1] - a[1]);
    if (!(along >= -2.0 * rounding_ && along <= low_.length[i] + 2.0 * rounding_)) return;
    const int lower_edge = lower_.side(low_.facet, i), upper_edge = upper_.side(up_.facet, j);
    double normal[3];
    const CrossingRegion region = crossing_normal(i, j, normal);
    add(x[0], x[1], p[2] + t * d[2], normal,
        lower_is_first_ ? HullFeatures::pair(lower_edge, upper_edge)
                        : HullFeatures::pair(upper_edge, lower_edge),
        region);
  }

  // Normal of side i of the lower facet and side j of the upper: their product if it lies between
  // the normals of the facets at both, else the lower facet's, as for edges that are nearly
  // parallel.
  FAN_FN CrossingRegion crossing_normal(int i, int j, double* out) const {
    double e[3], d[3], m[3], back[3];
    difference3(low_.next(i), low_.corners[i], e);
    difference3(up_.next(j), up_.corners[j], d);
    unit3(e, 0.0);
    unit3(d, 0.0);
    axis3(2, 1.0, out);
    cross(e, d, m);
    if (!unit3(m, TouchTolerances::lying)) return ALONG;
    const double side = side_of(m[2]);
    for (int c = 0; c < 3; ++c) {
      m[c] *= side;
      back[c] = -m[c];
    }
    if (!low_.has_normal(i, e, m) || !up_.has_normal(j, d, back)) return BEYOND;
    copy3(m, out);
    return CROSSING;
  }

  const Axes axes_;
  const HullFacetIn low_, up_;
  const PlacedHull &lower_, &upper_;
  bool lower_is_first_, low_carries_[max_hull_vertices], up_carries_[max_hull_vertices];
  double rounding_, slope_;
};

}  // namespace fan
