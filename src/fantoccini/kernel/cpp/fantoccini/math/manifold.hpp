// Motion on the configuration space: unit quaternions (w, x, y, z) and scalars.
#pragma once

#include "fantoccini/math/elementary.hpp"
#include "fantoccini/math/unrolled.hpp"

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
  const Real scale = inverse_root(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (int k = 0; k < 4; ++k) q[k] *= scale;
}

constexpr double series_half_turn = 0.25;  // rad: smaller half angles use a power series

// cos(x) and sin(x) / x in powers of x^2, without the highest one.
constexpr double cosine_series[] = {-1.0 / 3628800.0, 1.0 / 40320.0, -1.0 / 720.0,
                                    1.0 / 24.0,       -0.5,          1.0};
constexpr double factor_series[] = {-1.0 / 39916800.0, 1.0 / 362880.0, -1.0 / 5040.0,
                                    1.0 / 120.0,       -1.0 / 6.0,     1.0};

// The quaternion of a rotation vector phi.
template <class Real>
FAN_FN void quaternion_exp(const Real* phi, Real* out) {
  using std::sqrt;
  // cos(x) and sin(x) / x in powers of x^2, x = |phi| / 2. The terms left out are below 1e-18.
  const Real square = Real(0.25) * (phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2]);
  Real cosine = 1.0 / 479001600.0, factor = 1.0 / 6227020800.0;
  unrolled<0, 6>([&](auto k) FAN_INLINE {
    cosine = cosine * square + cosine_series[k];
    factor = factor * square + factor_series[k];
  });
  const auto wide = !(square < Real(series_half_turn * series_half_turn));
  if (any(wide)) {
    Real sine_far, cosine_far;
    const Real half = sqrt(select(wide, square, Real(1.0)));
    sine_cosine(half, &sine_far, &cosine_far);
    cosine = select(wide, cosine_far, cosine);
    factor = select(wide, sine_far / half, factor);
  }
  const Real half = 0.5 * factor;
  out[0] = cosine;
  out[1] = half * phi[0];
  out[2] = half * phi[1];
  out[3] = half * phi[2];
}

// The rotation vector of a unit quaternion, for the shorter way.
template <class Real>
FAN_FN void quaternion_log(const Real* q, Real* phi) {
  using std::sqrt;
  const Real sine = sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  const Real sign = select(q[0] < Real(0.0), Real(-1.0), Real(1.0));
  const auto small = sine < Real(1e-8);
  const Real safe = select(small, Real(1.0), sine);
  const Real factor =
      select(small, Real(2.0 * sign), Real(2.0 * sign * arctangent(safe / (sign * q[0])) / safe));
  for (int k = 0; k < 3; ++k) phi[k] = factor * q[1 + k];
}

// Normalises a quaternion whose length is 1 up to rounding: one Newton step.
template <class Real>
FAN_FN void tidy(Real* q) {
  const Real square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  const Real scale = 1.5 - 0.5 * square;
  unrolled<0, 4>([&](auto k) FAN_INLINE { q[k] *= scale; });
}

// moved = q moved by the tangent vector time d, with velocities d; for time = 1, d is the tangent
// vector. Scalars add, quaternions turn. moved may be q.
template <class Space, class Real>
FAN_FN void retract(const Real* q, const Real* d, double time, Real* moved) {
  each<Space::n_scalars>([&](int i) FAN_INLINE {
    moved[Space::scalar_q[i]] = q[Space::scalar_q[i]] + time * d[Space::scalar_v[i]];
  });
  for (int i = 0; i < Space::n_quaternions; ++i) {
    const Real* w = d + Space::quaternion_v[i];
    const Real phi[3] = {time * w[0], time * w[1], time * w[2]};
    Real turn[4], found[4];
    quaternion_exp(phi, turn);
    quaternion_product(q + Space::quaternion_q[i], turn, found);
    tidy(found);
    Real* there = moved + Space::quaternion_q[i];
    unrolled<0, 4>([&](auto k) FAN_INLINE { there[k] = found[k]; });
  }
}

template <class Space, class Real>
FAN_FN void retract(const Real* q, const Real* d, Real* moved) {
  retract<Space>(q, d, 1.0, moved);
}

// The midpoint between q and q_next, and the tangent vector xi between them, with q_next =
// q c(xi/4) c(xi/4): scalars move by xi, quaternions turn by c(s) = (1, s) / sqrt(1 + s.s), the
// shorter way.
template <class Space, class Real>
FAN_FN void half_way(const Real* q, const Real* q_next, Real* middle, Real* xi) {
  for (int i = 0; i < Space::n_scalars; ++i) {
    const int at = Space::scalar_q[i];
    xi[Space::scalar_v[i]] = q_next[at] - q[at];
    middle[at] = 0.5 * (q_next[at] + q[at]);
  }
  for (int i = 0; i < Space::n_quaternions; ++i) {
    const Real* a = q + Space::quaternion_q[i];
    const Real inverse[4] = {a[0], -a[1], -a[2], -a[3]};
    Real turn[4];
    quaternion_product(inverse, q_next + Space::quaternion_q[i], turn);
    const Real sign = select(turn[0] < Real(0.0), Real(-1.0), Real(1.0));
    const Real scale = sign / (1.0 + sign * turn[0]);
    Real half[4] = {Real(1.0), scale * turn[1], scale * turn[2], scale * turn[3]};
    for (int k = 0; k < 3; ++k) xi[Space::quaternion_v[i] + k] = 4.0 * half[1 + k];
    normalise(half);
    quaternion_product(a, half, middle + Space::quaternion_q[i]);
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
