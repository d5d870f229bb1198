// The event-driven run: adaptive steps of the frozen-mode flow, stopped where a tension falls
// through zero (release), a slack row closes (catch), or a winch begins or ends to slip.
#pragma once

#include "accumulation.hpp"
#include "contact.hpp"
#include "detector.hpp"
#include "guards.hpp"
#include "pace.hpp"
#include "record.hpp"

namespace fan {

struct EventTolerances {
  // |h| below which a row counts as closed where a run begins, relative to its scale: starts come
  // from files and solvers, and are then brought to h = 0.
  static constexpr double start_gap = 1e-9;
  // s: a row that lost its tension within this time has just lost it.
  static constexpr double same_instant = 1e-10;
  // s: steps that advance less count as none.
  static constexpr double standstill = 1e-12;
  static constexpr int max_standstill_steps = 200;
  // s: a step that fails at this size has no motion to follow.
  static constexpr double min_failing_step = 1e-10;
  // Step control (Hairer): the error is of order 8; safety, least and most growth of a step.
  static constexpr double order = 8.0, safety = 0.9, min_factor = 0.2, max_factor = 8.0;
  static constexpr double overflow_factor = 0.1;  // of a step whose error is no number
  // Share of the way to the target that counts as all of it, and from which on it is halved.
  static constexpr double whole = 1 - 1e-12, sliver = 0.5;
  // Inputs' accelerations and forces that jump at a break, relative to 1 and their size.
  static constexpr double jump = 1e-9;
  static constexpr int max_saves_per_step = 64;
};

template <class Model>
struct EventRun {
  using F = Flow<Model>;
  using Tolerance = EventTolerances;
  static constexpr int N = F::N, NQ = F::NQ, S = F::S, M = F::M, NY = F::NY;
  static constexpr int rows_per_step = Tolerance::max_saves_per_step + 4;
  static constexpr int events_per_step = 6 * M + 2 * F::D + 8;

  F flow;
  Contact<Model> contact;
  Detector<Model> detector;
  Accumulation accumulation;
  Pace<M> pace;
  double impact = 0.0;  // energy lost in catches so far
  double blame[room(M)] = {};  // by row, how much it is to blame for the status, 0 to 1
  Guards<Model> guards{flow};
  double step_size = 0.0;
  long long n_steps = 0, n_events = 0, stuck = 0;
  const double* save_at = nullptr;
  long long n_save = 0, next_save = 0;

  // Begins at flow.t, flow.y and flow.slip.
  Status start(Record<Model>& out) {
    flow.drive.start_at(flow.t);
    const bool none[room(M)] = {};
    Hold next[room(M)];
    for (int r = 0; r < M; ++r) flow.mode[r] = SLACK, loosened_[r] = -unbounded;
    flow.slip_time = flow.t;
    refresh();
    Status status = contact.retreat(flow);
    if (status == RUNNING) status = contact.choose(flow, none, none, next, Tolerance::start_gap);
    if (status == RUNNING) {
      set_mode(next);
      refresh();
      status = flow.project(flow.t, flow.y);
    }
    if (status == RUNNING) {
      // Closed rows may open at a rate that counts as still: mended where possible, before the books.
      double kept[NY];
      for (int j = 0; j < NY; ++j) kept[j] = flow.y[j];
      refresh();
      const bool held = contact.hold(flow, Attempts::list[0]) == RUNNING;
      for (int j = held ? F::WORK : 0; j < NY; ++j) flow.y[j] = kept[j];
    }
    step_size = flow.opt.first_step;
    refresh();
    flow.motors.begin(flow.y, flow.q_K, flow.p);
    if (status == RUNNING) status = watch();
    else accuse(contact.blame);
    for (int r = 0; r < S; ++r)
      if (flow.mode[r] == SLIPPING) note(out, SLIP, r, 0.0, flow.slip_rate[r]);
    emit(out);
    skip_saved();
    return status;
  }

  // Takes up new inputs at the present time.
  void resume() {
    at_break_ = true;
    looked_at_ = -1;
  }

  // Runs until t_end, for at most `budget` steps.
  Status run(double t_end, long long budget, Record<Model>& out) {
    const long long last_step = n_steps + budget;
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
      // The break itself is dealt with when the run goes on beyond it.
      at_break_ = flow.t >= smooth;
    }
    return flow.motors.verdict(0);
  }

  void remember(Memory& memory) {
    memory.keep(flow.t, flow.y, flow.mode, flow.slip, flow.slip_time, flow.motors);
    memory.keep(contact, detector, accumulation, pace, impact, blame, step_size);
    memory.keep(n_steps, n_events, stuck, at_break_, loosened_);
    guards.remember(memory);
  }

  // Writes the present state.
  void emit(Record<Model>& out) { write(flow.t, flow.y, out); }

 protected:
  // Deals with a break of the inputs at the present time; from there the flow is smooth until `end`.
  Status begin_stretch(double t_end, double* end, Record<Model>& out) {
    if (n_steps >= flow.opt.max_steps) return TOO_MANY_STEPS;
    if (n_events >= flow.opt.max_events || stuck > Tolerance::max_standstill_steps || pace.crowded()) {
      pace.shares(blame);
      return TOO_MANY_EVENTS;
    }
    if (at_break_) {
      const Status changed = breakpoint(out);
      if (changed != RUNNING) return changed;
    }
    const double brk = flow.drive.next_break(flow.t, t_end);
    const double rewound = flow.rewound(t_end);
    *end = brk < t_end ? brk : t_end;
    if (rewound < *end) *end = rewound > flow.t ? rewound : flow.t;
    const double emptied = runs_out();
    if (emptied <= flow.t) {
      for (int r = 0; r < M; ++r) blame[r] = r == emptying_ ? 1.0 : 0.0;
      return LENGTH_NOT_POSITIVE;
    }
    if (emptied < *end) *end = emptied;
    return RUNNING;
  }

  // When a driven length runs out in the inputs' present piece; looked at once for each.
  double runs_out() {
    if (flow.t < flow.drive.segment_start()) return unbounded;  // the inputs have yet to begin
    if (looked_at_ != flow.drive.segment() || flow.t < looked_from_) {
      looked_at_ = flow.drive.segment();
      looked_from_ = flow.t;
      empty_at_ = flow.emptied(unbounded, &emptying_);
    }
    return empty_at_;
  }

  // The evaluation, k[0] and accelerations at (t, y).
  void refresh() { flow.evaluate(flow.t, flow.y, flow.k[0]); }

  void set_mode(const Hold* mode) {
    for (int r = 0; r < M; ++r) flow.mode[r] = mode[r];
  }

  void accuse(const double* rows) {
    for (int r = 0; r < M; ++r) blame[r] = rows[r];
  }

  // What the detector says of the present state.
  Status watch() {
    const Status status = detector.look(flow);
    if (status != RUNNING) accuse(detector.blame);
    return status;
  }

  Status step(double target, Record<Model>& out) {
    const double left = target - flow.t;
    double s = step_size < flow.opt.max_step ? step_size : flow.opt.max_step;
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
      } else if (s > Tolerance::sliver * left) {
        s = Tolerance::sliver * left;  // no sliver before the target
      }
      if (s < guards.resolution()) return STEP_TOO_SMALL;
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
      double factor = err > 0.0 ? Tolerance::safety * pow(err, -1.0 / Tolerance::order) : growth_cap;
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
      const double found = guards.suspicious(s);
      if (found <= 0.0) return accept(s, reaches ? target : flow.t + s, out);
      const double at = guards.locate(found);
      const Status status = accept(at, at == left ? target : flow.t + at, out);
      return status == RUNNING ? instant(out) : status;
    }
  }

  // --- acceptance and events ------------------------------------------------------------------

  Status accept(double s, double new_t, Record<Model>& out) {
    if (next_save < n_save && save_at[next_save] < new_t) {
      save_inside(s, new_t, out);
      flow.evaluate(new_t, flow.end, flow.end_rate);
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
      if (flow.mode[r] == SLIPPING && flow.lack(r) < -GuardTolerances::min_speed) guards.armed[r] = true;
      if (flow.taut(r)) continue;
      if (h < -(GuardTolerances::open_gap + guards.noise) * flow.row_scale(r)) guards.armed[r] = true;
      if (h > 0.0) guards.armed[r] = false;
    }
    flow.motors.look(flow.y, flow.y + NQ, flow.q_K, flow.v_K, flow.acc_K, flow.p, true);
    const long long told = out.n_events;
    flow.motors.tell(flow.t, out);
    n_events += out.n_events - told;
    const bool event = guards.worst() > 0.0;
    Status seen = flow.frail() && !event ? another_basis(out) : RUNNING;
    if (seen == RUNNING) seen = watch();
    if (seen != RUNNING) return seen;
    guards.remember();
    if (flow.opt.save_steps) emit(out);
    while (next_save < n_save && save_at[next_save] <= flow.t) {
      if (!flow.opt.save_steps) emit(out);
      ++next_save;
    }
    return flow.motors.gone ? RUNAWAY : RUNNING;
  }

  void save_inside(double s, double new_t, Record<Model>& out) {
    flow.prepare_dense(s);
    const double t0 = flow.t;
    double state[NY], rate[NY];
    for (; next_save < n_save && save_at[next_save] < new_t; ++next_save) {
      const double at = save_at[next_save];
      flow.dense((at - t0) / s, state);
      flow.evaluate(at, state, rate);
      if (flow.project(at, state) != RUNNING) continue;
      flow.evaluate(at, state, rate);
      write(at, state, out);
    }
  }

  void write(double t, const double* y, Record<Model>& out) {
    double tension[room(M)];
    double slip[room(S)];  // without what a winch may be off its string's length, WinchTolerances::max_length_error
    bool taut[room(M)];
    for (int i = 0; i < S; ++i) slip[i] = flow.slip_now[i] > 0.0 ? flow.slip_now[i] : 0.0;
    contact.tensions(flow, tension);
    for (int r = 0; r < M; ++r) {
      // At a release the tension is zero up to rounding, of either sign.
      const bool both = r < S && Model::wire[r];
      if (!both && !(tension[r] > 0.0)) tension[r] = 0.0;
      taut[r] = flow.taut(r);
    }
    out.row(
        t, y, y + NQ, flow.acc, flow.q_K, flow.v_K, flow.acc_K, tension, taut, flow.p, y[F::WORK],
        y[F::LOSS], impact, y[F::SLIP_LOSS], slip);
  }

  void skip_saved() {
    while (next_save < n_save && save_at[next_save] <= flow.t) ++next_save;
    guards.remember();
  }

  // An event at (t, y): catches strike, then the next mode is chosen.
  Status instant(Record<Model>& out) {
    Situation s;
    bool caught = false;
    for (int r = 0; r < M; ++r) {
      s.before[r] = flow.mode[r];
      const bool held = s.before[r] == HELD || s.before[r] == PINNED;
      const double none = -flow.tension[r] / flow.weight();
      if (held && none > -GuardTolerances::negligible_tension) loosened_[r] = flow.t;
      // Among redundant rows one that has just lost its tension must not take turns with another.
      s.loose[r] = s.before[r] == SLACK ? !guards.armed[r] : flow.t - loosened_[r] <= Tolerance::same_instant;
      s.strained[r] = held && flow.winches.slips(r) &&
                      flow.tension[r] >= flow.winches.max_tension[r] - GuardTolerances::negligible_tension * flow.weight();
      const bool touches = s.before[r] == SLACK && guards.touches(r, FlowTolerances::closed_gap);
      s.caught[r] = touches;
      s.closed[r] = s.before[r] != SLACK || guards.closed(r, FlowTolerances::closed_gap);
      caught = caught || touches;
    }
    if (caught) {
      accumulation.watch(flow.t);
      if (!flow.opt.save_steps) emit(out);
      const Status status = contact.strike(flow, s.closed);
      if (status != RUNNING) return fail(status);
      impact += contact.lost;
      for (int r = 0; r < M; ++r) {
        s.caught[r] = s.caught[r] || (s.before[r] == SLACK && contact.impulse[r] > 0.0);
        s.loose[r] = s.loose[r] && !s.caught[r];
        if (s.caught[r]) note(out, CATCH, r, contact.impulse[r], contact.speed[r]);
      }
    }
    return settle_mode(s, out);
  }

  // At a break of the inputs the tensions may jump: choose the mode again, and write a second row
  // where the inputs' accelerations or the forces jump.
  Status breakpoint(Record<Model>& out) {
    double acc_K[room(Model::n_vK)], u_D[room(N)];
    for (int j = 0; j < Model::n_vK; ++j) acc_K[j] = flow.acc_K[j];
    for (int k = 0; k < N; ++k) u_D[k] = flow.u_D[k];
    at_break_ = false;
    flow.drive.start_at(flow.t);
    refresh();
    bool jumps = false;
    for (int j = 0; j < Model::n_vK; ++j) jumps = jumps || differ(acc_K[j], flow.acc_K[j]);
    for (int k = 0; k < N; ++k) jumps = jumps || differ(u_D[k], flow.u_D[k]);
    if (jumps) note(out, BREAKPOINT, -1, 0.0, 0.0);
    const long long rows = out.n_rows;
    bool touched = false;
    for (int r = 0; r < M; ++r)
      touched = touched || (flow.mode[r] == SLACK && guards.touches(r, FlowTolerances::closed_gap));
    const Status status = touched ? instant(out) : settle_mode(present(), out);
    if (jumps && out.n_rows == rows) emit(out);
    return status;
  }

  // Among redundant rows others stand better on their own: hold those instead.
  Status another_basis(Record<Model>& out) {
    return settle_mode(present(), out);
  }

  // The rows at an event: what they did before it, which are closed and which have just been
  // caught, which have just lost their tension and which have just reached their winch's largest.
  struct Situation {
    Hold before[room(M)];
    bool closed[room(M)], caught[room(M)], loose[room(M)], strained[room(M)];

    // Whether row r holds after the catches and before the choice of the next mode.
    bool holds(int r) const { return before[r] != SLACK || caught[r]; }
  };

  // The rows where nothing has happened to them.
  Situation present() const {
    Situation s;
    for (int r = 0; r < M; ++r) {
      s.before[r] = flow.mode[r];
      s.closed[r] = flow.taut(r);
      s.caught[r] = s.strained[r] = false;
      s.loose[r] = !flow.taut(r) && !guards.armed[r];
    }
    return s;
  }

  void note(Record<Model>& out, EventKind kind, int row, double impulse, double speed) {
    out.event(flow.t, kind, row, impulse, speed);
    pace.note(flow.t, row);
    ++n_events;
  }

  Status fail(Status status) {
    accuse(contact.blame);
    return status;
  }

  static bool differ(double a, double b) { return fabs(a - b) > Tolerance::jump * (1.0 + fabs(a) + fabs(b)); }

  Status settle_mode(const Situation& s, Record<Model>& out) {
    Hold next[room(M)];
    const double energy = flow.total_energy() - given();
    double stopped = 0.0;
    Status held = RUNNING;
    for (const Attempt& how : Attempts::list) {
      if (how.ahead > 0.0 && !flow.winches.some_slip) continue;
      // A row that holding the others brings to rest takes part in the choice.
      for (int round = 0; round <= M; ++round) {
        held = contact.choose(flow, s.loose, s.strained, next, FlowTolerances::closed_gap, how);
        if (held != RUNNING) { if (flow.winches.some_slip) break; else return fail(held); }
        set_mode(next);
        refresh();
        held = contact.hold(flow, how);
        if (contact.stopped > stopped) stopped = contact.stopped;
        if (held != RUNNING || !contact.brought) break;
      }
      if (held == RUNNING) refresh();
      if (held == RUNNING && !guards.contradicted()) break;
    }
    if (held != RUNNING) return fail(held);
    refresh();
    impact += energy - (flow.total_energy() - given());
    bool changed = false;
    for (int r = 0; r < M; ++r) {
      tell(s, r, out);
      changed = changed || next[r] != s.before[r] || s.caught[r];
      if (next[r] == SLIPPING) guards.armed[r] = flow.lack(r) < -GuardTolerances::min_speed;
      // A string that springs back leaves its bound for sure; one that is let go may stay at it.
      if (next[r] == SLACK && s.holds(r)) guards.armed[r] = contact.leaves(flow, r);
    }
    if (stopped > GuardTolerances::min_speed && accumulation.shrinking()) {
      note(out, ACCUMULATION, -1, 0.0, stopped);
      accumulation.forget();
    }
    guards.remember();
    if (changed) emit(out);
    return RUNNING;
  }

  // What inputs and winches have given so far.
  double given() const { return flow.y[F::WORK] - flow.y[F::SLIP_LOSS]; }

  // The event of row r that went from s.before to its mode, beside the catch that has been told.
  void tell(const Situation& s, int r, Record<Model>& out) {
    const Hold before = s.before[r], next = flow.mode[r];
    if (next == SLACK) {
      if (s.holds(r)) note(out, RELEASE, r, 0.0, 0.0);
      return;
    }
    if (!s.holds(r)) note(out, CATCH, r, 0.0, 0.0);
    if (next == SLIPPING && before != SLIPPING) note(out, SLIP, r, 0.0, flow.slip_rate[r]);
    if (next != SLIPPING && before == SLIPPING) note(out, GRIP, r, 0.0, 0.0);
  }

  bool at_break_ = false;
  // The inputs' piece whose lengths were looked at, from when on; when and whose length runs out.
  int looked_at_ = -1, emptying_ = -1;
  double looked_from_ = 0.0, empty_at_ = unbounded;
  double loosened_[room(M)];  // when each row last lost its tension
};

}  // namespace fan
