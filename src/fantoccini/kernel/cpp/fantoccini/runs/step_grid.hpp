// The times of fixed steps.
#pragma once

#include <cmath>

namespace fan {

// Where a run of fixed steps is.
struct StepCount {
  double t, dt;        // s: reached, and the length of the last step
  long long made = 0;  // steps since the run began
  long long here = 0;  // and since its grid began
};

// Multiples of dt from where a run or new inputs begin, then its end.
struct StepGrid {
  // Of a step: the last one may be longer by this, instead of being followed by a tiny one.
  static constexpr double sliver = 1e-6;
  // Of a step, or of the whole time if shorter: time left that counts as none, rounding of n dt.
  static constexpr double rounding = 1e-9;

  double origin, t_end, dt;  // s

  bool over(const StepCount& at) const {
    return at.t >= t_end - rounding * fmin(dt, t_end - origin);
  }
  double next(const StepCount& at) const {
    const double t = origin + double(at.here + 1) * dt;
    return t > t_end - sliver * dt ? t_end : t;
  }
  double length(const StepCount& at) const { return next(at) - at.t; }
};

// n steps of one length from time 0 on.
struct EvenSteps {
  double dt;  // s
  long long n;

  bool over(const StepCount& at) const { return at.here >= n; }
  double next(const StepCount& at) const { return dt * double(at.here + 1); }
  double length(const StepCount&) const { return dt; }
};

}  // namespace fan
