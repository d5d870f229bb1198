// Change of a rotation at the end of a step by that before it and by its rotation vector `phi`:
//
//   dq+ = Exp(-phi) dq + J_r(phi) d(phi)
#pragma once

#include "fantoccini/model/segments.hpp"

namespace fan {

// J_r(phi), and the rotation Exp(-phi), row by row.
FAN_FN void step_turn(const double* phi, double* J, double* R) {
  const double square = phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2];
  const TurningFactors<double> of(square);
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) {
      const double cross = r == c ? 0.0 : ((r + 1) % 3 == c ? -phi[3 - r - c] : phi[3 - r - c]);
      J[3 * r + c] = double(r == c) * (1.0 - of.b * square) - of.a * cross + of.b * phi[r] * phi[c];
    }
  // Exp(-phi) = 1 - [phi] J_r(phi)
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) {
      const int s = (r + 1) % 3, t = (r + 2) % 3;
      R[3 * r + c] = double(r == c) - (phi[s] * J[3 * t + c] - phi[t] * J[3 * s + c]);
    }
}

// Converts derivatives by a configuration that v has moved for `time` to those by the previous one,
// and adds to those by v.
template <class Space>
FAN_FN void turn_back(const double* v, double time, double* by_q, double* by_v) {
  for (int i = 0; i < Space::n_scalars; ++i) {
    const int k = Space::scalar_v[i];
    by_v[k] += time * by_q[k];
  }
  for (int i = 0; i < Space::n_quaternions; ++i) {
    const int k = Space::quaternion_v[i];
    double phi[3], J[9], R[9], by[3];
    for (int c = 0; c < 3; ++c) {
      phi[c] = time * v[k + c];
      by[c] = by_q[k + c];
    }
    step_turn(phi, J, R);
    for (int c = 0; c < 3; ++c) {
      by_v[k + c] += time * (J[c] * by[0] + J[3 + c] * by[1] + J[6 + c] * by[2]);
      by_q[k + c] = R[c] * by[0] + R[3 + c] * by[1] + R[6 + c] * by[2];
    }
  }
}

}  // namespace fan
