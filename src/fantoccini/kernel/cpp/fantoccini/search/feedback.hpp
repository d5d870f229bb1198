// Linear feedback (LQR) to an equilibrium.
#pragma once

#include "fantoccini/contract.hpp"
#include "fantoccini/model/segments.hpp"

namespace fan {

// acc_K = -gains z for the next T seconds, within the bounds. z is the state relative to the
// equilibrium, with its configurations scaled down so that every driven coordinate could cover its
// part in `reach` seconds, which may be 0.
template <class Model>
void equilibrium_feedback(
    const LqrLawArrays& to, const BoundArrays& bounds, double reach, double T, const double* q_D,
    const double* v_D, const double* q_K, const double* v_K, double* acc_K) {
  constexpr int N = Model::n_vD, K = Model::n_vK;
  double z[2 * (N + K)];
  increment<typename Model::Dynamic>(to.q_D, q_D, 1.0, z);
  increment<typename Model::Driven>(to.q_K, q_K, 1.0, z + 2 * N);
  double longest = reach;
  for (int k = 0; k < K; ++k) {
    const double time = std::abs(z[2 * N + k]) / (bounds.speed[k] > 0.0 ? bounds.speed[k] : 1e300);
    longest = time > longest ? time : longest;
  }
  const double scale = longest > reach ? reach / longest : 1.0;
  for (int k = 0; k < N; ++k) {
    z[k] *= scale;
    z[N + k] = v_D[k];
  }
  for (int k = 0; k < K; ++k) {
    z[2 * N + k] *= scale;
    z[2 * N + K + k] = v_K[k];
  }
  const auto within = [](double x, double most) {
    return x > most ? most : (x < -most ? -most : x);
  };
  for (int k = 0; k < K; ++k) {
    double wanted = 0.0;
    for (int i = 0; i < 2 * (N + K); ++i) wanted -= to.gains[k * 2 * (N + K) + i] * z[i];
    const double end = within(v_K[k] + T * wanted, bounds.speed[k]);
    acc_K[k] = within((end - v_K[k]) / T, bounds.acceleration[k]);
  }
}

}  // namespace fan
