// The law of cone.hpp for a bundle of lanes, each with rows and contacts of its own: semi-smooth
// Newton steps in all lanes at once (cone_lanes_step.hpp). Whatever takes no part in a lane is zero
// or a row of the unit matrix there, so that sums gain exact zeros and no lane's result depends on
// its neighbours.
//
// The centre of the proximal term is the guess. Lanes that do not get there in a few steps are for the
// scalar solver.
#pragma once

#include "cone_lanes_step.hpp"

namespace fan {

template <class Real, int n_rows, int n_points>
class ConeLanes : public ConeLanesStep<Real, n_rows, n_points> {
  using Step = ConeLanesStep<Real, n_rows, n_points>;

 public:
  using typename Step::Mask, typename Step::Matrix, typename Step::Own, typename Step::Tolerance;
  using Step::M, Step::C;
  using Step::n_single, Step::n_contacts, Step::has_single, Step::has_contact, Step::lower;
  using Step::upper, Step::mu, Step::most, Step::b_single, Step::x_single, Step::s_single;
  using Step::b, Step::x, Step::s, Step::single, Step::contact;

  Real residual;  // as in cone.hpp

  // The lanes, of those given, in which the law holds. x of the others is where they got.
  FAN_FN Mask solve(const Matrix& G, const Mask& lanes) {
    G_ = &G;
    begin();
    Mask open = lanes && !(scale_ > Real(Tolerance::largest_number));
    const Mask none = Real(0.0) > Real(1.0);
    Mask done = none;
    raise_ = top_ * Tolerance::raise;
    image(x_single, x, s_single, s);
    residual = violation(x_single, x, s_single, s) / scale_;
    for (int k = 0;; ++k) {
      const Mask now = open && residual <= Real(Tolerance::residual);
      if (any(now)) {
        if (k > 0) refine(now);
        const Mask held = tidy(now);
        done = done || held;
        open = open && !held;
      }
      if (k == Own::steps || !any(open)) return done;
      if (k == 0) centre();
      this->choose(open);
      if (!any(open)) return done;
      this->assemble();
      this->factorise();
      this->substitute();
      this->spread();
      image(next_single_, next_, next_s_single_, next_s_);
      take(open, violation(next_single_, next_, next_s_single_, next_s_) / scale_);
    }
  }

 private:
  using Step::G_, Step::top_, Step::raise_, Step::g_single_, Step::inverse_single_, Step::g_;
  using Step::inverse_, Step::next_single_, Step::next_, Step::larger_of, Step::of_singles, Step::block;

  // g of all rows, their inverses, and the sizes of G and b. What takes no part is 0.
  FAN_FN void begin() {
    using std::abs;
    top_ = Real(0.0);
    scale_ = Real(negligible);
    const auto measure = [&](const Mask& has, Real& x, Real& b, const Real& diagonal) {
      x = select(has, x, Real(0.0));
      b = select(has && !(abs(b) < Real(negligible)), b, Real(0.0));
      scale_ = larger_of(scale_, abs(b));
      top_ = larger_of(top_, select(has, diagonal, Real(0.0)));
    };
    for (int a = 0; a < n_single; ++a)
      measure(has_single[a], x_single[a], b_single[a], of_singles(a, a));
    for (int i = 0; i < n_contacts; ++i)
      for (int d = 0; d < 3; ++d)
        measure(has_contact[i], x[3 * i + d], b[3 * i + d], block(i, i)[d].of[d]);
    top_ = select(top_ > Real(0.0), top_, Real(1.0));
    const Real least = Tolerance::smallest_influence * top_;
    for (int a = 0; a < n_single; ++a) {
      g_single_[a] = larger_of(of_singles(a, a), least);
      inverse_single_[a] = Real(1.0) / g_single_[a];
    }
    for (int i = 0; i < n_contacts; ++i) {
      const Triple<Real>* own = block(i, i);
      g_[i] = larger_of((own[0].of[0] + own[1].of[1] + own[2].of[2]) * (1.0 / 3.0), least);
      inverse_[i] = Real(1.0) / g_[i];
    }
  }

  // s = G x - b.
  FAN_FN void image(const Real* x1, const Real* x3, Real* s1, Real* s3) const {
    for (int a = 0; a < n_single; ++a) {
      Real sum = -b_single[a];
      const Real* row = G_->singles + single[a] * G_->stride;
      for (int c = 0; c < n_single; ++c) sum += row[single[c]] * x1[c];
      s1[a] = sum;
    }
    bool pushes[C];  // in some lane
    for (int i = 0; i < n_contacts; ++i) {
      const Real p = x3[3 * i], q = x3[3 * i + 1], r = x3[3 * i + 2];
      pushes[i] = any(p != Real(0.0) || q != Real(0.0) || r != Real(0.0));
      Real u = -b[3 * i], v = -b[3 * i + 1], w = -b[3 * i + 2];
      for (int a = 0; a < n_single; ++a) {
        const Triple<Real>& by = G_->across[contact[i]][single[a]];
        u += by.of[0] * x1[a];
        v += by.of[1] * x1[a];
        w += by.of[2] * x1[a];
        if (pushes[i]) s1[a] += by.of[0] * p + by.of[1] * q + by.of[2] * r;
      }
      for (int j = 0; j < i; ++j) {
        if (!pushes[i] && !pushes[j]) continue;
        const Triple<Real>* by = block(i, j);
        const Real *from = x3 + 3 * j, pj = from[0], qj = from[1], rj = from[2];
        Real* to = s3 + 3 * j;
        u += by[0].of[0] * pj + by[0].of[1] * qj + by[0].of[2] * rj;
        v += by[1].of[0] * pj + by[1].of[1] * qj + by[1].of[2] * rj;
        w += by[2].of[0] * pj + by[2].of[1] * qj + by[2].of[2] * rj;
        FAN_UNROLL for (int d = 0; d < 3; ++d)
          to[d] += by[0].of[d] * p + by[1].of[d] * q + by[2].of[d] * r;
      }
      const Triple<Real>* own = block(i, i);
      s3[3 * i] = u + own[0].of[0] * p + own[0].of[1] * q + own[0].of[2] * r;
      s3[3 * i + 1] = v + own[1].of[0] * p + own[1].of[1] * q + own[1].of[2] * r;
      s3[3 * i + 2] = w + own[2].of[0] * p + own[2].of[1] * q + own[2].of[2] * r;
    }
  }

  // The largest speed by which x breaks the law.
  FAN_FN Real violation(const Real* x1, const Real* x3, const Real* s1, const Real* s3) const {
    using std::abs;
    using std::sqrt;
    Real worst = Real(0.0);
    const auto take = [&](const Mask& has, const Real& speed) {
      worst = select(has && !(speed <= worst), speed, worst);  // keeps NaN
    };
    for (int a = 0; a < n_single; ++a) {
      const Real w = clip(x1[a] - s1[a] * inverse_single_[a], lower[a], upper[a]);
      take(has_single[a], g_single_[a] * abs(x1[a] - w));
    }
    for (int i = 0; i < n_contacts; ++i) {
      const Real *y = x3 + 3 * i, *u = s3 + 3 * i, &by = inverse_[i];
      const Real normal = clip(y[0] - u[0] * by, Real(0.0), most);
      const Real p = y[1] - u[1] * by, q = y[2] - u[2] * by;
      const Real part = shrinking(p, q, mu[i] * larger_of(y[0], Real(0.0)));
      take(has_contact[i], g_[i] * abs(y[0] - normal));
      take(has_contact[i], g_[i] * abs(y[1] - p * part));
      take(has_contact[i], g_[i] * abs(y[2] - q * part));
    }
    return worst;
  }

  // The centre of the proximal term moves to x.
  FAN_FN void centre() {
    for (int a = 0; a < n_single; ++a) this->centre_single_[a] = x_single[a];
    for (int i = 0; i < 3 * n_contacts; ++i) this->centre_[i] = x[i];
  }

  FAN_FN static Real clip(const Real& value, const Real& low, const Real& high) {
    return select(value < low, low, select(value > high, high, value));
  }

  // The factor that takes (p, q) to the nearest point of a disc.
  FAN_FN static Real shrinking(const Real& p, const Real& q, const Real& radius) {
    using std::sqrt;
    const Real square = p * p + q * q, bound = radius * (1.0 + Tolerance::rounding);
    const Mask outside = square > bound * bound;
    const Real size = sqrt(select(outside, square, Real(1.0)));
    return select(outside, Real(radius / size), Real(1.0));
  }

  // Puts x within its bounds in these lanes; those in which the law still holds then.
  FAN_FN Mask tidy(const Mask& lanes) {
    Mask changed = Real(0.0) > Real(1.0);
    const auto set = [&](Real& to, const Real& value) {
      const Mask differs = lanes && value != to;
      changed = changed || differs;
      to = select(differs, value, to);
    };
    for (int a = 0; a < n_single; ++a)
      set(x_single[a], select(has_single[a], clip(x_single[a], lower[a], upper[a]), Real(0.0)));
    for (int i = 0; i < n_contacts; ++i) {
      Real* y = x + 3 * i;
      set(y[0], clip(y[0], Real(0.0), most));
      const Real part = shrinking(y[1], y[2], mu[i] * y[0]);
      set(y[1], y[1] * part);
      set(y[2], y[2] * part);
    }
    if (!any(changed)) return lanes;
    image(x_single, x, next_s_single_, next_s_);
    const Real found = violation(x_single, x, next_s_single_, next_s_) / scale_;
    for (int a = 0; a < n_single; ++a)
      s_single[a] = select(changed, next_s_single_[a], s_single[a]);
    for (int i = 0; i < 3 * n_contacts; ++i) s[i] = select(changed, next_s_[i], s[i]);
    residual = select(changed, found, residual);
    return lanes && residual <= Real(Tolerance::residual);
  }

  // One refinement with the factor at hand in these lanes, kept where the residual becomes smaller.
  FAN_FN void refine(const Mask& lanes) {
    const Mask rough = lanes && residual > Real(Own::refined);
    if (!any(rough)) return;
    this->load_residuals();
    this->substitute();
    this->spread();
    for (int a = 0; a < n_single; ++a)
      next_single_[a] = x_single[a] + (next_single_[a] - this->base_[a]);
    for (int i = 0; i < 3 * n_contacts; ++i) next_[i] += x[i];
    image(next_single_, next_, next_s_single_, next_s_);
    const Real found = violation(next_single_, next_, next_s_single_, next_s_) / scale_;
    take(rough && found < residual, found);
  }

  // Moves to the next x in these lanes.
  FAN_FN void take(const Mask& lanes, const Real& found) {
    const auto move = [&](Real* to, const Real* from, int n) {
      for (int i = 0; i < n; ++i) to[i] = select(lanes, from[i], to[i]);
    };
    move(x_single, next_single_, n_single);
    move(s_single, next_s_single_, n_single);
    move(x, next_, 3 * n_contacts);
    move(s, next_s_, 3 * n_contacts);
    residual = select(lanes, found, residual);
  }

  Real scale_;  // the largest |b_i|
  Real next_s_single_[M], next_s_[3 * C];
};

}  // namespace fan
