// How the active set at an instant is sought: by one attempt after another, until it holds together.
//
// The active set follows from tensions and accelerations alone while rows at rest are at rest
// together. Redundant strings may not be: where their lengths contradict one another by some 1e-9
// m/s, tensions ask for all of them, velocities for all but one, and the set would change without
// end. Winches that slip can give way. Then all rows are decided together by one implicit step of
// length d,
//
//   hdot + d hddot <= 0,   0 <= tension <= largest,   complementary,
//
// whose tensions and rates agree with one another. A shorter step sees less of what comes after the
// instant; a longer one suffers less from rounding.
#pragma once

#include "active_set.hpp"

namespace fan {

struct ContactTolerances {
  // |hdot| below which a closed row is at rest, relative to 1 or the largest velocity. A row that a
  // catch elsewhere loosens by less and that pulls again at once would be slack for some
  // 2 |hdot| / hddot = 2 us; holding it instead changes the state by the product of both, some 1e-11,
  // and spares a cascade of catches.
  static constexpr double max_rest_speed = 1e-5;
  // The same where redundant rows cannot be held together at that.
  static constexpr double strict_rest_speed = 1e-9;
  // s: a row that springs back and would close again so soon is at rest too, whatever it weighs: a
  // stiff drive and a restitution of 1 would have it bounce for ever.
  static constexpr double max_rest_hop = 2e-6;
  // J, relative to the weight times 1 m: the energy that bringing rows to rest may add; where winches
  // may give way instead, change.
  static constexpr double energy_gain = 1e-10;
  // Gap below which a row takes part when others are corrected, relative to its scale.
  static constexpr double nearby_gap = 1e-4;
  // |h| of a held row after a correction, relative to its scale. Other rows: closed_gap.
  static constexpr double held_gap = 1e-13;
  // Tension that counts as at its bound, relative to the largest.
  static constexpr double tension_at_bound = 1e-9;
  // Rounding of an acceleration, relative to the largest of its terms.
  static constexpr double acceleration_rounding = 1e-14;
  // Heights (m, rad), speeds and accelerations by which redundant rows may contradict one another.
  static constexpr double contradiction = 1e-10;
  // Energy lost in a catch that counts as 0, relative to the sum of its terms' sizes.
  static constexpr double loss_rounding = 1e-14;
  // Bisections of the common factor that keeps restitutions from adding energy: to rounding.
  static constexpr int restitution_halvings = 50;
};

struct Attempt {
  double stillness;    // |hdot| of rows at rest, relative to the velocities
  double ahead;        // length of the implicit step [s]; 0 for none
  double gain;         // energy that holding may add, relative to the weight times 1 m
  double disagreement;  // of the rates of redundant rows that are held, relative to the velocities
};

struct Attempts : ContactTolerances {
  static constexpr Attempt list[] = {
      {max_rest_speed, 0.0, energy_gain, strict_rest_speed},
      {max_rest_speed, max_rest_hop, energy_gain, strict_rest_speed},
      {max_rest_speed, 0.1 * max_rest_hop, energy_gain, strict_rest_speed},
      {max_rest_speed, 0.01 * max_rest_hop, energy_gain, strict_rest_speed},
      {max_rest_speed, max_rest_hop, energy_gain, 10.0 * strict_rest_speed},
      // What is slow even by the strict measure is held at any price.
      {strict_rest_speed, 0.0, unbounded, strict_rest_speed},
  };
};

}  // namespace fan
