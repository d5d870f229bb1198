// The narrow phase: contact points between two placed solids.
//
// Small motions keep a pair's points and their feature numbers. Solids in flat contact have all
// their corner points. Swapping the solids reverses the normals and keeps points and numbers,
// except for antiparallel capsules and boxes of equal size. Finite solids have finite points at any
// depth.
#pragma once

#include "fantoccini/collision/box_pair.hpp"
#include "fantoccini/collision/hull_round.hpp"

FAN_LOOPS_BEGIN

namespace fan {

namespace touching {

// Order of the solids of a pair, so that each pair of kinds needs one function.
enum Rank { OF_ELLIPSOID, OF_SEGMENT, OF_BOX, OF_HULL, OF_HALF_SPACE };

FAN_FN Rank rank(const PlacedSolid& x) {
  if (x.kind == HALF_SPACE) return OF_HALF_SPACE;
  if (x.kind == BOX) return OF_BOX;
  if (x.kind == HULL) return OF_HULL;
  return is_ellipsoid(x) ? OF_ELLIPSOID : OF_SEGMENT;
}

// `x` does not come after the hull `y`.
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

// Whether y must come before x, by its kind, its number or its sizes. Two boxes of one size are not
// swapped.
FAN_FN bool out_of_order(const PlacedSolid& x, const PlacedSolid& y) {
  if (rank(x) != rank(y)) return rank(x) > rank(y);
  if (rank(x) == OF_HULL) return x.mesh > y.mesh;
  if (rank(x) != OF_BOX) return false;
  for (int k = 0; k < 3; ++k)
    if (x.half[k] != y.half[k]) return x.half[k] > y.half[k];
  return x.radius > y.radius;
}

}  // namespace touching

// Contact points of x and y with a gap below `margin`, in order of feature. Returns their number
// (<= max_touches).
FAN_TOUCH_FN int touches(const PlacedSolid& x, const PlacedSolid& y, double margin, Touch* out) {
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
