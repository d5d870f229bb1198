// An event-driven or a time-stepping run of one trajectory.
#pragma once

#include "fantoccini/event/run.hpp"
#include "fantoccini/timestepping/run.hpp"

namespace fan {

template <class Model>
struct ModelRun {
  bool event_driven;
  EventRun<Model> event{};
  FixedRun<Model> fixed{};

  explicit ModelRun(bool event_driven) : event_driven(event_driven) {}

  Status start(const StartArrays& from, Record<Model>& out) {
    return event_driven ? start_event(from, out) : start_fixed(from, out);
  }

  Status run(double t_end, long long budget, Record<Model>& out) {
    return event_driven ? event.run(t_end, budget, out) : fixed.run(t_end, budget, out);
  }

  void emit(Record<Model>& out) { event_driven ? event.emit_present(out) : fixed.emit(out); }

  void set_input(const InputArrays& input) {
    if (event_driven) {
      event.flow.drive.set(input);
      event.resume();
    } else {
      fixed.drive.set(input);
      fixed.restart();
    }
  }

  void remember(Snapshot& memory) {
    event_driven ? event.remember(memory) : fixed.remember(memory);
  }

  RunProgress progress() const {
    if (event_driven) return {event.n_steps, event.flow.t, 0.0};
    return {fixed.n_steps, fixed.t, fixed.trajectory.worst_violation};
  }

  void tell_blame(Status status, double* out) const {
    const auto& motors = event_driven ? event.flow.motors : fixed.trajectory.motors;
    motors.blame(status, 0, out + Model::n_rows);
    const double* rows = event_driven ? event.instants.blame : fixed.trajectory.blame[0];
    for (int r = 0; r < Model::n_rows; ++r) out[r] = rows[r];
  }

 private:
  Status start_event(const StartArrays& from, Record<Model>& out) {
    auto& flow = event.flow;
    flow.opt = from.options;
    flow.drive.set(from.input);
    flow.t = from.t;
    copy(from.p, Model::n_p, flow.p);
    for (int j = 0; j < event.NY; ++j) flow.y[j] = 0.0;
    copy(from.q_D, Model::n_qD, flow.y);
    copy(from.v_D, Model::n_vD, flow.y + Model::n_qD);
    copy(from.slip, Model::n_strings, flow.slip);
    flow.winches.set(from.winches);
    event.save_at = from.save_at;
    event.n_save = from.n_save;
    return event.start(out);
  }

  Status start_fixed(const StartArrays& from, Record<Model>& out) {
    auto& trajectory = fixed.trajectory;
    trajectory.opt = from.options;
    fixed.drive.set(from.input);
    fixed.t = from.t;
    fixed.save_every = from.save_every;
    copy(from.p, Model::n_p, trajectory.p);
    copy(from.q_D, Model::n_qD, trajectory.state().q_D);
    copy(from.v_D, Model::n_vD, trajectory.state().v_D);
    copy(from.slip, Model::n_strings, trajectory.at.slip);
    trajectory.winches.set(from.winches);
    fixed.start(out);
    return RUNNING;
  }

  static void copy(const double* from, int n, double* to) {
    for (int i = 0; i < n; ++i) to[i] = from[i];
  }
};

}  // namespace fan
