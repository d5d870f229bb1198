// The C interface of a puppet's library of the variational integrator, as fantoccini.runtime loads
// it: that of abi.hpp for runs. The translation unit that includes this defines `fan::Model` first.
#pragma once

#include <new>

#include "export.hpp"
#include "variational_run.hpp"

namespace fan {

inline VariationalRun<Model>& run_of(void* handle) {
  return *static_cast<VariationalRun<Model>*>(handle);
}

}  // namespace fan

FAN_EXPORT void* fan_new(int) { return new (std::nothrow) fan::VariationalRun<fan::Model>(); }

FAN_EXPORT void fan_free(void* handle) { delete &fan::run_of(handle); }

FAN_EXPORT int fan_start(
    void* handle, double t, const double* q_D, const double* v_D, const double* slip,
    const double* p, const double* winches, const fan::InputArrays* input,
    const fan::Options* options, const double*, long long, int save_every,
    fan::Record<fan::Model>* out) {
  auto& run = fan::run_of(handle);
  run.save_every = save_every;
  run.drive.set(*input);
  run.set(t, *options, q_D, v_D, slip, p, winches);
  run.start(*out);
  return fan::RUNNING;
}

FAN_EXPORT int fan_run(
    void* handle, double t_end, long long budget, fan::Record<fan::Model>* out) {
  return fan::run_of(handle).run(t_end, budget, *out);
}

// Writes the present state as a row.
FAN_EXPORT void fan_emit(void* handle, fan::Record<fan::Model>* out) {
  if (out->room_for(1, 0)) fan::run_of(handle).emit(*out);
}

// Replaces the inputs from the present time on.
FAN_EXPORT void fan_set_input(void* handle, const fan::InputArrays* input) {
  auto& run = fan::run_of(handle);
  run.drive.set(*input);
  run.restart();
}

// As in abi.hpp.
FAN_EXPORT long long fan_memory(void* handle, unsigned char* out, const unsigned char* from) {
  fan::Memory memory(out, from);
  fan::run_of(handle).remember(memory);
  return memory.size();
}

// Counters: steps, time reached, worst violation [m or rad].
FAN_EXPORT void fan_progress(void* handle, double* out) {
  const auto& run = fan::run_of(handle);
  out[0] = double(run.n_steps);
  out[1] = run.led.t;
  out[2] = run.led.worst_violation;
}

// By row and drive that is watched, how much it is to blame for how the run ended, 0 to 1.
FAN_EXPORT void fan_blame(void* handle, int status, double* out) {
  const auto& run = fan::run_of(handle);
  run.led.motors().blame(fan::Status(status), 0, out + fan::Model::n_rows);
  for (int r = 0; r < fan::Model::n_rows; ++r) out[r] = run.led.blame[0][r];
}
