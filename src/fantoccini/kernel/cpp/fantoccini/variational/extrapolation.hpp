// Extrapolates the errors of previous first guesses to improve that of a step.
//
// A guess from the forces at the node has an error e_k of order dt^3, which changes little from
// step to step: e_k is estimated as 0, as e_k-1, along the straight line or the parabola through
// the last ones, whichever would have estimated e_k-1 best. Written for any Real.
#pragma once

#include "fantoccini/math/manifold.hpp"

namespace fan {

template <int n, class Real>
class Extrapolation {
  using Mask = typename Traits<Real>::Mask;

 public:
  FAN_FN void begin() {
    n_ = best_ = dt_ = Real(0.0);
    for (int j = 0; j < n_past; ++j)
      for (int k = 0; k < n; ++k) past_[j][k] = Real(0.0);
  }

  // Drops all past errors in these lanes.
  FAN_FN void forget(const Mask& lanes) {
    n_ = select(lanes, Real(0.0), n_);
    best_ = select(lanes, Real(0.0), best_);
  }

  // Adds the extrapolated error to x, the guess for a step of length dt.
  FAN_FN void add(const Real& dt, Real* x) {
    using std::abs;
    const Mask same = !(abs(dt - dt_) > same_step * dt);
    Real of[n_past];
    for (int j = 0; j < n_past; ++j) of[j] = Real(0.0);
    for (int order = 1; order <= n_past; ++order) {
      const Mask is = same && best_ == Real(double(order));
      for (int j = 0; j < order; ++j) of[j] = select(is, Real(weights[order - 1][j]), of[j]);
    }
    for (int k = 0; k < n; ++k)
      for (int j = 0; j < n_past; ++j) x[k] += of[j] * past_[j][k];
  }

  // Stores the error of the guess for a step of length dt in these lanes.
  FAN_FN void store_error(const Real& dt, const Real* error, const Mask& lanes) {
    using std::abs;
    forget(lanes && abs(dt - dt_) > same_step * dt);
    dt_ = select(lanes, dt, dt_);
    Real off[n_past + 1];
    for (int order = 0; order <= n_past; ++order) off[order] = Real(0.0);
    for (int k = 0; k < n; ++k) {
      const Real slope = past_[0][k] - past_[1][k], bend = slope - (past_[1][k] - past_[2][k]);
      const Real first = error[k] - past_[0][k], second = first - slope, third = second - bend;
      off[0] += error[k] * error[k];
      off[1] += first * first;
      off[2] += second * second;
      off[3] += third * third;
    }
    Real least = off[0], best = Real(0.0);
    for (int order = 1; order <= n_past; ++order) {
      const Mask better = n_ > Real(order - 0.5) && off[order] < least;
      least = select(better, off[order], least);
      best = select(better, Real(double(order)), best);
    }
    // The first error is repeated: there is none before it for comparison.
    best = select(n_ > Real(0.5), best, Real(1.0));
    best_ = select(lanes, best, best_);
    n_ = select(lanes && n_ < Real(double(n_past)), n_ + 1.0, n_);
    for (int k = 0; k < n; ++k) {
      for (int j = n_past - 1; j > 0; --j)
        past_[j][k] = select(lanes, past_[j - 1][k], past_[j][k]);
      past_[0][k] = select(lanes, error[k], past_[0][k]);
    }
  }

 private:
  static constexpr int n_past = 3;           // past errors: up to a parabola
  static constexpr double same_step = 1e-6;  // relative difference of steps that count as equal
  static constexpr double weights[n_past][n_past] = {
      {1.0, 0.0, 0.0}, {2.0, -1.0, 0.0}, {3.0, -3.0, 1.0}};
  Real past_[n_past][array_size(n)];  // the latest first
  Real n_;                            // number of valid ones
  Real best_;                         // number of those used by the next guess
  Real dt_;                           // s
};

}  // namespace fan
