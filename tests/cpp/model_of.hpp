// The generated model of a puppet for Real = double and, with FAN_LANES, for bundles of doubles.
#pragma once

#include <cmath>

#include "fantoccini/math/elementary.hpp"
#ifdef FAN_LANES
#include "fantoccini/math/lanes.hpp"
#endif
#include "model.hpp"

namespace fan {
namespace scalar {
#define casadi_real double
#include "model.c"
#undef casadi_real
}  // namespace scalar

#ifdef FAN_LANES
namespace wide {
#define casadi_real fan::Lanes<FAN_LANES>
#include "model.c"
#undef casadi_real
}  // namespace wide
#define FAN_WIDE(NAME)                                                    \
  static int NAME(const Lanes<FAN_LANES>** arg, Lanes<FAN_LANES>** res) { \
    return wide::fan_##NAME(arg, res, nullptr, nullptr, 0);               \
  }
#else
#define FAN_WIDE(NAME)
#endif

struct Model : ModelTables {
#define FAN_FUNCTION(NAME)                                    \
  static int NAME(const double** arg, double** res) {         \
    return scalar::fan_##NAME(arg, res, nullptr, nullptr, 0); \
  }                                                           \
  FAN_WIDE(NAME)
  FAN_FUNCTION(dynamics)
  FAN_FUNCTION(dynamics_varying)
  FAN_FUNCTION(step_dynamics)
  FAN_FUNCTION(step_dynamics_varying)
  FAN_FUNCTION(limit_rates)
  FAN_FUNCTION(rows)
  FAN_FUNCTION(energy)
  FAN_FUNCTION(momentum)
  FAN_FUNCTION(effort)
  FAN_FUNCTION(wrench_forces)
  FAN_FUNCTION(poses)
  FAN_FUNCTION(points)
  FAN_FUNCTION(solve_factor_transposed)
  FAN_FUNCTION(solve_factor)
  static void dynamics_constants(double** res) { scalar::fan_dynamics_constants(res); }
  static void step_dynamics_constants(double** res) { scalar::fan_step_dynamics_constants(res); }
  static void column(int which, const double** arg, double** res) {
    scalar::fan_column(which, arg, res);
  }
#ifdef FAN_LANES
  static void step_dynamics_constants(Lanes<FAN_LANES>** res) {
    wide::fan_step_dynamics_constants(res);
  }
  static void column(int which, const Lanes<FAN_LANES>** arg, Lanes<FAN_LANES>** res) {
    wide::fan_column(which, arg, res);
  }
#endif
};
}  // namespace fan
