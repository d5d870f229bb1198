// Inputs with constant accelerations and forces.
#pragma once

#include "fantoccini/model/segments.hpp"

namespace fan {

// Inputs of a bundle with constant accelerations and forces from a configuration and velocity.
template <class Space, int n_vD, class Real>
class HeldDrive {
 public:
  // Sets the accelerations and forces; `in` has the configuration and velocity at the start, and
  // u_D.
  template <class Inputs>
  FAN_FN void set(const Inputs& in, const Real* acc_K) {
    for (int i = 0; i < Space::n_q; ++i) base_[i] = in.q_K[i];
    for (int j = 0; j < Space::n_v; ++j) {
      Real* c = coef_ + n_powers * j;
      for (int k = 0; k < n_powers; ++k) c[k] = Real(0.0);
      c[1] = in.v_K[j];
      c[2] = 0.5 * acc_K[j];
    }
    for (int i = 0; i < Space::n_scalars; ++i)
      coef_[n_powers * Space::scalar_v[i]] = in.q_K[Space::scalar_q[i]];
    for (int j = 0; j < Space::n_v; ++j) still_[j] = is_constant(coef_ + n_powers * j);
    bool still = true;
    for (int j = 0; j < Space::n_v; ++j) still = still && still_[j];
    for (int k = 0; k < n_vD; ++k) {
      u_D_[k] = in.u_D[k];
      still = still && !any(u_D_[k] != Real(0.0));
    }
    still_number_ = still ? ++numbers_ : 0;
  }

  // The inputs at t.
  template <class Inputs>
  FAN_FN void at(const Real& t, Inputs& in) const {
    motion_of<Space>(coef_, base_, still_, t, in.q_K, in.v_K, in.acc_K);
    for (int k = 0; k < n_vD; ++k) in.u_D[k] = u_D_[k];
  }

  template <class Inputs>
  FAN_FN void start(const Real& t, Inputs& in) const {
    at(t, in);
    in.still = still_number_;
  }

  // Those at the end of a step; constant ones are written once.
  template <class Inputs>
  FAN_FN void fill(const Real& t, Inputs& in) const {
    if (still_number_ != 0 && in.still == still_number_) return;
    start(t, in);
  }

 private:
  bool still_[array_size(Space::n_v)];
  long long still_number_ = 0, numbers_ = 0;  // as in LaneDrive
  Real coef_[array_size(Space::n_v * n_powers)], base_[array_size(Space::n_q)],
      u_D_[array_size(n_vD)];
};

}  // namespace fan
