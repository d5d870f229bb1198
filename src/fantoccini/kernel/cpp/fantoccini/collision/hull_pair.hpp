// Contact points of two hulls, and of a hull and a box.
//
// As for two boxes (box_pair.hpp): facets that face one another have the points of the polygon that
// they share, two edges have one point, or two where they are nearly parallel, and hulls apart
// whose facets do not face one another touch at their nearest points. Points have the numbers and
// the normals of the vertices, facets and edges that touch there, whichever facet decides.
#pragma once

#include "fantoccini/collision/hull_faces.hpp"
#include "fantoccini/collision/hull_nearest.hpp"

namespace fan {

FAN_FN Core core_of_edge(const PlacedHull& x, int e) {
  double a[3], b[3];
  x.vertex(x.edge(e)[0], a);
  x.vertex(x.edge(e)[1], b);
  return Core(a, b);
}

// The edges through a point of a hull that are nearly perpendicular to a direction.
struct EdgesThrough {
  static constexpr int capacity = 16;
  int n = 0, edges[capacity];

  FAN_FN EdgesThrough(const PlacedHull& x, const double* point, const double* direction) {
    const double near = HullTolerances::rounding * x.hull.outer;
    double turned[3], from[3], local[3];
    into_axes(x.R, direction, turned);
    difference3(point, x.at, from);
    into_axes(x.R, from, local);
    for (int e = 0; e < x.hull.n_edges && n < capacity; ++e) {
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

// Adds the points of two facets that face one another, unless the hulls are apart and all gaps
// exceed `widest`, their distance or widest gap. Returns whether points were added.
FAN_FN bool touch_facets(
    const PlacedHull& x, const PlacedHull& y, const HullAxis& axis, bool of_x, double widest,
    Touches& to) {
  const PlacedHull &owner = of_x ? x : y, &other = of_x ? y : x;
  double inward[3], local[3], reach;
  for (int c = 0; c < 3; ++c) inward[c] = of_x ? axis.normal[c] : -axis.normal[c];
  into_axes(other.R, inward, local);
  const int facet = other.facet_towards_local(other.farthest_local(local, reach), local);
  const HullPolygon shared(owner, axis.first, other, facet, of_x);
  double least = DistanceTolerances::max_distance;
  for (int i = 0; i < shared.n; ++i) least = fmin(least, shared.spots[i].height);
  if (shared.n == 0 || (widest > 0.0 && least > widest + shared.tolerance)) return false;
  for (int i = 0; i < shared.n; ++i) {
    double below[3], above[3], normal[3];
    shared.place(shared.spots[i], below, above, normal);
    for (int c = 0; of_x && c < 3; ++c) normal[c] = -normal[c];
    to.add(
        of_x ? below : above, of_x ? above : below, normal, shared.spots[i].number,
        shared.spots[i].region);
  }
  return true;
}

FAN_FN void touch_hull_edges(
    const PlacedHull& x, const PlacedHull& y, const HullAxis& axis, Touches& to) {
  const PointPair pair = nearest_points(core_of_edge(x, axis.first), core_of_edge(y, axis.second));
  to.add(pair.p, pair.q, axis.normal, HullFeatures::pair(axis.first, axis.second));
}

// Feature number of the nearest points of two hulls, and its exact normal: for a vertex and a
// facet, or two edges that cross.
FAN_FN int name_nearest(
    const PlacedHull& x, const PlacedHull& y, const NearestOfClouds& nearest, double* normal) {
  using Kind = HullFeature::Kind;
  const HullFeature of_x = nearest.feature_of(x, true), of_y = nearest.feature_of(y, false);
  double n[3];
  int number = HullFeatures::nearest;
  if (of_x.kind == Kind::EDGE && of_y.kind == Kind::EDGE) {
    cross(core_of_edge(x, of_x.number).u, core_of_edge(y, of_y.number).u, n);
    if (!unit3(n, TouchTolerances::crossing)) return HullFeatures::nearest;
    number = HullFeatures::pair(of_x.number, of_y.number);
  } else if (of_x.kind == Kind::VERTEX && of_y.kind == Kind::FACET) {
    y.normal(of_y.number, n);
    number = HullFeatures::vertex(true, of_x.number, of_y.number);
  } else if (of_x.kind == Kind::FACET && of_y.kind == Kind::VERTEX) {
    x.normal(of_x.number, n);
    number = HullFeatures::vertex(false, of_y.number, of_x.number);
  } else {
    return HullFeatures::nearest;
  }
  const double side = side_of(dot3(n, normal));
  for (int k = 0; k < 3; ++k) normal[k] = side * n[k];
  return number;
}

FAN_FN void touch_hulls_apart(
    const PlacedHull& x, const PlacedHull& y, const NearestOfClouds& nearest, Touches& to) {
  const EdgesThrough x_edges(x, nearest.pair.p, nearest.normal);
  const EdgesThrough y_edges(y, nearest.pair.q, nearest.normal);
  PointPair ends[2];
  double flat = 0.0;
  for (int i = 0; i < x_edges.n; ++i)
    for (int j = 0; j < y_edges.n; ++j) {
      const Overlap overlap(core_of_edge(x, x_edges.edges[i]), core_of_edge(y, y_edges.edges[j]));
      if (!(overlap.flat > flat)) continue;
      flat = overlap.flat;
      for (int k = 0; k < 2; ++k) ends[k] = overlap.ends[k];
    }
  if (flat == 0.0) {
    double normal[3];
    copy3(nearest.normal, normal);
    const int number = name_nearest(x, y, nearest, normal);
    return to.add(nearest.pair.p, nearest.pair.q, normal, number);
  }
  for (int k = 0; k < 2; ++k) {
    const PointPair pair = between_pairs(nearest.pair, ends[k], flat);
    double normal[3];
    copy3(nearest.normal, normal);
    aim(pair, normal);
    to.add(pair.p, pair.q, normal, HullFeatures::nearest + k);
  }
}

// Adds the deepest vertex of hulls that overlap and share no point of a facet.
FAN_FN void touch_deepest(
    const PlacedHull& x, const PlacedHull& y, const HullAxis& axis, bool of_x, Touches& to) {
  const PlacedHull& other = of_x ? y : x;
  double inward[3], p[3], q[3], reach;
  for (int c = 0; c < 3; ++c) inward[c] = of_x ? axis.normal[c] : -axis.normal[c];
  const int i = other.farthest(inward, reach);
  other.vertex(i, p);
  along3(p, of_x ? axis.gap : -axis.gap, axis.normal, q);
  to.add(of_x ? q : p, of_x ? p : q, axis.normal, HullFeatures::vertex(!of_x, i, axis.first));
}

FAN_FN void touch_hulls(const PlacedHull& x, const PlacedHull& y, Touches& to) {
  using Tol = BoxTolerances;
  const double total_radius = to.x_radius + to.y_radius;
  const NearestOfClouds nearest(cloud_of(x), cloud_of(y), to.margin + total_radius);
  if (nearest.is_far || nearest.distance - total_radius >= to.margin) return;
  const HullAxis of_x = widest_facet(x, y, -1.0), of_y = widest_facet(y, x, 1.0);
  const double same = Tol::same_face * fmin(x.hull.outer, y.hull.outer);
  const bool by_x = of_x.gap > of_y.gap + same;
  const HullAxis& face = by_x ? of_x : of_y;
  if (!nearest.meet) {
    if (!touch_facets(x, y, face, by_x, nearest.distance, to)) touch_hulls_apart(x, y, nearest, to);
    return;
  }
  const HullEdges edges(x, y, fmax(Tol::edge_share * face.gap, face.gap + same));
  if (edges.has_pair()) return touch_hull_edges(x, y, edges.best, to);
  if (!touch_facets(x, y, face, by_x, 0.0, to)) touch_deepest(x, y, face, by_x, to);
}

}  // namespace fan
