// One contact point by its features alone, wherever the solids are: a vertex and a plane,
//
//     gap = n . (p - q_plane),   n the normal of the facet,
//
// or two edges with the directions u and v,
//
//     gap = n . (p_x - p_y),   n = +-u x v / |u x v|.
//
// Inside their features these are the points that touches() finds. An integrator's trial states, and
// those over which rates are differenced, go beyond: there a feature's gap goes on smoothly.
#pragma once

#include "touch.hpp"

namespace fan {

namespace following {

// A vertex against the plane of a facet with the outward normal m through o.
FAN_FN void follow_vertex(
    const double* vertex, bool of_first, const double* m, const double* o, int feature,
    Touches& to) {
  double from[3], foot[3], n[3];
  difference3(vertex, o, from);
  along3(vertex, -dot3(from, m), m, foot);
  for (int k = 0; k < 3; ++k) n[k] = of_first ? m[k] : -m[k];
  to.add(of_first ? vertex : foot, of_first ? foot : vertex, n, feature);
}

// A line along an edge: a point of it, its direction, and a direction out of the solid.
struct EdgeLine {
  double a[3], u[3], outward[3];
};

// Two edges that cross; where they do along them. Whether they do.
FAN_FN bool follow_edges(
    const EdgeLine& x, const EdgeLine& y, int feature, double* along, double* n, Touches& to) {
  double w[3], p[3], q[3];
  cross3(x.u, y.u, n);
  const double sine = length3(n);
  if (!unit3(n, TouchTolerances::lying)) return false;
  const double side = -side_of(dot3(n, x.outward));
  for (int k = 0; k < 3; ++k) n[k] *= side;
  difference3(x.a, y.a, w);
  const double uv = dot3(x.u, y.u), wu = dot3(w, x.u), wv = dot3(w, y.u);
  along[0] = (uv * wv - wu) / (sine * sine);
  along[1] = (wv - uv * wu) / (sine * sine);
  along3(x.a, along[0], x.u, p);
  along3(y.a, along[1], y.u, q);
  to.add(p, q, n, feature);
  return true;
}

FAN_FN EdgeLine line_of(const PlacedHull& hull, int e) {
  EdgeLine out;
  double right[3];
  const Core core = core_of_edge(hull, e);
  copy3(core.a, out.a);
  copy3(core.u, out.u);
  hull.normal(hull.edge(e)[2], out.outward);
  hull.normal(hull.edge(e)[3], right);
  along3(out.outward, 1.0, right, out.outward);
  return out;
}

// The length of an edge, and whether n is among the normals of the hull there.
FAN_FN bool is_normal_of_edge(const PlacedHull& hull, int e, const double* n, double* length) {
  const int* edge = hull.edge(e);
  const Core core = core_of_edge(hull, e);
  double facet[3], inward[3];
  *length = core.length;
  // The facet to the left has the edge along its turn, that to the right against it.
  for (int k = 0; k < 2; ++k) {
    hull.normal(edge[2 + k], facet);
    cross3(facet, core.u, inward);
    if ((k == 0 ? 1.0 : -1.0) * dot3(n, inward) > BoxTolerances::rounding) return false;
  }
  return true;
}

// Whether a point of a facet's plane lies in the facet.
FAN_FN bool is_in_facet(const PlacedHull& hull, int f, const double* point, double rounding) {
  double from[3], local[3], along[3], inward[3];
  difference3(point, hull.at, from);
  into_axes(hull.R, from, local);
  for (int k = 0; k < hull.n_corners(f); ++k) {
    const double* a = hull.local(hull.corner(f, k));
    difference3(hull.local(hull.corner(f, (k + 1) % hull.n_corners(f))), a, along);
    cross3(hull.local_normal(f), along, inward);
    unit3(inward, 0.0);
    difference3(local, a, from);
    if (dot3(from, inward) < -rounding) return false;
  }
  return true;
}

// `holds`: whether the point lies within its features.
FAN_FN bool follow_hulls(
    const PlacedHull& x, const PlacedHull& y, int feature, Touches& to, bool* holds) {
  const double rounding = HullTolerances::rounding * fmin(x.hull.outer, y.hull.outer);
  if (feature >= HullFeatures::nearest) return false;
  if (feature >= HullFeatures::edges) {
    const int e = (feature - HullFeatures::edges) / max_hull_edges;
    const int g = (feature - HullFeatures::edges) % max_hull_edges;
    double at[2], n[3], back[3], length[2];
    if (!follow_edges(line_of(x, e), line_of(y, g), feature, at, n, to)) return false;
    for (int k = 0; k < 3; ++k) back[k] = -n[k];
    *holds = is_normal_of_edge(x, e, back, length) && is_normal_of_edge(y, g, n, length + 1);
    for (int k = 0; k < 2; ++k)
      *holds = *holds && at[k] >= -rounding && at[k] <= length[k] + rounding;
    return true;
  }
  const bool of_first = feature < HullFeatures::of_second;
  const int own = of_first ? feature : feature - HullFeatures::of_second;
  const int facet = own / max_hull_vertices, i = own % max_hull_vertices;
  const PlacedHull &other = of_first ? y : x, &owner = of_first ? x : y;
  double p[3], m[3], o[3];
  owner.vertex(i, p);
  other.normal(facet, m);
  along3(other.at, other.height(facet), m, o);
  follow_vertex(p, of_first, m, o, feature, to);
  *holds = is_in_facet(other, facet, p, rounding);
  return true;
}

FAN_FN void corner_of(const PlacedSolid& box, int corner, double* out) {
  double local[3];
  for (int k = 0; k < 3; ++k) local[k] = (corner >> k) & 1 ? box.half[k] : -box.half[k];
  out_of_axes(box.R, local, out);
  along3(box.a, 1.0, out, out);
}

// A box's edge by its number (edge_number).
FAN_FN EdgeLine line_of(const PlacedSolid& box, int number) {
  EdgeLine out;
  const int k = number / 4, j = (k + 1) % 3, i = (k + 2) % 3;
  corner_of(box, (number & 1) << j | (number >> 1 & 1) << i, out.a);
  copy3(box.R + 3 * k, out.u);
  for (int c = 0; c < 3; ++c)
    out.outward[c] = (number & 1 ? 1.0 : -1.0) * box.R[3 * j + c] +
                     (number & 2 ? 1.0 : -1.0) * box.R[3 * i + c];
  return out;
}

// Whether n is among the normals of a box at an edge.
FAN_FN bool is_normal_of_edge(const PlacedSolid& box, int number, const double* n) {
  const int k = number / 4, j = (k + 1) % 3, i = (k + 2) % 3;
  return (number & 1 ? 1.0 : -1.0) * dot3(n, box.R + 3 * j) >= -BoxTolerances::rounding &&
         (number & 2 ? 1.0 : -1.0) * dot3(n, box.R + 3 * i) >= -BoxTolerances::rounding;
}

FAN_FN bool follow_boxes(
    const PlacedSolid& x, const PlacedSolid& y, int feature, Touches& to, bool* holds) {
  const double rounding = HullTolerances::rounding * fmin(length3(x.half), length3(y.half));
  if (feature >= BoxFeatures::nearest) return false;
  if (feature >= BoxFeatures::edges) {
    const int e = (feature - BoxFeatures::edges) / 12, g = (feature - BoxFeatures::edges) % 12;
    double at[2], n[3], back[3];
    if (!follow_edges(line_of(x, e), line_of(y, g), feature, at, n, to)) return false;
    for (int k = 0; k < 3; ++k) back[k] = -n[k];
    *holds = is_normal_of_edge(x, e, back) && is_normal_of_edge(y, g, n) &&
             fmin(at[0], at[1]) >= -rounding && at[0] <= 2.0 * x.half[e / 4] + rounding &&
             at[1] <= 2.0 * y.half[g / 4] + rounding;
    return true;
  }
  const bool of_first = feature < BoxFeatures::of_y;
  const int own = of_first ? feature : feature - BoxFeatures::of_y;
  const int face = own / BoxFeatures::corners;
  const PlacedSolid &other = of_first ? y : x, &owner = of_first ? x : y;
  double p[3], m[3], o[3], from[3], local[3];
  corner_of(owner, own % BoxFeatures::corners, p);
  for (int c = 0; c < 3; ++c) m[c] = (face & 1 ? 1.0 : -1.0) * other.R[3 * (face / 2) + c];
  along3(other.a, other.half[face / 2], m, o);
  follow_vertex(p, of_first, m, o, feature, to);
  difference3(p, other.a, from);
  into_axes(other.R, from, local);
  *holds = true;
  for (int k = 0; k < 3; ++k)
    *holds = *holds && (k == face / 2 || fabs(local[k]) <= other.half[k] + rounding);
  return true;
}

// Solids in the order of `touching`.
FAN_FN bool in_order(
    const PlacedSolid& x, const PlacedSolid& y, int feature, Touches& to, bool* holds) {
  using namespace touching;
  const Rank first = rank(x), second = rank(y);
  if (second == OF_HALF_SPACE && (first == OF_HULL || first == OF_BOX)) {
    double p[3];
    if (first == OF_BOX) corner_of(x, feature, p);
    else placed_hull(x).vertex(feature, p);
    add_above(p, y, feature, to);
    *holds = true;
    return true;
  }
  if (second == OF_HULL && first == OF_HULL)
    return follow_hulls(placed_hull(x), placed_hull(y), feature, to, holds);
  if (second == OF_HULL && first == OF_BOX)
    return follow_hulls(BoxHull(x).placed, placed_hull(y), feature, to, holds);
  return second == OF_BOX && first == OF_BOX && follow_boxes(x, y, feature, to, holds);
}

}  // namespace following

// The point of x and y that has a feature, whether or not the solids touch there now; `holds` says
// whether they certainly may. Returns whether the feature has such a point.
FAN_FN bool follow_touch(
    const PlacedSolid& x, const PlacedSolid& y, int feature, Touch* out, bool* holds) {
  const bool turned = touching::out_of_order(x, y);
  const PlacedSolid &first = turned ? y : x, &second = turned ? x : y;
  Touches to{out, DistanceTolerances::far, inflation(first), inflation(second)};
  *holds = false;
  if (!following::in_order(first, second, feature, to, holds)) return false;
  for (int k = 0; turned && k < 3; ++k) out->normal[k] = -out->normal[k];
  return true;
}

}  // namespace fan
