// How the modes at an instant are sought: one way after the other, until the modes hold together.
//
// Modes follow from tensions and accelerations alone while rows at rest are at rest together.
// Redundant strings may not be: where their lengths contradict one another by some 1e-9 m/s, tensions
// ask for all of them, velocities for all but one, and the modes would change without end. Winches
// that slip can give way. Then all rows are decided together by one implicit step of length d,
//
//   hdot + d hddot <= 0,   0 <= tension <= largest,   complementary,
//
// whose tensions and rates agree with one another. The shorter the step the less does it see of what
// comes after the instant; the longer, the less of rounding.
#pragma once

#include "active_set.hpp"

namespace fan {

// |hdot| below which a closed row counts as at rest. A row that a catch elsewhere loosens by less
// and that pulls again at once would be slack for some 2 |hdot| / hddot = 2 us; holding it instead
// changes the state by the product of both, some 1e-11, and spares a cascade of catches.
constexpr double kStill = 1e-5;
constexpr double kHardlyStill = 1e-9;  // likewise, where redundant rows cannot be held together
// s: a row that springs back and would be closed again so soon is at rest too, whatever it weighs: a
// stiff drive and a restitution of 1 would have it bounce for ever.
constexpr double kHop = 2e-6;
// J, relative to the weight times 1 m: what bringing rows that are nearly still to rest may add; and
// where winches may give way instead, what it may change.
constexpr double kGain = 1e-10;

struct Choice {
  double stillness;    // |hdot| of rows at rest, relative to the velocities
  double ahead;        // length of the implicit step [s]; 0 for none
  double gain;         // energy that holding may add, relative to the weight times 1 m
  double disagreement;  // of the rates of redundant rows that are held, relative to the velocities
};

constexpr Choice kChoices[] = {
    {kStill, 0.0, kGain, kHardlyStill},
    {kStill, kHop, kGain, kHardlyStill},
    {kStill, 0.1 * kHop, kGain, kHardlyStill},
    {kStill, 0.01 * kHop, kGain, kHardlyStill},
    {kStill, kHop, kGain, 10.0 * kHardlyStill},
    // What is hardly still is held at any price.
    {kHardlyStill, 0.0, kForever, kHardlyStill},
};

}  // namespace fan
