// Tolerances of the time-stepper.
#pragma once

namespace fan {

struct TimeSteppingTolerances {
  // m or rad: once a row was overstepped by more, a step may move less far. The inputs then cannot
  // be followed, or not by steps of this length, or the start was violated as much.
  static constexpr double stirred_violation = 1e-3;
  // How far a coordinate may turn (rad) and move (m) in a step, afterwards.
  static constexpr double max_turn_per_step = 0.5, max_move_per_step = 5.0;
  // Before, it may move this many times as far.
  static constexpr double unstirred_factor = 10.0;
  // rad/s or m/s beyond which a row that closes at the start is caught, not held: more than rows
  // that hold move in a step, less than matters in the ledger.
  static constexpr double catching_speed = 1e-3;
  // rad/s or m/s at which a limit joins the problem because it would be passed: above the rounding
  // of speeds that reach it exactly.
  static constexpr double passing_speed = 1e-12;
  // m, rad or per second: where every limit is farther than this from being passed, far above
  // rounding, they are not gone through one by one.
  static constexpr double surely_not = 1e-6;
};

}  // namespace fan
