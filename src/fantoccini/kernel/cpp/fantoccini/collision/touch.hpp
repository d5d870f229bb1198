// Contact points between two placed solids, and a bounding-sphere test that skips distant pairs.
//
// With FAN_TOUCH_EXTERNAL only declarations are included. The definitions do not depend on the
// puppet, so touch_unit.hpp is compiled once per machine and linked.
#pragma once

#include "fantoccini/collision/solids.hpp"

#ifndef FAN_TOUCH_EXTERNAL
#include "fantoccini/collision/follow.hpp"
#include "fantoccini/collision/narrow_phase.hpp"
#endif

FAN_LOOPS_BEGIN

namespace fan {

#ifdef FAN_TOUCH_EXTERNAL
int touches(const PlacedSolid& x, const PlacedSolid& y, double margin, Touch* out);
bool follow_touch(
    const PlacedSolid& x, const PlacedSolid& y, int feature, int region, Touch* out, bool* holds);
#endif

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

// Whether spheres around two solids are at least `margin` apart, so that the solids do not touch.
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

}  // namespace fan

FAN_LOOPS_END
