// The time-stepper of a batch's bundle of lanes, as lane_batch.hpp leads it.
#pragma once

#include "led_step.hpp"

namespace fan {

template <class Model_, class Real_>
struct FixedLanes {
  using Model = Model_;
  using Real = Real_;
  using Mask = typename Traits<Real>::Mask;
  static constexpr int M = Model::n_rows;

  LedStep<Model, Real> led;
  Real t, status, worst_violation;

  void set(double start, const Options& options, const double* winches, const double* numbers) {
    t = Real(start);
    led.opt = options;
    led.winches.set(winches);
    for (int i = 0; i < Model::n_p; ++i) led.p[i] = Real(numbers[i]);
  }

  Real* q_D() { return led.state().q_D; }
  Real* v_D() { return led.state().v_D; }
  Real* slip() { return led.at.slip; }
  Real* p() { return led.p; }
  const Real* acc() const { return led.at.acc; }
  const Real* tension() const { return led.at.tension; }
  const Mask* taut() const { return led.at.taut; }
  auto& inputs() { return led.inputs(); }
  const auto& motors() const { return led.motors; }
  const double* blame_of(int lane) const { return led.blame[lane]; }
  Mask runs() const { return led.status < Real(RUNNING + 0.5); }
  Mask caught(int r) const { return led.at.taut[r] && !was_[r]; }
  Mask released(int r) const { return was_[r] && !led.at.taut[r]; }

  // Work, damping, impact and slip loss.
  void books(Real* out) const {
    out[0] = led.work;
    out[1] = led.damping;
    out[2] = led.impact;
    out[3] = led.slip_loss;
  }

  template <class Drive>
  void begin(Drive& drive) {
    drive.start(t, led.coming());
    led.take_inputs();
    led.begin();
    tell();
  }

  template <class Drive>
  void advance(Drive& drive, double from, double next) {
    for (int r = 0; r < M; ++r) was_[r] = led.at.taut[r];
    drive.at(Real(next), led.coming());
    led.advance(next - from);
    t = select(runs(), Real(next), t);
    tell();
  }

 private:
  void tell() {
    status = led.status;
    worst_violation = led.worst_violation;
  }

  Mask was_[room(M)];
};

}  // namespace fan
