// Range of the acceleration of a driven coordinate in an interval that keeps it within its bounds
// of acceleration, speed and position then and later:
//
//   |u| <= a,   |v + h u| <= s,   v + h u <= w(q, v),   w^2 / (2 a) = high - q - h (v + w) / 2
//
// w is the speed after the interval from which it can still stop at its bound.
#pragma once

#include <algorithm>
#include <cmath>

namespace fan {

// A bound of u with its derivatives by q and v.
struct DrivenLimit {
  double value, by_q, by_v;
};

struct DrivenBounds {
  double acceleration, speed, low, high;

  DrivenLimit highest(double q, double v, double h) const {
    DrivenLimit to = {acceleration, 0.0, 0.0};
    if ((speed - v) / h < to.value) to = {(speed - v) / h, 0.0, -1.0 / h};
    const double a = std::min(acceleration, 1e6), half = 0.5 * a * h,
                 travel = high - q - 0.5 * h * v;
    if (travel < 1e30 && acceleration > 0.0) {
      const double root = std::sqrt(std::max(half * half + 2.0 * a * travel, 0.0));
      const double u = (root - half - v) / h;
      if (u < to.value) {
        const double by = root > 0.1 * half ? -a / root : 0.0;
        to = {u, by / h, (0.5 * h * by - 1.0) / h};
      }
    }
    // A coordinate outside its bounds returns with the largest acceleration.
    return to.value < -acceleration ? DrivenLimit{-acceleration, 0.0, 0.0} : to;
  }

  DrivenLimit lowest(double q, double v, double h) const {
    const DrivenLimit mirrored = DrivenBounds{acceleration, speed, -high, -low}.highest(-q, -v, h);
    return {-mirrored.value, mirrored.by_q, mirrored.by_v};
  }
};

}  // namespace fan
