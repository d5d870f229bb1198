// How a rotation at the end of a step turns with that before it and with its rotation vector phi:
//
//   dq+ = Exp(-phi) dq + J_r(phi) dphi
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

}  // namespace fan
