// The time-stepper led by inputs: exact increments of the driven coordinates, the books, and what
// stops a trajectory. Written for any Real.
#pragma once

#include "options.hpp"
#include "pieces.hpp"
#include "status.hpp"
#include "timestepping.hpp"

namespace fan {

constexpr double kRunaway = 1e9;  // m, rad, or per second: beyond this a state means nothing

template <class Model, class Real>
struct LedStep {
  using Space = typename Model::Driven;
  using Mask = typename Traits<Real>::Mask;
  static constexpr int NQ = Model::n_qD, N = Model::n_vD, S = Model::n_strings;
  static constexpr int M = Model::n_rows, NK = Model::n_vK;

  Real q_D[room(NQ)], v_D[room(N)], p[room(Model::n_p)];
  Real q_K[room(Model::n_qK)], v_K[room(NK)], acc_K[room(NK)], u_D[room(N)];  // at present
  // The inputs at the end of the next step.
  Real q_next[room(Model::n_qK)], v_next[room(NK)], acc_next[room(NK)], u_next[room(N)];
  TimeStep<Model, Real> at;
  Winches<S> winches;
  Options opt;
  Real work, damping, impact, slip_loss, worst_violation;
  Real status;  // a Status: RUNNING, or what has stopped the trajectory

  // Takes the inputs in `next` up as the present ones.
  FAN_FN void take_inputs() {
    for (int i = 0; i < Model::n_qK; ++i) q_K[i] = q_next[i];
    for (int j = 0; j < NK; ++j) {
      v_K[j] = v_next[j];
      acc_K[j] = acc_next[j];
    }
    for (int k = 0; k < N; ++k) u_D[k] = u_next[k];
  }

  // Begins at q_D, v_D, at.slip and the present inputs. The tensions of the start are those of the
  // first step, tried and taken back.
  FAN_FN void begin() {
    const Mask no = Real(0.0) > Real(1.0);
    work = damping = impact = slip_loss = worst_violation = Real(0.0);
    status = Real(RUNNING);
    for (int r = 0; r < M; ++r) {
      at.taut[r] = at.held[r] = no;
      at.tension[r] = Real(0.0);
    }
    for (int i = 0; i < S; ++i) at.slips[i] = no;
    at.stirred = at.idle = no;
    for (int k = 0; k < N; ++k) at.acc[k] = Real(0.0);
    Real q[room(NQ)], v[room(N)], slip[room(S)];
    for (int i = 0; i < NQ; ++i) q[i] = q_D[i];
    for (int k = 0; k < N; ++k) v[k] = v_D[k];
    for (int i = 0; i < S; ++i) slip[i] = at.slip[i];
    at.step(q, v, q_K, v_K, acc_K, u_D, opt.dt, opt.recovery_speed, opt.tension_cap, winches, p);
    for (int i = 0; i < S; ++i) at.slip[i] = slip[i];
    at.stirred = no;
    for (int r = 0; r < M; ++r) at.held[r] = at.taut[r];
  }

  // A step of length dt to the inputs in `next`. A trajectory that cannot make it is stopped and
  // keeps what it had.
  FAN_FN void advance(double dt) {
    Real rate[room(NK)], mean[room(NK)];
    increment<Space>(q_K, q_next, dt, rate);
    for (int j = 0; j < NK; ++j) mean[j] = (v_next[j] - v_K[j]) * (1.0 / dt);
    Real q[room(NQ)], v[room(N)], slip[room(S)];
    for (int i = 0; i < NQ; ++i) q[i] = q_D[i];
    for (int k = 0; k < N; ++k) v[k] = v_D[k];
    for (int i = 0; i < S; ++i) slip[i] = at.slip[i];
    at.step(
        q_D, v_D, q_K, rate, mean, u_D, dt, opt.recovery_speed, opt.tension_cap, winches, p);
    judge();
    const Mask goes = status < Real(RUNNING + 0.5);
    if (any(!goes)) {
      for (int i = 0; i < NQ; ++i) q_D[i] = select(goes, q_D[i], q[i]);
      for (int k = 0; k < N; ++k) v_D[k] = select(goes, v_D[k], v[k]);
      for (int i = 0; i < S; ++i) at.slip[i] = select(goes, at.slip[i], slip[i]);
    }
    const auto book = [&](Real& sum, const Real& part) {
      sum += select(goes, part, Real(0.0));
    };
    book(work, at.work);
    book(damping, at.loss);
    book(impact, at.impact);
    book(slip_loss, at.slip_loss);
    worst_violation =
        select(goes && at.violation > worst_violation, at.violation, worst_violation);
    at.idle = !goes;
    take_inputs();
  }

 private:
  FAN_FN void judge() {
    using std::abs;
    Mask wild = Real(0.0) > Real(1.0), empty = wild;
    for (int i = 0; i < NQ; ++i) wild = wild || !(abs(q_D[i]) < Real(kRunaway));
    for (int k = 0; k < N; ++k) wild = wild || !(abs(v_D[k]) < Real(kRunaway));
    for (int i = 0; i < S; ++i)
      if (Model::length_q[i] >= 0) empty = empty || !(q_next[Model::length_q[i]] > Real(0.0));
    const auto stop = [&](const Mask& mask, Status why) {
      status = select(mask && status < Real(RUNNING + 0.5), Real(why), status);
    };
    stop(!at.settled, NOT_SETTLED);
    stop(wild, NOT_FINITE);
    stop(empty, LENGTH_NOT_POSITIVE);
  }
};

}  // namespace fan
