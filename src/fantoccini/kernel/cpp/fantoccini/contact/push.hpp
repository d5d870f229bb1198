// Memory of a time step's contacts: the points that push, and tolerances.
#pragma once

#include "fantoccini/math/real.hpp"

namespace fan {

struct ContactStepTolerances {
  // m/s: speed at which a point joins the problem because it would be passed; above rounding.
  static constexpr double passing_speed = 1e-12;
  // Points that would cover less than this share of their gap over the step at the speeds of the
  // start are left to the check of the velocities after the step.
  static constexpr double share_of_way = 0.5;
  // m/s: speed above which a point that pushes slides; above the effect of the residual.
  static constexpr double sliding_speed = 1e-9;
  // Largest number of further searches in a step, for points that struck links would pass.
  static constexpr int max_searches = 8;
  // Steps of an impact: the first ends where the solids touch, the second stops them.
  static constexpr int steps_of_impact = 2;
  // m/s: closing speed of a point that pushes across a gap, above which it will be stopped in the
  // next step, as after a rebound that another impact reverses.
  static constexpr double closing_speed = 0.1;
  // Touches within this share of a step count as simultaneous.
  static constexpr double same_touch = 1e-6;
  // Largest residual of the law of an accepted step: far below the error of the step itself.
  static constexpr double accepted_residual = 1e-5;
  // Relative distance of an impulse from its winch's bound that is rounding.
  static constexpr double at_bound = 1e-9;
  // Compliances of rows, relative to G's largest diagonal entry, that are tried one after the other
  // if no solution of the law is found.
  static constexpr double softness[] = {1e-8, 1e-7, 1e-6};
  // Bisections of the common factor that keeps restitutions from adding energy.
  static constexpr int halvings = 20;
  // Added energy that is rounding, relative to the energy exchanged by the impulses; above this the
  // residual of the law is the bound.
  static constexpr double rounding = 1e-9;
  // s for every m/s at which points close: an impact may take the impulse of the largest force for
  // so long, in however short a step. With a gravity of 1 m/s^2 that is 100 times the momentum of
  // everything at that speed.
  static constexpr double impact_time = 1e-3;
};

// A point that pushes at the end of a step.
struct ContactPush {
  int pair, feature, steps;  // number of steps, above steps_of_impact increased by one
  int wait;                  // steps without patches (patches.hpp)
  bool rested;               // at the start of the step: the forces of one step closed it
  bool rebounds = false;     // it rebounds or is about to: a next touch is a new one
  double gap, at[3], normal[3], impulse[3], velocity[3];
};

// Whether a point comes before another in the order of the list.
template <class Other>
FAN_FN bool is_before(const ContactPush& a, const Other& b) {
  return a.pair < b.pair || (a.pair == b.pair && a.feature < b.feature);
}

// Keeps the points that were at rest, as if they had pushed for long. Returns their number.
FAN_FN int keep_resting(ContactPush* push, int n) {
  int kept = 0;
  for (int i = 0; i < n; ++i) {
    if (!push[i].rested) continue;
    push[kept] = push[i];
    push[kept++].steps = ContactStepTolerances::steps_of_impact + 1;
  }
  return kept;
}

// Remaining gap at the end of a step dt in which a point has closed it.
inline double closed_gap(const ContactPush& push, double dt) {
  double u = 0.0;
  for (int c = 0; c < 3; ++c) u += push.velocity[c] * push.normal[c];
  return push.gap > 0.0 && u < 0.0 ? fmax(push.gap + dt * u, 0.0) : push.gap;
}

// Replaces ContactStep for puppets without contacts.
struct NoContacts {};

}  // namespace fan
