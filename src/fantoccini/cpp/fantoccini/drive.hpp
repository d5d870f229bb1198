// Driven coordinates as piecewise polynomials of degree five (fantoccini.motion.Input).
//
// Scalars: q(t) = sum_k coef_k (t - break)^k. Rotations: R(t) = R(base) exp(phi(t)), phi(0) = 0,
// with body angular velocity w = J_r(phi) phidot. User forces u_D(t) are polynomials likewise.
// Before the first break and after the last the coordinates stand still.
#pragma once

#include <algorithm>
#include <vector>

#include "manifold.hpp"

namespace fan {

// The arrays of an input, row by row as NumPy has them.
struct InputArrays {
  int n_segments;
  const double* breaks;  // (n_segments + 1,)
  const double* coef;    // (n_segments, n_vK, 6)
  const double* base;    // (n_segments, n_qK)
  const double* force;   // (n_segments, n_vD, 6) or null
};

template <class Space, int n_vD>
class Drive {
 public:
  void set(const InputArrays& in) {
    n_ = in.n_segments;
    breaks_.assign(in.breaks, in.breaks + n_ + 1);
    coef_.assign(in.coef, in.coef + n_ * Space::n_v * 6);
    base_.assign(in.base, in.base + n_ * Space::n_q);
    force_.clear();
    if (in.force) force_.assign(in.force, in.force + n_ * n_vD * 6);
    segment_ = 0;
  }

  // Chooses the polynomials of the step that starts at t: they hold until the next break.
  void start_at(double t) { choose(t, t < breaks_[0] ? BEFORE : (t >= breaks_[n_] ? AFTER : WITHIN)); }

  // Chooses the polynomials at t alone; at the last break those that end there.
  void look_at(double t) { choose(t, t < breaks_[0] ? BEFORE : (t > breaks_[n_] ? AFTER : WITHIN)); }

  // The first break after t, or `none` when there is none.
  double next_break(double t, double none) const {
    const auto found = std::upper_bound(breaks_.begin(), breaks_.end(), t);
    return found == breaks_.end() ? none : *found;
  }

  // q_K, v_K, acc_K and u_D at t, by the polynomials last chosen.
  void evaluate(double t, double* q, double* v, double* a, double* u) const {
    const double at = phase_ == BEFORE ? breaks_[0] : (phase_ == AFTER ? breaks_[n_] : t);
    const double s = at - breaks_[segment_];
    const double* coef = &coef_[segment_ * Space::n_v * 6];
    const double* base = base_.data() + segment_ * Space::n_q;
    for (int i = 0; i < Space::n_scalars; ++i) {
      const int j = Space::scalar_v[i];
      polynomial(coef + 6 * j, s, q[Space::scalar_q[i]], v[j], a[j]);
    }
    for (int i = 0; i < Space::n_quaternions; ++i) {
      const int j = Space::quaternion_v[i];
      const int at_q = Space::quaternion_q[i];
      double phi[3], rate[3], second[3], turn[4];
      for (int k = 0; k < 3; ++k) polynomial(coef + 6 * (j + k), s, phi[k], rate[k], second[k]);
      quaternion_exp(phi, turn);
      quaternion_product(base + at_q, turn, q + at_q);
      normalise(q + at_q);
      body_rates(phi, rate, second, v + j, a + j);
    }
    if (phase_ != WITHIN)
      for (int j = 0; j < Space::n_v; ++j) v[j] = a[j] = 0.0;
    for (int j = 0; j < n_vD; ++j) {
      double unused_rate, unused_second;
      u[j] = 0.0;
      if (!force_.empty() && phase_ == WITHIN)
        polynomial(&force_[(segment_ * n_vD + j) * 6], s, u[j], unused_rate, unused_second);
    }
  }

 private:
  static void polynomial(const double* c, double s, double& p, double& d, double& dd) {
    p = c[0] + s * (c[1] + s * (c[2] + s * (c[3] + s * (c[4] + s * c[5]))));
    d = c[1] + s * (2 * c[2] + s * (3 * c[3] + s * (4 * c[4] + s * 5 * c[5])));
    dd = 2 * c[2] + s * (6 * c[3] + s * (12 * c[4] + s * 20 * c[5]));
  }

  // w = J_r phidot and its rate; J_r = 1 - a [phi] + b [phi]^2 with a = (1 - cos)/theta^2 and
  // b = (theta - sin)/theta^3.
  static void body_rates(
      const double* phi, const double* rate, const double* second, double* w, double* alpha) {
    const double square = phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2];
    double a, b, da, db;  // da = a'/theta, db = b'/theta
    if (square < 1.0) {
      a = b = da = db = 0.0;
      double power = 1.0, before = 0.0, factorial = 1.0;
      for (int k = 0; k < 10; ++k) {
        factorial *= k == 0 ? 2.0 : (2.0 * k + 1) * (2.0 * k + 2);
        a += power / factorial;
        b += power / (factorial * (2 * k + 3));
        da += 2 * k * before / factorial;
        db += 2 * k * before / (factorial * (2 * k + 3));
        before = -power;
        power *= -square;
      }
    } else {
      const double theta = sqrt(square), c = cos(theta), s = sin(theta);
      a = (1 - c) / square;
      b = (theta - s) / (theta * square);
      da = (theta * s - 2 * (1 - c)) / (square * square);
      db = (3 * s - theta * (2 + c)) / (theta * square * square);
    }
    double cross1[3], cross2[3], second1[3], second2[3], turn[3];
    cross(phi, rate, cross1);
    cross(phi, cross1, cross2);
    cross(phi, second, second1);
    cross(phi, second1, second2);
    cross(rate, cross1, turn);
    const double along = phi[0] * rate[0] + phi[1] * rate[1] + phi[2] * rate[2];
    for (int k = 0; k < 3; ++k) {
      w[k] = rate[k] - a * cross1[k] + b * cross2[k];
      alpha[k] = second[k] - a * second1[k] + b * second2[k] -
                 da * along * cross1[k] + db * along * cross2[k] + b * turn[k];
    }
  }

  static void cross(const double* a, const double* b, double* out) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
  }

  enum Phase { BEFORE, WITHIN, AFTER };

  void choose(double t, Phase phase) {
    phase_ = phase;
    const auto found = std::upper_bound(breaks_.begin(), breaks_.end(), t);
    const int before = int(found - breaks_.begin()) - 1;
    segment_ = before < 0 ? 0 : (before >= n_ ? n_ - 1 : before);
  }

  int n_ = 0, segment_ = 0;
  Phase phase_ = BEFORE;
  std::vector<double> breaks_, coef_, base_, force_;
};

}  // namespace fan
