// The time-stepping run of one trajectory: drives the time-stepper by an input and writes rows.
#pragma once

#include "drive.hpp"
#include "led_step.hpp"
#include "memory.hpp"
#include "record.hpp"

namespace fan {

template <class Model>
struct FixedRun {
  static constexpr int N = Model::n_vD, S = Model::n_strings, M = Model::n_rows;

  LedStep<Model, double> led;
  Drive<typename Model::Driven, N> drive;
  double t = 0.0, origin = 0.0;
  long long n_steps = 0, n_here = 0;
  int save_every = 1;

  void start(Record<Model>& out) {
    restart();
    led.begin();
    emit(out);
  }

  // Runs until t_end, for at most `budget` steps.
  Status run(double t_end, long long budget, Record<Model>& out) {
    next_end_ = t_end;
    const double least = 1e-9 * fmin(led.opt.dt, t_end - origin);
    while (t < t_end - least) {
      if (budget-- <= 0 || !out.room_for(2, M + S + 2 * Model::n_watched + 1)) return RUNNING;
      if (n_steps >= led.opt.max_steps) return TOO_MANY_STEPS;
      double next = origin + double(n_here + 1) * led.opt.dt;
      if (next > t_end - 1e-6 * led.opt.dt) next = t_end;
      const Status status = advance(next, out);
      if (status != RUNNING) return status;
    }
    return led.motors.verdict(0);
  }

  // Writes the present state.
  void emit(Record<Model>& out) {
    const auto& state = led.state();
    const auto& in = led.inputs();
    out.row(
        t, state.q_D, state.v_D, led.at.acc, in.q_K, in.v_K, in.acc_K, led.at.tension, led.at.taut,
        led.p, led.work, led.damping, led.impact, led.slip_loss, led.at.slip);
  }

  // New inputs, or a new step grid, from here on.
  void restart() {
    drive.start_at(t);
    look(t);
    led.take_inputs();
    origin = t;
    n_here = 0;
  }

  void remember(Memory& memory) { memory.keep(led, t, origin, n_steps, n_here); }

 private:
  void look(double when) {
    auto& in = led.coming();
    drive.evaluate(when, in.q_K, in.v_K, in.acc_K, in.u_D);
  }

  Status advance(double next, Record<Model>& out) {
    const double dt = next - t;
    drive.look_at(next);
    look(next);
    bool was[room(M)], slipped[room(S)];
    for (int r = 0; r < M; ++r) was[r] = led.at.taut[r];
    for (int i = 0; i < S; ++i) slipped[i] = led.at.slips[i];
    led.advance(dt);
    const Status status = Status(int(led.status));
    if (status != RUNNING) return status;
    ++n_steps;
    ++n_here;
    t = next;
    const TimeStep<Model, double>& at = led.at;
    for (int r = 0; r < M; ++r)
      if (was[r] != at.taut[r])
        out.event(t, at.taut[r] ? CATCH : RELEASE, r, at.taut[r] ? at.tension[r] * dt : 0.0, 0.0);
    for (int i = 0; i < S; ++i)
      if (slipped[i] != at.slips[i]) out.event(t, at.slips[i] ? SLIP : GRIP, i, 0.0, 0.0);
    led.motors.tell(t, out);
    if (n_here % save_every == 0 || t >= next_end_) emit(out);
    return RUNNING;
  }

  double next_end_ = 0.0;  // the end of the run asked for: its last row is always written
};

}  // namespace fan
