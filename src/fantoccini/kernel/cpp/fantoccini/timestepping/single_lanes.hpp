// Lanes of a bundle that make a step as a single trajectory does: those whose contacts are not
// solved in all lanes at once (contact/lanes.hpp). Such a lane restarts from its state before the
// bundle's step, of which nothing else is used.
#pragma once

#include "fantoccini/contact/lanes.hpp"
#include "fantoccini/model/winch.hpp"

namespace fan {

template <class Model, class Real>
struct TimeStep;

template <class Model, class Real>
class SingleLanes {
  using Many = TimeStep<Model, Real>;
  using One = TimeStep<Model, double>;

 public:
  static constexpr int NQ = Model::n_qD, N = Model::n_vD, S = Model::n_strings, M = Model::n_rows;
  static constexpr int NK = Model::n_vK, QK = Model::n_qK, P = Model::n_p;
  static constexpr int width = Traits<Real>::width;
  using Mask = typename Traits<Real>::Mask;

  // Rows that pulled in a lane's first step and closed faster than its forces move them.
  Mask fast[array_size(M)];

  FAN_FN void ready(const Options& options) {
    single_.ready(options);
    for (int r = 0; r < M; ++r) fast[r] = Real(0.0) > Real(1.0);
  }

  // Saves the lanes' state before a step.
  FAN_FN void save(const Many& at) {
    for (int k = 0; k < N; ++k) {
      acc_[0][k] = at.accs_[at.acc_at_][k];
      acc_[1][k] = at.accs_[1 - at.acc_at_][k];
    }
    for (int r = 0; r < M; ++r) {
      tension_[r] = at.tension[r];
      taut_[r] = at.taut[r];
      pulled_[r] = at.pulled[r];
      held_[r] = at.held[r];
    }
    for (int i = 0; i < S; ++i) slip_[i] = at.slip[i];
    steady_ = at.steady;
    steadier_ = at.was_steady;
    stirred_ = at.was_violated;
  }

  // Makes the step of these lanes.
  FAN_FN void step(
      Many& at, const Mask& lanes, const Real* q_D, const Real* v_D, const Real* q_K,
      const Real* v_K, const Real* acc_K, const Real* u_D, double dt, double recovery_speed,
      double cap, const Winches<S>& winches, const Real* p, Real* q_next, Real* v_next) {
    for (int l = 0; l < width; ++l) {
      if (!lane_of(lanes, l)) continue;
      load(at, l);
      take(q_D, NQ, l, q_D_);
      take(v_D, N, l, v_D_);
      take(q_K, QK, l, q_K_);
      take(v_K, NK, l, v_K_);
      take(acc_K, NK, l, acc_K_);
      take(u_D, N, l, u_D_);
      take(p, P, l, p_);
      single_.step(
          q_D_, v_D_, q_K_, v_K_, acc_K_, u_D_, dt, recovery_speed, cap, winches, p_, q_next_,
          v_next_);
      for (int i = 0; i < NQ; ++i) lane_of(q_next[i], l) = q_next_[i];
      for (int k = 0; k < N; ++k) lane_of(v_next[k], l) = v_next_[k];
      store(at, l);
    }
  }

 private:
  FAN_FN static void take(const Real* from, int n, int l, double* to) {
    for (int i = 0; i < n; ++i) to[i] = lane_of(from[i], l);
  }

  FAN_FN void load(Many& at, int l) {
    take(acc_[0], N, l, single_.accs_[0]);
    take(acc_[1], N, l, single_.accs_[1]);
    single_.acc_at_ = 0;
    for (int r = 0; r < M; ++r) {
      single_.tension[r] = lane_of(tension_[r], l);
      single_.taut[r] = lane_of(taut_[r], l);
      single_.pulled[r] = lane_of(pulled_[r], l);
      single_.held[r] = lane_of(held_[r], l);
    }
    take(slip_, S, l, single_.slip);
    single_.steady = lane_of(steady_, l);
    single_.was_steady = lane_of(steadier_, l);
    single_.was_violated = lane_of(stirred_, l);
    single_.forced = at.forced;
    single_.extrapolates = at.extrapolates;
    single_.limits_near_ = single_.limits_pull_ = single_.limits_pulled_ = true;
    at.contacts.hand_over(l, single_.contacts);
  }

  FAN_FN void store(Many& at, int l) {
    for (int k = 0; k < N; ++k) lane_of(at.accs_[at.acc_at_][k], l) = single_.acc()[k];
    for (int r = 0; r < M; ++r) {
      lane_of(at.tension[r], l) = single_.tension[r];
      at.taut[r].set(l, single_.taut[r]);
      at.pulled[r].set(l, single_.pulled[r]);
      at.held[r].set(l, single_.held[r]);
      fast[r].set(l, false);
    }
    for (int i = 0; i < S; ++i) {
      lane_of(at.slip[i], l) = single_.slip[i];
      at.slips[i].set(l, single_.slips[i]);
    }
    for (int a = 0; a < single_.rows.n; ++a)
      fast[single_.rows.row[a]].set(l, single_.closes_fast(a, single_.whole));
    at.steady.set(l, single_.steady);
    at.was_steady.set(l, single_.was_steady);
    at.was_violated.set(l, single_.was_violated);
    at.settled.set(l, single_.settled);
    lane_of(at.work, l) = single_.work;
    lane_of(at.eval.loss, l) = single_.eval.loss;
    lane_of(at.impact, l) = single_.impact;
    lane_of(at.slip_loss, l) = single_.slip_loss;
    lane_of(at.friction, l) = single_.friction;
    lane_of(at.violation, l) = single_.violation;
    lane_of(at.speed_bound, l) = single_.speed_bound;
    at.limits_pull_ = at.limits_pulled_ = true;
    at.contacts.take(l, single_.contacts);
  }

  One single_;
  Real acc_[2][array_size(N)], tension_[array_size(M)], slip_[array_size(S)];
  Mask taut_[array_size(M)], pulled_[array_size(M)], held_[array_size(M)], steady_, steadier_,
      stirred_;
  // Of one lane.
  double q_D_[array_size(NQ)], v_D_[array_size(N)], q_K_[array_size(QK)], v_K_[array_size(NK)],
      acc_K_[array_size(NK)];
  double u_D_[array_size(N)], p_[array_size(P)], q_next_[array_size(NQ)], v_next_[array_size(N)];
};

}  // namespace fan
