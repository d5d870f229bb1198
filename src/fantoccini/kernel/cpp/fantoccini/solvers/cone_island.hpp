// The solver of cone.hpp for rows that all influence one another: semi-smooth Newton, with a
// proximal term, and the method of multipliers for another start.
#pragma once

#include "fantoccini/solvers/cone_equations.hpp"

namespace fan {

template <int capacity>
struct ConeIsland : ConeEquations<capacity> {
  using Equations = ConeEquations<capacity>;
  using Equations::b, Equations::mu, Equations::x, Equations::s, Equations::speed;
  using Equations::is_finite, Equations::larger, Equations::length, Equations::project;
  using Equations::N, Equations::n, Equations::stride, Equations::n_contacts, Equations::G;
  using Equations::residual, Equations::measure;
  using typename Equations::Tolerance;
  int iterations = 0, rounds = 0;

  // Whether the law holds, up to the residual. If not, x is the best iterate within the bounds.
  // `quick`: after few steps from the guess, damped ones and few rounds of the method of
  // multipliers are tried, which is best for many mostly easy problems.
  FAN_FN bool solve(bool quick = false) {
    iterations = rounds = 0;
    residual = best_residual_ = unbounded;
    weigh();
    const bool guessed = take_guess();
    for (int i = 0; i < n; ++i) best_[i] = x[i];
    const int steps = quick ? Tolerance::quick_steps : Tolerance::steps;
    bool done = newton(Tolerance::raise, steps, steps) || (quick && damped());
    if (!done && guessed) {
      for (int i = 0; i < n; ++i) x[i] = 0.0;
      done = !quick && newton(Tolerance::raise, steps, steps);
    }
    const int attempts = quick ? Tolerance::quick_attempts : Tolerance::attempts;
    const int rounds_of_first = quick ? Tolerance::quick_rounds : Tolerance::rounds;
    const int patience = quick ? Tolerance::quick_patience : Tolerance::patience;
    for (int k = 0; k < attempts && !done; ++k) {
      multipliers(rounds_of_first << k);
      done = (quick && damped()) || newton(Tolerance::firm_raise, patience, Tolerance::firm_steps);
    }
    if (done) return true;
    for (int i = 0; i < n; ++i) x[i] = best_[i];
    bound(x);
    measure();
    return this->is_exact();
  }

 private:
  using Equations::g_, Equations::centre_, Equations::lu_;
  using Equations::step, Equations::refine, Equations::row_of, Equations::top_, Equations::scale_;
  using Equations::weigh, Equations::bound, Equations::violation, Equations::choose;

  // Whether there is a guess other than 0.
  FAN_FN bool take_guess() {
    bool guessed = false;
    for (int i = 0; i < n; ++i) {
      if (!is_finite(x[i])) x[i] = 0.0;
      guessed = guessed || x[i] != 0.0;
    }
    return guessed;
  }

  // Newton's method from x; `patience` is the number of steps for one centre, `most` the total.
  // Returns whether x is a solution; if not, x is the last centre.
  FAN_FN bool newton(double share, int patience, int most) {
    int tries = 0;
    for (int i = 0; i < n; ++i) centre_[i] = x[i];
    for (int k = 0; k < most && share < Tolerance::firmest_raise; ++k) {
      measure();
      if (is_solution()) {
        if (tries > 0 && residual > Tolerance::rough) refine();
        return true;
      }
      if (tries > 0 &&
          violation(share * top_) < larger(Tolerance::centred, this->known_to_) * scale_) {
        for (int i = 0; i < n; ++i) centre_[i] = x[i];
        share = larger(share * Tolerance::softer, Tolerance::raise);
        tries = 0;
      } else if (tries >= patience) {
        for (int i = 0; i < n; ++i) x[i] = centre_[i];
        measure();
        share *= Tolerance::firmer;
        tries = 0;
      }
      choose(share * top_);
      if (!step(share * top_)) break;
      ++iterations;
      ++tries;
    }
    for (int i = 0; i < n; ++i) x[i] = centre_[i];
    return false;
  }

  // A few Newton steps from x, each with its centre there, halved until the violation of the law
  // decreases. Returns whether x is a solution.
  FAN_FN bool damped() {
    double from[N], of[N], to[N], image[N];
    measure();
    if (is_solution()) return true;
    for (int k = 0; k < Tolerance::damped_steps; ++k) {
      const double before = residual;
      for (int i = 0; i < n; ++i) {
        centre_[i] = from[i] = x[i];
        of[i] = s[i];
      }
      choose(0.0);
      if (!step(Tolerance::damping * top_)) return false;
      ++iterations;
      measure();
      if (is_solution()) {
        if (residual > Tolerance::rough) refine();
        return true;
      }
      for (int i = 0; i < n; ++i) {
        to[i] = x[i];
        image[i] = s[i];
      }
      double best = speed, part = 1.0;
      const auto take = [&](double share) {
        for (int i = 0; i < n; ++i) {
          x[i] = share == 1.0 ? to[i] : from[i] + share * (to[i] - from[i]);
          s[i] = share == 1.0 ? image[i] : of[i] + share * (image[i] - of[i]);
        }
        return violation(0.0);
      };
      double tried = 1.0;
      for (int j = 0; j < Tolerance::halvings && !(best <= before * scale_); ++j) {
        tried *= 0.5;
        const double value = take(tried);
        if (best <= value) continue;
        best = value;
        part = tried;
      }
      if (tried != part) take(part);
      speed = best;
      residual = best / larger(scale_, negligible);
    }
    return false;
  }

  // Whether x, clipped to its bounds, is a solution. Stores the best x.
  FAN_FN bool is_solution() {
    if (this->is_exact() && bound(x)) measure();
    if (residual < best_residual_) {
      best_residual_ = residual;
      for (int i = 0; i < n; ++i) best_[i] = x[i];
    }
    return this->is_exact();
  }

  // The method of multipliers from x: y is x within the cones; z becomes s, with mu |s_T| added to
  // s_n.
  FAN_FN void multipliers(int most) {
    double y[N], z[N], r[N];
    lu_.resize(n);
    for (int i = 0; i < n * stride; ++i) lu_.A[i] = G[i];
    for (int i = 0; i < n; ++i)
      lu_.A[i * stride + i] += (Tolerance::penalty + Tolerance::hold) * g_[i];
    if (!lu_.factorise()) return;
    for (int i = 0; i < n; ++i) {
      y[i] = x[i];
      z[i] = 0.0;
    }
    for (int k = 0; k < most; ++k) {
      for (int i = 0; i < n; ++i)
        r[i] = b[i] + z[i] + g_[i] * (Tolerance::hold * x[i] + Tolerance::penalty * y[i]);
      for (int c = 0; c < n_contacts; ++c) {
        const int i = row_of(c);
        r[i] -= mu[c] * length(z[i + 1], z[i + 2]);
      }
      lu_.substitute(r);
      for (int i = 0; i < n; ++i) {
        x[i] = r[i];
        r[i] = y[i] + Tolerance::relaxation * (r[i] - y[i]) - z[i] / (Tolerance::penalty * g_[i]);
        y[i] = r[i];
      }
      for (int c = 0; c < n_contacts; ++c) project(y + row_of(c), mu[c]);
      bound(y);
      for (int i = 0; i < n; ++i) z[i] = Tolerance::penalty * g_[i] * (y[i] - r[i]);
    }
    rounds += most;
    for (int i = 0; i < n; ++i) x[i] = y[i];
  }

  double best_residual_ = unbounded, best_[N];
};

}  // namespace fan
