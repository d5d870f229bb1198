// A run of one trajectory with fixed steps: driven by an input, written row by row.
#pragma once

#include "fantoccini/contact/events.hpp"
#include "fantoccini/contact/share.hpp"
#include "fantoccini/runs/drive.hpp"
#include "fantoccini/runs/record.hpp"
#include "fantoccini/runs/snapshot.hpp"
#include "fantoccini/runs/stepping.hpp"

namespace fan {

template <class Trajectory>
class GridRun {
 public:
  using Model = typename Trajectory::Model;

  // The argument exists for interface/run.hpp and has no meaning here.
  explicit GridRun(bool = false) {}

  Status start(const StartArrays& from, Record<Model>& out) {
    trajectory_.set(from.t, from.options, from.winches);
    load_start(trajectory_, 0, from);
    save_every_ = from.save_every;
    drive_.set(from.input);
    trajectory_.begin(drive_);
    count_ = {from.t, from.options.dt};
    origin_ = from.t;
    if constexpr (touches)
      if (trajectory_.opt.contacts) {
        const auto& at = trajectory_.at.contacts;
        meetings_.begin(*trajectory_.opt.contacts, at.push[0], at.n[0]);
      }
    emit(out);
    return RUNNING;
  }

  // Runs until t_end, for at most `budget` steps.
  Status run(double t_end, long long budget, Record<Model>& out) {
    Writer writer{*this, out, t_end, budget};
    make_steps(trajectory_, drive_, StepGrid{origin_, t_end, trajectory_.opt.dt}, count_, writer);
    return verdict(trajectory_, 0, writer.ended);
  }

  // Writes the present state.
  void emit(Record<Model>& out) {
    const auto& in = trajectory_.inputs();
    double energy_terms[5];
    trajectory_.energy_terms(energy_terms);
    out.row(
        trajectory_.t, trajectory_.q_D(), trajectory_.v_D(), trajectory_.acc(), in.q_K, in.v_K,
        in.acc_K, trajectory_.tension(), trajectory_.taut(), trajectory_.p(), energy_terms,
        trajectory_.slip());
    if constexpr (touches) {
      auto& at = trajectory_.at;
      const int n = at.contacts.shared(at.eval, at.rows, share_, shared_);
      for (int i = 0; i < n; ++i) shared_[i].gap = closed_gap(shared_[i], count_.dt);
      out.touching(shared_, n, count_.dt, at.contacts.residual);
    }
  }

  // Starts new inputs and a new step grid at the present time.
  void set_input(const InputArrays& input) {
    drive_.set(input);
    trajectory_.restart(drive_);
    origin_ = trajectory_.t;
    count_.n_grid = 0;
  }

  void remember(Snapshot& memory) {
    const ContactArrays* contacts = trajectory_.opt.contacts;
    memory.keep(trajectory_, count_, origin_, meetings_);
    trajectory_.attach(contacts);
  }

  Trajectory& trajectory() { return trajectory_; }

  RunProgress progress() const {
    return {count_.n_total, trajectory_.t, trajectory_.worst_violation};
  }

  void write_attribution(Status status, double* out) const {
    fan::write_attribution(trajectory_, status, 0, out);
  }

 private:
  static constexpr int S = Model::n_strings, M = Model::n_rows;
  static constexpr bool touches = Trajectory::touches;
  static constexpr int C = touches ? Model::n_contacts : 0;
  static constexpr int max_events =  // per step
      2 * M + S + 2 * Model::n_watched + 1 + ContactEvents<C>::most;

  // Writes the rows due after a step, while there is space.
  struct Writer {
    GridRun& run;
    Record<Model>& out;
    double t_end;
    long long budget;
    Status ended = DONE;  // at the end of the grid; else the reason for leaving it

    bool ready(const StepCount& count) {
      if (budget-- <= 0 || !out.room_for(2, max_events)) ended = RUNNING;
      else if (count.n_total >= run.trajectory_.opt.max_steps) ended = TOO_MANY_STEPS;
      return ended == DONE;
    }

    void record(const StepCount& count, bool moved) {
      if (moved) run.tell(out);
      const bool on_time = count.n_grid % run.save_every_ == 0;
      const bool stopped = !run.trajectory_.runs();
      if (!stopped ? on_time || count.t >= t_end : Trajectory::makes_parts && (moved || !on_time))
        run.emit(out);
    }
  };

  // Writes the events of the last step.
  void tell(Record<Model>& out) {
    const double t = trajectory_.t;
    for (int r = 0; r < M; ++r) {
      if (trajectory_.caught(r))
        out.event(t, CATCH, r, trajectory_.catch_impulse(r, count_.dt), 0.0);
      if (trajectory_.released(r)) out.event(t, RELEASE, r, 0.0, 0.0);
    }
    for (int i = 0; i < S; ++i) {
      if (trajectory_.slip_begun(i)) out.event(t, SLIP, i, 0.0, 0.0);
      if (trajectory_.slip_ended(i)) out.event(t, GRIP, i, 0.0, 0.0);
    }
    if constexpr (touches)
      if (trajectory_.opt.contacts) {
        const auto& at = trajectory_.at.contacts;
        meetings_.write(
            *trajectory_.opt.contacts, at.push[0], at.n[0], t, M + Model::n_watched, out);
      }
    trajectory_.motors.tell(t, out);
  }

  Trajectory trajectory_{};
  Drive<typename Model::Driven, Model::n_vD> drive_{};
  StepCount count_{};
  double origin_ = 0.0;  // s: of the grid
  int save_every_ = 1;
  ContactEvents<C> meetings_;
  ContactShare<touches ? M + 3 * C : 0> share_;
  ContactPush shared_[array_size(C)];
};

}  // namespace fan
