// A step in which contacts rebound: bodies continue with their velocities until the first one
// touches, after t, and all impulses and forces of the step act there:
//
//   q' = q moved by t v;   v+ by the law at q';   q+ = q' moved by (dt - t) v+
//
// so that a rebound happens where the solids touch, at any speed and step. If several contacts
// touch one after another, the step is made in parts, each of which ends between two touches;
// impulses are at most those of the whole step. If a string, a limit or a contact without rebound
// closes before t, the motion until the touch is a separate part. For one trajectory.
#pragma once

#include "fantoccini/contact/push.hpp"
#include "fantoccini/math/manifold.hpp"
#include "fantoccini/math/real.hpp"

namespace fan {

struct TouchingStepTolerances {
  // Accuracy of the time of a touch, relative to a step, and Newton steps for it.
  static constexpr double touch_time = 1e-12;
  static constexpr int newton_steps = 6;
  // Least remainder of a step after a touch, relative to the step, in which other points must
  // close.
  static constexpr double least_left = 1e-9;
  // m or rad: a row that closes by less before a touch closes with it.
  static constexpr double closed_gap = 1e-9;
  // Largest number of parts of a step; later touches in the last part rebound with its first.
  static constexpr int max_parts = 16;
};

template <class Model>
class TouchingStep {
 public:
  static constexpr int NQ = Model::n_qD, N = Model::n_vD, S = Model::n_strings;
  static constexpr int M = Model::n_rows, QK = Model::n_qK, C = Model::n_contacts;
  using Tolerance = TouchingStepTolerances;

  double delay = 0.0;  // s: t of the last step, or of its last part
  bool parts = false;  // whether the last step was made in parts

  // Makes a step dt of `at`, which has begun at (q_D, v_D, q_K). begin(q_D, v_D, q_K, part, left)
  // begins a part, with `left` the time after its touch; end(v_D, part, may_part) ends one with v+
  // in v_next or, if it may, requires another part first.
  template <class Step, class Begin, class End>
  FAN_FN void step(
      Step& at, const Begin& begin, const End& end, const double* q_D, const double* v_D,
      const double* q_K, const double* v_K, const double* p, double dt, double* q_next,
      const double* v_next) {
    delay = 0.0;
    parts = false;
    if (!at.contacts.has_rebound()) {
      if (end(v_D, dt, true)) return retract<typename Model::Dynamic>(q_D, v_next, dt, q_next);
      begin(q_D, v_D, q_K, dt, dt);
    }
    touch(at, begin, end, q_D, v_D, q_K, v_K, p, dt, q_next, v_next);
  }

 private:
  // As step(), with a rebound.
  template <class Step, class Begin, class End>
  FAN_OUT_OF_LINE void touch(
      Step& at, const Begin& begin, const End& end, const double* q_D, const double* v_D,
      const double* q_K, const double* v_K, const double* p, double dt, double* q_next,
      const double* v_next) {
    start(q_D, v_D, q_K);
    clear();
    loss_ = at.eval.loss;
    double left = dt;
    for (int n_parts = 1;; ++n_parts) {
      const auto [first, second] = at.contacts.touches(ContactStepTolerances::same_touch * dt);
      const bool may_part = n_parts < Tolerance::max_parts;
      double part = left;
      if (may_part && second < left) {
        part = 0.5 * (fmax(first, 0.0) + second);
        begin(q_, v_, q_K_, part, part);
      }
      const double t = at.contacts.touches(0.0).first;
      if (may_part && t > ContactStepTolerances::same_touch * dt && t < part &&
          closes_before(at, t)) {
        part = t;
        delay = 0.0;
        at.contacts.hold_back(true);
        begin(q_, v_, q_K_, part, part);
        end(v_, part, false);
        at.contacts.hold_back(false);
      } else if (
          delay = go_to_touch(at, begin, v_K, part, Tolerance::touch_time * dt);
          !end(v_, part, may_part)) {
        part = delay + 0.5 * at.contacts.next_strike();
        begin(q_, v_, q_K_, part, part);
        delay = go_to_touch(at, begin, v_K, part, Tolerance::touch_time * dt);
        end(v_, part, false);
      }
      retract<typename Model::Dynamic>(q_touch_, v_next, part - delay, q_next);
      if (delay > 0.0) at.impact += excess_potential(v_K, p, part, v_next, q_next);
      if (!parts && part == dt) return;
      parts = true;
      add(at, part);
      left -= part;
      if (!(left > 0.0)) break;
      retract<typename Model::Driven>(q_K_, v_K, part, q_K_touch_);
      start(q_next, v_next, q_K_touch_);
      begin(q_, v_, q_K_, left, left);
    }
    set_step(at, v_D, v_next, dt);
  }

  // Whether a slack string, a limit that does not push or a contact that does not rebound closes
  // before a time t from the start of the part.
  template <class Step>
  bool closes_before(const Step& at, double t) const {
    const auto closes = [&](int r, double h, double hdot) {
      return !at.taut[r] && hdot > 0.0 && h + t * hdot > Tolerance::closed_gap;
    };
    double rate[array_size(M - S)];
    at.eval.limit_rates(v_, rate);
    for (int i = 0; i < S; ++i)
      if (closes(i, at.eval.h[i], at.eval.hdot[i])) return true;
    for (int i = 0; i < M - S; ++i)
      if (closes(S + i, at.eval.h_limit[i], rate[i])) return true;
    return at.contacts.closes_before(t);
  }

  struct Totals {
    double work, impact, slip_loss, friction;
  };

  void start(const double* q_D, const double* v_D, const double* q_K) {
    for (int i = 0; i < NQ; ++i) q_[i] = q_touch_[i] = q_D[i];
    for (int k = 0; k < N; ++k) v_[k] = v_D[k];
    for (int i = 0; i < QK; ++i) q_K_[i] = q_K[i];
  }

  // Continues until a rebounding contact touches, within a part. Returns for how long. The step has
  // then begun there.
  template <class Step, class Begin>
  double go_to_touch(Step& at, const Begin& begin, const double* v_K, double part, double small) {
    double t = 0.0;
    for (int k = 0; k < Tolerance::newton_steps && at.contacts.has_rebound(); ++k) {
      const double next = fmin(fmax(t + at.contacts.touches(0.0).first, 0.0), part);
      if (!(fabs(next - t) > small)) break;
      t = next;
      retract<typename Model::Dynamic>(q_, v_, t, q_touch_);
      retract<typename Model::Driven>(q_K_, v_K, t, q_K_touch_);
      begin(q_touch_, v_, q_K_touch_, part, fmax(part - t, Tolerance::least_left * part));
    }
    return t;
  }

  // Potential energy at the end of the part if the bodies moved with v+ from its start, minus that
  // at q_next [J]. The ledger balances for the former, so the loss of the impact includes this.
  double excess_potential(
      const double* v_K, const double* p, double part, const double* v_next, const double* q_next) {
    double q[array_size(NQ)], q_K[array_size(QK)], T, V, V_next;
    const auto potential = [&](const double* at, double& out) {
      struct {
        double *T, *V;
      } energy{&T, &out};
      Call<Model, double>::energy(at, v_next, q_K, v_K, p, energy);
    };
    retract<typename Model::Dynamic>(q_, v_next, part, q);
    retract<typename Model::Driven>(q_K_, v_K, part, q_K);
    potential(q, V);
    potential(q_next, V_next);
    return V - V_next;
  }

  void clear() {
    totals_ = {0.0, 0.0, 0.0, 0.0};
    for (int r = 0; r < M; ++r) impulse_[r] = 0.0;
    for (int i = 0; i < S; ++i) slips_[i] = false;
    settled_ = true;
    violation_ = residual_ = 0.0;
    n_pushed_ = 0;
  }

  // Adds a completed part.
  template <class Step>
  void add(Step& at, double part) {
    totals_.work += at.work;
    totals_.impact += at.impact;
    totals_.slip_loss += at.slip_loss;
    totals_.friction += at.friction;
    for (int r = 0; r < M; ++r) impulse_[r] += at.tension[r] * part;
    for (int i = 0; i < S; ++i) slips_[i] = slips_[i] || at.slips[i];
    settled_ = settled_ && at.settled;
    violation_ = fmax(violation_, at.violation);
    residual_ = fmax(residual_, at.contacts.residual);
    at.contacts.join(pushed_, n_pushed_);
    n_pushed_ = at.contacts.n[0];
    for (int i = 0; i < n_pushed_; ++i) pushed_[i] = at.contacts.push[0][i];
  }

  // Leaves in `at` the whole step, which was made in parts.
  template <class Step>
  void set_step(Step& at, const double* v_D, const double* v_next, double dt) const {
    at.work = totals_.work;
    at.impact = totals_.impact;
    at.slip_loss = totals_.slip_loss;
    at.friction = totals_.friction;
    for (int r = 0; r < M; ++r) at.tension[r] = impulse_[r] * (1.0 / dt);
    for (int i = 0; i < S; ++i) at.slips[i] = slips_[i];
    at.settled = settled_;
    at.eval.loss = loss_;
    at.violation = violation_;
    at.contacts.residual = residual_;
    for (int k = 0; k < N; ++k) at.accs_[at.acc_at_][k] = (v_next[k] - v_D[k]) * (1.0 / dt);
    at.steady = false;
  }

  double q_[array_size(NQ)], v_[array_size(N)], q_K_[array_size(QK)];  // at the start of a part
  double q_touch_[array_size(NQ)], q_K_touch_[array_size(QK)];         // at its touch
  // Of the completed parts.
  Totals totals_;
  double impulse_[array_size(M)], violation_, residual_, loss_;
  bool slips_[array_size(S)], settled_;
  ContactPush pushed_[array_size(C)];
  int n_pushed_;
};

// Replaces it for puppets without contacts, and in bundles of lanes.
struct NoTouchingStep {};

}  // namespace fan
