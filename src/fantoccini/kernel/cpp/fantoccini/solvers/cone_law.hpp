// Constants and small functions of cone.hpp.
#pragma once

#include "fantoccini/math/real.hpp"

namespace fan {

struct ConeTolerances {
  // Largest residual of a solution; see `residual`.
  static constexpr double residual = 1e-10;
  // Rounding of s, relative to the largest sum of |G_ij x_j|: between bodies of very different
  // mass, accelerations cancel, which leaves such a residual. It is capped, because jammed forces
  // have an unbounded rounding error.
  static constexpr double rounding_of_sum = 8.0 * 2.2e-16;
  static constexpr double largest_rounding = 5e-10;
  // Residual above which a solution is refined: above rounding.
  static constexpr double rough = 1e-14;
  // Raise of G's diagonal, relative to its largest entry: at first, and for starts from the method
  // of multipliers.
  static constexpr double raise = 1e-10;
  static constexpr double firm_raise = 1e-3;
  static constexpr double firmest_raise = 10.0;
  // Change of the raise after a failure, and after a success.
  static constexpr double firmer = 10.0;
  static constexpr double softer = 0.3;
  // Residual of the raised problem at which its solution becomes the centre.
  static constexpr double centred = 1e-11;
  // Lower bound of g, relative to G's largest diagonal entry.
  static constexpr double smallest_influence = 1e-12;
  // A disc smaller than this, relative to |x_T - s_T / g|, is a point.
  static constexpr double smallest_disc = 1e-14;
  // A tangential part that exceeds its disc by less than this, relative, is unchanged.
  static constexpr double rounding = 1e-15;
  // Larger numbers count as overflow (bounds may be larger).
  static constexpr double largest_number = 1e100;
  // Newton steps: from the guess or from zero; in one attempt from another start; for one centre in
  // such an attempt.
  static constexpr int steps = 20;
  static constexpr int firm_steps = 300;
  static constexpr int patience = 20;
  // Attempts with a start by the method of multipliers; rounds of the first, doubled each time.
  static constexpr int attempts = 5;
  static constexpr int rounds = 100;
  // Of quick solves: steps from the guess, then damped ones, halvings of each, and their raise.
  static constexpr int quick_steps = 8;
  static constexpr int damped_steps = 8, halvings = 3;
  static constexpr double damping = 1e-5;
  // Then the method of multipliers: few rounds are often enough.
  static constexpr int quick_attempts = 9;
  static constexpr int quick_rounds = 8;
  static constexpr int quick_patience = 8;
  // The method's penalty and its proximal weight of the last x, relative to g; its over-relaxation.
  static constexpr double penalty = 0.1;
  static constexpr double hold = 1e-8;
  static constexpr double relaxation = 1.6;
};

struct ConeLaw {
  using Tolerance = ConeTolerances;

  FAN_FN static bool is_finite(double value) { return fabs(value) < Tolerance::largest_number; }

  FAN_FN static double clip(double value, double low, double high) {
    return value < low ? low : value > high ? high : value;
  }

  FAN_FN static double larger(double p, double q) { return p > q ? p : q; }

  FAN_FN static double length(double p, double q) { return sqrt(p * p + q * q); }

  // Moves the tangential part of y to the nearest point of its disc. Returns whether that changed
  // it.
  FAN_FN static bool shorten(double* y, double radius) {
    const double square = y[1] * y[1] + y[2] * y[2], most = radius * (1.0 + Tolerance::rounding);
    if (square <= most * most) return false;
    const double size = sqrt(square);
    y[1] *= radius / size;
    y[2] *= radius / size;
    return true;
  }

  // Projects y onto the cone |y_T| <= mu y_n.
  FAN_FN static void project(double* y, double mu) {
    const double size = length(y[1], y[2]);
    if (size <= mu * y[0]) return;
    y[0] = larger(0.0, (y[0] + mu * size) / (1.0 + mu * mu));
    shorten(y, mu * y[0]);
  }
};

}  // namespace fan
