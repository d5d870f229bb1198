// The C interface of runs, as fantoccini.kernel.runtime loads it. The translation unit that
// includes this defines `fan::Model` and the runs, `fan::AnyRun`, first.
#pragma once

#include <new>

#include "fantoccini/interface/export.hpp"
#include "fantoccini/runs/snapshot.hpp"

FAN_EXPORT void* fan_new(int event_driven) {
  return new (std::nothrow) fan::AnyRun(event_driven != 0);
}

FAN_EXPORT void fan_free(void* run) { delete static_cast<fan::AnyRun*>(run); }

// Sets up a run and writes its first row.
FAN_EXPORT int fan_start(void* run, const fan::StartArrays* start, fan::Record<fan::Model>* out) {
  return static_cast<fan::AnyRun*>(run)->start(*start, *out);
}

// Runs until t_end (DONE), until the record is full or the budget of steps is used (RUNNING), or
// until another status.
FAN_EXPORT int fan_run(void* run, double t_end, long long budget, fan::Record<fan::Model>* out) {
  return static_cast<fan::AnyRun*>(run)->run(t_end, budget, *out);
}

// Writes the present state as a row.
FAN_EXPORT void fan_emit(void* run, fan::Record<fan::Model>* out) {
  if (out->room_for(1, 0)) static_cast<fan::AnyRun*>(run)->emit(*out);
}

// Replaces the inputs from the present time on.
FAN_EXPORT void fan_set_input(void* run, const fan::InputArrays* input) {
  static_cast<fan::AnyRun*>(run)->set_input(*input);
}

// Writes the run's state, without its inputs, to `out`, or reads it from `from`, written by a run
// of the same library; either may be null. The inputs must be set before the run continues. Returns
// the size in bytes.
FAN_EXPORT long long fan_memory(void* run, unsigned char* out, const unsigned char* from) {
  fan::Snapshot memory(out, from);
  static_cast<fan::AnyRun*>(run)->remember(memory);
  return memory.size();
}

FAN_EXPORT void fan_progress(const void* run, fan::RunProgress* out) {
  *out = static_cast<const fan::AnyRun*>(run)->progress();
}

// Attribution of the run's end to each row and watched drive, at most 1.
FAN_EXPORT void fan_attribution(const void* run, int status, double* out) {
  static_cast<const fan::AnyRun*>(run)->write_attribution(fan::Status(status), out);
}
