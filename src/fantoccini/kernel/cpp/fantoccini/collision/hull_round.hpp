// Contact points of a hull with a sphere, a capsule or an ellipsoid, in the hull's axes.
//
// A capsule is treated as with a box (box_capsule.hpp). The gap of an ellipsoid along a unit vector
// is n . c - h_1(n) - h_2(n), as in ellipsoid.hpp; its greatest value is sought among the normals
// of facets and the best directions against single edges, each with the support function of the
// whole hull, so that the result separates the solids. Where an edge runs deep through the
// ellipsoid, a facet replaces it.
#pragma once

#include "fantoccini/collision/hull_pair.hpp"

namespace fan {

// The ends of the part of a core that lies above a facet, in the hull's axes; see FaceClip. For
// cores outside the hull, `nearest` are the nearest points.
struct FacetClip {
  static constexpr int core_end = -1, nearest_points = -2;
  PointPair ends[2];
  int bound[2] = {core_end, core_end};  // of each end: a side of the facet, or one of these
  bool exists = true;

  FAN_FN FacetClip(
      const PlacedHull& hull, int facet, const Core& core, double at, const PointPair* nearest)
      : ends{} {
    const double* n = hull.local_normal(facet);
    const int corners = hull.n_corners(facet);
    double low = 0.0, high = core.length;
    for (int k = 0; k < corners; ++k) {
      const double* a = hull.local(hull.corner(facet, k));
      const double* b = hull.local(hull.corner(facet, (k + 1) % corners));
      double along[3], inward[3], from[3];
      difference3(b, a, along);
      cross(n, along, inward);
      if (!unit3(inward, 0.0)) continue;
      difference3(core.a, a, from);
      const double height = dot3(from, inward), rate = dot3(core.u, inward);
      if (fabs(rate) > DistanceTolerances::min_length) {
        double& end = rate > 0.0 ? low : high;
        if (rate > 0.0 ? -height / rate > low : -height / rate < high) {
          end = -height / rate;
          bound[rate > 0.0 ? 0 : 1] = k;
        }
      } else {
        exists = exists && height >= 0.0;
      }
    }
    exists = exists && low <= high;
    for (int k = 0; k < 2; ++k) {
      const bool beyond = k == 0 ? at < low : at > high;
      if (beyond && nearest) {
        ends[k] = *nearest;
        bound[k] = nearest_points;
        continue;
      }
      along3(core.a, beyond ? at : k == 0 ? low : high, core.u, ends[k].p);
      along3(ends[k].p, hull.height(facet) - dot3(ends[k].p, n), n, ends[k].q);
    }
  }
};

// Direction in which a core that meets a hull leaves it; see WayOut.
struct WayOutOfHull {
  double normal[3], gap = -DistanceTolerances::max_distance;
  int facet = 0, edge = -1;

  FAN_FN WayOutOfHull(const PlacedHull& hull, const Core& core) {
    for (int f = 0; f < hull.hull.n_facets; ++f) {
      const double* n = hull.local_normal(f);
      const double axis_gap = fmin(dot3(n, core.a), dot3(n, core.b)) - hull.height(f);
      if (!(axis_gap > gap)) continue;
      gap = axis_gap;
      facet = f;
      copy3(n, normal);
    }
    if (!(core.length > 0.0)) return;
    double least = BoxTolerances::edge_share * gap;
    for (int e = 0; e < hull.hull.n_edges; ++e) {
      const int* edge_of = hull.edge(e);
      const double *left = hull.local_normal(edge_of[2]), *right = hull.local_normal(edge_of[3]);
      if (dot3(left, core.u) * dot3(right, core.u) > 0.0) continue;
      const double *a = hull.local(edge_of[0]), *b = hull.local(edge_of[1]);
      double along[3], n[3], from[3];
      difference3(b, a, along);
      unit3(along, 0.0);
      cross(core.u, along, n);
      if (!unit3(n, TouchTolerances::lying)) continue;
      const double side = side_of(dot3(n, a));  // the origin is inside
      difference3(core.a, a, from);
      const double axis_gap = side * dot3(n, from);
      if (!(axis_gap > least)) continue;
      gap = least = axis_gap;
      edge = e;
      for (int c = 0; c < 3; ++c) normal[c] = side * n[c];
    }
  }
};

FAN_FN void touch_hull_inside(const PlacedHull& hull, const Core& core, double at, Touches& to) {
  const WayOutOfHull out(hull, core);
  if (out.edge >= 0) {
    const int* edge = hull.edge(out.edge);
    const PointPair pair = nearest_points(core, Core(hull.local(edge[0]), hull.local(edge[1])));
    return to.add(pair.p, pair.q, out.normal, 0);
  }
  const FacetClip clip(hull, out.facet, core, at, nullptr);
  if (clip.exists) {
    for (int k = 0; k < (core.length > 0.0 ? 2 : 1); ++k)
      to.add(clip.ends[k].p, clip.ends[k].q, out.normal, k);
    return;
  }
  const double* end = dot3(core.a, out.normal) < dot3(core.b, out.normal) ? core.a : core.b;
  double q[3];
  along3(end, -out.gap, out.normal, q);
  to.add(end, q, out.normal, 0);
}

// The nearest points of a core and a hull, in the hull's axes, computed again from the features on
// which they lie: exact, and smooth while these do not change.
struct CoreAndHull {
  CorePart part;
  HullFeature of;
  PointPair pair;
  double normal[3];

  FAN_FN CoreAndHull(const PlacedHull& hull, const Core& core, const NearestOfClouds& nearest)
      : part(nearest.part_of_first()), of(nearest.feature_of(hull, false)), pair(nearest.pair) {
    copy3(nearest.normal, normal);
    if (part != MIDDLE) copy3(part == FIRST_END ? core.a : core.b, pair.p);
    if (of.kind == HullFeature::VERTEX) copy3(hull.local(of.number), pair.q);
    if (of.kind == HullFeature::FACET && part != MIDDLE) {
      const double* n = hull.local_normal(of.number);
      along3(pair.p, hull.height(of.number) - dot3(pair.p, n), n, pair.q);
      copy3(n, normal);
      return;
    }
    if (of.kind == HullFeature::EDGE && part != MIDDLE)
      core_of_edge(hull, of.number).project(pair.p, pair.q);
    if (of.kind == HullFeature::VERTEX && part == MIDDLE) core.project(pair.q, pair.p);
    if (of.kind == HullFeature::EDGE && part == MIDDLE)
      lines_nearest(core, core_of_edge(hull, of.number), pair);
    aim(pair, normal);
  }

  // A region number for every combination of parts and features. The middle of a core that lies
  // along a facet has no point of its own there.
  FAN_FN int region() const {
    const bool lasts =
        of.kind != HullFeature::NONE && (of.kind != HullFeature::FACET || part != MIDDLE);
    return (lasts ? lasting_regions : 0) + 3 * of.code() + part;
  }
};

// `local` is the hull in its own axes.
FAN_FN void touch_hull_outside(
    const PlacedHull& local, const Core& core, const CoreAndHull& nearest, Touches& to) {
  const double* normal = nearest.normal;
  const PointPair& pair = nearest.pair;
  const int region = nearest.region();
  if (core.length == 0.0) return to.add(pair.p, pair.q, normal, 0, region);
  double reach, tilt[3], from[3];
  difference3(pair.p, core.a, from);
  const double at = clamped(dot3(from, core.u), 0.0, core.length);
  const int facet = local.facet_towards_local(local.farthest_local(normal, reach), normal);
  cross(local.local_normal(facet), normal, tilt);
  const FacetClip clip(local, facet, core, at, &pair);
  const double on_facet = clip.exists ? flatness(length3(tilt)) : 0.0;
  const EdgesThrough edges(local, pair.q, normal);
  PointPair ends[2];
  double on_edge = 0.0;
  for (int i = 0; i < edges.n; ++i) {
    const Overlap overlap(core, core_of_edge(local, edges.edges[i]));
    if (!(overlap.flat > on_edge)) continue;
    on_edge = overlap.flat;
    for (int k = 0; k < 2; ++k) ends[k] = overlap.ends[k];
  }
  if (on_facet == 0.0 && on_edge == 0.0) return to.add(pair.p, pair.q, normal, 0, region);
  const int shape = 3 * stretch_of(on_facet) + stretch_of(on_edge);
  for (int k = 0; k < 2; ++k) {
    PointPair end = pair;
    if (on_edge > 0.0) end = between_pairs(end, ends[k], on_edge);
    if (on_facet > 0.0) end = between_pairs(end, clip.ends[k], on_facet);
    double n[3];
    copy3(normal, n);
    aim(end, n);
    // Of a core that lies flat, the end does not depend on the nearest points.
    const bool flat = on_facet >= 1.0 && clip.bound[k] != FacetClip::nearest_points;
    const int bound = flat ? max_hull_vertices * facet + clip.bound[k] + 1 : -1;
    to.add(end.p, end.q, n, k, flat ? -2 - bound : 9 * (region % lasting_regions) + shape);
  }
}

constexpr double no_turn[9] = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
constexpr double no_shift[3] = {0.0, 0.0, 0.0};

// Adds the points of a sphere or capsule x and a hull: feature 0, and 1 where two points are
// needed.
FAN_FN void touch_hull_by_segment(const PlacedSolid& x, const PlacedSolid& hull, Touches& to) {
  const PlacedHull local{*hull.hull, no_turn, no_shift};
  double ends[6];
  into_frame(hull, x.a, ends);
  into_frame(hull, x.b, ends + 3);
  const Core core(ends, ends + 3);
  const Cloud points{ends, core.length > 0.0 ? 2 : 1, no_turn, no_shift};
  const double total_radius = to.x_radius + to.y_radius;
  const NearestOfClouds nearest(points, cloud_of(local), to.margin + total_radius);
  if (nearest.is_far || nearest.distance - total_radius >= to.margin) return;
  if (nearest.meet) {
    double from[3];
    difference3(nearest.pair.p, core.a, from);
    touch_hull_inside(local, core, clamped(dot3(from, core.u), 0.0, core.length), to);
  } else {
    touch_hull_outside(local, core, CoreAndHull(local, core, nearest), to);
  }
  place_touches(hull, 0, to);
}

// The widest gap between an ellipsoid and a hull, in the hull's axes.
class EllipsoidHullGap {
 public:
  double normal[3], gap = -DistanceTolerances::max_distance;
  HullFeature of;  // feature of the hull's point

  // Ends early where the gap is certainly `enough`.
  FAN_FN EllipsoidHullGap(
      const PlacedHull& local, const EllipsoidReach& reach, const double* centre,
      const double* radii, double enough)
      : hull_(local), reach_(reach), centre_(centre), least_(radii[0]) {
    for (int k = 1; k < 3; ++k) least_ = fmin(least_, radii[k]);
    for (int f = 0; f < local.hull.n_facets; ++f) {
      const double* n = local.local_normal(f);
      const double height = dot3(n, centre) - local.height(f);
      double p[3];
      if (height - least_ > gap) take(n, height - reach.farthest(n, p), {HullFeature::FACET, f});
    }
    find_nearest_vertex();
    for (int e = 0; e < local.hull.n_edges && gap < enough; ++e) try_edge(e);
  }

 private:
  FAN_FN void take(const double* n, double axis_gap, HullFeature feature) {
    if (!(axis_gap > gap)) return;
    gap = axis_gap;
    of = feature;
    copy3(n, normal);
  }

  // Finds the vertex that is the hull's point nearest to the ellipsoid's middle, if there is one.
  FAN_FN void find_nearest_vertex() {
    bool beside[max_hull_vertices] = {};
    for (int e = 0; e < hull_.hull.n_edges; ++e) {
      const int* ends = hull_.edge(e);
      const double *a = hull_.local(ends[0]), *b = hull_.local(ends[1]);
      double along[3], w[3];
      difference3(b, a, along);
      difference3(centre_, a, w);
      if (dot3(w, along) > 0.0) beside[ends[0]] = true;
      difference3(centre_, b, w);
      if (dot3(w, along) < 0.0) beside[ends[1]] = true;
    }
    for (int i = 0; i < hull_.hull.n_vertices; ++i)
      if (!beside[i]) nearest_ = i;
  }

  // Tries the best direction against one edge, if one of its normals or those of its ends may be
  // better. If the ellipsoid's middle has its nearest point elsewhere, its height is greatest over
  // an end, along a normal of an edge there.
  FAN_FN void try_edge(int e) {
    const EdgeAt edge(hull_, e, no_shift);
    double w[3], p[3];
    difference3(centre_, edge.p, w);
    const int* ends = hull_.edge(e);
    const bool is_nearest = ends[0] == nearest_ || ends[1] == nearest_;
    if (!is_nearest && !(edge.max_height(w) - least_ > gap)) return;
    double axes[9], middle[3], from[3], turned[3], M_axes[9], n[3];
    const Core core(hull_.local(hull_.edge(e)[0]), hull_.local(hull_.edge(e)[1]));
    const double half[3] = {0.5 * core.length, 0.0, 0.0};
    axes_along(core.u, axes);
    for (int k = 0; k < 3; ++k) middle[k] = 0.5 * (core.a[k] + core.b[k]);
    difference3(centre_, middle, from);
    into_axes(axes, from, turned);
    for (int i = 0; i < 3; ++i) into_axes(axes, reach_.M + 3 * i, M_axes + 3 * i);
    EllipsoidReach first = reach_;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        first.M[3 * i + j] = axes[3 * i] * M_axes[j] + axes[3 * i + 1] * M_axes[3 + j] +
                             axes[3 * i + 2] * M_axes[6 + j];
    const GapClimb climb(first, nullptr, half, turned, DistanceTolerances::max_distance);
    out_of_axes(axes, climb.n, n);
    double height;
    const int farthest = hull_.farthest_local(n, height);
    const HullFeature feature = climb.n[0] == 0.0 ? HullFeature{HullFeature::EDGE, e}
                                                  : HullFeature{HullFeature::VERTEX, farthest};
    take(n, dot3(n, centre_) - height - reach_.farthest(n, p), feature);
  }

  const PlacedHull& hull_;
  const EllipsoidReach& reach_;
  const double* centre_;
  double least_;
  int nearest_ = -1;
};

// Adds the point of an ellipsoid x and a hull: feature 0.
FAN_FN void touch_hull_by_ellipsoid(const PlacedSolid& x, const PlacedSolid& hull, Touches& to) {
  const PlacedHull local{*hull.hull, no_turn, no_shift};
  double middle[3], centre[3], axes[9], p[3], q[3];
  centre3(x, middle);
  into_frame(hull, middle, centre);
  for (int j = 0; j < 3; ++j) into_axes(hull.R, x.R + 3 * j, axes + 3 * j);
  const EllipsoidReach reach(axes, x.half);
  const EllipsoidHullGap widest(local, reach, centre, x.half, to.margin + to.y_radius);
  reach.farthest(widest.normal, p);
  difference3(centre, p, p);
  along3(p, -widest.gap, widest.normal, q);
  to.add(p, q, widest.normal, 0, widest.of.code());
  place_touches(hull, 0, to);
}

}  // namespace fan
