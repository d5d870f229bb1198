// The times of fixed steps.
#pragma once

#include <cmath>

namespace fan {

// Progress of a run with fixed steps.
struct StepCount {
  double t, dt;           // s: reached; length of the last step
  long long n_total = 0;  // steps since the run began
  long long n_grid = 0;   // since its grid began
};

// Multiples of dt from the start of a run or of new inputs, then its end.
struct StepGrid {
  // Relative to a step: the last one may be longer by this, to avoid a tiny one after it.
  static constexpr double sliver = 1e-6;
  // Remaining time that counts as none, relative to a step, or to the whole time if shorter:
  // rounding of n dt.
  static constexpr double rounding = 1e-9;

  double origin, t_end, dt;  // s

  bool over(const StepCount& at) const {
    return at.t >= t_end - rounding * fmin(dt, t_end - origin);
  }
  double next(const StepCount& at) const {
    const double t = origin + double(at.n_grid + 1) * dt;
    return t > t_end - sliver * dt ? t_end : t;
  }
  double length(const StepCount& at) const { return next(at) - at.t; }
};

// n equal steps from time 0.
struct EvenSteps {
  double dt;  // s
  long long n;

  bool over(const StepCount& at) const { return at.n_grid >= n; }
  double next(const StepCount& at) const { return dt * double(at.n_grid + 1); }
  double length(const StepCount&) const { return dt; }
};

}  // namespace fan
