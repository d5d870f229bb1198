// Largest moves of coordinates in a time step, and the power of forces over one.
#pragma once

#include "fantoccini/math/elementary.hpp"
#include "fantoccini/math/unrolled.hpp"
#include "fantoccini/timestepping/tolerances.hpp"

namespace fan {

// Reciprocal of the largest move of each coordinate in a step.
template <class Model>
struct SpeedShares {
  double of[array_size(Model::n_vD)] = {};
  constexpr SpeedShares() {
    using Tolerance = TimeSteppingTolerances;
    for (int k = 0; k < Model::n_vD; ++k)
      of[k] = 1.0 / (Model::turns[k] ? Tolerance::max_turn_per_step : Tolerance::max_move_per_step);
  }
};

// Scales down velocities so that no part of the move over dt exceeds `most`: inputs that cannot be
// followed then do bounded harm. Returns the lanes in which it did; |v|^2 was at most `bound`.
template <class Model, class Real>
FAN_FN typename Traits<Real>::Mask limit_speed(const Real& most, double dt, Real* v, Real& bound) {
  constexpr int N = Model::n_vD;
  static constexpr SpeedShares<Model> shares{};
  constexpr double farthest_move = TimeSteppingTolerances::max_move_per_step;
  const Real pace = weighted_squares<N>(v, shares.of);
  bound = pace * (farthest_move * farthest_move);
  if (!any(!(dt * dt * pace < most * most))) return Real(0.0) > Real(1.0);
  using std::abs;
  Real farthest = Real(0.0);
  for (int k = 0; k < N; ++k) farthest = maximum(Real(abs(dt * v[k] * shares.of[k])), farthest);
  const Real brake = select(farthest > most, most / farthest, Real(1.0));
  for (int k = 0; k < N; ++k) v[k] *= brake;
  return brake < Real(1.0);
}

// u . (v + v+) / 2 with v+ = v + change, four sums at a time: each addition waits for the previous
// one.
template <int n, class Real>
FAN_FN Real mean_power(const Real* u, const Real* v, const Real* change) {
  Real sum[4] = {Real(0.0), Real(0.0), Real(0.0), Real(0.0)};
  unrolled_by<4, n>([&](int k, auto j) FAN_INLINE { sum[j] += u[k] * (v[k] + 0.5 * change[k]); });
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

// Work of the inputs over a step from v to v + change: of driven ends, of the forces u_D unless
// null, and of motors.
template <class Model, class Eval, class Real>
FAN_FN Real
work_of_step(const Eval& eval, const Real* u_D, const Real* v_D, const Real* change, double dt) {
  Real work = dt * eval.power0;
  if (Model::coupled)
    for (int k = 0; k < Model::n_vD; ++k) work += eval.M_DK_v_K[k] * change[k];
  Real power = u_D ? mean_power<Model::n_vD>(u_D, v_D, change) : Real(0.0);
  for (int m = 0; m < Model::n_motors; ++m) {
    const int k = Model::motor_v[m];
    power += (eval.f_M[m] - eval.y_M[m] * change[k]) * (v_D[k] + 0.5 * change[k]);
  }
  return work + dt * power;
}

}  // namespace fan
