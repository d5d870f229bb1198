// The time-stepper of a bundle of lanes, with the interface that runs/lane_batch.hpp calls.
#pragma once

#include "fantoccini/timestepping/trajectory.hpp"

namespace fan {

template <class Model_, class Real_>
struct FixedLanes {
  using Model = Model_;
  using Real = Real_;
  using Mask = typename Traits<Real>::Mask;
  static constexpr int M = Model::n_rows;

  TimeSteppingTrajectory<Model, Real> trajectory;
  Real t, status, worst_violation;

  void set(double start, const Options& options, const double* winches) {
    t = Real(start);
    trajectory.opt = options;
    trajectory.winches.set(winches);
  }

  Real* q_D() { return trajectory.state().q_D; }
  Real* v_D() { return trajectory.state().v_D; }
  Real* slip() { return trajectory.at.slip; }
  Real* p() { return trajectory.p; }
  const Real* acc() const { return trajectory.at.acc(); }
  const Real* tension() const { return trajectory.at.tension; }
  const Mask* taut() const { return trajectory.at.taut; }
  auto& inputs() { return trajectory.inputs(); }
  const auto& motors() const { return trajectory.motors; }
  const double* blame_of(int lane) const { return trajectory.blame[lane]; }
  Mask runs() const { return trajectory.status < Real(RUNNING + 0.5); }
  Mask caught(int r) const { return trajectory.at.taut[r] && !was_[r]; }
  Mask released(int r) const { return was_[r] && !trajectory.at.taut[r]; }

  Real contact_residual() const {
    if constexpr (TimeStep<Model, Real>::touches) return trajectory.at.contacts.residual;
    else return Real(0.0);
  }

  // Work, damping, impact, slip loss and friction.
  void books(Real* out) const {
    out[0] = trajectory.work;
    out[1] = trajectory.damping;
    out[2] = trajectory.impact;
    out[3] = trajectory.slip_loss;
    out[4] = trajectory.friction;
  }

  template <class Drive>
  void begin(Drive& drive) {
    drive.start(t, trajectory.coming());
    trajectory.take_inputs();
    trajectory.begin();
    tell();
  }

  // Takes up a trajectory that was begun before, at state() and new inputs: first the inputs, then
  // what it remembers, then the rest.
  template <class Drive>
  void resume(Drive& drive) {
    drive.start(t, trajectory.coming());
    trajectory.take_inputs();
    trajectory.at.ready(trajectory.opt);
  }

  void take_up() {
    trajectory.at.idle = !(trajectory.status < Real(RUNNING + 0.5));
    tell();
  }

  template <class Drive>
  void advance(Drive& drive, double from, double next) {
    for (int r = 0; r < M; ++r) was_[r] = trajectory.at.taut[r];
    drive.fill(Real(next), trajectory.coming());
    trajectory.advance(next - from);
    t = select(runs(), Real(next), t);
    tell();
  }

 private:
  void tell() {
    status = trajectory.status;
    worst_violation = trajectory.worst_violation;
  }

  Mask was_[room(M)];
};

}  // namespace fan
