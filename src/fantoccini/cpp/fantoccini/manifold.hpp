// Motion on the configuration space: unit quaternions (w, x, y, z) and scalars.
#pragma once

#include "real.hpp"

namespace fan {

// out = a b.
template <class Real>
FAN_FN void quaternion_product(const Real* a, const Real* b, Real* out) {
  const Real w = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
  const Real x = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2];
  const Real y = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1];
  const Real z = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0];
  out[0] = w;
  out[1] = x;
  out[2] = y;
  out[3] = z;
}

template <class Real>
FAN_FN void normalise(Real* q) {
  using std::sqrt;
  const Real scale = Real(1.0) / sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (int k = 0; k < 4; ++k) q[k] *= scale;
}

// The quaternion of a rotation vector phi.
template <class Real>
FAN_FN void quaternion_exp(const Real* phi, Real* out) {
  using std::cos;
  using std::sin;
  using std::sqrt;
  const Real square = phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2];
  const Real half = Real(0.5) * sqrt(square);
  const Real near = Real(0.5) - square * (1.0 / 48.0) * (Real(1.0) - square * (1.0 / 80.0));
  const auto small = half < Real(1e-3);
  const Real safe = select(small, Real(1.0), half);
  const Real factor = select(small, near, Real(Real(0.5) * sin(safe) / safe));
  out[0] = cos(half);
  for (int k = 0; k < 3; ++k) out[1 + k] = factor * phi[k];
}

// The rotation vector of a unit quaternion, the shorter way round.
template <class Real>
FAN_FN void quaternion_log(const Real* q, Real* phi) {
  using std::atan2;
  using std::sqrt;
  const Real sine = sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  const Real sign = select(q[0] < Real(0.0), Real(-1.0), Real(1.0));
  const auto small = sine < Real(1e-8);
  const Real safe = select(small, Real(1.0), sine);
  const Real factor =
      select(small, Real(2.0 * sign), Real(2.0 * sign * atan2(safe, sign * q[0]) / safe));
  for (int k = 0; k < 3; ++k) phi[k] = factor * q[1 + k];
}

// q <- q moved by the tangent vector d (velocities times a time): scalars add, quaternions turn.
template <class Space, class Real>
FAN_FN void retract(Real* q, const Real* d) {
  for (int i = 0; i < Space::n_scalars; ++i) q[Space::scalar_q[i]] += d[Space::scalar_v[i]];
  for (int i = 0; i < Space::n_quaternions; ++i) {
    Real turn[4];
    quaternion_exp(d + Space::quaternion_v[i], turn);
    Real* here = q + Space::quaternion_q[i];
    quaternion_product(here, turn, here);
    normalise(here);
  }
}

// qdot = N(q) v.
template <class Space, class Real>
FAN_FN void configuration_rate(const Real* q, const Real* v, Real* rate) {
  for (int i = 0; i < Space::n_scalars; ++i) rate[Space::scalar_q[i]] = v[Space::scalar_v[i]];
  for (int i = 0; i < Space::n_quaternions; ++i) {
    const Real* w = v + Space::quaternion_v[i];
    const Real pure[4] = {Real(0.0), Real(0.5) * w[0], Real(0.5) * w[1], Real(0.5) * w[2]};
    quaternion_product(q + Space::quaternion_q[i], pure, rate + Space::quaternion_q[i]);
  }
}

template <class Space, class Real>
FAN_FN void normalise_all(Real* q) {
  for (int i = 0; i < Space::n_quaternions; ++i) normalise(q + Space::quaternion_q[i]);
}

}  // namespace fan
