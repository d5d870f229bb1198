// One piece of an input (fantoccini.motion.Input): polynomials of degree five in the time s since
// the piece began.
//
// Scalars: q(s) = sum_k coef_k s^k. Rotations: R(s) = R(base) exp(phi(s)), with body angular
// velocity w = J_r(phi) phidot. User forces u_D are polynomials likewise.
#pragma once

#include "fantoccini/math/manifold.hpp"
#include "fantoccini/math/space.hpp"

namespace fan {

constexpr int n_powers = 6;

// Value, first and second derivative, by Horner's scheme.
template <class Real>
FAN_FN void polynomial(const Real* c, Real s, Real& p, Real& d, Real& dd) {
  const Real p4 = c[4] + s * c[5], d4 = p4 + s * c[5];
  const Real p3 = c[3] + s * p4, d3 = p3 + s * d4, e3 = d4 + s * c[5];
  const Real p2 = c[2] + s * p3, d2 = p2 + s * d3, e2 = d3 + s * e3;
  const Real p1 = c[1] + s * p2;
  p = c[0] + s * p1;
  d = p1 + s * d2;
  dd = 2.0 * (d2 + s * e2);
}

// The coefficients of J_r = 1 - a [phi] + b [phi]^2, for theta^2 = |phi|^2: a = (1 - cos)/theta^2,
// b = (theta - sin)/theta^3, da = a'/theta and db = b'/theta.
template <class Real>
struct TurningFactors {
  Real a = Real(0.0), b = a, da = a, db = a;

  FAN_FN explicit TurningFactors(const Real& square) {
    const auto small = square < Real(1.0);
    if (any(small)) {
      Real power = Real(1.0), before = Real(0.0);
      double factorial = 1.0;
      for (int k = 0; k < 10; ++k) {
        factorial *= k == 0 ? 2.0 : (2.0 * k + 1) * (2.0 * k + 2);
        a += power / factorial;
        b += power / (factorial * (2 * k + 3));
        da += 2.0 * k * before / factorial;
        db += 2.0 * k * before / (factorial * (2 * k + 3));
        before = -power;
        power *= -square;
      }
    }
    if (any(!small)) {
      using std::sqrt;
      const Real big = select(small, Real(1.0), square);
      const Real theta = sqrt(big);
      Real s, c;
      sine_cosine(theta, &s, &c);
      a = select(small, a, Real((1.0 - c) / big));
      b = select(small, b, Real((theta - s) / (theta * big)));
      da = select(small, da, Real((theta * s - 2.0 * (1.0 - c)) / (big * big)));
      db = select(small, db, Real((3.0 * s - theta * (2.0 + c)) / (theta * big * big)));
    }
  }
};

// w = J_r phidot and its rate.
template <class Real>
FAN_FN void body_rates(
    const Real* phi, const Real* rate, const Real* second, Real* w, Real* alpha) {
  const TurningFactors<Real> of(phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2]);
  const Real &a = of.a, &b = of.b, &da = of.da, &db = of.db;
  Real cross1[3], cross2[3], second1[3], second2[3], turn[3];
  cross(phi, rate, cross1);
  cross(phi, cross1, cross2);
  cross(phi, second, second1);
  cross(phi, second1, second2);
  cross(rate, cross1, turn);
  const Real along = phi[0] * rate[0] + phi[1] * rate[1] + phi[2] * rate[2];
  for (int k = 0; k < 3; ++k) {
    w[k] = rate[k] - a * cross1[k] + b * cross2[k];
    alpha[k] = second[k] - a * second1[k] + b * second2[k] - da * along * cross1[k] +
               db * along * cross2[k] + b * turn[k];
  }
}

// Whether a polynomial is a constant, in all lanes.
template <class Real>
FAN_FN bool is_constant(const Real* c) {
  auto moves = Real(0.0) > Real(1.0);
  for (int k = 1; k < n_powers; ++k) moves = moves || c[k] != Real(0.0);
  return !any(moves);
}

// q_K, v_K and acc_K at s, from coef (n_v, 6), base (n_q,) and still (n_v,), which flags constant
// polynomials: most driven coordinates are at rest most of the time.
template <class Space, class Real>
FAN_FN void motion_of(
    const Real* coef, const Real* base, const bool* still, Real s, Real* q, Real* v, Real* a) {
  for (int i = 0; i < Space::n_scalars; ++i) {
    const int j = Space::scalar_v[i];
    if (still[j]) {
      q[Space::scalar_q[i]] = coef[n_powers * j];
      v[j] = a[j] = Real(0.0);
      continue;
    }
    polynomial(coef + n_powers * j, s, q[Space::scalar_q[i]], v[j], a[j]);
  }
  for (int i = 0; i < Space::n_quaternions; ++i) {
    const int j = Space::quaternion_v[i], at = Space::quaternion_q[i];
    Real phi[3], rate[3], second[3], turn[4];
    for (int k = 0; k < 3; ++k)
      polynomial(coef + n_powers * (j + k), s, phi[k], rate[k], second[k]);
    quaternion_exp(phi, turn);
    quaternion_product(base + at, turn, q + at);
    normalise(q + at);
    body_rates(phi, rate, second, v + j, a + j);
  }
}

// Whether a space's scalars come first, in order.
template <class Space>
constexpr bool scalars_first() {
  for (int i = 0; i < Space::n_scalars; ++i)
    if (Space::scalar_q[i] != i || Space::scalar_v[i] != i) return false;
  return true;
}

// The velocity that moves q to q_next in dt.
template <class Space, class Real>
FAN_FN void increment(const Real* q, const Real* q_next, double dt, Real* rate) {
  const double per = 1.0 / dt;
  each<Space::n_scalars>([&](int i) FAN_INLINE {
    const int at = scalars_first<Space>() ? i : Space::scalar_q[i];
    const int to = scalars_first<Space>() ? i : Space::scalar_v[i];
    rate[to] = (q_next[at] - q[at]) * per;
  });
  for (int i = 0; i < Space::n_quaternions; ++i) {
    const Real* a = q + Space::quaternion_q[i];
    const Real inverse[4] = {a[0], -a[1], -a[2], -a[3]};
    Real turn[4], phi[3];
    quaternion_product(inverse, q_next + Space::quaternion_q[i], turn);
    quaternion_log(turn, phi);
    for (int k = 0; k < 3; ++k) rate[Space::quaternion_v[i] + k] = phi[k] * (1.0 / dt);
  }
}

}  // namespace fan
