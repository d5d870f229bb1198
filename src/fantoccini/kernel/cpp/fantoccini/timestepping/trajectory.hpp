// A trajectory of the time-stepper: follows the inputs by exact increments of the driven
// coordinates, computes the ledger and sets the status. Written for any Real, with the interface of
// runs/stepping.hpp.
#pragma once

#include "fantoccini/contract.hpp"
#include "fantoccini/model/motor_watch.hpp"
#include "fantoccini/model/segments.hpp"
#include "fantoccini/timestepping/step.hpp"

namespace fan {

template <class Model_, class Real_>
struct TimeSteppingTrajectory {
  using Model = Model_;
  using Real = Real_;
  using Space = typename Model::Driven;
  using Mask = typename Traits<Real>::Mask;
  static constexpr int NQ = Model::n_qD, N = Model::n_vD, S = Model::n_strings;
  static constexpr int M = Model::n_rows, NK = Model::n_vK, width = Traits<Real>::width;
  static constexpr bool touches = TimeStep<Model, Real>::touches;
  static constexpr bool makes_parts = false;  // a step is made as a whole, or not at all

  struct State {
    Real q_D[array_size(NQ)], v_D[array_size(N)];
  };
  struct Inputs {
    Real q_K[array_size(Model::n_qK)], v_K[array_size(NK)], acc_K[array_size(NK)],
        u_D[array_size(N)] = {};
    // Nonzero if nothing moves and no force acts: inputs with the same number are then equal.
    long long still = 0;
  };

  TimeStep<Model, Real> at;
  Winches<S> winches;
  MotorWatch<Model, Real> motors;
  Options opt;
  Real t;  // s
  Real work, damping, impact, slip_loss, friction, worst_violation;
  Real status;  // a Status: RUNNING, or the reason for the trajectory's stop
  double attribution[width][array_size(M)];  // of the rows for the status, 0 to 1

  // Sets the time and options of all lanes; states and parameters are set afterwards.
  FAN_FN void set(double start, const Options& options, const double* table) {
    t = Real(start);
    opt = options;
    winches.set(table);
  }

  FAN_FN State& state() { return states_[state_]; }
  FAN_FN Inputs& inputs() { return inputs_[inputs_at_]; }           // at present
  FAN_FN Inputs& next_inputs() { return inputs_[1 - inputs_at_]; }  // at the end of the next step

  Real* q_D() { return state().q_D; }
  Real* v_D() { return state().v_D; }
  Real* slip() { return at.slip; }
  Real* p() { return p_; }
  const Real* acc() const { return at.acc(); }
  const Real* tension() const { return at.tension; }
  const Mask* taut() const { return at.taut; }
  FAN_FN Mask runs() const { return status < Real(RUNNING + 0.5); }

  // Of the last step.
  Mask caught(int r) const { return at.taut[r] && !was_[r]; }
  Mask released(int r) const { return was_[r] && !at.taut[r]; }
  Real catch_impulse(int r, double dt) const { return at.tension[r] * dt; }
  Mask slip_begun(int i) const { return at.slips[i] && !slipped_[i]; }
  Mask slip_ended(int i) const { return slipped_[i] && !at.slips[i]; }

  Real contact_residual() const {
    if constexpr (touches) return at.contacts.residual;
    else return Real(0.0);
  }

  // Work, damping, impact, slip loss and friction.
  void energy_terms(Real* out) const {
    out[0] = work;
    out[1] = damping;
    out[2] = impact;
    out[3] = slip_loss;
    out[4] = friction;
  }

  // Sets new inputs from the present time on.
  template <class Drive>
  FAN_FN void restart(Drive& drive) {
    drive.start(t, next_inputs());
    advance_inputs();
  }

  // Resumes an earlier trajectory from state() and new inputs. Its memory is to be read next, and
  // continue_from() called then.
  template <class Drive>
  void resume(Drive& drive) {
    restart(drive);
    at.ready(opt);
  }
  void continue_from() { at.idle = !runs(); }

  // To be called after the bytes of this object were read (runs/snapshot.hpp): their pointers are
  // invalid.
  void attach(const ContactArrays* solids) {
    opt.contacts = at.solids = solids;
    inputs().still = next_inputs().still = 0;  // another drive has its own numbers
  }

  // Begins at state(), at.slip and the inputs at t. The tensions of the start are those of the
  // first step, which is made and undone.
  template <class Drive>
  FAN_FN void begin(Drive& drive) {
    restart(drive);
    const Mask no = Real(0.0) > Real(1.0);
    work = damping = impact = slip_loss = friction = worst_violation = Real(0.0);
    status = Real(RUNNING);
    for (int r = 0; r < M; ++r) {
      at.set_row(r, no, no);
      at.tension[r] = Real(0.0);
    }
    for (int i = 0; i < S; ++i) at.slips[i] = no;
    at.was_violated = at.idle = no;
    at.ready(opt);
    for (int l = 0; l < width; ++l)
      for (int r = 0; r < M; ++r) attribution[l][r] = 0.0;
    at.clear_acc();
    at.forget(!no);
    Real slip[array_size(S)];
    for (int i = 0; i < S; ++i) slip[i] = at.slip[i];
    step(inputs().v_K, inputs().acc_K, opt.dt, true);
    for (int i = 0; i < S; ++i) at.slip[i] = slip[i];
    at.was_violated = no;
    at.forget(!no);
    hold();
    if constexpr (touches) at.contacts.take_as_resting();
    motors.begin(state().q_D, inputs().q_K, p_);
    lost_ = last_loss_ = Real(0.0);
    last_dt_ = Real(0.0);
  }

  // Memory of previous steps for a later one, besides state(), the inputs and p.
  template <class Memory>
  FAN_FN void remember(Memory& memory) {
    at.remember(memory);
    motors.remember(memory);
    memory.keep(
        work, damping, impact, slip_loss, friction, worst_violation, status, lost_, last_loss_,
        last_root_, last_dt_);
    memory.keep_of_lanes(attribution);
  }

  // Makes a step of length dt to the time `next` and the inputs there. A trajectory for which it
  // fails is stopped and keeps its state.
  template <class Drive>
  FAN_FN void advance(Drive& drive, double next, double dt) {
    for (int r = 0; r < M; ++r) was_[r] = at.taut[r];
    for (int i = 0; i < S; ++i) slipped_[i] = at.slips[i];
    drive.fill(Real(next), next_inputs());
    advance(dt);
    t = select(runs(), Real(next), t);
  }

 private:
  // Makes the coming inputs the present ones.
  FAN_FN void advance_inputs() { inputs_at_ = 1 - inputs_at_; }

  // Steps to the coming inputs.
  FAN_FN void advance(double dt) {
    Real slip[array_size(S)];
    for (int i = 0; i < S; ++i) slip[i] = at.slip[i];
    if (inputs().still != 0 && inputs().still == next_inputs().still) {
      step(inputs().v_K, inputs().acc_K, dt, false);
    } else {
      Real rate[array_size(NK)], mean[array_size(NK)];
      increment<Space>(inputs().q_K, next_inputs().q_K, dt, rate);
      const Real *v_K = inputs().v_K, *v_K_next = next_inputs().v_K;
      each<NK>([&](int j) FAN_INLINE { mean[j] = (v_K_next[j] - v_K[j]) * (1.0 / dt); });
      step(rate, mean, dt, true);
    }
    add_loss(dt);
    set_status();
    const Mask running = runs();
    State &old = state(), &next_state = stepped();
    if (any(!running)) {
      for (int i = 0; i < NQ; ++i)
        next_state.q_D[i] = select(running, next_state.q_D[i], old.q_D[i]);
      for (int k = 0; k < N; ++k)
        next_state.v_D[k] = select(running, next_state.v_D[k], old.v_D[k]);
      for (int i = 0; i < S; ++i) at.slip[i] = select(running, at.slip[i], slip[i]);
    }
    state_ = 1 - state_;
    const auto add = [&](Real& sum, const Real& part) { sum += select(running, part, Real(0.0)); };
    add(work, at.work);
    damping = select(running, Real(lost_ + estimated_loss()), damping);
    add(impact, at.impact);
    add(slip_loss, at.slip_loss);
    add(friction, at.friction);
    worst_violation =
        select(running && at.violation > worst_violation, at.violation, worst_violation);
    at.idle = !running;
    advance_inputs();
    const auto& in = inputs();
    motors.observe(state().q_D, state().v_D, in.q_K, in.v_K, in.acc_K, p_, running);
  }

  // Holds rows that pull at the start, except those that close faster than the forces of a step
  // move them: these are caught from the first step on.
  FAN_FN void hold() {
    for (int r = 0; r < M; ++r) at.held[r] = at.taut[r] && !at.closed_fast_singly(r);
    for (int a = 0; a < at.rows.n; ++a) {
      const int r = at.rows.row[a];
      at.held[r] = at.held[r] && !at.closes_fast(a, opt.dt);
    }
    for (int r = 0; r < M; ++r) at.pulled[r] = at.held[r];
  }

  FAN_FN State& stepped() { return states_[1 - state_]; }  // result of a step from state()

  FAN_FN void step(const Real* v_K, const Real* acc_K, double dt, bool forced) {
    State &from = state(), &to = stepped();
    at.forced = forced;
    at.step(
        from.q_D, from.v_D, inputs().q_K, v_K, acc_K, inputs().u_D, dt, opt.recovery_speed,
        opt.tension_cap, winches, p_, to.q_D, to.v_D);
  }

  // Damping and drag act at v+, so that a step loses
  //
  //   dt v+ . D (v + v+) / 2,   which is   dt/2 sqrt(P+) (sqrt(P) + sqrt(P+))
  //
  // with the powers P = v . D v at its ends, if D v keeps its direction. P+ is known at the next
  // step, which therefore adds the loss of the step before.
  FAN_FN void add_loss(double dt) {
    using std::sqrt;
    const Real power = at.eval.loss, root = sqrt(select(power > Real(0.0), power, Real(0.0)));
    last_loss_ = 0.5 * last_dt_ * root * (root + last_root_);
    lost_ += last_loss_;
    last_root_ = root;
    last_dt_ = Real(dt);
  }

  // Estimate of the last step's loss while only P at its start is known: that of the previous step,
  // at most dt P.
  FAN_FN Real estimated_loss() const {
    const Real largest = last_dt_ * last_root_ * last_root_;
    return select(last_loss_ < largest, last_loss_, largest);
  }

  // Sets the status after a step.
  FAN_FN void set_status() {
    const State& next_state = stepped();
    const Real bound = Real(max_state_norm * max_state_norm), square = squares<NQ>(next_state.q_D);
    Mask overflow = !(square + at.speed_bound < bound);
    if (any(overflow)) overflow = !(square + squares<N>(next_state.v_D) < bound);
    Mask empty = Real(0.0) > Real(1.0);
    for (int i = 0; i < S; ++i) empty = empty || is_empty(i);
    const auto stop = [&](const Mask& mask, Status why) {
      status = select(mask && runs(), Real(why), status);
    };
    stop(motors.gone, RUNAWAY);
    stop(!at.settled, NOT_SETTLED);
    if constexpr (touches) {
      Real too_many = Real(0.0);
      for (int l = 0; l < width; ++l) lane_of(too_many, l) = at.contacts.too_many(l) ? 1.0 : 0.0;
      stop(too_many > Real(0.5), TOO_MANY_CONTACTS);
    }
    stop(overflow, NOT_FINITE);
    const Mask runs_out = empty && runs();
    if (any(runs_out)) attribute_to_empty(runs_out);
    stop(runs_out, LENGTH_NOT_POSITIVE);
  }

  // Whether the length of a driven or wound string has run out.
  FAN_FN Mask is_empty(int i) {
    if (Model::length_q[i] < 0 && Model::wound_q[i] < 0) return Real(0.0) > Real(1.0);
    return !(
        string_length<Model, Real>(i, stepped().q_D, next_inputs().q_K) >
        Real(LengthTolerances::min_length));
  }

  void attribute_to_empty(const Mask& lanes) {
    for (int i = 0; i < S; ++i) {
      const Mask empty = lanes && is_empty(i);
      for (int l = 0; l < width; ++l)
        attribution[l][i] = lane_of(empty, l) ? 1.0 : attribution[l][i];
    }
  }

  // J: losses before the last step, and of the previous step; sqrt(P) at the last step's start.
  Real lost_, last_loss_, last_root_ = Real(0.0);
  Real last_dt_ = Real(0.0);  // s: length of the last step; 0 before the first one
  Mask was_[array_size(M)],
      slipped_[array_size(S)];  // before the last step: taut rows, slipping winches
  Real p_[array_size(Model::n_p)];
  State states_[2];
  Inputs inputs_[2];
  int state_ = 0, inputs_at_ = 0;
};

}  // namespace fan
