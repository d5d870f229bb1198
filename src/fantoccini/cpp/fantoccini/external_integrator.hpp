// An event-driven run whose steps an external integrator makes, any that the caller likes. It asks
// for the flow with the active set frozen and its guards at the states it tries and says what it
// has reached; everything else (projection, detectors, impulses, modes, breaks, rows) is
// EventRun's.
#pragma once

#include "event.hpp"

namespace fan {

template <class Model>
struct ExternalRun : EventRun<Model> {
  using Base = EventRun<Model>;
  using F = typename Base::F;
  using Base::flow, Base::guards;

  // What the flow is at (t, y) with the active set frozen; each of the results may be null.
  struct Look {
    double* rate;   // (NY,)
    double* guard;  // by row and drive, positive where the row's state no longer holds (guards.hpp)
    double* met;    // likewise, how far beyond its root a guard may be at its event
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

  // As begin_stretch; what the clock does not resolve of the stretch is passed at once.
  Status stretch(double t_end, double* end, Record<Model>& out) {
    if (this->at_break_) this->refresh();
    const Status status = this->begin_stretch(t_end, end, out);
    smooth_until_ = *end;
    if (status == RUNNING && *end - flow.t <= guards.resolution()) {
      flow.t = *end;
      this->at_break_ = true;
    }
    return status;
  }

  // Takes (t, y), which the step from the present state has reached.
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

  // Deals with the guards that are positive at the present state.
  Status react(Record<Model>& out) {
    this->refresh();
    return this->instant(out);
  }

  // Writes the row of the next time to save, at which the step's dense output is y.
  void save(double t, double* y, Record<Model>& out) {
    ++this->next_save;
    if (settle(t, y) != RUNNING) return;
    double rate[F::NY];
    flow.evaluate(t, y, rate);
    this->write(t, y, out);
  }

  // Writes the present state, wherever the flow has been looked at since.
  void present(Record<Model>& out) {
    this->refresh();
    this->emit(out);
  }

 private:
  double smooth_until_ = 0.0;
};

}  // namespace fan
