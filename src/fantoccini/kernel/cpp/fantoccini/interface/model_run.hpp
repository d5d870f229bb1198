// An event-driven or a time-stepping run of one trajectory.
#pragma once

#include "fantoccini/event/run.hpp"
#include "fantoccini/runs/grid_run.hpp"
#include "fantoccini/timestepping/trajectory.hpp"

namespace fan {

template <class Model>
struct ModelRun {
  bool event_driven;
  EventRun<Model> event{};
  GridRun<TimeSteppingTrajectory<Model, double>> fixed{};

  explicit ModelRun(bool event_driven) : event_driven(event_driven) {}

  Status start(const StartArrays& from, Record<Model>& out) {
    return event_driven ? event.start(from, out) : fixed.start(from, out);
  }

  Status run(double t_end, long long budget, Record<Model>& out) {
    return event_driven ? event.run(t_end, budget, out) : fixed.run(t_end, budget, out);
  }

  void emit(Record<Model>& out) { event_driven ? event.emit_present(out) : fixed.emit(out); }

  void set_input(const InputArrays& input) {
    event_driven ? event.set_input(input) : fixed.set_input(input);
  }

  void remember(Snapshot& memory) {
    event_driven ? event.remember(memory) : fixed.remember(memory);
  }

  RunProgress progress() const { return event_driven ? event.progress() : fixed.progress(); }

  void write_attribution(Status status, double* out) const {
    event_driven ? event.write_attribution(status, out) : fixed.write_attribution(status, out);
  }
};

}  // namespace fan
