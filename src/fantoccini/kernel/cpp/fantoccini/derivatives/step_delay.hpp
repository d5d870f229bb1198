// Derivatives of steps with a rebound (timestepping/touching_step.hpp). All is evaluated at the
// touch, after t, with
//
//   dq' = Exp(-t v) dq + J_r(t v) t dv + v dt,   likewise for q_K' by its rate,
//   0 = d(gap) at q',   from which dt follows.
//
// A landing closes its gap over the rest of the step: u_n+ = -gap/left changes with t, too.
#pragma once

#include "fantoccini/contract.hpp"
#include "fantoccini/derivatives/step_turn.hpp"
#include "fantoccini/math/manifold.hpp"

namespace fan {

// Index of the rebounding point that touches first among n; -1 if there is none.
inline int first_touch(const StepContact* points, int n) {
  int first = -1;
  for (int i = 0; i < n; ++i)
    if (points[i].bounces > 0.0 && (first < 0 || points[i].gap < points[first].gap)) first = i;
  return first;
}

// The change of u_n+ + gap/left of a point with t, at a fixed place; 0 where it has the whole step.
inline double asked_by_delay(const StepContact& point, double dt) {
  return point.closes > 1.0 / dt ? point.gap * point.closes * point.closes : 0.0;
}

template <class Model>
class StepDelay {
 public:
  static constexpr int N = Model::n_vD, K = Model::n_vK, P = Model::n_p;

  double time = 0.0;  // s: t

  // A step from (q_D, q_K) that continues for `delay` with (v_D, rate); these must outlive this
  // object.
  void begin(
      const double* q_D, const double* v_D, const double* q_K, const double* rate, double delay) {
    time = delay;
    v_ = v_D;
    rate_ = rate;
    gap_by_ = nullptr;
    q_D_ = q_D;
    q_K_ = q_K;
    if (time == 0.0) return;
    retract<typename Model::Dynamic>(q_D, v_D, time, moved_D_);
    retract<typename Model::Driven>(q_K, rate, time, moved_K_);
    q_D_ = moved_D_;
    q_K_ = moved_K_;
  }

  // Configuration at which its equations are evaluated.
  const double* q_D() const { return q_D_; }
  const double* q_K() const { return q_K_; }

  // Sets the changes of the gap that closes there, by q_D and q_K first and by p last, as in
  // ContactPartials; they must outlive this object. Without them t is fixed.
  void set_gap(const double* by) { gap_by_ = by; }

  // Converts derivatives by q_D and q_K at the touch, v_D, the rate and p, and by t, to derivatives
  // by the start of the step.
  void pull(double* q_D, double* v_D, double* q_K, double* rate, double* p, double by_t) const {
    if (gap_by_) {
      const double *g = gap_by_, *g_K = g + N, *g_p = g + 2 * (N + K);
      double closing = 0.0;
      for (int k = 0; k < N; ++k) {
        by_t += q_D[k] * v_[k];
        closing -= g[k] * v_[k];
      }
      for (int k = 0; k < K; ++k) {
        by_t += q_K[k] * rate_[k];
        closing -= g_K[k] * rate_[k];
      }
      const double share = by_t / closing;
      for (int k = 0; k < N; ++k) q_D[k] += share * g[k];
      for (int k = 0; k < K; ++k) q_K[k] += share * g_K[k];
      for (int k = 0; k < P; ++k) p[k] += share * g_p[k];
    }
    turn_back<typename Model::Dynamic>(v_, time, q_D, v_D);
    turn_back<typename Model::Driven>(rate_, time, q_K, rate);
  }

 private:
  const double *v_, *rate_, *q_D_, *q_K_, *gap_by_ = nullptr;
  double moved_D_[array_size(Model::n_qD)], moved_K_[array_size(Model::n_qK)];
};

}  // namespace fan
