// The narrow phase: contact points between two placed solids, and a cheap test before it.
//
// The points of a pair stay where they are, and keep their numbers, when the solids move a little;
// solids that lie flat have all their points. Swapping the solids gives the same points with the
// normals turned round, and the same numbers but for two capsules that point opposite ways and boxes
// of one size. Finite
// solids have finite points, however deep they are in one another.
#pragma once

#include "touch_box_pair.hpp"
#include "touch_hull_round.hpp"

FAN_LOOPS_BEGIN

namespace fan {

namespace touching {

// Solids come in this order, so that each pair of kinds is met once.
enum Rank { OF_ELLIPSOID, OF_SEGMENT, OF_BOX, OF_HULL, OF_HALF_SPACE };

FAN_FN Rank rank(const PlacedSolid& x) {
  if (x.kind == HALF_SPACE) return OF_HALF_SPACE;
  if (x.kind == BOX) return OF_BOX;
  if (x.kind == HULL) return OF_HULL;
  return is_ellipsoid(x) ? OF_ELLIPSOID : OF_SEGMENT;
}

// A solid x that does not come after the hull y.
FAN_FN void touch_hull(const PlacedSolid& x, const PlacedSolid& y, Touches& to) {
  if (rank(x) == OF_ELLIPSOID) return touch_hull_by_ellipsoid(x, y, to);
  if (rank(x) == OF_SEGMENT) return touch_hull_by_segment(x, y, to);
  if (rank(x) == OF_BOX) return touch_hulls(BoxHull(x).placed, placed_hull(y), to);
  touch_hulls(placed_hull(x), placed_hull(y), to);
}

FAN_FN void in_order(const PlacedSolid& x, const PlacedSolid& y, Touches& to) {
  if (rank(x) == OF_HALF_SPACE) return;
  if (rank(y) == OF_HALF_SPACE && rank(x) == OF_HULL)
    return touch_plane_by_hull(placed_hull(x), y, to);
  if (rank(y) == OF_HALF_SPACE) return touch_plane(x, y, to);
  if (rank(y) == OF_HULL) return touch_hull(x, y, to);
  if (rank(x) == OF_ELLIPSOID) return touch_ellipsoid(x, y, to);
  if (rank(y) == OF_SEGMENT) return touch_segments(x, y, to);
  if (rank(x) == OF_SEGMENT) return touch_box_by_segment(x, y, to);
  touch_boxes(x, y, to);
}

// Whether y must come before x: its kind, its number or its sizes say so. Two boxes of one size stay
// as they are.
FAN_FN bool out_of_order(const PlacedSolid& x, const PlacedSolid& y) {
  if (rank(x) != rank(y)) return rank(x) > rank(y);
  if (rank(x) == OF_HULL) return x.mesh > y.mesh;
  if (rank(x) != OF_BOX) return false;
  for (int k = 0; k < 3; ++k)
    if (x.half[k] != y.half[k]) return x.half[k] > y.half[k];
  return x.radius > y.radius;
}

}  // namespace touching

// Radius of the sphere around a solid, about its middle; half-spaces have none.
FAN_FN double bounding_radius(const PlacedSolid& x) {
  if (x.kind == HALF_SPACE) return unbounded;
  if (x.kind == BOX) return length3(x.half) + x.radius;
  if (x.kind == HULL) return x.hull->outer + x.radius;
  if (is_ellipsoid(x)) return fmax(x.half[0], fmax(x.half[1], x.half[2]));
  double along[3];
  difference3(x.b, x.a, along);
  return 0.5 * length3(along) + x.radius;
}

// Whether spheres around two solids are at least `margin` apart; then the solids do not touch.
// Half-spaces are apart from one another.
FAN_FN bool certainly_apart(const PlacedSolid& x, const PlacedSolid& y, double margin) {
  if (x.kind == HALF_SPACE && y.kind == HALF_SPACE) return true;
  if (x.kind == HALF_SPACE) return certainly_apart(y, x, margin);
  double centre[3], from[3];
  centre3(x, centre);
  if (y.kind == HALF_SPACE) {
    difference3(centre, y.a, from);
    return dot3(from, y.b) - y.radius - bounding_radius(x) >= margin;
  }
  double other[3];
  centre3(y, other);
  difference3(centre, other, from);
  const double reach = bounding_radius(x) + bounding_radius(y) + margin;
  return reach <= 0.0 || dot3(from, from) >= reach * reach;
}

// Contact points of x and y with a gap below `margin`; returns how many (<= max_touches), in order
// of feature.
FAN_FN int touches(const PlacedSolid& x, const PlacedSolid& y, double margin, Touch* out) {
  const bool turned = touching::out_of_order(x, y);
  const PlacedSolid &first = turned ? y : x, &second = turned ? x : y;
  Touches to{out, margin, inflation(first), inflation(second)};
  touching::in_order(first, second, to);
  for (int i = 0; turned && i < to.n; ++i)
    for (int k = 0; k < 3; ++k) out[i].normal[k] = -out[i].normal[k];
  return to.n;
}

}  // namespace fan

FAN_LOOPS_END
