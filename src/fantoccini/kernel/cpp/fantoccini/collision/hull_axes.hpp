// Separating axes of two hulls: the normals of their facets, and the products of two edges whose
// arcs on the sphere of normals cross (Gregorius, "The separating axis test between convex
// polyhedra", GDC 2013). Facets and edges are skipped where a ball inside the other hull shows that
// they are no better than the best axis so far.
#pragma once

#include "fantoccini/collision/hull.hpp"

namespace fan {

// A separating axis: the unit normal from the second hull to the first, the gap along it, and its
// features.
struct HullAxis {
  double normal[3], gap = -DistanceTolerances::max_distance;
  int first = -1, second = -1;  // a facet, or an edge of each
};

// The facet of `owner` with the widest gap; `side` is 1 for the second hull, -1 for the first.
FAN_FN HullAxis widest_facet(const PlacedHull& owner, const PlacedHull& other, double side) {
  HullAxis best;
  double apart[3], middle[3];
  difference3(other.at, owner.at, apart);
  into_axes(owner.R, apart, middle);
  for (int f = 0; f < owner.hull.n_facets; ++f) {
    const double height = dot3(owner.local_normal(f), middle) - owner.height(f);
    if (!(height - other.hull.inner > best.gap)) continue;
    double n[3], back[3], turned[3], reach;
    owner.normal(f, n);
    for (int k = 0; k < 3; ++k) back[k] = -n[k];
    into_axes(other.R, back, turned);
    other.farthest_local(turned, reach);
    const double gap = height - reach;
    if (!(gap > best.gap)) continue;
    best.gap = gap;
    best.first = f;
    for (int k = 0; k < 3; ++k) best.normal[k] = side * n[k];
  }
  return best;
}

// An edge in the world, relative to an origin: a point, the direction, the normals beside it.
struct EdgeAt {
  int number;
  double p[3], u[3], left[3], right[3];

  FAN_FN EdgeAt() = default;

  FAN_FN EdgeAt(const PlacedHull& x, int e, const double* origin) : number(e) {
    const int* edge = x.edge(e);
    double from[3], to[3];
    x.vertex(edge[0], from);
    x.vertex(edge[1], to);
    difference3(to, from, u);
    unit3(u, 0.0);
    difference3(from, origin, p);
    x.normal(edge[2], left);
    x.normal(edge[3], right);
  }

  // The greatest height above the edge of a point at w from it, along normals of the edge.
  FAN_FN double max_height(const double* w) const {
    const double a = dot3(left, w), b = dot3(right, w), cosine = dot3(left, right);
    if (!(a > cosine * b && b > cosine * a)) return fmax(a, b);
    const double along = dot3(u, w);
    return sqrt(fmax(dot3(w, w) - along * along, 0.0));
  }
};

class HullEdges {
 public:
  HullAxis best;

  // The pair of edges with the widest gap above `least`.
  FAN_FN HullEdges(const PlacedHull& x, const PlacedHull& y, double least) : x_(x), y_(y) {
    best.gap = least;
    const double origin[3] = {0.0, 0.0, 0.0};
    double x_at[3];
    difference3(x.at, y.at, x_at);
    EdgeAt kept[max_hull_edges];
    int n = 0;
    for (int e = 0; e < y.hull.n_edges; ++e) {
      const EdgeAt edge(y, e, y.at);
      double w[3];
      difference3(x_at, edge.p, w);
      if (edge.max_height(w) - x.hull.inner > least) kept[n++] = edge;
    }
    if (n == 0) return;
    for (int e = 0; e < x.hull.n_edges; ++e) {
      const EdgeAt edge(x, e, y.at);
      double w[3];
      difference3(origin, edge.p, w);
      if (!(edge.max_height(w) - y.hull.inner > best.gap)) continue;
      for (int k = 0; k < n; ++k) take(edge, kept[k]);
    }
  }

  FAN_FN bool has_pair() const { return best.first >= 0; }

 private:
  FAN_FN void take(const EdgeAt& a, const EdgeAt& b) {
    const double b_left = dot3(b.left, a.u), b_right = dot3(b.right, a.u);
    if (!(b_left * b_right <= 0.0)) return;
    const double a_left = dot3(a.left, b.u), a_right = dot3(a.right, b.u);
    if (!(a_left * a_right <= 0.0) || b_left * a_right > 0.0 || b_right * a_left > 0.0) return;
    double n[3], outward[3], apart[3];
    cross(a.u, b.u, n);
    if (!unit3(n, sqrt(DistanceTolerances::min_axis_square))) return;
    along3(a.left, 1.0, a.right, outward);
    difference3(a.p, b.p, apart);
    const double side = -side_of(dot3(n, outward));  // towards the first hull
    const double gap = side * dot3(n, apart);
    if (!(gap > best.gap)) return;
    for (int k = 0; k < 3; ++k) n[k] *= side;
    if (!holds_apart(n, gap)) return;
    best.gap = gap;
    best.first = a.number;
    best.second = b.number;
    copy3(n, best.normal);
  }

  // Whether both hulls end at the two edges along a normal. Where arcs meet at an end, or nearly,
  // rounding decides whether they cross.
  FAN_FN bool holds_apart(const double* normal, double gap) const {
    double back[3], x_reach, y_reach;
    for (int k = 0; k < 3; ++k) back[k] = -normal[k];
    x_.farthest(back, x_reach);
    y_.farthest(normal, y_reach);
    const double size = x_.hull.outer + y_.hull.outer;
    return -x_reach - y_reach >= gap - HullTolerances::rounding * size;
  }

  const PlacedHull &x_, &y_;
};

}  // namespace fan
