// One contact point from its features alone, at any poses of the solids: a vertex and a plane,
//
//     gap = n . (p - q_plane),   n the normal of the facet,
//
// or two edges with the directions u and v,
//
//     gap = n . (p_x - p_y),   n = +-u x v / |u x v|.
//
// Spheres and capsules have a point of their core nearest to a facet, an edge or a vertex; the
// region then says which. Within their features these are the points that touches() finds. In trial
// states of integrators and finite differences, points lie outside them: the gap continues smoothly
// there.
#pragma once

#include "fantoccini/collision/narrow_phase.hpp"

namespace fan {

struct FollowTolerances {
  // Distances by which a point may lie outside its features, relative to a solid's size or in a
  // unit vector: for pairs of hulls or boxes, and for round solids, whose gaps continue smoothly.
  static constexpr double polyhedra = HullTolerances::rounding, round = 1e-12;
};

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

// Adds the point of two edges. `along`: its positions along them. Returns false if they are
// parallel.
FAN_FN bool follow_edges(
    const EdgeLine& x, const EdgeLine& y, int feature, double* along, double* n, Touches& to) {
  double w[3], p[3], q[3];
  cross(x.u, y.u, n);
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

// Whether n is among the normals of the hull at an edge. Sets the edge's length.
FAN_FN bool is_normal_of_edge(
    const PlacedHull& hull, int e, const double* n, double tolerance, double* length) {
  const int* edge = hull.edge(e);
  const Core core = core_of_edge(hull, e);
  double facet[3], inward[3];
  *length = core.length;
  // The facet to the left contains the edge in its own order, the facet to the right in reverse.
  for (int k = 0; k < 2; ++k) {
    hull.normal(edge[2 + k], facet);
    cross(facet, core.u, inward);
    if ((k == 0 ? 1.0 : -1.0) * dot3(n, inward) > tolerance) return false;
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
    cross(hull.local_normal(f), along, inward);
    unit3(inward, 0.0);
    difference3(local, a, from);
    if (dot3(from, inward) < -rounding) return false;
  }
  return true;
}

// Follows a point of two hulls. `holds`: whether it lies within its features.
FAN_FN bool follow_hulls(
    const PlacedHull& x, const PlacedHull& y, int feature, Touches& to, bool* holds) {
  const double rounding = FollowTolerances::polyhedra * fmin(x.hull.outer, y.hull.outer);
  if (feature >= HullFeatures::nearest) return false;
  if (feature >= HullFeatures::edges) {
    const int e = (feature - HullFeatures::edges) / max_hull_edges;
    const int g = (feature - HullFeatures::edges) % max_hull_edges;
    double at[2], n[3], reversed[3], length[2];
    if (!follow_edges(line_of(x, e), line_of(y, g), feature, at, n, to)) return false;
    for (int k = 0; k < 3; ++k) reversed[k] = -n[k];
    *holds = is_normal_of_edge(x, e, reversed, FollowTolerances::polyhedra, length) &&
             is_normal_of_edge(y, g, n, FollowTolerances::polyhedra, length + 1);
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

// Whether n is among the normals of a hull at a vertex, in its axes.
FAN_FN bool is_normal_of_vertex(const PlacedHull& hull, int i, const double* n) {
  for (int e = 0; e < hull.hull.n_edges; ++e) {
    const int* edge = hull.edge(e);
    if (edge[0] != i && edge[1] != i) continue;
    double along[3];
    difference3(hull.local(edge[0] == i ? edge[1] : edge[0]), hull.local(i), along);
    unit3(along, 0.0);
    if (dot3(along, n) > FollowTolerances::round) return false;
  }
  return true;
}

// Follows a point of a core, in the axes of a hull, from the region of their nearest points
// (CoreAndHull).
FAN_FN bool follow_core(
    const PlacedHull& hull, const Core& core, int feature, int region, Touches& to, bool* holds) {
  const int code = region - lasting_regions, number = code / 12 - 1;
  const auto part = CorePart(code % 3);
  const auto kind = HullFeature::Kind(code / 3 % 4);
  const bool is_middle = part == MIDDLE;
  const double rounding = FollowTolerances::round * hull.hull.outer;
  double p[3], q[3], n[3], length = 0.0;
  *holds = true;
  if (!is_middle) copy3(part == FIRST_END ? core.a : core.b, p);
  if (kind == HullFeature::FACET) {
    copy3(hull.local_normal(number), n);
    along3(p, hull.height(number) - dot3(p, n), n, q);
    *holds = is_in_facet(hull, number, q, rounding);
  } else if (kind == HullFeature::VERTEX) {
    copy3(hull.local(number), q);
    if (is_middle) core.project(q, p);
  } else {
    const Core edge = core_of_edge(hull, number);
    if (!is_middle) {
      edge.project(p, q);
    } else {
      PointPair pair;
      if (!lines_nearest(core, edge, pair)) return false;
      copy3(pair.p, p);
      copy3(pair.q, q);
    }
    double from[3];
    difference3(q, edge.a, from);
    const double at = dot3(from, edge.u);
    *holds = at >= -rounding && at <= edge.length + rounding;
  }
  if (kind != HullFeature::FACET) {
    difference3(p, q, n);
    if (!unit3(n, TouchTolerances::tiny)) return false;
  }
  if (kind == HullFeature::EDGE)
    *holds = *holds && is_normal_of_edge(hull, number, n, FollowTolerances::round, &length);
  if (kind == HullFeature::VERTEX) *holds = *holds && is_normal_of_vertex(hull, number, n);
  *holds = *holds && is_nearest_part(core, part, p, n, FollowTolerances::round);
  to.add(p, q, n, feature, region);
  return true;
}

// A box's edge from its number (edge_number).
FAN_FN EdgeLine line_of(const PlacedSolid& box, int number) {
  EdgeLine out;
  const int k = number / 4, j = (k + 1) % 3, i = (k + 2) % 3;
  corner_of(box, (number & 1) << j | (number >> 1 & 1) << i, out.a);
  copy3(box.R + 3 * k, out.u);
  for (int c = 0; c < 3; ++c)
    out.outward[c] =
        (number & 1 ? 1.0 : -1.0) * box.R[3 * j + c] + (number & 2 ? 1.0 : -1.0) * box.R[3 * i + c];
  return out;
}

// Whether n is among the normals of a box at an edge.
FAN_FN bool is_normal_of_edge(const PlacedSolid& box, int number, const double* n) {
  const int k = number / 4, j = (k + 1) % 3, i = (k + 2) % 3;
  return (number & 1 ? 1.0 : -1.0) * dot3(n, box.R + 3 * j) >= -FollowTolerances::polyhedra &&
         (number & 2 ? 1.0 : -1.0) * dot3(n, box.R + 3 * i) >= -FollowTolerances::polyhedra;
}

FAN_FN bool follow_boxes(
    const PlacedSolid& x, const PlacedSolid& y, int feature, Touches& to, bool* holds) {
  const double rounding = FollowTolerances::polyhedra * fmin(length3(x.half), length3(y.half));
  if (feature >= BoxFeatures::nearest) return false;
  if (feature >= BoxFeatures::edges) {
    const int e = (feature - BoxFeatures::edges) / 12, g = (feature - BoxFeatures::edges) % 12;
    double at[2], n[3], reversed[3];
    if (!follow_edges(line_of(x, e), line_of(y, g), feature, at, n, to)) return false;
    for (int k = 0; k < 3; ++k) reversed[k] = -n[k];
    *holds = is_normal_of_edge(x, e, reversed) && is_normal_of_edge(y, g, n) &&
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

// Follows a point of a core, in the axes of a box, from the part of the core and the region of the
// box (region_of_box): the nearest points of the box lie on a line, where the coordinates along the
// region's directions are at their bounds.
FAN_FN bool follow_core(
    const double* half, const Core& core, int feature, int region, Touches& to, bool* holds) {
  const int code = region - lasting_regions, digit[3] = {code / 9 % 3, code / 3 % 3, code % 3};
  const auto part = CorePart(code / 27);
  double p[3], q[3], n[3], along = 0.0, square = 0.0;
  for (int k = 0; k < 3; ++k) {
    q[k] = digit[k] == 1 ? half[k] : -half[k];
    if (digit[k] == 0) continue;
    along += (core.a[k] - q[k]) * core.u[k];
    square += core.u[k] * core.u[k];
  }
  if (part == MIDDLE && !(square > TouchTolerances::lying * TouchTolerances::lying)) return false;
  if (part == MIDDLE) along3(core.a, -along / square, core.u, p);
  else copy3(part == FIRST_END ? core.a : core.b, p);
  const double rounding = FollowTolerances::round * length3(half);
  *holds = true;
  for (int k = 0; k < 3; ++k) {
    if (digit[k] == 0) {
      *holds = *holds && fabs(p[k]) <= half[k] + rounding;
      q[k] = p[k];
    } else {
      *holds = *holds && (q[k] > 0.0 ? p[k] - q[k] : q[k] - p[k]) >= -rounding;
    }
  }
  difference3(p, q, n);
  if (!unit3(n, TouchTolerances::tiny)) return false;
  *holds = *holds && is_nearest_part(core, part, p, n, FollowTolerances::round);
  to.add(p, q, n, feature, region);
  return true;
}

// Follows a point of two cores, from the nearest part of each.
FAN_FN bool follow_cores(
    const Core& x, const Core& y, int feature, int region, Touches& to, bool* holds) {
  const auto of_x = CorePart((region - lasting_regions) / 3);
  const auto of_y = CorePart((region - lasting_regions) % 3);
  PointPair at;
  if (of_x != MIDDLE) copy3(of_x == FIRST_END ? x.a : x.b, at.p);
  if (of_y != MIDDLE) copy3(of_y == FIRST_END ? y.a : y.b, at.q);
  if (of_x == MIDDLE && of_y == MIDDLE && !lines_nearest(x, y, at)) return false;
  if (of_x == MIDDLE && of_y != MIDDLE) x.project(at.q, at.p);
  if (of_x != MIDDLE && of_y == MIDDLE) y.project(at.p, at.q);
  double n[3], reversed[3];
  if (!aim(at, n)) return false;
  for (int k = 0; k < 3; ++k) reversed[k] = -n[k];
  *holds = is_nearest_part(x, of_x, at.p, n, FollowTolerances::round) &&
           is_nearest_part(y, of_y, at.q, reversed, FollowTolerances::round);
  to.add(at.p, at.q, n, feature, region);
  return true;
}

// Follows a point of a sphere or capsule x and a sphere, capsule, box or hull y.
FAN_FN bool follow_segment(
    const PlacedSolid& x, const PlacedSolid& y, int feature, int region, Touches& to, bool* holds) {
  using namespace touching;
  const Rank second = rank(y);
  if (region < lasting_regions) return false;
  if (second == OF_SEGMENT)
    return follow_cores(Core(x.a, x.b), Core(y.a, y.b), feature, region, to, holds);
  if (second == OF_HALF_SPACE) return false;
  double ends[6];
  into_frame(y, x.a, ends);
  into_frame(y, x.b, ends + 3);
  const Core core(ends, ends + 3);
  const bool exists =
      second == OF_BOX
          ? follow_core(y.half, core, feature, region, to, holds)
          : follow_core(PlacedHull{*y.hull, no_turn, no_shift}, core, feature, region, to, holds);
  if (exists) place_touches(y, 0, to);
  return exists;
}

// Follows a point of two solids in the order of `touching`.
FAN_FN bool follow_in_order(
    const PlacedSolid& x, const PlacedSolid& y, int feature, int region, Touches& to, bool* holds) {
  using namespace touching;
  const Rank first = rank(x), second = rank(y);
  if (first == OF_SEGMENT) return follow_segment(x, y, feature, region, to, holds);
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

// Finds the point of x and y with a feature and a region, whether or not the solids touch there
// now. `holds`: whether it certainly lies within its features. Returns whether there is one.
FAN_TOUCH_FN bool follow_touch(
    const PlacedSolid& x, const PlacedSolid& y, int feature, int region, Touch* out, bool* holds) {
  const bool turned = touching::out_of_order(x, y);
  const PlacedSolid &first = turned ? y : x, &second = turned ? x : y;
  Touches to{out, DistanceTolerances::max_distance, inflation(first), inflation(second)};
  *holds = false;
  if (!following::follow_in_order(first, second, feature, region, to, holds)) return false;
  for (int k = 0; turned && k < 3; ++k) out->normal[k] = -out->normal[k];
  return true;
}

}  // namespace fan
