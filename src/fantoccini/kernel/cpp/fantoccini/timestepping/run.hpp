// The time-stepping run of one trajectory: drives the time-stepper by an input and writes rows.
#pragma once

#include "fantoccini/contact/events.hpp"
#include "fantoccini/runs/drive.hpp"
#include "fantoccini/runs/record.hpp"
#include "fantoccini/runs/snapshot.hpp"
#include "fantoccini/runs/step_grid.hpp"
#include "fantoccini/timestepping/trajectory.hpp"

namespace fan {

template <class Model>
struct FixedRun {
  static constexpr int N = Model::n_vD, S = Model::n_strings, M = Model::n_rows;
  static constexpr bool touches = TimeStep<Model, double>::touches;
  static constexpr int most_events =  // of a step
      M + S + 2 * Model::n_watched + 1 + ContactEvents<Model::n_contacts>::most;

  TimeSteppingTrajectory<Model, double> trajectory;
  Drive<typename Model::Driven, N> drive;
  double t = 0.0, origin = 0.0;
  long long n_steps = 0, n_here = 0;
  int save_every = 1;

  void start(Record<Model>& out) {
    last_dt_ = trajectory.opt.dt;
    restart();
    trajectory.begin();
    if constexpr (touches)
      if (trajectory.opt.contacts) {
        const auto& at = trajectory.at.contacts;
        meetings_.begin(*trajectory.opt.contacts, at.push[0], at.n[0]);
      }
    emit(out);
  }

  // Runs until t_end, for at most `budget` steps.
  Status run(double t_end, long long budget, Record<Model>& out) {
    next_end_ = t_end;
    const StepGrid grid{origin, t_end, trajectory.opt.dt};
    while (t < grid.end()) {
      if (budget-- <= 0 || !out.room_for(2, most_events)) return RUNNING;
      if (n_steps >= trajectory.opt.max_steps) return TOO_MANY_STEPS;
      const Status status = advance(grid.at(n_here + 1), out);
      if (status != RUNNING) return status;
    }
    return trajectory.motors.verdict(0);
  }

  // Writes the present state.
  void emit(Record<Model>& out) {
    const auto& state = trajectory.state();
    const auto& in = trajectory.inputs();
    out.row(
        t, state.q_D, state.v_D, trajectory.at.acc(), in.q_K, in.v_K, in.acc_K,
        trajectory.at.tension, trajectory.at.taut, trajectory.p, trajectory.work,
        trajectory.damping, trajectory.impact, trajectory.slip_loss, trajectory.friction,
        trajectory.at.slip);
    if constexpr (touches) {
      auto& contacts = trajectory.at.contacts;
      const int n = contacts.shared(trajectory.at.eval, trajectory.at.rows, share_, shared_);
      for (int i = 0; i < n; ++i) shared_[i].gap = closed_gap(shared_[i], last_dt_);
      out.touching(shared_, n, last_dt_, contacts.residual);
    }
  }

  // New inputs, or a new step grid, from here on.
  void restart() {
    drive.start_at(t);
    look(t);
    trajectory.take_inputs();
    origin = t;
    n_here = 0;
  }

  void remember(Snapshot& memory) {
    const ContactArrays* contacts = trajectory.opt.contacts;
    memory.keep(trajectory, t, origin, n_steps, n_here, last_dt_, meetings_);
    trajectory.opt.contacts = trajectory.at.solids = contacts;
    trajectory.inputs().still = trajectory.coming().still = 0;  // another drive numbers its own
  }

 private:
  void look(double when) { drive.fill(when, trajectory.coming()); }

  Status advance(double next, Record<Model>& out) {
    const double dt = next - t;
    drive.look_at(next);
    look(next);
    bool was[room(M)], slipped[room(S)];
    for (int r = 0; r < M; ++r) was[r] = trajectory.at.taut[r];
    for (int i = 0; i < S; ++i) slipped[i] = trajectory.at.slips[i];
    trajectory.advance(dt);
    last_dt_ = dt;
    const Status status = Status(int(trajectory.status));
    if (status != RUNNING) return status;
    ++n_steps;
    ++n_here;
    t = next;
    const TimeStep<Model, double>& at = trajectory.at;
    for (int r = 0; r < M; ++r)
      if (was[r] != at.taut[r])
        out.event(t, at.taut[r] ? CATCH : RELEASE, r, at.taut[r] ? at.tension[r] * dt : 0.0, 0.0);
    for (int i = 0; i < S; ++i)
      if (slipped[i] != at.slips[i]) out.event(t, at.slips[i] ? SLIP : GRIP, i, 0.0, 0.0);
    if constexpr (touches)
      if (trajectory.opt.contacts)
        meetings_.tell(
            *trajectory.opt.contacts, at.contacts.push[0], at.contacts.n[0], t,
            M + Model::n_watched, out);
    trajectory.motors.tell(t, out);
    if (n_here % save_every == 0 || t >= next_end_) emit(out);
    return RUNNING;
  }

  ContactEvents<Model::n_contacts> meetings_;
  ContactShare<touches ? M + 3 * Model::n_contacts : 0> share_;
  ContactPush shared_[room(Model::n_contacts)];
  double last_dt_ = 0.0;   // s: of the last step
  double next_end_ = 0.0;  // the end of the run asked for: its last row is always written
};

}  // namespace fan
