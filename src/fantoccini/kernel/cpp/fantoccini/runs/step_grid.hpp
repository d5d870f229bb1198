// The times of fixed steps: multiples of dt from where a run or new inputs begin, then its end.
#pragma once

#include <cmath>

namespace fan {

struct StepGrid {
  // Of a step: the last one may be longer by this, instead of being followed by a tiny one.
  static constexpr double sliver = 1e-6;
  // Of a step, or of the whole time if shorter: time left that counts as none, rounding of n dt.
  static constexpr double rounding = 1e-9;

  double origin, t_end, dt;  // s

  // When the end counts as reached.
  double end() const { return t_end - rounding * fmin(dt, t_end - origin); }

  // The time after n steps.
  double at(long long n) const {
    const double t = origin + double(n) * dt;
    return t > t_end - sliver * dt ? t_end : t;
  }
};

}  // namespace fan
