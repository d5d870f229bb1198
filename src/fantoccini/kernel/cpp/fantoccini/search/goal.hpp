// Distance of a state from a goal.
#pragma once

#include <cmath>

#include "fantoccini/contract.hpp"
#include "fantoccini/math/manifold.hpp"

namespace fan {

// d = sum_i w_i |q_i - goal_i| + w_v |v_D - goal| + w_K |v_K - goal|, or with |point - place|
// instead of the first sum; `pose` of the link: R by columns, then r.
template <class Model>
double goal_distance(
    const GoalArrays& goal, const double* q_D, const double* v_D, const double* v_K,
    const double* pose) {
  using Space = typename Model::Dynamic;
  const auto outside = [](double x, double low, double high) {
    return x < low ? low - x : (x > high ? x - high : 0.0);
  };
  double total = 0.0;
  if (goal.kind == POINT) {
    for (int c = 0; c < 3; ++c) {
      double world = pose[9 + c];
      for (int j = 0; j < 3; ++j) world += pose[3 * j + c] * goal.at[j];
      const double distance = outside(world, goal.place[c], goal.place_high[c]);
      total += distance * distance;
    }
    total = std::sqrt(total);
  } else {
    for (int i = 0; i < Space::n_scalars; ++i) {
      const int q = Space::scalar_q[i];
      total += goal.weight[Space::scalar_v[i]] * outside(q_D[q], goal.low[q], goal.high[q]);
    }
    for (int i = 0; i < Space::n_quaternions; ++i) {
      const double w = goal.weight[Space::quaternion_v[i]];
      if (w == 0.0) continue;
      const double *a = goal.low + Space::quaternion_q[i], *b = q_D + Space::quaternion_q[i];
      const double conjugate[4] = {a[0], -a[1], -a[2], -a[3]};
      double turn[4], phi[3];
      quaternion_product(conjugate, b, turn);
      quaternion_log(turn, phi);
      total += w * std::sqrt(squares<3>(phi));
    }
  }
  const auto difference = [](const double* v, const double* wanted, int n) {
    double sum = 0.0;
    for (int k = 0; k < n; ++k) sum += (v[k] - wanted[k]) * (v[k] - wanted[k]);
    return std::sqrt(sum);
  };
  if (goal.speed_weight > 0.0) total += goal.speed_weight * difference(v_D, goal.v_D, Model::n_vD);
  if (goal.driven_weight > 0.0)
    total += goal.driven_weight * difference(v_K, goal.v_K, Model::n_vK);
  return total;
}

}  // namespace fan
