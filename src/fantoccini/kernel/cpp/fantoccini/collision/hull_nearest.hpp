// Nearest points of the convex hulls of two sets of points, by the algorithm of Gilbert, Johnson
// and Keerthi (IEEE J. Robotics and Automation 4(2), 1988). It finds v, the point of the hulls'
// difference nearest to the origin, as the nearest point of a simplex, to which every round adds
// the farthest point of the difference in the direction -v.
#pragma once

#include "fantoccini/collision/hull.hpp"

namespace fan {

// A set of points placed in the world, in place of its convex hull.
struct Cloud {
  const double* points;
  int n;
  const double *R, *at;

  // Index of the farthest point in a direction.
  FAN_FN int farthest(const double* direction) const {
    double n_local[3];
    into_axes(R, direction, n_local);
    int best = 0;
    double largest = dot3(points, n_local);
    for (int i = 1; i < n; ++i) {
      const double projection = dot3(points + 3 * i, n_local);
      if (projection > largest) {
        largest = projection;
        best = i;
      }
    }
    return best;
  }

  // Writes point i, in world axes, relative to an origin.
  FAN_FN void point(int i, const double* origin, double* out) const {
    double offset[3];
    out_of_axes(R, points + 3 * i, out);
    difference3(at, origin, offset);
    along3(out, 1.0, offset, out);
  }
};

// The vertex, edge or facet of a hull on which a point of its surface lies, and its number.
struct HullFeature {
  enum Kind { VERTEX, EDGE, FACET, NONE };
  Kind kind = NONE;
  int number = -1;

  // A number that is unique among the features of a hull; 3 if there is none.
  FAN_FN int code() const { return 4 * (number + 1) + kind; }
};

FAN_FN Cloud cloud_of(const PlacedHull& x) {
  return {x.hull.vertices, x.hull.n_vertices, x.R, x.at};
}

class NearestOfClouds {
 public:
  using Tol = HullTolerances;
  PointPair pair{};  // the nearest points
  double normal[3];  // from the second to the first; undefined for clouds that meet
  double distance;   // m; 0 if they meet, `enough` if they are shown to be at least that far apart
  bool meet = false, is_far = false;

  FAN_FN NearestOfClouds(const Cloud& x, const Cloud& y, double enough)
      : normal{}, distance(enough), x_(x), y_(y) {
    double w[3];
    add(x.n - 1, 0, w);
    n_ = 1;
    weight_[0] = 1.0;
    copy3(w, v_);
    double square = dot3(v_, v_);
    for (int round = 0; round < Tol::max_turns && square > Tol::meeting * Tol::meeting; ++round) {
      double reversed[3];
      for (int k = 0; k < 3; ++k) reversed[k] = -v_[k];
      const int i = x_.farthest(reversed), j = y_.farthest(v_);
      if (is_in_simplex(i, j)) break;
      add(i, j, w);
      const double along = dot3(v_, w);
      if (along > 0.0 && along * along > enough * enough * square) {
        is_far = true;
        return;
      }
      if (square - along <= Tol::progress * square) break;
      if (!shrink(square)) break;
      square = dot3(v_, v_);
    }
    meet = meet || !(square > Tol::meeting * Tol::meeting);
    finish();
  }

  // Feature on which the nearest point of one of the hulls lies: the facets that all corners of the
  // simplex share determine it.
  FAN_FN HullFeature feature_of(const PlacedHull& hull, bool of_first) const {
    const int* corners = of_first ? first_index_ : second_index_;
    HullFeature out;
    int n_facets = 0, facets[2] = {};
    for (int k = hull.hull.around_begins[corners[0]]; k < hull.hull.around_begins[corners[0] + 1];
         ++k) {
      const int f = hull.hull.around[k];
      bool shared = true;
      for (int a = 1; a < n_; ++a)
        shared = shared && (corners[a] == corners[0] || hull.has_corner(f, corners[a]));
      if (!shared) continue;
      if (n_facets < 2) facets[n_facets] = f;
      ++n_facets;
    }
    if (n_facets == 1) {
      out.kind = HullFeature::FACET;
      out.number = facets[0];
    } else if (n_facets == 2) {
      out.number = hull.edge_between(facets[0], facets[1]);
      out.kind = out.number < 0 ? HullFeature::NONE : HullFeature::EDGE;
    } else if (n_facets > 2) {
      out.kind = HullFeature::VERTEX;
      out.number = corners[0];
    }
    return out;
  }

  // For a first cloud of one or two points: the nearest of them; MIDDLE means between them.
  FAN_FN CorePart part_of_first() const {
    bool used[2] = {};
    for (int k = 0; k < n_; ++k) used[first_index_[k] == 0 ? 0 : 1] = true;
    return used[0] ? (used[1] ? MIDDLE : FIRST_END) : SECOND_END;
  }

 private:
  // Appends the difference of two points to those of the simplex.
  FAN_FN void add(int i, int j, double* w) {
    first_index_[n_] = i;
    second_index_[n_] = j;
    x_.point(i, y_.at, p_[n_]);
    y_.point(j, y_.at, q_[n_]);
    difference3(p_[n_], q_[n_], difference_[n_]);
    copy3(difference_[n_], w);
  }

  FAN_FN bool is_in_simplex(int i, int j) const {
    for (int k = 0; k < n_; ++k)
      if (first_index_[k] == i && second_index_[k] == j) return true;
    return false;
  }

  // A part of the simplex and its point nearest to the origin.
  struct Part {
    int n = 0, corner[3];
    double weight[3], v[3], square = DistanceTolerances::max_distance;
  };

  FAN_FN void try_point(int a, Part& best) const {
    const double square = dot3(difference_[a], difference_[a]);
    if (!(square < best.square)) return;
    best.n = 1;
    best.corner[0] = a;
    best.weight[0] = 1.0;
    copy3(difference_[a], best.v);
    best.square = square;
  }

  // Tries the interior of an edge.
  FAN_FN void try_edge(int a, int b, Part& best) const {
    double along[3], v[3];
    difference3(difference_[b], difference_[a], along);
    const double length = dot3(along, along), t = -dot3(difference_[a], along);
    if (!(t > 0.0 && t < length)) return;
    along3(difference_[a], t / length, along, v);
    const double square = dot3(v, v);
    if (!(square < best.square)) return;
    best.n = 2;
    best.corner[0] = a;
    best.corner[1] = b;
    best.weight[0] = 1.0 - t / length;
    best.weight[1] = t / length;
    copy3(v, best.v);
    best.square = square;
  }

  // Tries the interior of a triangle.
  FAN_FN void try_triangle(int a, int b, int c, Part& best) const {
    double ab[3], ac[3], normal[3], across[3];
    difference3(difference_[b], difference_[a], ab);
    difference3(difference_[c], difference_[a], ac);
    cross(ab, ac, normal);
    const double area = dot3(normal, normal);
    if (!(area > Tol::flat_area * dot3(ab, ab) * dot3(ac, ac))) return;
    cross(difference_[b], difference_[c], across);
    const double at_a = dot3(across, normal) / area;
    cross(difference_[c], difference_[a], across);
    const double at_b = dot3(across, normal) / area;
    const double at_c = 1.0 - at_a - at_b;
    if (!(at_a > 0.0 && at_b > 0.0 && at_c > 0.0)) return;
    const double height = dot3(difference_[a], normal) / area;
    const double square = height * height * area;
    if (!(square < best.square)) return;
    best.n = 3;
    best.corner[0] = a;
    best.corner[1] = b;
    best.corner[2] = c;
    best.weight[0] = at_a;
    best.weight[1] = at_b;
    best.weight[2] = at_c;
    for (int k = 0; k < 3; ++k) best.v[k] = height * normal[k];
    best.square = square;
  }

  // Whether the origin is in the simplex of four points.
  FAN_FN bool contains_origin() const {
    for (int k = 0; k < 4; ++k) {
      const double *a = difference_[(k + 1) % 4], *b = difference_[(k + 2) % 4],
                   *c = difference_[(k + 3) % 4];
      double ab[3], ac[3], normal[3], up[3];
      difference3(b, a, ab);
      difference3(c, a, ac);
      cross(ab, ac, normal);
      difference3(difference_[k], a, up);
      const double height = dot3(up, normal), origin_height = -dot3(a, normal);
      const double flat = Tol::progress * length3(normal) * (length3(up) + length3(a));
      if (!(fabs(height) > flat) || !(origin_height * height > 0.0)) return false;
    }
    return true;
  }

  // Reduces the simplex to the nearest of its parts with its last point. Returns whether the
  // distance shrinks.
  FAN_FN bool shrink(double square) {
    const int last = n_;
    Part best;
    if (last == 3 && contains_origin()) {
      meet = true;
      return false;
    }
    try_point(last, best);
    for (int a = 0; a < last; ++a) try_edge(a, last, best);
    for (int a = 0; a < last; ++a)
      for (int b = a + 1; b < last; ++b) try_triangle(a, b, last, best);
    if (!(best.square < square)) return false;
    for (int k = 0; k < best.n; ++k) {
      const int from = best.corner[k];  // >= k: in ascending order
      first_index_[k] = first_index_[from];
      second_index_[k] = second_index_[from];
      copy3(p_[from], p_[k]);
      copy3(q_[from], q_[k]);
      copy3(difference_[from], difference_[k]);
      weight_[k] = best.weight[k];
    }
    n_ = best.n;
    copy3(best.v, v_);
    return true;
  }

  // Sets the results from the simplex.
  FAN_FN void finish() {
    for (int k = 0; k < n_; ++k)
      for (int c = 0; c < 3; ++c) {
        pair.p[c] += weight_[k] * p_[k][c];
        pair.q[c] += weight_[k] * q_[k][c];
      }
    along3(pair.p, 1.0, y_.at, pair.p);
    along3(pair.q, 1.0, y_.at, pair.q);
    distance = meet ? 0.0 : length3(v_);
    copy3(v_, normal);
    unit3(normal, 0.0);
  }

  const Cloud &x_, &y_;
  int n_ = 0, first_index_[4], second_index_[4];
  double p_[4][3], q_[4][3], difference_[4][3], weight_[4], v_[3];
};

}  // namespace fan
