// An event-driven run whose steps an external integrator makes. The caller evaluates the flow with
// the active set frozen, and its guards, at any states, and hands in the state it has reached.
// Everything else (projection, detectors, impulses, active sets, breaks, rows) is EventRun's.
#pragma once

#include "fantoccini/event/run.hpp"

namespace fan {

template <class Model>
struct ExternalRun : EventRun<Model> {
  using Base = EventRun<Model>;
  using F = typename Base::F;
  using Base::flow, Base::guards;

  // The flow at (t, y) with the active set frozen; each of the results may be null.
  struct Look {
    double* rate;   // (NY,)
    double* guard;  // by row and drive, positive where the row's state no longer holds (guards.hpp)
    double* met;    // likewise, the largest value of a guard at its event
    double* slip;   // (S,) m
  };

  void look(double t, const double* y, const Look& out) {
    double rate[F::NY];
    flow.evaluate(t, y, out.rate ? out.rate : rate);
    for (int r = 0; out.guard && r < F::ALL; ++r) out.guard[r] = guards.guard(r);
    for (int r = 0; out.met && r < F::ALL; ++r) out.met[r] = guards.met(r);
    for (int i = 0; out.slip && i < F::S; ++i) out.slip[i] = flow.slip_now[i];
  }

  // Brings (t, y) to unit quaternions and onto the held rows.
  Status settle(double t, double* y) {
    double rate[F::NY];
    normalise_all<typename Model::Dynamic>(y);
    flow.evaluate(t, y, rate);
    return flow.project(t, y);
  }

  // As begin_stretch, but skips a stretch that the clock does not resolve.
  Status stretch(double t_end, double* end, Record<Model>& out) {
    if (this->at_break_) this->instants.refresh();
    const Status status = this->begin_stretch(t_end, end, out);
    smooth_until_ = *end;
    if (status == RUNNING && *end - flow.t <= guards.resolution()) {
      flow.t = *end;
      this->at_break_ = true;
    }
    return status;
  }

  // Accepts (t, y) as the end of a step from the present state. Times to save before t must have
  // been saved: the dense output of EventRun is not that of this step.
  Status accept_reached(double t, const double* y, Record<Model>& out) {
    ++this->n_steps;
    for (int j = 0; j < F::NY; ++j) flow.end[j] = y[j];
    Status status = settle(t, flow.end);
    if (status != RUNNING) return status;
    flow.evaluate(t, flow.end, flow.end_rate);
    status = this->accept(t - flow.t, t, out);
    this->at_break_ = flow.t >= smooth_until_;
    return status;
  }

  // Handles the event at the present state.
  Status react(Record<Model>& out) {
    this->instants.refresh();
    return this->instants.instant(out);
  }

  // Writes the row of the next time to save, at which the step's dense output is y.
  Status save(double t, double* y, Record<Model>& out) {
    ++this->next_save;
    const Status status = settle(t, y);
    if (status != RUNNING) return status;
    for (int j = 0; j < F::NY; ++j)
      if (!is_finite(y[j])) return NOT_FINITE;
    double rate[F::NY];
    flow.evaluate(t, y, rate);
    this->instants.writer.write(t, y, out);
    return RUNNING;
  }

  // Writes the present state, wherever the flow was evaluated last.
  void present(Record<Model>& out) {
    this->instants.refresh();
    this->instants.writer.emit(out);
  }

 private:
  double smooth_until_ = 0.0;
};

}  // namespace fan
