// Basis of the narrow phase: placed solids, contact points, and 3-vectors.
#pragma once

#include "fantoccini/collision/distance.hpp"
#include "fantoccini/contract.hpp"
#include "fantoccini/math/space.hpp"

// Linkage of the functions that touch_unit.hpp exports; inline elsewhere.
#ifndef FAN_TOUCH_FN
#define FAN_TOUCH_FN FAN_FN
#endif

FAN_LOOPS_BEGIN

namespace fan {

struct TouchTolerances {
  static constexpr double tiny = 1e-12;       // m: cores nearer than this have no direction
  static constexpr double lying = 0.005;      // sin of an angle below which solids lie flat
  static constexpr double crossing = 0.05;    // sin of an angle above which one point is enough
  static constexpr double leaving = 1e-12;    // relative to a unit vector: less is rounding
  static constexpr double min_overlap = 0.1;  // of the shorter segment, for two full points
};

// One contact point.
struct Touch {
  double point[3];   // world, midway between the two surfaces [m]
  double normal[3];  // unit, world, from the second solid towards the first
  double gap;        // m: distance of the surfaces along the normal; negative: depth
  int feature;       // number of the point within the pair: the same from step to step
  int region;        // changes where the surfaces continue with another curvature
};

// Regions of a point of two edges. CROSSING: its normal is their product. ALONG: they are nearly
// parallel, and it has a face's normal. BEYOND: their product is not a normal of the solids there,
// and other features touch instead.
enum CrossingRegion { CROSSING = 0, ALONG = 1, BEYOND = -1 };

constexpr int max_touches = 8;  // per pair

// From here on a region is the feature on which the point lies and, with the pair's feature,
// defines the point: it continues beyond the region by that alone (follow.hpp).
constexpr int lasting_regions = 1 << 24;

// A solid placed in the world; see SolidKind. An ellipsoid has the centre (a + b) / 2, the columns
// of R as axes and the radii `half`; the radius is that of the capsule around it.
using PlacedSolid = Solid;

FAN_FN bool is_ellipsoid(const PlacedSolid& x) { return x.kind == SEGMENT && x.half[0] > 0.0; }

// Distance by which a solid's core is inflated.
FAN_FN double inflation(const PlacedSolid& x) { return is_ellipsoid(x) ? 0.0 : x.radius; }

FAN_FN void centre3(const PlacedSolid& x, double* out) {
  for (int k = 0; k < 3; ++k) out[k] = x.kind == SEGMENT ? 0.5 * (x.a[k] + x.b[k]) : x.a[k];
}

// A point in the axes of a solid, from its middle.
FAN_FN void into_frame(const PlacedSolid& x, const double* point, double* out) {
  double from[3];
  difference3(point, x.a, from);
  into_axes(x.R, from, out);
}

// A corner of a box: one bit for each axis.
FAN_FN void corner_of(const PlacedSolid& box, int corner, double* out) {
  double local[3];
  for (int k = 0; k < 3; ++k) local[k] = (corner >> k) & 1 ? box.half[k] : -box.half[k];
  out_of_axes(box.R, local, out);
  along3(box.a, 1.0, out, out);
}

// Region of a box about the origin that a normal leaves: a face, an edge or a corner.
FAN_FN int region_of_box(const double* normal) {
  int region = 0;
  for (int k = 0; k < 3; ++k)
    region = 3 * region + (fabs(normal[k]) <= TouchTolerances::leaving ? 0
                           : normal[k] > 0.0                           ? 1
                                                                       : 2);
  return region;
}

// Flatness: from 1 for solids that lie flat to 0 for those that cross, with a continuous slope.
FAN_FN double flatness(double sine) {
  using Tol = TouchTolerances;
  const double t = clamped((Tol::crossing - sine) / (Tol::crossing - Tol::lying), 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

// A solid of a link with the axes R and the origin r.
FAN_FN void place_solid(const Solid& from, const double* R, const double* r, Solid& to) {
  to.kind = from.kind;
  to.link = from.link;
  to.mesh = from.mesh;
  to.radius = from.radius;
  to.hull = from.hull;
  FAN_UNROLL for (int c = 0; c < 3; ++c) {
    to.half[c] = from.half[c];
    to.a[c] = r[c] + R[c] * from.a[0] + R[3 + c] * from.a[1] + R[6 + c] * from.a[2];
    to.b[c] = r[c] + R[c] * from.b[0] + R[3 + c] * from.b[1] + R[6 + c] * from.b[2];
  }
  if (from.kind == SEGMENT && !is_ellipsoid(from)) return;
  FAN_UNROLL for (int c = 0; c < 3; ++c) FAN_UNROLL for (int j = 0; j < 3; ++j) to.R[3 * j + c] =
      R[c] * from.R[3 * j] + R[3 + c] * from.R[3 * j + 1] + R[6 + c] * from.R[3 * j + 2];
}

// Contact points of a pair, collected in order of feature.
struct Touches {
  Touch* out;
  double margin, x_radius, y_radius;  // radii by which the cores are inflated
  int n = 0;

  // Adds the point midway between p of the first core and q of the second, or on the second's
  // surface if requested, if its gap is below the margin.
  FAN_FN void add(
      const double* p, const double* q, const double* normal, int feature, int region = 0,
      bool on_second = false) {
    double apart[3];
    difference3(p, q, apart);
    const double gap = dot3(apart, normal) - x_radius - y_radius;
    if (!(gap < margin) || n == max_touches) return;
    int place = n++;
    for (; place > 0 && out[place - 1].feature > feature; --place) out[place] = out[place - 1];
    Touch& to = out[place];
    const double part = on_second ? 0.0 : 0.5;
    for (int k = 0; k < 3; ++k) {
      const double own = p[k] - normal[k] * x_radius, other = q[k] + normal[k] * y_radius;
      to.point[k] = other + part * (own - other);
      to.normal[k] = normal[k];
    }
    to.gap = gap;
    to.feature = feature;
    to.region = region;
  }
};

}  // namespace fan

FAN_LOOPS_END
