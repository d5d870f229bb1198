// Exact distances between points, segments and boxes, for any Real, without branches on one.
// Capsules and spheres are segments with a radius, which the caller subtracts.
#pragma once

#include <initializer_list>

#include "fantoccini/math/elementary.hpp"
#include "fantoccini/math/space.hpp"

namespace fan {

struct DistanceTolerances {
  static constexpr double min_length = 1e-12;       // m: shorter segments count as points
  static constexpr double min_determinant = 1e-12;  // sin^2 of an angle: parallel below it
  static constexpr double min_axis_square = 1e-8;   // sin^2 of two edges' angle: no axis below it
  static constexpr double max_distance = 1e30;      // m or m^2: larger than every distance
};

template <class Real>
FAN_FN Real clamped(const Real& x, const Real& low, const Real& high) {
  return select(x < low, low, select(x > high, high, x));
}

// The square of a point's distance from the segment a + t d, 0 <= t <= 1.
template <class Real>
FAN_FN Real square_to_segment(const Real* point, const Real* a, const Real* d, const Real& d_d) {
  Real r[3];
  FAN_UNROLL for (int k = 0; k < 3; ++k) r[k] = point[k] - a[k];
  const Real t = clamped(Real(dot3(r, d) / d_d), Real(0.0), Real(1.0));
  FAN_UNROLL for (int k = 0; k < 3; ++k) r[k] -= t * d[k];
  return dot3(r, r);
}

// Distance between the segments a to b and c to d: at an end, or where the lines' nearest points
// lie inside both.
template <class Real>
FAN_FN Real between_segments(const Real* a, const Real* b, const Real* c, const Real* d) {
  using std::sqrt;
  Real u[3], v[3], w[3];
  FAN_UNROLL for (int k = 0; k < 3; ++k) {
    u[k] = b[k] - a[k];
    v[k] = d[k] - c[k];
    w[k] = a[k] - c[k];
  }
  const Real tiny = Real(DistanceTolerances::min_length * DistanceTolerances::min_length);
  const Real uu = dot3(u, u) + tiny, vv = dot3(v, v) + tiny, uv = dot3(u, v);
  const Real wu = dot3(w, u), wv = dot3(w, v);
  Real least = square_to_segment(a, c, v, vv);
  const auto nearer = [&](const Real& square) { least = select(square < least, square, least); };
  nearer(square_to_segment(b, c, v, vv));
  nearer(square_to_segment(c, a, u, uu));
  nearer(square_to_segment(d, a, u, uu));
  const Real determinant = uu * vv - uv * uv;
  const auto crossing = determinant > Real(DistanceTolerances::min_determinant) * (uu * vv);
  const Real safe = select(crossing, determinant, Real(1.0));
  const Real s = (uv * wv - vv * wu) / safe, t = (uu * wv - uv * wu) / safe;
  const auto inside = crossing && s > Real(0.0) && s < Real(1.0) && t > Real(0.0) && t < Real(1.0);
  Real apart[3];
  FAN_UNROLL for (int k = 0; k < 3; ++k) apart[k] = w[k] + s * u[k] - t * v[k];
  nearer(select(inside, dot3(apart, apart), least));
  return sqrt(least);
}

// Parameter of the point of the segment a to b nearest to a box about the origin: 0 at a, 1 at b.
// Half the derivative of the squared distance along the segment is increasing and piecewise linear,
// with breaks where the segment crosses a face's plane: its zero lies between the two nearest
// breaks.
template <class Real>
FAN_FN Real nearest_to_box(const Real* a, const Real* b, const double* half) {
  using std::abs;
  Real d[3];
  FAN_UNROLL for (int k = 0; k < 3; ++k) d[k] = b[k] - a[k];
  const auto outside = [&](int k, const Real& t) {
    const Real x = a[k] + t * d[k];
    return Real(x - clamped(x, Real(-half[k]), Real(half[k])));
  };
  const auto slope = [&](const Real& t) {
    return Real(outside(0, t) * d[0] + outside(1, t) * d[1] + outside(2, t) * d[2]);
  };
  Real low = Real(0.0), high = Real(1.0), at_low = slope(low), at_high = slope(high);
  FAN_UNROLL for (int k = 0; k < 3; ++k) {
    const auto moves = abs(d[k]) > Real(DistanceTolerances::min_length);
    const Real inverse = Real(1.0) / select(moves, d[k], Real(1.0));
    for (const double side : {-half[k], half[k]}) {
      const Real t = (Real(side) - a[k]) * inverse;
      const auto between = moves && t > low && t < high;
      const Real slope_at_t = slope(t);
      const auto before = between && slope_at_t < Real(0.0),
                 after = between && !(slope_at_t < Real(0.0));
      low = select(before, t, low);
      at_low = select(before, slope_at_t, at_low);
      high = select(after, t, high);
      at_high = select(after, slope_at_t, at_high);
    }
  }
  const Real rise = at_high - at_low;
  const auto turns = at_low < Real(0.0) && at_high > Real(0.0);
  const Real inner = low - at_low * (high - low) / select(turns, rise, Real(1.0));
  return select(turns, inner, select(at_low < Real(0.0), high, low));
}

// Distance of the segment a to b from a box about the origin, 0 where they meet.
template <class Real>
FAN_FN Real segment_to_box(const Real* a, const Real* b, const double* half) {
  using std::sqrt;
  const Real t = nearest_to_box(a, b, half);
  Real square = Real(0.0);
  FAN_UNROLL for (int k = 0; k < 3; ++k) {
    const Real x = a[k] + t * (b[k] - a[k]);
    const Real out = x - clamped(x, Real(-half[k]), Real(half[k]));
    square += out * out;
  }
  return sqrt(square);
}

// A lower bound of a box's distance from another about the origin, by separating axes: the widest
// gap along face normals and products of edges. For boxes that overlap it is minus the depth.
template <class Real>
FAN_FN Real box_to_box(const Real* centre, const Real* R, const double* half, const double* other) {
  using std::abs;
  using std::sqrt;
  Real size[9];
  for (int i = 0; i < 9; ++i) size[i] = abs(R[i]);
  Real widest = Real(-DistanceTolerances::max_distance);
  const auto gap = [&](const Real& apart, const Real& reach) {
    const Real axis_gap = abs(apart) - reach;
    widest = select(axis_gap > widest, axis_gap, widest);
  };
  // R holds the axes of the first box, column by column.
  FAN_UNROLL for (int k = 0; k < 3; ++k)
      gap(centre[k],
          Real(Real(other[k]) + half[0] * size[k] + half[1] * size[3 + k] + half[2] * size[6 + k]));
  for (int j = 0; j < 3; ++j)
    gap(dot3(centre, R + 3 * j), Real(
                                     Real(half[j]) + other[0] * size[3 * j] +
                                     other[1] * size[3 * j + 1] + other[2] * size[3 * j + 2]));
  FAN_UNROLL for (int k = 0; k < 3; ++k) for (int j = 0; j < 3; ++j) {
    // The cross product of the k-th axis and the j-th column.
    const int k1 = (k + 1) % 3, k2 = (k + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
    const Real x1 = -R[3 * j + k2], x2 = R[3 * j + k1];
    const Real square = x1 * x1 + x2 * x2;
    const auto crossed = square > Real(DistanceTolerances::min_axis_square);
    const Real scale = Real(1.0) / sqrt(select(crossed, square, Real(1.0)));
    const Real reach = other[k1] * size[3 * j + k2] + other[k2] * size[3 * j + k1] +
                       half[j1] * size[3 * j2 + k] + half[j2] * size[3 * j1 + k];
    const Real axis_gap = (abs(centre[k1] * x1 + centre[k2] * x2) - reach) * scale;
    widest = select(crossed && axis_gap > widest, axis_gap, widest);
  }
  return widest;
}

// Distance of a box from another about the origin where they do not overlap. The nearest points are
// on an edge of the first, or a corner of the other.
template <class Real>
FAN_FN Real
between_boxes(const Real* centre, const Real* R, const double* half, const double* other) {
  using std::abs;
  using std::sqrt;
  Real least = Real(DistanceTolerances::max_distance);
  const auto nearer = [&](const Real& candidate) {
    least = select(candidate < least, candidate, least);
  };
  for (const double x : {-other[0], other[0]})
    for (const double y : {-other[1], other[1]})
      for (const double z : {-other[2], other[2]}) {
        const Real from[] = {x - centre[0], y - centre[1], z - centre[2]};
        Real square = Real(0.0);
        for (int j = 0; j < 3; ++j) {
          const Real out = abs(dot3(from, R + 3 * j)) - Real(half[j]);
          square += select(out > Real(0.0), Real(out * out), Real(0.0));
        }
        nearer(square);
      }
  least = sqrt(least);
  for (int j = 0; j < 3; ++j) {
    const int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
    for (const double x : {-half[j1], half[j1]})
      for (const double y : {-half[j2], half[j2]}) {
        Real a[3], b[3];
        for (int c = 0; c < 3; ++c) {
          const Real middle = centre[c] + R[3 * j1 + c] * x + R[3 * j2 + c] * y;
          a[c] = middle - R[3 * j + c] * half[j];
          b[c] = middle + R[3 * j + c] * half[j];
        }
        nearer(segment_to_box(a, b, other));
      }
  }
  return least;
}

}  // namespace fan
