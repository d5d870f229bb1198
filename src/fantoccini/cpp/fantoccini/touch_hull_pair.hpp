// Contact points of two hulls, and of a hull and a box.
//
// As for two boxes (touch_box_pair.hpp): facets that see one another have the points of the polygon
// that they share, two edges have one point, or two where they are nearly parallel, and hulls apart
// whose facets do not see one another touch at their nearest points. Points are numbered by the
// vertices and edges they come from, whichever facet decides.
#pragma once

#include "touch_hull_axes.hpp"
#include "touch_hull_nearest.hpp"

namespace fan {

FAN_FN Core core_of_edge(const PlacedHull& x, int e) {
  double a[3], b[3];
  x.vertex(x.edge(e)[0], a);
  x.vertex(x.edge(e)[1], b);
  return Core(a, b);
}

// The edges through a point of a hull that are nearly at right angles to a direction.
struct EdgesThrough {
  static constexpr int room = 16;
  int n = 0, edges[room];

  FAN_FN EdgesThrough(const PlacedHull& x, const double* point, const double* direction) {
    const double near = HullTolerances::rounding * x.hull.outer;
    double turned[3], from[3], local[3];
    into_axes(x.R, direction, turned);
    difference3(point, x.at, from);
    into_axes(x.R, from, local);
    for (int e = 0; e < x.hull.n_edges && n < room; ++e) {
      const double* a = x.local(x.edge(e)[0]);
      double along[3], off[3];
      difference3(x.local(x.edge(e)[1]), a, along);
      const double square = dot3(along, along);
      if (!(square > 0.0)) continue;
      difference3(local, a, from);
      along3(from, -clamped(dot3(from, along) / square, 0.0, 1.0), along, off);
      if (!(dot3(off, off) <= near * near)) continue;
      if (fabs(dot3(along, turned)) < TouchTolerances::crossing * sqrt(square)) edges[n++] = e;
    }
  }
};

// The points of a facet, the upper, above another, the lower; see SharedPolygon.
class HullPolygon {
 public:
  HullSpot spots[2 * max_hull_vertices];
  int n = 0;
  double tolerance;  // m: points this near are one

  FAN_FN HullPolygon(
      const PlacedHull& lower, int lower_facet, const PlacedHull& upper, int upper_facet,
      bool lower_is_first)
      : n_low_(lower.n_corners(lower_facet)),
        n_up_(upper.n_corners(upper_facet)),
        lower_is_first_(lower_is_first) {
    double axes[9], up[3], across[3], p[3];
    axes_along(lower.local_normal(lower_facet), axes);
    for (int k = 0; k < 3; ++k) out_of_axes(lower.R, axes + 3 * k, axes_ + 3 * k);
    upper.normal(upper_facet, up);
    cross3(axes_, up, across);
    const double share = length3(across) < TouchTolerances::lying ? BoxTolerances::same_face
                                                                  : HullTolerances::rounding;
    tolerance = share * fmin(lower.hull.outer, upper.hull.outer);
    along3(lower.at, lower.height(lower_facet), axes_, origin_);
    for (int k = 0; k < n_low_; ++k) {
      lower.vertex(lower.corner(lower_facet, k), p);
      into(p, low_[k]);
    }
    for (int k = 0; k < n_up_; ++k) {
      upper.vertex(upper.corner(upper_facet, k), p);
      into(p, up_[k]);
    }
    for (int k = 0; k < n_up_; ++k)
      if (over_lower(up_[k]))
        add(up_[k][0], up_[k][1], up_[k][2], vertex(!lower_is_first, upper.corner(upper_facet, k)));
    const double m[3] = {dot3(up, axes_ + 3), dot3(up, axes_ + 6), dot3(up, axes_)};
    for (int k = 0; fabs(m[2]) > DistanceTolerances::min_length && k < n_low_; ++k) {
      if (!under_upper(low_[k])) continue;
      const double x = low_[k][0] - up_[0][0], y = low_[k][1] - up_[0][1];
      const double height = up_[0][2] - (m[0] * x + m[1] * y) / m[2];
      add(low_[k][0], low_[k][1], height, vertex(lower_is_first, lower.corner(lower_facet, k)));
    }
    for (int i = 0; i < n_low_; ++i)
      for (int j = 0; j < n_up_; ++j)
        add_crossing(i, lower.side(lower_facet, i), j, upper.side(upper_facet, j));
    n = few_spots(spots, n, max_touches, fmin(lower.hull.outer, upper.hull.outer));
  }

  // The point of a spot on the lower facet, and the one above it.
  FAN_FN void points(const HullSpot& spot, double* below, double* above) const {
    along3(origin_, spot.at[0], axes_ + 3, below);
    along3(below, spot.at[1], axes_ + 6, below);
    along3(below, spot.height, axes_, above);
  }

 private:
  FAN_FN void into(const double* x, double* out) const {
    double from[3];
    difference3(x, origin_, from);
    out[0] = dot3(from, axes_ + 3);
    out[1] = dot3(from, axes_ + 6);
    out[2] = dot3(from, axes_);
  }

  FAN_FN static int vertex(bool of_first, int i) {
    return of_first ? i : HullFeatures::of_second + i;
  }

  FAN_FN void add(double x, double y, double height, int number) {
    if (n == 2 * max_hull_vertices) return;
    const double near = 3.0 * tolerance;
    for (int i = 0; i < n; ++i)
      if (fabs(spots[i].at[0] - x) < near && fabs(spots[i].at[1] - y) < near) return;
    spots[n++] = HullSpot{{x, y}, height, number};
  }

  // How far x is to the left of the line from a to b; far for a line of no length.
  FAN_FN static double left_of(const double* a, const double* b, const double* x) {
    const double u = b[0] - a[0], v = b[1] - a[1], length = sqrt(u * u + v * v);
    if (!(length > DistanceTolerances::min_length)) return DistanceTolerances::far;
    return (u * (x[1] - a[1]) - v * (x[0] - a[0])) / length;
  }

  FAN_FN bool over_lower(const double* x) const {
    for (int i = 0; i < n_low_; ++i)
      if (!(left_of(low_[i], low_[(i + 1) % n_low_], x) > -tolerance)) return false;
    return true;
  }

  // The upper facet's corners come clockwise, as seen on the lower.
  FAN_FN bool under_upper(const double* x) const {
    bool any = false;
    for (int j = 0; j < n_up_; ++j) {
      const double right = left_of(up_[(j + 1) % n_up_], up_[j], x);
      if (!(right > -tolerance)) return false;
      any = any || right < DistanceTolerances::far;
    }
    return any;
  }

  // Where side j of the upper facet crosses side i of the lower.
  FAN_FN void add_crossing(int i, int lower_edge, int j, int upper_edge) {
    const double *a = low_[i], *b = low_[(i + 1) % n_low_];
    const double *p = up_[j], *q = up_[(j + 1) % n_up_];
    const double at_p = left_of(a, b, p), at_q = left_of(a, b, q);
    if ((at_p < -tolerance) == (at_q < -tolerance)) return;
    const double t = clamped(at_p / (at_p - at_q), 0.0, 1.0);
    const double x[2] = {p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])};
    const double u = b[0] - a[0], v = b[1] - a[1];
    const double along = u * (x[0] - a[0]) + v * (x[1] - a[1]);
    if (!(along >= 0.0 && along <= u * u + v * v)) return;
    const int number = lower_is_first_ ? HullFeatures::pair(lower_edge, upper_edge)
                                       : HullFeatures::pair(upper_edge, lower_edge);
    add(x[0], x[1], p[2] + t * (q[2] - p[2]), number);
  }

  int n_low_, n_up_;
  bool lower_is_first_;
  double axes_[9], origin_[3], low_[max_hull_vertices][3], up_[max_hull_vertices][3];
};

// The points of two facets that see one another, if the hulls, whose distance or widest gap is
// `widest`, are apart by no less; whether they do.
FAN_FN bool touch_facets(
    const PlacedHull& x, const PlacedHull& y, const HullAxis& axis, bool of_x, double widest,
    Touches& to) {
  const PlacedHull &owner = of_x ? x : y, &other = of_x ? y : x;
  double inward[3], local[3], reach;
  for (int c = 0; c < 3; ++c) inward[c] = of_x ? axis.normal[c] : -axis.normal[c];
  into_axes(other.R, inward, local);
  const int facet = other.facet_towards_local(other.farthest_local(local, reach), local);
  const HullPolygon shared(owner, axis.first, other, facet, of_x);
  double least = DistanceTolerances::far;
  for (int i = 0; i < shared.n; ++i) least = fmin(least, shared.spots[i].height);
  if (shared.n == 0 || (widest > 0.0 && least > widest + shared.tolerance)) return false;
  for (int i = 0; i < shared.n; ++i) {
    double below[3], above[3];
    shared.points(shared.spots[i], below, above);
    to.add(of_x ? below : above, of_x ? above : below, axis.normal, shared.spots[i].number);
  }
  return true;
}

FAN_FN void touch_hull_edges(
    const PlacedHull& x, const PlacedHull& y, const HullAxis& axis, Touches& to) {
  const PointPair pair =
      nearest_points(core_of_edge(x, axis.first), core_of_edge(y, axis.second));
  to.add(pair.p, pair.q, axis.normal, HullFeatures::pair(axis.first, axis.second));
}

FAN_FN void touch_hulls_apart(
    const PlacedHull& x, const PlacedHull& y, const NearestOfClouds& nearest, Touches& to) {
  const EdgesThrough x_edges(x, nearest.pair.p, nearest.normal);
  const EdgesThrough y_edges(y, nearest.pair.q, nearest.normal);
  PointPair ends[2];
  double flat = 0.0;
  for (int i = 0; i < x_edges.n; ++i)
    for (int j = 0; j < y_edges.n; ++j) {
      const Overlap overlap(
          core_of_edge(x, x_edges.edges[i]), core_of_edge(y, y_edges.edges[j]));
      if (!(overlap.flat > flat)) continue;
      flat = overlap.flat;
      for (int k = 0; k < 2; ++k) ends[k] = overlap.ends[k];
    }
  if (flat == 0.0)
    return to.add(nearest.pair.p, nearest.pair.q, nearest.normal, HullFeatures::nearest);
  for (int k = 0; k < 2; ++k) {
    const PointPair pair = between_pairs(nearest.pair, ends[k], flat);
    double normal[3];
    copy3(nearest.normal, normal);
    aim(pair, normal);
    to.add(pair.p, pair.q, normal, HullFeatures::nearest + k);
  }
}

// Hulls that overlap and share no point of a facet: the deepest vertex.
FAN_FN void touch_deepest(
    const PlacedHull& x, const PlacedHull& y, const HullAxis& axis, bool of_x, Touches& to) {
  const PlacedHull& other = of_x ? y : x;
  double inward[3], p[3], q[3], reach;
  for (int c = 0; c < 3; ++c) inward[c] = of_x ? axis.normal[c] : -axis.normal[c];
  const int i = other.farthest(inward, reach);
  other.vertex(i, p);
  along3(p, of_x ? axis.gap : -axis.gap, axis.normal, q);
  to.add(of_x ? q : p, of_x ? p : q, axis.normal, of_x ? HullFeatures::of_second + i : i);
}

FAN_FN void touch_hulls(const PlacedHull& x, const PlacedHull& y, Touches& to) {
  using Tol = BoxTolerances;
  const double swollen = to.x_radius + to.y_radius;
  const NearestOfClouds nearest(cloud_of(x), cloud_of(y), to.margin + swollen);
  if (nearest.far || nearest.distance - swollen >= to.margin) return;
  const HullAxis of_x = widest_facet(x, y, -1.0), of_y = widest_facet(y, x, 1.0);
  const double same = Tol::same_face * fmin(x.hull.outer, y.hull.outer);
  const bool by_x = of_x.gap > of_y.gap + same;
  const HullAxis& face = by_x ? of_x : of_y;
  if (!nearest.meet) {
    if (!touch_facets(x, y, face, by_x, nearest.distance, to)) touch_hulls_apart(x, y, nearest, to);
    return;
  }
  const HullEdges edges(x, y, fmax(Tol::edge_share * face.gap, face.gap + same));
  if (edges.found()) return touch_hull_edges(x, y, edges.best, to);
  if (!touch_facets(x, y, face, by_x, 0.0, to)) touch_deepest(x, y, face, by_x, to);
}

}  // namespace fan
