// The C interface of a compiled puppet, as fantoccini.kernel.runtime loads it. The translation unit
// that includes this defines `fan::Model` first.
#pragma once

#include "fantoccini/contact/gaps.hpp"
#include "fantoccini/derivatives/step_touches.hpp"
#include "fantoccini/event/batch.hpp"
#include "fantoccini/interface/map.hpp"
#include "fantoccini/interface/model_run.hpp"

namespace fan {
using AnyRun = ModelRun<Model>;
}

#include "fantoccini/interface/run.hpp"

// --- the flow of an event-driven run, with the active set frozen ---------------------------------
//
// y = (q_D, v_D, work, loss, slip loss).

// At (t, y): rate (n_y,), guards (n_rows + n_watched,) and slip (n_strings,); each may be null.
FAN_EXPORT void fan_evaluate(
    void* handle, double t, const double* y, double* rate, double* guard, double* slip) {
  auto& event = static_cast<fan::AnyRun*>(handle)->event;
  using F = fan::Flow<fan::Model>;
  double unused[F::NY];
  event.flow.evaluate(t, y, rate ? rate : unused);
  for (int r = 0; guard && r < F::ALL; ++r) guard[r] = event.guards.guard(r);
  for (int i = 0; slip && i < F::S; ++i) slip[i] = event.flow.slip_now[i];
}

// Writes to `end` the time until which the flow is smooth, at most t_end; returns a status.
FAN_EXPORT int fan_smooth_until(
    void* handle, double t_end, double* end, fan::Record<fan::Model>* out) {
  return static_cast<fan::AnyRun*>(handle)->event.begin_stretch(t_end, end, *out);
}

// The present time, y and the mode of every row (fan::Hold).
FAN_EXPORT double fan_present(const void* handle, double* y, signed char* mode) {
  const auto& flow = static_cast<const fan::AnyRun*>(handle)->event.flow;
  for (int j = 0; j < flow.NY; ++j) y[j] = flow.y[j];
  for (int r = 0; r < flow.M; ++r) mode[r] = flow.row_state[r];
  return flow.t;
}

FAN_BATCHES(fan::EventBatch<fan::Model>)

// Distances (n, n_pairs) of the solids of every pair at n configurations; entries of `gaps` are not
// written for distances above `margin`. Returns 0, or 1 if there is not enough memory.
FAN_EXPORT int fan_gaps(
    const fan::ContactArrays* in, long long n, const double* q_D, const double* q_K,
    const double* p, double margin, double* gaps) {
  return fan::measure_gaps<fan::Model>(*in, n, q_D, q_K, p, margin, gaps);
}

// The contact points of a pair at n poses of its first solid's link (TouchPoses::find).
FAN_EXPORT void fan_touches(
    const fan::ContactArrays* in, int pair, int n, const double* poses, const double* other,
    double margin, double* out) {
  fan::TouchPoses<fan::Model>::find(*in, pair, n, poses, other, margin, out);
}

// First time steps with contact (find_step_touches).
FAN_EXPORT int fan_step_touches(
    const fan::TouchingStepArrays* in, long long first, long long last) {
  return fan::find_step_touches<fan::Model>(*in, first, last);
}

// A complementarity problem of n rows (solvers/active_set.hpp): W^T (n, n_vD), b (n,), upper (n,),
// two_sided (n,) -> x of minimum norm, s, and a Farkas ray if there is no solution, each (n,).
// `active` (n,) is the first guess, and then the rows in the basis. Returns fan::Solved.
FAN_EXPORT int fan_complementarity(
    int n, const double* W, const double* b, const double* upper, const int* two_sided, int* active,
    double* x, double* s, double* ray) {
  using Set = fan::ActiveSet<fan::Model::n_rows, fan::Model::n_vD>;
  struct Memory {
    Set set;
    fan::LeastNorm<Set> least;
    bool stays[Set::C];
  };
  if (n > fan::Model::n_rows) return int(fan::Solved::TOO_LARGE);
  Memory* memory = new (std::nothrow) Memory();
  if (!memory) return int(fan::Solved::TOO_LARGE);
  Set& set = memory->set;
  set.n = n;
  for (int i = 0; i < n; ++i) {
    set.column[i] = W + i * fan::Model::n_vD;
    set.b[i] = b[i];
    set.upper[i] = upper[i];
    set.two_sided[i] = two_sided[i] != 0;
    set.place[i] = active[i] ? Set::BASIC : Set::LOW;
    memory->stays[i] = true;
    ray[i] = 0.0;
  }
  const fan::Solved solved = set.solve();
  if (solved == fan::Solved::INFEASIBLE)
    for (int i = 0; i < n; ++i) ray[i] = set.ray[i];
  if (solved == fan::Solved::YES) {
    set.complete(memory->stays);
    memory->least.apply(set);
  }
  for (int i = 0; i < n; ++i) {
    x[i] = set.x[i];
    s[i] = set.s[i];
    active[i] = set.place[i] == Set::BASIC;
  }
  delete memory;
  return int(solved);
}
