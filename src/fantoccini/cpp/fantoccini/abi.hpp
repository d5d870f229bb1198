// The C interface of a compiled puppet, as fantoccini.runtime loads it. The translation unit that
// includes this defines `fan::Model` first.
#pragma once

#include <new>

#include "event_batch.hpp"
#include "export.hpp"
#include "fixed.hpp"
#include "map_abi.hpp"
#include "outside.hpp"

namespace fan {

// A run of either method behind one handle.
struct Run {
  bool event_driven;
  OutsideRun<Model> event;
  FixedRun<Model> fixed;
};

inline void read_state(
    const double* q_D, const double* v_D, double* to_q, double* to_v) {
  for (int i = 0; i < Model::n_qD; ++i) to_q[i] = q_D[i];
  for (int k = 0; k < Model::n_vD; ++k) to_v[k] = v_D[k];
}

}  // namespace fan

FAN_EXPORT void* fan_new(int event_driven) {
  fan::Run* run = new (std::nothrow) fan::Run();
  if (run) run->event_driven = event_driven != 0;
  return run;
}

FAN_EXPORT void fan_free(void* handle) { delete static_cast<fan::Run*>(handle); }

// Sets everything a run needs and writes its first row. `winches` has the largest tension, the
// rewinding speed and the restitution of every string; `save_at` must outlive the run.
FAN_EXPORT int fan_start(
    void* handle, double t, const double* q_D, const double* v_D, const double* slip,
    const double* p, const double* winches, const fan::InputArrays* input, const fan::Options* options, const double* save_at,
    long long n_save, int save_every, fan::Record<fan::Model>* out) {
  using fan::Model;
  fan::Run& run = *static_cast<fan::Run*>(handle);
  if (run.event_driven) {
    auto& e = run.event;
    e.flow.opt = *options;
    e.flow.drive.set(*input);
    e.flow.t = t;
    for (int i = 0; i < Model::n_p; ++i) e.flow.p[i] = p[i];
    for (int j = 0; j < e.NY; ++j) e.flow.y[j] = 0.0;
    fan::read_state(q_D, v_D, e.flow.y, e.flow.y + Model::n_qD);
    for (int i = 0; i < Model::n_strings; ++i) e.flow.slip[i] = slip[i];
    e.flow.winches.set(winches);
    e.save_at = save_at;
    e.n_save = n_save;
    return e.start(*out);
  }
  auto& f = run.fixed;
  auto& led = f.led;
  led.opt = *options;
  f.drive.set(*input);
  f.t = t;
  f.save_every = save_every;
  for (int i = 0; i < Model::n_p; ++i) led.p[i] = p[i];
  fan::read_state(q_D, v_D, led.state().q_D, led.state().v_D);
  for (int i = 0; i < Model::n_strings; ++i) led.at.slip[i] = slip[i];
  led.winches.set(winches);
  f.start(*out);
  return fan::RUNNING;
}

// Runs until t_end (DONE), until the record is full or the budget of steps is spent (RUNNING), or
// until something stops it.
FAN_EXPORT int fan_run(
    void* handle, double t_end, long long budget, fan::Record<fan::Model>* out) {
  fan::Run& run = *static_cast<fan::Run*>(handle);
  return run.event_driven ? run.event.run(t_end, budget, *out) : run.fixed.run(t_end, budget, *out);
}

// Writes the present state as a row.
FAN_EXPORT void fan_emit(void* handle, fan::Record<fan::Model>* out) {
  fan::Run& run = *static_cast<fan::Run*>(handle);
  if (!out->room_for(1, 0)) return;
  run.event_driven ? run.event.present(*out) : run.fixed.emit(*out);
}

// Replaces the inputs from the present time on.
FAN_EXPORT void fan_set_input(void* handle, const fan::InputArrays* input) {
  fan::Run& run = *static_cast<fan::Run*>(handle);
  if (run.event_driven) {
    run.event.flow.drive.set(*input);
    run.event.resume();
  } else {
    run.fixed.drive.set(*input);
    run.fixed.restart();
  }
}

// Writes what the run knows beside its inputs to `out`, unless it is null, or reads it from `from`:
// of a run of the same library. Inputs are to be set before it goes on. Returns the bytes it takes.
FAN_EXPORT long long fan_memory(void* handle, unsigned char* out, const unsigned char* from) {
  fan::Run& run = *static_cast<fan::Run*>(handle);
  fan::Memory memory(out, from);
  run.event_driven ? run.event.remember(memory) : run.fixed.remember(memory);
  return memory.size();
}

// Counters: steps, time reached, worst violation (time-stepping) [m].
FAN_EXPORT void fan_progress(void* handle, double* out) {
  const fan::Run& run = *static_cast<fan::Run*>(handle);
  out[0] = double(run.event_driven ? run.event.n_steps : run.fixed.n_steps);
  out[1] = run.event_driven ? run.event.flow.t : run.fixed.t;
  out[2] = run.event_driven ? 0.0 : run.fixed.led.worst_violation;
}

// By row and drive that is watched, how much it is to blame for how the run ended, 0 to 1.
FAN_EXPORT void fan_blame(void* handle, int status, double* out) {
  const fan::Run& run = *static_cast<fan::Run*>(handle);
  const auto& motors = run.event_driven ? run.event.flow.motors : run.fixed.led.motors;
  motors.blame(fan::Status(status), 0, out + fan::Model::n_rows);
  const double* rows = run.event_driven ? run.event.blame : run.fixed.led.blame[0];
  for (int r = 0; r < fan::Model::n_rows; ++r) out[r] = rows[r];
}

// --- an event-driven run whose steps are made outside (outside.hpp) -----------------------------
//
// y = (q_D, v_D, work, loss, slip loss). What comes back is a status.

// Sets how large the integrator's errors in a row's h may be, where it has just been released and
// where it is redundant (Guards::noise, afield).
FAN_EXPORT void fan_set_noise(void* handle, double noise, double afield) {
  auto& run = static_cast<fan::Run*>(handle)->event;
  run.guards.noise = run.contact.hop = noise;
  run.guards.afield = afield;
}

// How far the flow is smooth from the present time, at most to t_end; a break there is dealt with.
FAN_EXPORT int fan_stretch(
    void* handle, double t_end, double* end, fan::Record<fan::Model>* out) {
  return static_cast<fan::Run*>(handle)->event.stretch(t_end, end, *out);
}

// The flow at (t, y): rate (n_y,), guards and how well they are met (n_rows + n_watched,), slip
// (n_strings,); each may be null.
FAN_EXPORT void fan_look(
    void* handle, double t, const double* y, double* rate, double* guard, double* met,
    double* slip) {
  static_cast<fan::Run*>(handle)->event.look(t, y, {rate, guard, met, slip});
}

// Brings y at time t onto the held rows.
FAN_EXPORT int fan_settle(void* handle, double t, double* y) {
  return static_cast<fan::Run*>(handle)->event.settle(t, y);
}

// Takes (t, y), which a step has reached.
FAN_EXPORT int fan_accept(
    void* handle, double t, const double* y, fan::Record<fan::Model>* out) {
  return static_cast<fan::Run*>(handle)->event.accept_reached(t, y, *out);
}

// Deals with the guards that are positive at the present state.
FAN_EXPORT int fan_react(void* handle, fan::Record<fan::Model>* out) {
  return static_cast<fan::Run*>(handle)->event.react(*out);
}

// Writes the row of the next time to save, at which the step's dense output is y.
FAN_EXPORT void fan_save(void* handle, double t, double* y, fan::Record<fan::Model>* out) {
  static_cast<fan::Run*>(handle)->event.save(t, y, *out);
}

// The present time, y and what every row does (fan::Hold).
FAN_EXPORT double fan_present(const void* handle, double* y, signed char* mode) {
  const auto& flow = static_cast<const fan::Run*>(handle)->event.flow;
  for (int j = 0; j < flow.NY; ++j) y[j] = flow.y[j];
  for (int r = 0; r < flow.M; ++r) mode[r] = flow.mode[r];
  return flow.t;
}

// --- many event-driven runs (batch.hpp, event_batch.hpp) ----------------------------------------

FAN_POOL

// Works on a pool until nothing is left; 0, or 1 where there was no memory.
FAN_EXPORT int fan_batch_work(void* pool) {
  return fan::work_on<fan::EventBatch<fan::Model>>(pool);
}

// Complementarity of n rows by itself (active_set.hpp): W (n, n_vD) with a row's column in each row,
// b (n,), upper (n,), two_sided (n,) -> x of least norm, s, and a Farkas ray where there is no
// solution (n,) each. `active` (n,) is the guess on entry and the rows in the basis on return.
// Returns 0 when solved, 1 when no solution exists, 2 when the bound on rounds was met, 3 for more
// rows than the puppet has or for no memory.
FAN_EXPORT int fan_complementarity(
    int n, const double* W, const double* b, const double* upper, const int* two_sided, int* active,
    double* x, double* s, double* ray) {
  using Set = fan::ActiveSet<fan::Model::n_rows, fan::Model::n_vD>;
  struct Room {
    Set set;
    fan::LeastNorm<Set> least;
    bool stays[Set::C];
  };
  if (n > fan::Model::n_rows) return 3;
  Room* room = new (std::nothrow) Room();
  if (!room) return 3;
  Set& set = room->set;
  set.n = n;
  for (int i = 0; i < n; ++i) {
    set.column[i] = W + i * fan::Model::n_vD;
    set.b[i] = b[i];
    set.upper[i] = upper[i];
    set.two_sided[i] = two_sided[i] != 0;
    set.place[i] = active[i] ? Set::BASIC : Set::LOW;
    room->stays[i] = true;
    ray[i] = 0.0;
  }
  const fan::Solved solved = set.solve();
  if (solved == fan::Solved::INFEASIBLE)
    for (int i = 0; i < n; ++i) ray[i] = set.ray[i];
  if (solved == fan::Solved::YES) {
    set.complete(room->stays);
    room->least.apply(set);
  }
  for (int i = 0; i < n; ++i) {
    x[i] = set.x[i];
    s[i] = set.s[i];
    active[i] = set.place[i] == Set::BASIC;
  }
  delete room;
  return int(solved);
}
