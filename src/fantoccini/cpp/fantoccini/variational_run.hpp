// The variational run of one trajectory: drives the integrator by an input, halves steps that it
// cannot solve, and writes rows.
#pragma once

#include "active_set.hpp"
#include "drive.hpp"
#include "options.hpp"
#include "record.hpp"
#include "status.hpp"
#include "variational.hpp"

namespace fan {

constexpr double kFinest = 1.0 / 4096.0;  // of a step: how far it is halved
constexpr double kTooWild = 1e9;          // m, rad, per second: a state of this size means nothing

template <class Model>
struct VariationalRun {
  static constexpr int N = Model::n_vD, S = Model::n_strings, M = Model::n_rows;
  using Step = VariationalStep<Model, double>;

  Step at;
  Drive<typename Model::Driven, N> drive;
  Options opt;
  double t = 0.0, origin = 0.0;
  double work = 0.0, damping = 0.0, impact = 0.0, slip_loss = 0.0, worst_violation = 0.0;
  double blame[room(M)];
  long long n_steps = 0, n_here = 0;
  int save_every = 1;

  // Where the run begins; options and inputs come before.
  void set(
      double start, const double* q_D, const double* v_D, const double* slip, const double* p,
      const double* winches) {
    t = start;
    n_steps = 0;
    auto& here = at.here;
    here.cap = opt.tension_cap;
    here.winches.set(winches);
    for (int i = 0; i < Model::n_p; ++i) here.p[i] = p[i];
    for (int i = 0; i < Model::n_qD; ++i) here.q_D[i] = q_D[i];
    for (int k = 0; k < N; ++k) here.v_D[k] = v_D[k];
    for (int i = 0; i < S; ++i) here.slip[i] = slip[i];
  }

  void start(Record<Model>& out) {
    begin_grid();
    at.begin(opt.dt);
    work = damping = impact = slip_loss = worst_violation = 0.0;
    for (int r = 0; r < M; ++r) tension_[r] = blame[r] = 0.0;
    try_out();
    emit(out);
  }

  // Runs until t_end, for at most `budget` steps.
  Status run(double t_end, long long budget, Record<Model>& out) {
    while (t < t_end - 1e-9 * opt.dt) {
      if (budget-- <= 0 || !out.room_for(2, 2 * (M + S) + 1)) return RUNNING;
      if (n_steps >= opt.max_steps) return TOO_MANY_STEPS;
      double next = origin + double(n_here + 1) * opt.dt;
      if (next > t_end - 1e-6 * opt.dt) next = t_end;
      const Status status = advance(next, out);
      if (status != RUNNING) return status;
      if (n_here % save_every == 0 || t >= t_end) emit(out);
    }
    return DONE;
  }

  // Writes the present state.
  void emit(Record<Model>& out) {
    const auto& here = at.here;
    out.row(
        t, here.q_D, here.v_D, at.acc, here.now.q_K, here.now.v_K, here.now.acc_K, tension_,
        here.taut, here.p, work, damping, impact, slip_loss, here.slip);
  }

  // New inputs, or a new step grid, from here on; the velocities of the driven coordinates go on.
  void restart() {
    begin_grid();
    at.here.settle();
  }

 private:
  using Inputs = typename Step::Inputs;

  void begin_grid() {
    drive.start_at(t);
    look(t, at.here.now);
    origin = t;
    n_here = 0;
  }

  void look(double when, Inputs& in) {
    drive.evaluate(when, in.q_K, in.v_K, in.acc_K, in.u_D);
  }

  // A step, in as many parts as it takes.
  Status advance(double next, Record<Model>& out) {
    const double start = t, dt = next - t;
    double part = dt;
    bool was[room(M)], slipped[room(S)], gives[room(S)];
    double impulse[room(M)], caught[room(M)];
    for (int r = 0; r < M; ++r) {
      was[r] = at.here.taut[r];
      impulse[r] = caught[r] = 0.0;
    }
    for (int i = 0; i < S; ++i) {
      slipped[i] = at.slips[i];
      gives[i] = false;
    }
    Status status = RUNNING;
    while (t < next && status == RUNNING) {
      const bool last = next - t <= part * (1.0 + 1e-9);
      const double end = last ? next : t + part, before = t;
      if (!try_to(end)) {
        part = 0.5 * (end - t);
        if (part < kFinest * dt) status = reason();
        continue;
      }
      for (int r = 0; r < M; ++r) (at.caught[r] ? caught : impulse)[r] += at.impulse[r];
      for (int i = 0; i < S; ++i) gives[i] = gives[i] || at.slips[i];
      status = judged(t - before);
      if (!last) part *= 2.0;
    }
    if (t == start) {
      if (n_here % save_every != 0) emit(out);
      return status;
    }
    ++n_steps;
    ++n_here;
    for (int r = 0; r < M; ++r) {
      // What pulled in a part of the step and has let go bears nothing any more.
      tension_[r] = at.here.taut[r] ? impulse[r] / (t - start) : 0.0;
      if (caught[r] > 0.0) out.event(t, CATCH, r, caught[r], 0.0);
      if (!at.here.taut[r] && (was[r] || caught[r] > 0.0)) out.event(t, RELEASE, r, 0.0, 0.0);
    }
    for (int i = 0; i < S; ++i) {
      at.slips[i] = gives[i];
      if (slipped[i] != gives[i]) out.event(t, gives[i] ? SLIP : GRIP, i, 0.0, 0.0);
    }
    if (status != RUNNING) emit(out);
    return status;
  }

  // What pulls at the start, and how much, is what does so in the first step.
  void try_out() {
    if (!solve_to(t + opt.dt)) return;
    for (int r = 0; r < M; ++r) {
      if (!at.here.closed(r)) continue;
      at.here.lambda[r] = at.found_impulse(r);
      tension_[r] = at.found_impulse(r) * (2.0 / opt.dt);
    }
    restart();
  }

  // Goes to `end` in one part, or stays where it is.
  bool try_to(double end) {
    if (!solve_to(end)) return false;
    const double dt = end - t;
    at.accept(dt, true);
    t = end;
    work += at.work;
    damping += at.loss;
    impact += at.impact;
    slip_loss += at.slip_loss;
    for (int r = 0; r < M; ++r)
      if (at.overstep(r) > worst_violation) worst_violation = at.overstep(r);
    return true;
  }

  bool solve_to(double end) {
    const double dt = part_ = end - t, middle = t + 0.5 * dt;
    drive.look_at(middle);
    drive.evaluate_force(middle, at.lead.u_D);
    drive.look_at(end);
    look(end, at.coming);
    half_way<typename Model::Driven>(
        at.here.now.q_K, at.coming.q_K, at.lead.q_mid, at.lead.v_mid);
    for (int j = 0; j < Model::n_vK; ++j) at.lead.v_mid[j] *= 1.0 / dt;
    return at.solve(dt, true);
  }

  // After a part of a step, of length dt. A pull counts over a whole step: in a short part, what rows
  // that are taut get of a blow just before looks like one.
  Status judged(double dt) {
    const double size = squares<Model::n_qD>(at.here.q_D) + squares<N>(at.here.v_D);
    if (!(size < kTooWild * kTooWild)) return NOT_FINITE;
    if (is_empty(at.here.now)) return LENGTH_NOT_POSITIVE;
    double most = 0.0, span = dt > opt.dt ? dt : opt.dt;
    for (int r = 0; r < M; ++r) {
      const double pull = fabs(at.impulse[r]);
      if (at.caught[r]) span = 1.0;  // s: rows that pull pass a blow on
      else if (pull > most) most = pull;
    }
    if (most <= at.here.cap * span) return RUNNING;
    for (int r = 0; r < M; ++r) blame[r] = at.caught[r] ? 0.0 : fabs(at.impulse[r]) / most;
    return TENSION_CAP;
  }

  static bool is_empty(const Inputs& in) {
    for (int i = 0; i < S; ++i)
      if (Model::length_q[i] >= 0 && !(in.q_K[Model::length_q[i]] > 0.0)) return true;
    return false;
  }

  // Why even the shortest part of a step was not solved; a row's share in it is its blame.
  Status reason() {
    if (is_empty(at.coming)) return LENGTH_NOT_POSITIVE;
    ActiveSet<M, N> set;
    const auto& rows = at.here.firm.rows;
    at.demand(part_, set.b);
    set.n = rows.n;
    for (int a = 0; a < rows.n; ++a) {
      const int r = rows.row[a];
      set.column[a] = rows.column[a];
      set.upper[a] = at.here.winches.slips(r) ? at.here.winches.max_tension[r] * part_ : kForever;
      set.two_sided[a] = rows.two_sided[a];
      set.place[a] = ActiveSet<M, N>::LOW;
    }
    const Solved solved = set.solve();
    if (solved == Solved::UNSETTLED) return NOT_SETTLED;
    const double* share = solved == Solved::INFEASIBLE ? set.ray : set.x;
    double most = 0.0, span = part_;
    for (int a = 0; a < rows.n; ++a) {
      if (share[a] != 0.0 && !at.here.taut[rows.row[a]]) span = 1.0;  // s: a blow, not a pull
      most = fmax(most, fabs(share[a]));
    }
    if (solved == Solved::YES && most <= at.here.cap * span) return NOT_SETTLED;
    for (int a = 0; a < rows.n; ++a) blame[rows.row[a]] = fabs(share[a]) / most;
    return solved == Solved::YES ? TENSION_CAP : IMPOSSIBLE_INPUT;
  }

  double tension_[room(M)];
  double part_ = 0.0;  // s: length of the step last looked for
};

}  // namespace fan
