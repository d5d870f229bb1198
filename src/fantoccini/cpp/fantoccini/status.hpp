// How a run ended; the numbers are those of fantoccini.errors.Status.
#pragma once

namespace fan {

enum Status : int {
  DONE = 0,
  RUNNING = 1,
  IMPOSSIBLE_INPUT = 2,
  TENSION_CAP = 3,
  STEP_TOO_SMALL = 4,
  TOO_MANY_EVENTS = 5,
  TOO_MANY_STEPS = 6,
  NOT_FINITE = 7,
  COLLAPSED = 8,
  LENGTH_NOT_POSITIVE = 9,
  PROJECTION_FAILED = 10,
  STOPPED = 11,
  SINGULAR_MASS = 12,
  NOT_SETTLED = 13,
  LOST_STEPS = 14,
  RUNAWAY = 15,
  // Of Python alone, which keeps the rows, judges runs at their end, and finds strings that
  // contradict one another.
  TOO_MANY_ROWS = 16,
  REDUNDANT_STRINGS = 17,
  OVERSTEPPED = 18,
  GAINED_ENERGY = 19,
};

// What happened to a row; the numbers are those of fantoccini.motion.EventKind.
enum EventKind : int {
  CATCH = 0,
  RELEASE = 1,
  ACCUMULATION = 2,
  BREAKPOINT = 3,
  SLIP = 4,
  GRIP = 5,
  LOST_STEP = 6,
  RAN_AWAY = 7,
};

}  // namespace fan
