// Attempts to find the active set at an instant, one after another until one is consistent.
//
// The active set follows from tensions and accelerations alone if rows at rest can be at rest
// together. Redundant strings may not be: if their lengths contradict one another by about 1e-9
// m/s, all must hold by their tensions but all except one by their velocities, and the set would
// change without end. Winches that can slip resolve this: one implicit step of length d decides all
// rows together,
//
//   hdot + d hddot <= 0,   0 <= tension <= largest,   complementary,
//
// with consistent tensions and rates. A shorter step depends less on the motion after the instant;
// a longer one suffers less from rounding.
#pragma once

#include "fantoccini/solvers/active_set.hpp"

namespace fan {

struct ClosedRowTolerances {
  // m/s or rad/s, times the largest velocity if that is above 1: |hdot| up to which a closed row is
  // at rest. A row that a catch elsewhere loosens by less would be slack for 2 |hdot| / hddot = 2
  // us under gravity. Holding it instead changes the state by the product of both, about 1e-11, and
  // avoids a cascade of catches.
  static constexpr double max_rest_speed = Constants::rest_speed;
  // The same in the last attempt. Also the largest disagreement of the rates of redundant held
  // rows: samples of an exact inverse kinematics differ by as much (docs/physics.md).
  static constexpr double strict_rest_speed = 1e-9;
  // s: a row that rebounds and would close again within this time is at rest at any speed: with a
  // stiff drive and a restitution of 1 it would bounce forever. Also the longest implicit step.
  static constexpr double max_rest_hop = 2e-6;
  // Relative to the weight times 1 m: largest energy added or, if any winch can slip, added or
  // removed by bringing rows to rest.
  static constexpr double energy_gain = 1e-10;
  // Gap below which a row takes part in the correction of others, relative to its scale.
  static constexpr double nearby_gap = 1e-4;
  // |h| of a held row after ClosedRows::retreat, relative to its scale; h of others: closed_gap.
  static constexpr double held_gap = 1e-13;
  // Distance from 0 or from its winch's largest tension, relative to the largest present, at which
  // a tension counts as at its bound.
  static constexpr double tension_at_bound = 1e-9;
  // Rounding of a row's hddot, relative to Flow::hddot_scale.
  static constexpr double acceleration_rounding = 1e-14;
  // Largest contradiction of redundant rows: heights in m or rad, speeds relative to 1 or the
  // largest velocity, accelerations relative to Flow::hddot_scale.
  static constexpr double contradiction = 1e-10;
  // Energy lost in a catch that counts as 0, relative to the sum of |impulse hdot|.
  static constexpr double loss_rounding = 1e-14;
  // Bisections of the common factor that keeps restitutions from adding energy: to rounding.
  static constexpr int restitution_halvings = 50;
};

struct Attempt {
  double rest_speed;    // |hdot| up to which rows are at rest, as max_rest_speed
  double ahead;         // length of the implicit step [s]; 0 for none
  double gain;          // largest energy added by holding, relative to the weight times 1 m
  double disagreement;  // of the rates of redundant held rows, as strict_rest_speed
};

struct Attempts : ClosedRowTolerances {
  static constexpr Attempt list[] = {
      {max_rest_speed, 0.0, energy_gain, strict_rest_speed},
      {max_rest_speed, max_rest_hop, energy_gain, strict_rest_speed},
      {max_rest_speed, 0.1 * max_rest_hop, energy_gain, strict_rest_speed},
      {max_rest_speed, 0.01 * max_rest_hop, energy_gain, strict_rest_speed},
      {max_rest_speed, max_rest_hop, energy_gain, 10.0 * strict_rest_speed},
      // Fewer rows are at rest; they are held whatever energy that adds.
      {strict_rest_speed, 0.0, unbounded, strict_rest_speed},
  };
};

}  // namespace fan
