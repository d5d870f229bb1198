// The variational run of one trajectory: drives the integrator by an input and writes rows.
#pragma once

#include "drive.hpp"
#include "led_variation.hpp"
#include "memory.hpp"
#include "record.hpp"

namespace fan {

template <class Model>
struct VariationalRun {
  static constexpr int N = Model::n_vD, S = Model::n_strings, M = Model::n_rows;
  using Led = LedVariation<Model, double>;

  Led led{};
  Drive<typename Model::Driven, N> drive{};
  double origin = 0.0;
  long long n_steps = 0, n_here = 0;
  int save_every = 1;

  explicit VariationalRun(bool = false) {}

  Status start(const StartArrays& from, Record<Model>& out) {
    save_every = from.save_every;
    drive.set(from.input);
    n_steps = 0;
    led.set(from.t, from.options, from.winches, from.p);
    for (int i = 0; i < Model::n_qD; ++i) led.q_D()[i] = from.q_D[i];
    for (int k = 0; k < N; ++k) led.v_D()[k] = from.v_D[k];
    for (int i = 0; i < S; ++i) led.slip()[i] = from.slip[i];
    Look look{drive};
    led.begin(look);
    begin_grid();
    emit(out);
    return RUNNING;
  }

  // Runs until t_end, for at most `budget` steps.
  Status run(double t_end, long long budget, Record<Model>& out) {
    const double dt = led.opt.dt;
    const double least = 1e-9 * fmin(dt, t_end - origin);
    while (led.t < t_end - least) {
      if (budget-- <= 0 || !out.room_for(2, 2 * (M + S + Model::n_watched) + 1)) return RUNNING;
      if (n_steps >= led.opt.max_steps) return TOO_MANY_STEPS;
      double next = origin + double(n_here + 1) * dt;
      if (next > t_end - 1e-6 * dt) next = t_end;
      const bool written = n_here % save_every == 0;
      const double before = led.t;
      Look look{drive};
      led.advance(look, before, next);
      const Status status = Status(int(led.status));
      const bool moved = led.t > before;
      if (moved) {
        ++n_steps;
        ++n_here;
        tell(out);
      }
      const bool due = n_here % save_every == 0 || led.t >= t_end;
      if (status == RUNNING ? due : moved || !written) emit(out);
      if (status != RUNNING) return status;
    }
    return led.motors().verdict(0);
  }

  // Writes the present state.
  void emit(Record<Model>& out) {
    const auto& here = led.node();
    out.row(
        led.t, here.q_D, here.v_D, led.at.acc, here.now.q_K, here.now.v_K, here.now.acc_K,
        led.pull, here.taut, here.p, led.work, led.damping, led.impact, led.slip_loss, here.slip);
  }

  void set_input(const InputArrays& input) {
    drive.set(input);
    restart();
  }

  RunProgress progress() const { return {n_steps, led.t, led.worst_violation}; }

  void tell_blame(Status status, double* out) const {
    led.motors().blame(status, 0, out + M);
    for (int r = 0; r < M; ++r) out[r] = led.blame[0][r];
  }

  // New inputs, or a new step grid, from here on; the velocities of the driven coordinates go on.
  void restart() {
    Look look{drive};
    led.restart(look);
    begin_grid();
  }

  void remember(Memory& memory) { memory.keep(led, origin, n_steps, n_here); }

 private:
  using Inputs = typename Led::Inputs;

  // The inputs as LedVariation looks at them.
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
    origin = led.t;
    n_here = 0;
  }

  // The events of the last step.
  void tell(Record<Model>& out) {
    for (int r = 0; r < M; ++r) {
      if (led.caught(r)) out.event(led.t, CATCH, r, led.blow[r], 0.0);
      if (led.released(r)) out.event(led.t, RELEASE, r, 0.0, 0.0);
    }
    for (int i = 0; i < S; ++i)
      if (led.slipped[i] != led.slips[i])
        out.event(led.t, led.slips[i] ? SLIP : GRIP, i, 0.0, 0.0);
    led.motors().tell(led.t, out);
  }
};

}  // namespace fan
