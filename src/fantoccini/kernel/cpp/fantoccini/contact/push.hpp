// What a time step finds out about contacts: the points that push, and the tolerances that decide.
#pragma once

#include "fantoccini/math/real.hpp"

namespace fan {

struct ContactStepTolerances {
  // m/s at which a point joins the problem because it would be passed: above rounding.
  static constexpr double passing_speed = 1e-12;
  // Share of the way to its solid, over the step, that a point goes at the speed of the start and
  // still is left to the look at the velocities after the step.
  static constexpr double share_of_way = 0.5;
  // m/s at which a point that pushes slides rather than sticks: above what the residual leaves.
  static constexpr double sliding_speed = 1e-9;
  // How often a step looks again for points that what was struck would pass.
  static constexpr int looks = 8;
  // Steps that an impact takes: the first ends where the solids touch, the second stops them.
  static constexpr int steps_of_impact = 2;
  // m/s at which a point that pushes across a gap still closes it: it will be stopped in the next
  // step, as after a rebound that another impact turns round.
  static constexpr double closing_speed = 0.1;
  // Share of a step within which touches are one.
  static constexpr double same_touch = 1e-6;
  // Residual of the law up to which a step is accepted: far below the error of the step itself.
  static constexpr double accepted_residual = 1e-5;
  // By how much less, relative, an impulse at its winch's bound may be found: rounding.
  static constexpr double at_bound = 1e-9;
  // Shares of G's largest diagonal entry by which rows yield where the law has no solution that is
  // found, tried one after the other.
  static constexpr double softness[] = {1e-8, 1e-7, 1e-6};
  // Bisections of the common factor that keeps restitutions from adding energy.
  static constexpr int halvings = 20;
  // Energy added that is rounding, relative to what the impulses exchange; above it the law's
  // residual.
  static constexpr double rounding = 1e-9;
  // s for every m/s at which points close: an impact may take the impulse of the largest force for
  // so long, in however short a step. With a gravity of 1 m/s^2 that is 100 times the momentum of
  // everything at that speed.
  static constexpr double impact_time = 1e-3;
};

// A point that pushes at the end of a step.
struct ContactPush {
  int pair, feature, steps;  // for how many steps, counted beyond steps_of_impact by one
  int wait;                  // steps for which patches are not tried (patches.hpp)
  bool rested;               // at the start of the step: the forces of one step closed it
  bool rebounds = false;     // it sprang back or is about to: a next touch is a new one
  double gap, at[3], normal[3], impulse[3], velocity[3];
};

// Whether a point comes before another in the order in which they are kept.
template <class Other>
FAN_FN bool is_before(const ContactPush& a, const Other& b) {
  return a.pair < b.pair || (a.pair == b.pair && a.feature < b.feature);
}

// Of what pushes, leaves what was at rest, as if it had pushed for long; returns how many these
// are.
FAN_FN int keep_resting(ContactPush* push, int n) {
  int kept = 0;
  for (int i = 0; i < n; ++i) {
    if (!push[i].rested) continue;
    push[kept] = push[i];
    push[kept++].steps = ContactStepTolerances::steps_of_impact + 1;
  }
  return kept;
}

// The gap that is left at the end of a step dt in which a point has closed it.
inline double closed_gap(const ContactPush& push, double dt) {
  double u = 0.0;
  for (int c = 0; c < 3; ++c) u += push.velocity[c] * push.normal[c];
  return push.gap > 0.0 && u < 0.0 ? fmax(push.gap + dt * u, 0.0) : push.gap;
}

// In the place of ContactStep for puppets that touch nothing.
struct NoContacts {};

}  // namespace fan
