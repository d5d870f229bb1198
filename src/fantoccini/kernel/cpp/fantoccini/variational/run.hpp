// The variational run of one trajectory: drives the integrator by an input and writes rows.
#pragma once

#include "fantoccini/runs/drive.hpp"
#include "fantoccini/runs/record.hpp"
#include "fantoccini/runs/snapshot.hpp"
#include "fantoccini/runs/step_grid.hpp"
#include "fantoccini/variational/trajectory.hpp"

namespace fan {

template <class Model>
struct VariationalRun {
  static constexpr int N = Model::n_vD, S = Model::n_strings, M = Model::n_rows;
  using Trajectory = VariationalTrajectory<Model, double>;

  Trajectory trajectory{};
  Drive<typename Model::Driven, N> drive{};
  double origin = 0.0;
  long long n_steps = 0, n_here = 0;
  int save_every = 1;

  // The argument is there for interface/run.hpp and has no meaning here.
  explicit VariationalRun(bool = false) {}

  Status start(const StartArrays& from, Record<Model>& out) {
    save_every = from.save_every;
    drive.set(from.input);
    n_steps = 0;
    trajectory.set(from.t, from.options, from.winches);
    for (int i = 0; i < Model::n_p; ++i) trajectory.p()[i] = from.p[i];
    for (int i = 0; i < Model::n_qD; ++i) trajectory.q_D()[i] = from.q_D[i];
    for (int k = 0; k < N; ++k) trajectory.v_D()[k] = from.v_D[k];
    for (int i = 0; i < S; ++i) trajectory.slip()[i] = from.slip[i];
    Look look{drive};
    trajectory.begin(look);
    begin_grid();
    emit(out);
    return RUNNING;
  }

  // Runs until t_end, for at most `budget` steps.
  Status run(double t_end, long long budget, Record<Model>& out) {
    const StepGrid grid{origin, t_end, trajectory.opt.dt};
    while (trajectory.t < grid.end()) {
      if (budget-- <= 0 || !out.room_for(2, 2 * (M + S + Model::n_watched) + 1)) return RUNNING;
      if (n_steps >= trajectory.opt.max_steps) return TOO_MANY_STEPS;
      const bool written = n_here % save_every == 0;
      const double before = trajectory.t;
      Look look{drive};
      trajectory.advance(look, before, grid.at(n_here + 1));
      const Status status = Status(int(trajectory.status));
      const bool moved = trajectory.t > before;
      if (moved) {
        ++n_steps;
        ++n_here;
        tell(out);
      }
      const bool due = n_here % save_every == 0 || trajectory.t >= t_end;
      if (status == RUNNING ? due : moved || !written) emit(out);
      if (status != RUNNING) return status;
    }
    return trajectory.motors().verdict(0);
  }

  // Writes the present state.
  void emit(Record<Model>& out) {
    const auto& here = trajectory.node();
    out.row(
        trajectory.t, here.q_D, here.v_D, trajectory.at.acc, here.now.q_K, here.now.v_K,
        here.now.acc_K, trajectory.pull, here.taut, here.p, trajectory.work, trajectory.damping,
        trajectory.impact, trajectory.slip_loss, 0.0, here.slip);
  }

  void set_input(const InputArrays& input) {
    drive.set(input);
    restart();
  }

  RunProgress progress() const { return {n_steps, trajectory.t, trajectory.worst_violation}; }

  void tell_blame(Status status, double* out) const {
    trajectory.motors().blame(status, 0, out + M);
    for (int r = 0; r < M; ++r) out[r] = trajectory.blame[0][r];
  }

  // New inputs, or a new step grid, from here on. The driven velocities must be continuous.
  void restart() {
    Look look{drive};
    trajectory.restart(look);
    begin_grid();
  }

  void remember(Snapshot& memory) { memory.keep(trajectory, origin, n_steps, n_here); }

 private:
  using Inputs = typename Trajectory::Inputs;

  // The inputs, with the interface that VariationalTrajectory calls.
  struct Look {
    Drive<typename Model::Driven, N>& drive;

    void start(double t, Inputs& in) {
      drive.start_at(t);
      drive.evaluate(t, in.q_K, in.v_K, in.acc_K, in.u_D);
    }
    void at(double t, Inputs& in) {
      drive.look_at(t);
      drive.evaluate(t, in.q_K, in.v_K, in.acc_K, in.u_D);
    }
    void force(double t, double* u) {
      drive.look_at(t);
      drive.evaluate_force(t, u);
    }
  };

  void begin_grid() {
    origin = trajectory.t;
    n_here = 0;
  }

  // The events of the last step.
  void tell(Record<Model>& out) {
    for (int r = 0; r < M; ++r) {
      if (trajectory.caught(r)) out.event(trajectory.t, CATCH, r, trajectory.blow[r], 0.0);
      if (trajectory.released(r)) out.event(trajectory.t, RELEASE, r, 0.0, 0.0);
    }
    for (int i = 0; i < S; ++i)
      if (trajectory.slipped[i] != trajectory.slips[i])
        out.event(trajectory.t, trajectory.slips[i] ? SLIP : GRIP, i, 0.0, 0.0);
    trajectory.motors().tell(trajectory.t, out);
  }
};

}  // namespace fan
