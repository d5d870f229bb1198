// The time-stepping run of one trajectory: drives TimeStep by an input and writes rows.
#pragma once

#include "flow.hpp"
#include "record.hpp"
#include "timestepping.hpp"

namespace fan {

constexpr double kRunaway = 1e9;  // m, rad, or per second: beyond this a state means nothing

template <class Model>
struct FixedRun {
  static constexpr int NQ = Model::n_qD, N = Model::n_vD, S = Model::n_strings;
  static constexpr int M = Model::n_rows, NK = Model::n_vK;

  Drive<typename Model::Driven, N> drive;
  Options opt;
  double p[room(Model::n_p)];
  double t = 0.0, origin = 0.0;
  double q_D[room(NQ)], v_D[room(N)];
  double q_K[room(Model::n_qK)], v_K[room(NK)], acc_K[room(NK)], u_D[room(N)];
  TimeStep<Model, double> at;
  Winches<S> winches;
  double work = 0.0, damping = 0.0, impact = 0.0, slip_loss = 0.0, worst_violation = 0.0;
  long long n_steps = 0, n_here = 0;
  int save_every = 1;

  void start(Record<Model>& out) {
    drive.start_at(t);
    drive.evaluate(t, q_K, v_K, acc_K, u_D);
    for (int r = 0; r < M; ++r) {
      at.taut[r] = at.held[r] = false;
      at.tension[r] = 0.0;
    }
    for (int i = 0; i < S; ++i) at.slips[i] = false;
    at.stirred = false;
    for (int k = 0; k < N; ++k) at.acc[k] = 0.0;
    origin = t;
    n_here = 0;
    // The tensions of the first row are those of the first step, tried and taken back.
    double q[room(NQ)], v[room(N)], slip[room(S)];
    for (int i = 0; i < NQ; ++i) q[i] = q_D[i];
    for (int k = 0; k < N; ++k) v[k] = v_D[k];
    for (int i = 0; i < S; ++i) slip[i] = at.slip[i];
    at.step(q, v, q_K, v_K, acc_K, u_D, opt.dt, opt.recovery_speed, opt.tension_cap, winches, p);
    for (int i = 0; i < S; ++i) at.slip[i] = slip[i];
    at.stirred = false;
    for (int r = 0; r < M; ++r) at.held[r] = at.taut[r];
    emit(out);
  }

  // Runs until t_end, for at most `budget` steps.
  Status run(double t_end, long long budget, Record<Model>& out) {
    next_end_ = t_end;
    while (t < t_end - 1e-9 * opt.dt) {
      if (budget-- <= 0 || !out.room_for(2, M + S + 1)) return RUNNING;
      if (n_steps >= opt.max_steps) return TOO_MANY_STEPS;
      double next = origin + double(n_here + 1) * opt.dt;
      if (next > t_end - 1e-6 * opt.dt) next = t_end;
      const Status status = advance(next, out);
      if (status != RUNNING) return status;
    }
    return DONE;
  }

  // Writes the present state.
  void emit(Record<Model>& out) {
    out.row(
        t, q_D, v_D, at.acc, q_K, v_K, acc_K, at.tension, at.taut, p, work, damping, impact,
        slip_loss, at.slip);
  }

  // New inputs, or a new step grid, from here on.
  void restart() {
    drive.start_at(t);
    drive.evaluate(t, q_K, v_K, acc_K, u_D);
    origin = t;
    n_here = 0;
  }

 private:
  Status advance(double next, Record<Model>& out) {
    const double dt = next - t;
    double q_next[room(Model::n_qK)], v_next[room(NK)], a_next[room(NK)], u_next[room(N)];
    drive.look_at(next);
    drive.evaluate(next, q_next, v_next, a_next, u_next);
    double rate[room(NK)], mean[room(NK)];
    increment(q_K, q_next, dt, rate);
    for (int j = 0; j < NK; ++j) mean[j] = (v_next[j] - v_K[j]) / dt;
    bool was[room(M)], slipped[room(S)];
    for (int r = 0; r < M; ++r) was[r] = at.taut[r];
    for (int i = 0; i < S; ++i) slipped[i] = at.slips[i];
    double q_before[room(NQ)], v_before[room(N)];
    for (int i = 0; i < NQ; ++i) q_before[i] = q_D[i];
    for (int k = 0; k < N; ++k) v_before[k] = v_D[k];
    at.step(
        q_D, v_D, q_K, rate, mean, u_D, dt, opt.recovery_speed, opt.tension_cap, winches, p);
    if (!at.settled) {
      for (int i = 0; i < NQ; ++i) q_D[i] = q_before[i];
      for (int k = 0; k < N; ++k) v_D[k] = v_before[k];
      return NOT_SETTLED;
    }
    ++n_steps;
    ++n_here;
    t = next;
    work += at.work;
    damping += at.loss;
    impact += at.impact;
    slip_loss += at.slip_loss;
    if (at.violation > worst_violation) worst_violation = at.violation;
    for (int i = 0; i < NQ; ++i)
      if (!(fabs(q_D[i]) < kRunaway)) return NOT_FINITE;
    for (int k = 0; k < N; ++k)
      if (!(fabs(v_D[k]) < kRunaway)) return NOT_FINITE;
    for (int i = 0; i < S; ++i)
      if (Model::length_q[i] >= 0 && q_next[Model::length_q[i]] <= 0.0) return LENGTH_NOT_POSITIVE;
    copy(q_next, v_next, a_next, u_next);
    for (int r = 0; r < M; ++r)
      if (was[r] != at.taut[r])
        out.event(t, at.taut[r] ? CATCH : RELEASE, r, at.taut[r] ? at.tension[r] * dt : 0.0, 0.0);
    for (int i = 0; i < S; ++i)
      if (slipped[i] != at.slips[i]) out.event(t, at.slips[i] ? SLIP : GRIP, i, 0.0, 0.0);
    if (n_here % save_every == 0 || t >= next_end_) emit(out);
    return RUNNING;
  }

  void copy(const double* q, const double* v, const double* a, const double* u) {
    for (int i = 0; i < Model::n_qK; ++i) q_K[i] = q[i];
    for (int j = 0; j < NK; ++j) {
      v_K[j] = v[j];
      acc_K[j] = a[j];
    }
    for (int k = 0; k < N; ++k) u_D[k] = u[k];
  }

  // The velocity that takes q to q_next in dt.
  static void increment(const double* q, const double* q_next, double dt, double* rate) {
    using Space = typename Model::Driven;
    for (int i = 0; i < Space::n_scalars; ++i) {
      const int at = Space::scalar_q[i];
      rate[Space::scalar_v[i]] = (q_next[at] - q[at]) / dt;
    }
    for (int i = 0; i < Space::n_quaternions; ++i) {
      const double* a = q + Space::quaternion_q[i];
      const double inverse[4] = {a[0], -a[1], -a[2], -a[3]};
      double turn[4], phi[3];
      quaternion_product(inverse, q_next + Space::quaternion_q[i], turn);
      quaternion_log(turn, phi);
      for (int k = 0; k < 3; ++k) rate[Space::quaternion_v[i] + k] = phi[k] / dt;
    }
  }

  double next_end_ = 0.0;  // the end of the run asked for: its last row is always written
};

}  // namespace fan
