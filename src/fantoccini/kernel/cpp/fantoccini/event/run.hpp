// The event-driven run: adaptive steps of the flow with frozen active set, stopped where a tension
// falls through zero (release), a slack row closes (catch), or a winch begins or ends to slip.
#pragma once

#include "fantoccini/event/detector.hpp"
#include "fantoccini/event/instants.hpp"
#include "fantoccini/math/lane_of.hpp"
#include "fantoccini/runs/snapshot.hpp"

namespace fan {

template <class Model>
struct EventRun {
  using F = Flow<Model>;
  using Tolerance = EventTolerances;
  static constexpr int N = F::N, NQ = F::NQ, S = F::S, M = F::M, NY = F::NY;
  static constexpr int rows_per_step = Tolerance::max_saves_per_step + 4;
  static constexpr int events_per_step = 6 * M + 2 * F::D + 4 * F::C + 8;

  F flow;
  Guards<Model> guards{flow};
  EventInstants<Model> instants{flow, guards};
  Detector<Model> detector;
  double step_size = 0.0;
  long long n_steps = 0, stuck = 0;
  const double* save_at = nullptr;
  long long n_save = 0, next_save = 0;

  Status start(const StartArrays& from, Record<Model>& out) {
    set(from);
    flow.drive.start_at(flow.t);
    const bool none[array_size(M)] = {};
    Hold next[array_size(M)];
    for (int r = 0; r < M; ++r) {
      flow.row_state[r] = SLACK;
      instants.tension_lost_at[r] = -unbounded;
    }
    flow.slip_time = flow.t;
    if constexpr (F::touches) flow.contacts.points.in = flow.opt.contacts;
    instants.refresh();
    if (instants.in_contact(Tolerance::touching_at_start)) return start_in_contact(out);
    Status status = instants.closed_rows.retreat(flow);
    if (status == RUNNING)
      status = instants.closed_rows.choose(flow, none, none, next, Tolerance::start_gap);
    if (status == RUNNING) {
      instants.set_active_set(next);
      instants.refresh();
      status = flow.project(flow.t, flow.y);
    }
    if (status == RUNNING) {
      // Held rows may move by up to max_rest_speed. They are stopped if possible; the ledger starts
      // after that.
      double kept[NY];
      for (int j = 0; j < NY; ++j) kept[j] = flow.y[j];
      instants.refresh();
      const bool held = instants.closed_rows.hold(flow, Attempts::list[0]) == RUNNING;
      for (int j = held ? F::WORK : 0; j < NY; ++j) flow.y[j] = kept[j];
    }
    step_size = flow.opt.first_step;
    instants.refresh();
    flow.motors.begin(flow.y, flow.q_K, flow.p);
    if (status == RUNNING) status = watch();
    else instants.attribute_to_rows(instants.closed_rows.attribution);
    write_slips(out);
    instants.writer.emit(out);
    skip_saved();
    return status;
  }

  // Likewise if solids touch.
  Status start_in_contact(Record<Model>& out) {
    step_size = flow.opt.first_step;
    flow.motors.begin(flow.y, flow.q_K, flow.p);
    for (int r = 0; r < M; ++r) instants.closed_rows.attribution[r] = 0.0;
    Status status = instants.contact_instant(out, Tolerance::touching_at_start, true);
    write_slips(out);
    if (status != RUNNING) instants.writer.emit(out);
    if (status == RUNNING) status = watch();
    skip_saved();
    return status;
  }

  // Writes events of the winches that slip.
  void write_slips(Record<Model>& out) {
    for (int r = 0; r < S; ++r)
      if (flow.row_state[r] == SLIPPING) instants.writer.note(out, SLIP, r, 0.0, flow.slip_rate[r]);
  }

  // Replaces the inputs from the present time on.
  void set_input(const InputArrays& input) {
    flow.drive.set(input);
    at_break_ = true;
    cached_segment_ = -1;
  }

  RunProgress progress() const { return {n_steps, flow.t, 0.0}; }

  // By row and watched drive, its share in the cause of the run's status.
  void write_attribution(Status status, double* out) const {
    flow.motors.attribute(status, 0, instants.attribution, out);
  }

  // Runs until t_end, for at most `budget` steps.
  Status run(double t_end, long long budget, Record<Model>& out) {
    const long long last_step = n_steps + budget;
    instants.until = t_end;
    while (flow.t < t_end) {
      if (n_steps >= last_step || !out.room_for(rows_per_step, events_per_step)) return RUNNING;
      double smooth;
      const Status ready = begin_stretch(t_end, &smooth, out);
      if (ready != RUNNING) return ready;
      double target = smooth;
      const double last = next_save + Tolerance::max_saves_per_step - 1 < n_save
                              ? save_at[next_save + Tolerance::max_saves_per_step - 1]
                              : target;
      if (last < target && last > flow.t) target = last;
      const Status status = step(target, out);
      if (status != RUNNING) return status;
      // A break at the end of this run is handled when the run continues.
      at_break_ = flow.t >= smooth;
    }
    // A row that closes exactly at the end is caught, so that a run can begin at the last state.
    if (closes()) {
      if (!out.room_for(rows_per_step, events_per_step)) return RUNNING;
      const Status status = instants.instant(out);
      if (status != RUNNING) return status;
    }
    return flow.motors.verdict(0);
  }

  // Handles a break of the inputs at the present time, and finds `end`, until which the flow is
  // smooth.
  Status begin_stretch(double t_end, double* end, Record<Model>& out) {
    if (n_steps >= flow.opt.max_steps) return TOO_MANY_STEPS;
    if (instants.writer.n_events >= flow.opt.max_events ||
        stuck > Tolerance::max_standstill_steps || instants.writer.event_rate.crowded()) {
      instants.writer.event_rate.shares(instants.attribution);
      return TOO_MANY_EVENTS;
    }
    if (at_break_) {
      at_break_ = false;
      const Status changed = instants.breakpoint(out);
      if (changed != RUNNING) return changed;
    }
    const double brk = flow.drive.next_break(flow.t, t_end);
    const double rewound = flow.rewound(t_end);
    *end = brk < t_end ? brk : t_end;
    if (rewound < *end) *end = rewound > flow.t ? rewound : flow.t;
    const double emptied = runs_out();
    if (emptied <= flow.t) {
      for (int r = 0; r < M; ++r) instants.attribution[r] = r == empty_row_ ? 1.0 : 0.0;
      return LENGTH_NOT_POSITIVE;
    }
    if (emptied < *end) *end = emptied;
    return RUNNING;
  }

  // Writes the present state, independent of the flow's latest evaluation.
  void emit_present(Record<Model>& out) {
    instants.refresh();
    instants.writer.emit(out);
  }

  void remember(Snapshot& memory) {
    memory.keep(flow.t, flow.y, flow.row_state, flow.slip, flow.slip_time, flow.motors);
    auto& writer = instants.writer;
    memory.keep(instants.closed_rows, detector, instants.accumulation);
    memory.keep(writer.event_rate, writer.impact, instants.attribution, step_size);
    memory.keep(n_steps, writer.n_events, stuck, at_break_, instants.tension_lost_at);
    flow.contacts.remember(memory);
    guards.remember(memory);
  }

 protected:
  // Sets the start of the run, and its options.
  void set(const StartArrays& from) {
    flow.opt = from.options;
    flow.drive.set(from.input);
    flow.t = from.t;
    put_lane(from.p, Model::n_p, 0, flow.p);
    for (int j = 0; j < NY; ++j) flow.y[j] = 0.0;
    put_lane(from.q_D, NQ, 0, flow.y);
    put_lane(from.v_D, N, 0, flow.y + NQ);
    put_lane(from.slip, S, 0, flow.slip);
    flow.winches.set(from.winches);
    save_at = from.save_at;
    n_save = from.n_save;
  }

  // Time at which a driven length runs out in the inputs' present piece; computed once for each
  // piece.
  double runs_out() {
    if (flow.t < flow.drive.segment_start()) return unbounded;  // the inputs have not begun
    if (cached_segment_ != flow.drive.segment() || flow.t < cached_from_) {
      cached_segment_ = flow.drive.segment();
      cached_from_ = flow.t;
      empty_time_ = flow.emptied(unbounded, &empty_row_);
    }
    return empty_time_;
  }

  // The detector's status of the present state.
  Status watch() {
    const Status status = detector.check(flow);
    if (status == RUNNING) return status;
    // A string may be wedged in with the points that friction jams.
    const bool wedged = status == TENSION_CAP && step_size < Tolerance::min_failing_step;
    if (wedged && flow.contacts.jamming(flow)) return NO_UNIQUE_MOTION;
    instants.attribute_to_rows(detector.attribution);
    return status;
  }

  Status step(double target, Record<Model>& out) {
    const double left = target - flow.t;
    double s = step_size < flow.opt.max_step ? step_size : flow.opt.max_step;
    if constexpr (F::touches)
      if (flow.contacts.points.in && flow.contacts.points.safe < s) s = flow.contacts.points.safe;
    if (left <= guards.resolution()) {
      flow.t = target;
      ++stuck;
      return RUNNING;
    }
    double growth_cap = Tolerance::max_factor;
    for (;;) {
      bool reaches = false;
      if (s >= left * Tolerance::whole) {
        s = left;
        reaches = true;
      } else if (s > Tolerance::two_steps * left) {
        s = Tolerance::two_steps * left;  // so that the last step is not tiny
      }
      if (s < guards.resolution()) return too_small();
      ++n_steps;
      if (n_steps >= flow.opt.max_steps) return TOO_MANY_STEPS;
      flow.stages(s);
      const double err = flow.error(s);
      if (!(err < unbounded)) {
        if (s < Tolerance::min_failing_step) return NOT_FINITE;
        s *= Tolerance::overflow_factor;
        growth_cap = 1.0;
        continue;
      }
      double factor = growth_cap;
      if (err > 0.0) factor = Tolerance::safety * pow(err, -1.0 / Tolerance::order);
      if (err > 1.0) {
        s *= factor < Tolerance::min_factor ? Tolerance::min_factor : factor;
        growth_cap = 1.0;
        continue;
      }
      factor = factor < Tolerance::min_factor ? Tolerance::min_factor
                                              : (factor > growth_cap ? growth_cap : factor);
      if (!reaches || factor < 1.0) step_size = s * factor;
      else if (s * factor > step_size) step_size = s * factor;
      if (flow.finish(s) != RUNNING) {
        if (s < Tolerance::min_failing_step) return PROJECTION_FAILED;
        s *= Tolerance::min_factor;
        growth_cap = 1.0;
        continue;
      }
      flow.contacts.redistribute(flow);
      const double crossing = guards.suspicious(s);
      if (crossing <= 0.0) return accept(s, reaches ? target : flow.t + s, out);
      const double at = guards.locate(crossing);
      // Friction's direction is kept beyond a point's stop: a step that ends before it may be
      // worse.
      if (flow.contacts.holds() && !(flow.error(at) <= 1.0)) {
        s = Tolerance::min_factor * at;
        growth_cap = 1.0;
        continue;
      }
      const Status status = accept(at, at == left ? target : flow.t + at, out);
      return status == RUNNING ? instants.instant(out) : status;
    }
  }

  // Whether a slack row is at its bound at the present state and moves past it.
  bool closes() const {
    for (int r = 0; r < M; ++r)
      if (flow.row_state[r] == SLACK && guards.touches(r, FlowTolerances::closed_gap) &&
          flow.rate_of(r, flow.y + NQ) > instants.closed_rows.rest_speed(flow))
        return true;
    return false;
  }

  // Status of a step below the clock's resolution; its trial may have left the flow anywhere.
  Status too_small() {
    instants.refresh();
    return flow.contacts.jamming(flow) ? NO_UNIQUE_MOTION : STEP_TOO_SMALL;
  }

  // --- acceptance and events ------------------------------------------------------------------

  Status accept(double s, double new_t, Record<Model>& out) {
    Status saved = RUNNING;
    if (next_save < n_save && save_at[next_save] < new_t) {
      saved = save_inside(s, new_t, out);
      flow.evaluate(new_t, flow.end, flow.end_rate);
      flow.contacts.redistribute(flow);
    }
    for (int j = 0; j < NY; ++j)
      if (!is_finite(flow.end[j])) return NOT_FINITE;
    const double moved = new_t - flow.t;
    flow.t = new_t;
    for (int j = 0; j < NY; ++j) {
      flow.y[j] = flow.end[j];
      flow.k[0][j] = flow.end_rate[j];
    }
    stuck = moved > Tolerance::standstill ? 0 : stuck + 1;
    for (int r = 0; r < M; ++r) {
      const double h = flow.eval.height(r);
      if (flow.row_state[r] == SLIPPING && flow.violation(r) < -GuardTolerances::min_speed)
        guards.armed[r] = true;
      if (flow.taut(r)) continue;
      if (h < -GuardTolerances::open_gap * flow.row_scale(r)) guards.armed[r] = true;
      if (h > 0.0) guards.armed[r] = false;
    }
    flow.motors.observe(flow.y, flow.y + NQ, flow.q_K, flow.v_K, flow.acc_K, flow.p, true);
    const long long before = out.n_events;
    flow.motors.tell(flow.t, out);
    instants.writer.n_events += out.n_events - before;
    const bool event = guards.worst() > 0.0;
    Status seen = flow.nearly_dependent() && !event ? instants.another_basis(out) : RUNNING;
    if (seen == RUNNING) seen = watch();
    if (seen == RUNNING) seen = saved;
    if (seen != RUNNING) return seen;
    bool ahead = false;
    if constexpr (F::touches)
      ahead =
          flow.contacts.active() && !event && flow.contacts.rows.choose_slow(flow.contacts.points);
    instants.update_directions(out);
    if constexpr (F::touches) {
      if (ahead) look_ahead();
      if (flow.contacts.points.too_many) return TOO_MANY_CONTACTS;
    }
    guards.remember();
    if (flow.opt.save_steps) instants.writer.emit(out);
    while (next_save < n_save && save_at[next_save] <= flow.t) {
      if (!flow.opt.save_steps) instants.writer.emit(out);
      ++next_save;
    }
    return flow.motors.gone ? RUNAWAY : RUNNING;
  }

  // Evaluates the present state again, with the friction of slow points ahead; without slow points
  // if that would end a mode.
  void look_ahead() {
    for (;;) {
      instants.refresh();
      flow.contacts.redistribute(flow);
      if (!(guards.worst() > 0.0) || !flow.contacts.points.forget_slow()) return;
    }
  }

  // Writes the samples within the step. Returns the status of the first that fails.
  Status save_inside(double s, double new_t, Record<Model>& out) {
    flow.prepare_dense(s);
    const double t0 = flow.t;
    double state[NY], rate[NY];
    for (; next_save < n_save && save_at[next_save] < new_t; ++next_save) {
      const double at = save_at[next_save];
      flow.dense((at - t0) / s, state);
      flow.evaluate(at, state, rate);
      const Status status = flow.project(at, state);
      if (status != RUNNING) return status;
      flow.evaluate(at, state, rate);
      flow.contacts.redistribute(flow);
      instants.writer.write(at, state, out);
    }
    return RUNNING;
  }

  void skip_saved() {
    while (next_save < n_save && save_at[next_save] <= flow.t) ++next_save;
    guards.remember();
  }

  bool at_break_ = false;
  // Cache of runs_out(): the piece and its start, the time, and the row.
  int cached_segment_ = -1, empty_row_ = -1;
  double cached_from_ = 0.0, empty_time_ = unbounded;
};

}  // namespace fan
