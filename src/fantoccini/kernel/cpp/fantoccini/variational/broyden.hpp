// Broyden's rank-one updates, stored as steps (Kelley, Iterative methods for linear and nonlinear
// equations, 1995, section 7.3): they accelerate an iteration that is nearly Newton's. Written for
// any Real.
#pragma once

#include "fantoccini/math/manifold.hpp"

namespace fan {

template <int n, class Real>
struct Broyden {
  using Mask = typename Traits<Real>::Mask;
  static constexpr int max_stored = 12;  // steps; then it restarts

  FAN_FN void begin() { n_steps_ = 0; }

  // Drops all updates in these lanes.
  FAN_FN void forget(const Mask& lanes) {
    for (int j = 0; j < n_steps_; ++j)
      for (int k = 0; k < n; ++k) steps_[j][k] = select(lanes, Real(0.0), steps_[j][k]);
  }

  // Replaces z, the step of the plain iteration, by the corrected step. The last update may
  // lengthen it at most five times.
  FAN_FN void correct(Real* z) {
    if (n_steps_ == max_stored) n_steps_ = 0;
    for (int j = 0; j + 1 < n_steps_; ++j) {
      const Real part = share(j, z);
      for (int k = 0; k < n; ++k) z[k] += part * steps_[j + 1][k];
    }
    if (n_steps_ > 0) {
      const Real left = 1.0 - share(n_steps_ - 1, z);
      const Real scale = 1.0 / select(left > Real(0.2), left, Real(0.2));
      for (int k = 0; k < n; ++k) z[k] *= scale;
    }
    for (int k = 0; k < n; ++k) steps_[n_steps_][k] = z[k];
    ++n_steps_;
  }

 private:
  // The component of z along step j, relative to the step.
  FAN_FN Real share(int j, const Real* z) const {
    Real sum[4] = {Real(0.0), Real(0.0), Real(0.0), Real(0.0)};
    for (int k = 0; k < n; ++k) sum[k % 4] += steps_[j][k] * z[k];
    return ((sum[0] + sum[1]) + (sum[2] + sum[3])) / (squares<n>(steps_[j]) + 1e-300);
  }

  int n_steps_ = 0;
  Real steps_[max_stored][array_size(n)];
};

}  // namespace fan
