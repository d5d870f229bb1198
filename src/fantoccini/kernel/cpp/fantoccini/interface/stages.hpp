// The C interface of programs of stages, as fantoccini.kernel.runtime loads it, without a puppet.
#pragma once

#include <new>

#include "fantoccini/interface/export.hpp"
#include "fantoccini/search/stage_clamped.hpp"
#include "fantoccini/search/stage_program.hpp"

FAN_EXPORT void* fan_stage_solver_new() { return new (std::nothrow) fan::StageProgramSolver(); }

FAN_EXPORT void fan_stage_solver_free(void* solver) {
  delete static_cast<fan::StageProgramSolver*>(solver);
}

// Returns 0, or 1 if there is not enough memory.
FAN_EXPORT int fan_stage_solve(void* solver, fan::StageProgramArrays* in) {
  try {
    static_cast<fan::StageProgramSolver*>(solver)->solve(*in);
  } catch (const std::bad_alloc&) {
    return 1;
  }
  return 0;
}

FAN_EXPORT void* fan_clamped_stages_new() { return new (std::nothrow) fan::ClampedStages(); }

FAN_EXPORT void fan_clamped_stages_free(void* solver) {
  delete static_cast<fan::ClampedStages*>(solver);
}

// Adds a time step to the intervals. Returns 0, or 1 if there is not enough memory.
FAN_EXPORT int fan_clamped_stages_step(void* solver, const fan::StageStepArrays* in) {
  try {
    static_cast<fan::ClampedStages*>(solver)->dynamics.add(*in);
  } catch (const std::bad_alloc&) {
    return 1;
  }
  return 0;
}

// Results for the steps added since the first. Returns 0, or 1 if there is not enough memory.
FAN_EXPORT int fan_clamped_stages_solve(void* solver, fan::StageClampArrays* in) {
  try {
    static_cast<fan::ClampedStages*>(solver)->solve(*in);
  } catch (const std::bad_alloc&) {
    return 1;
  }
  return 0;
}
