// Hulls (convex polytopes of meshes, and boxes) placed in the world, and their contact with a
// half-space.
#pragma once

#include "fantoccini/collision/ellipsoid.hpp"

namespace fan {

constexpr int max_hull_vertices = int(Constants::hull_vertices);
constexpr int max_hull_edges = 3 * max_hull_vertices;  // by Euler's formula
constexpr int max_hull_facets = 2 * max_hull_vertices;

struct HullTolerances {
  static constexpr double meeting = 1e-10;    // m: cores nearer than this meet
  static constexpr double progress = 1e-14;   // relative to the squared distance: end of the search
  static constexpr double rounding = 1e-9;    // relative to the size: heights that count as equal
  static constexpr double flat_area = 1e-20;  // of squared sides: triangles without area
  static constexpr double above = 1e-6;  // relative to the size: lower by this, a corner counts
  static constexpr int max_turns = 100;  // of the search for nearest points; 5 to 20 are usual
};

// A hull placed in the world.
struct PlacedHull {
  const Hull& hull;
  const double *R, *at;

  FAN_FN const double* local(int i) const { return hull.vertices + 3 * i; }
  FAN_FN const double* local_normal(int f) const { return hull.planes + 4 * f; }
  FAN_FN double height(int f) const { return hull.planes[4 * f + 3]; }

  FAN_FN void vertex(int i, double* out) const {
    out_of_axes(R, local(i), out);
    along3(at, 1.0, out, out);
  }

  FAN_FN void normal(int f, double* out) const { out_of_axes(R, local_normal(f), out); }

  // The vertex farthest in a direction in the hull's axes, and its height along it.
  FAN_FN int farthest_local(const double* n, double& reach) const {
    int best = 0;
    reach = -DistanceTolerances::max_distance;
    for (int i = 0; i < hull.n_vertices; ++i) {
      const double projection = dot3(hull.vertices + 3 * i, n);
      if (projection > reach) {
        reach = projection;
        best = i;
      }
    }
    return best;
  }

  // Likewise in a direction of the world.
  FAN_FN int farthest(const double* n, double& reach) const {
    double turned[3];
    into_axes(R, n, turned);
    const int best = farthest_local(turned, reach);
    reach += dot3(at, n);
    return best;
  }

  // The facet at a vertex whose normal is nearest to a direction in the hull's axes.
  FAN_FN int facet_towards_local(int vertex, const double* n) const {
    int best = hull.around[hull.around_begins[vertex]];
    double most = -2.0;
    for (int k = hull.around_begins[vertex]; k < hull.around_begins[vertex + 1]; ++k) {
      const double projection = dot3(local_normal(hull.around[k]), n);
      if (projection > most) {
        most = projection;
        best = hull.around[k];
      }
    }
    return best;
  }

  FAN_FN int n_corners(int f) const { return hull.begins[f + 1] - hull.begins[f]; }
  FAN_FN int corner(int f, int k) const { return hull.corners[hull.begins[f] + k]; }
  FAN_FN int side(int f, int k) const { return hull.sides[hull.begins[f] + k]; }

  FAN_FN bool has_corner(int f, int vertex) const {
    for (int k = 0; k < n_corners(f); ++k)
      if (corner(f, k) == vertex) return true;
    return false;
  }

  FAN_FN const int* edge(int e) const { return hull.edges + 4 * e; }

  // The edge between two facets, or -1.
  FAN_FN int edge_between(int f, int g) const {
    for (int k = 0; k < n_corners(f); ++k) {
      const int* ends = edge(side(f, k));
      if (ends[2] == g || ends[3] == g) return side(f, k);
    }
    return -1;
  }
};

// A box as a hull: bit k of a vertex is the side of axis k.
class BoxHull {
 public:
  FAN_FN explicit BoxHull(const PlacedSolid& box) : placed{hull_, box.R, box.a} {
    for (int i = 0; i < 8; ++i)
      for (int k = 0; k < 3; ++k) vertices_[3 * i + k] = (i >> k) & 1 ? box.half[k] : -box.half[k];
    for (int f = 0; f < 6; ++f) {
      axis3(f / 2, f % 2 == 0 ? -1.0 : 1.0, planes_ + 4 * f);
      planes_[4 * f + 3] = box.half[f / 2];
    }
    hull_.inner = box.half[0];
    for (int k = 1; k < 3; ++k) hull_.inner = fmin(hull_.inner, box.half[k]);
    hull_.outer = length3(box.half);
  }

 private:
  static constexpr int begins_[7] = {0, 4, 8, 12, 16, 20, 24};
  static constexpr int corners_[24] = {0, 4, 6, 2, 1, 3, 7, 5, 0, 1, 5, 4,
                                       2, 6, 7, 3, 0, 2, 3, 1, 4, 5, 7, 6};
  static constexpr int sides_[24] = {8,  6, 10, 4, 5, 11, 7, 9, 0, 9, 2, 8,
                                     10, 3, 11, 1, 4, 1,  5, 0, 2, 7, 3, 6};
  static constexpr int edges_[48] = {0, 1, 2, 4, 2, 3, 4, 3, 4, 5, 5, 2, 6, 7, 3, 5,
                                     0, 2, 4, 0, 1, 3, 1, 4, 4, 6, 0, 5, 5, 7, 5, 1,
                                     0, 4, 0, 2, 1, 5, 2, 1, 2, 6, 3, 0, 3, 7, 1, 3};
  static constexpr int around_begins_[9] = {0, 3, 6, 9, 12, 15, 18, 21, 24};
  static constexpr int around_[24] = {0, 2, 4, 1, 2, 4, 0, 3, 4, 1, 3, 4,
                                      0, 2, 5, 1, 2, 5, 0, 3, 5, 1, 3, 5};
  double vertices_[24], planes_[24];
  Hull hull_{8,       6,       12,       0.0,    0.0,    vertices_,
             planes_, begins_, corners_, sides_, edges_, around_begins_,
             around_};

 public:
  PlacedHull placed;
};

FAN_FN PlacedHull placed_hull(const PlacedSolid& x) { return {*x.hull, x.R, x.a}; }

// A vertex of a facet's polygon: its position in two axes of the facet, its height and its number.
struct HullSpot {
  double at[2], height;
  int number;
};

// Picks at most `capacity` vertices of a convex polygon, which come in a fixed order: those
// farthest in directions fixed to the facet, and the lowest if it is lower. The choice is unchanged
// by small motions of the solids.
template <class Spot>
FAN_FN int pick_spots(Spot* spots, int n, int capacity, double size) {
  if (n <= capacity) return n;
  // Directions of a regular polygon, rotated so that few are perpendicular to an edge.
  constexpr double begin = 0.2345, turn = 6.283185307179586;
  bool kept[2 * max_hull_vertices] = {};
  double least = DistanceTolerances::max_distance;
  for (int d = 0; d < capacity - 1; ++d) {
    const double u = cos(begin + turn * d / (capacity - 1)),
                 v = sin(begin + turn * d / (capacity - 1));
    int best = 0;
    double reach = -DistanceTolerances::max_distance;
    for (int i = 0; i < n; ++i) {
      const double projection = u * spots[i].at[0] + v * spots[i].at[1];
      if (!(projection > reach + HullTolerances::above * size)) continue;
      reach = projection;
      best = i;
    }
    kept[best] = true;
    least = fmin(least, spots[best].height);
  }
  int lowest = 0;
  for (int i = 1; i < n; ++i)
    if (spots[i].height < spots[lowest].height) lowest = i;
  if (spots[lowest].height < least - HullTolerances::above * size) kept[lowest] = true;
  int m = 0;
  for (int i = 0; i < n; ++i)
    if (kept[i]) spots[m++] = spots[i];
  return m;
}

// Adds the corners of the facet most nearly opposed to the half-space, among those at the lowest
// vertex, then other vertices within the margin while there is space. Features are the vertices.
FAN_FN void touch_plane_by_hull(const PlacedHull& x, const PlacedSolid& plane, Touches& to) {
  double down[3], from[3], reach;
  into_axes(x.R, plane.b, down);
  for (int k = 0; k < 3; ++k) down[k] = -down[k];
  const int lowest = x.farthest_local(down, reach);
  difference3(x.at, plane.a, from);
  const double origin = dot3(from, plane.b);
  if (!(origin - reach < to.margin + to.x_radius + to.y_radius)) return;
  const int facet = x.facet_towards_local(lowest, down);
  double axes[9];
  axes_along(x.local_normal(facet), axes);
  HullSpot spots[2 * max_hull_vertices];
  int n = 0;
  bool used[max_hull_vertices] = {};
  for (int k = 0; k < x.n_corners(facet); ++k) {
    const int i = x.corner(facet, k);
    const double* p = x.local(i);
    used[i] = true;
    spots[n++] = HullSpot{{dot3(p, axes + 3), dot3(p, axes + 6)}, -dot3(p, down), i};
  }
  n = pick_spots(spots, n, max_touches, x.hull.outer);
  // Vertices that are not of the facet are higher.
  const double most = to.margin + to.x_radius + to.y_radius - origin;
  while (n < max_touches) {
    int next = -1;
    double height = most;
    for (int i = 0; i < x.hull.n_vertices; ++i) {
      const double projection = -dot3(x.local(i), down);
      if (used[i] || !(projection < height)) continue;
      height = projection;
      next = i;
    }
    if (next < 0) break;
    used[next] = true;
    spots[n++] = HullSpot{{}, height, next};
  }
  for (int k = 0; k < n; ++k) {
    double p[3];
    x.vertex(spots[k].number, p);
    add_above(p, plane, spots[k].number, to);
  }
}

}  // namespace fan
