// The position term of a time step.
#pragma once

#include "fantoccini/math/real.hpp"

namespace fan {

// h / dt. If h > 0, dt is at least a whole step, and the term at most the recovery speed. If h < 0,
// the row may close within this step.
template <class Real>
struct PositionTerm {
  double back, ahead, limit;  // 1/s, 1/s, m/s or rad/s

  FAN_FN PositionTerm(double dt, double whole, double recovery_speed)
      : back(1.0 / (dt > whole ? dt : whole)), ahead(1.0 / dt), limit(recovery_speed) {}

  FAN_ALWAYS_INLINE Real operator()(const Real& h) const {
    return minimum(Real(h * select(h > Real(0.0), Real(back), Real(ahead))), Real(limit));
  }

  // The term of a wire, which holds in both directions.
  FAN_ALWAYS_INLINE Real of_wire(const Real& h) const {
    return maximum(minimum(Real(h * back), Real(limit)), Real(-limit));
  }
};

}  // namespace fan
