// Tolerances of the time-stepper.
#pragma once

namespace fan {

struct TimeSteppingTolerances {
  // m or rad: violation of a row after which moves per step are limited further. The inputs then
  // cannot be followed, or not with steps of this length, or the start was violated as much.
  static constexpr double limiting_violation = 1e-3;
  // Largest turn (rad) and move (m) of a coordinate in a step after that.
  static constexpr double max_turn_per_step = 0.5, max_move_per_step = 5.0;
  // Factor of both before that.
  static constexpr double initial_factor = 10.0;
  // rad/s or m/s above which a row that closes at the start is caught, not held: above the speeds
  // of held rows, below effects on the ledger.
  static constexpr double catching_speed = 1e-3;
  // rad/s or m/s: speed at which a limit joins the problem because it would be passed; above the
  // rounding of speeds that reach it exactly.
  static constexpr double passing_speed = 1e-12;
  // m, rad or per second: if every limit is at least this far from being passed (far above
  // rounding), they are not checked one by one.
  static constexpr double safe_distance = 1e-6;
};

}  // namespace fan
