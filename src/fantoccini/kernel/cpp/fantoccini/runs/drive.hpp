// Driven coordinates from the pieces of an input. They are at rest before its first break and after
// its last.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "fantoccini/contract.hpp"
#include "fantoccini/model/segments.hpp"

namespace fan {

template <class Space, int n_vD>
class Drive {
 public:
  // Copies the input. Call start_at() or look_at() before the next evaluation.
  void set(const InputArrays& in) {
    n_ = in.n_segments;
    breaks_.assign(in.breaks, in.breaks + n_ + 1);
    const std::size_t n = n_;
    coef_.assign(in.coef, in.coef + n * Space::n_v * n_powers);
    base_.assign(in.base, in.base + n * Space::n_q);
    force_.clear();
    if (in.force) force_.assign(in.force, in.force + n * n_vD * n_powers);
    enter(0);
  }

  // Chooses the polynomials of the step that starts at t: they hold until the next break.
  void start_at(double t) {
    choose(t, t < breaks_[0] ? BEFORE : (t >= breaks_[n_] ? AFTER : WITHIN));
  }

  // Chooses the polynomials at t only; at the last break those that end there.
  void look_at(double t) {
    choose(t, t < breaks_[0] ? BEFORE : (t > breaks_[n_] ? AFTER : WITHIN));
  }

  // The first break after t, or `none` when there is none.
  double next_break(double t, double none) const {
    const auto next = std::upper_bound(breaks_.begin(), breaks_.end(), t);
    return next == breaks_.end() ? none : *next;
  }

  // The last chosen piece: its number, start, end and polynomials.
  int segment() const { return segment_; }
  double segment_start() const { return breaks_[segment_]; }
  double segment_end() const { return breaks_[segment_ + 1]; }
  const double* segment_coef() const {
    return coef_.data() + std::size_t(segment_) * Space::n_v * n_powers;
  }

  // Inputs at the start of a run of steps.
  template <class Inputs>
  void start(double t, Inputs& in) {
    start_at(t);
    evaluate(t, in.q_K, in.v_K, in.acc_K, in.u_D);
    in.still = still_number_;
  }

  // Those at the end of a step; constant ones are written once.
  template <class Inputs>
  void fill(double t, Inputs& in) {
    look_at(t);
    if (still_number_ != 0 && in.still == still_number_) return;
    evaluate(t, in.q_K, in.v_K, in.acc_K, in.u_D);
    in.still = still_number_;
  }

  // Those at t, for steps that may end early.
  template <class Inputs>
  void at(double t, Inputs& in) {
    look_at(t);
    evaluate(t, in.q_K, in.v_K, in.acc_K, in.u_D);
  }

  // u_D only, likewise.
  void force(double t, double* u) {
    look_at(t);
    forces(t - breaks_[segment_], u);
  }

  // q_K, v_K, acc_K and u_D at t, by the last chosen polynomials.
  void evaluate(double t, double* q, double* v, double* a, double* u) const {
    const double at = phase_ == BEFORE ? breaks_[0] : (phase_ == AFTER ? breaks_[n_] : t);
    const double s = at - breaks_[segment_];
    const double* coef = segment_coef();
    const double* base = base_.data() + std::size_t(segment_) * Space::n_q;
    motion_of<Space>(coef, base, still_, s, q, v, a);
    if (phase_ != WITHIN)
      for (int j = 0; j < Space::n_v; ++j) v[j] = a[j] = 0.0;
    forces(s, u);
  }

 private:
  enum Phase { BEFORE, WITHIN, AFTER };

  void choose(double t, Phase phase) {
    const bool changes = phase != phase_;
    phase_ = phase;
    const auto next = std::upper_bound(breaks_.begin(), breaks_.end(), t);
    const int before = int(next - breaks_.begin()) - 1;
    const int segment = before < 0 ? 0 : (before >= n_ ? n_ - 1 : before);
    if (segment != segment_) enter(segment);
    else if (changes) number();
  }

  // Numbers constant inputs.
  void number() {
    bool still = phase_ != WITHIN || force_.empty();
    for (int j = 0; j < Space::n_v; ++j) still = still && (phase_ != WITHIN || still_[j]);
    still_number_ = still ? ++numbers_ : 0;
  }

  // u_D at a time s after the start of the piece.
  void forces(double s, double* u) const {
    for (int j = 0; j < n_vD; ++j) {
      double unused_rate, unused_second;
      u[j] = 0.0;
      if (force_.empty() || phase_ != WITHIN) continue;
      const double* coef = force_.data() + (std::size_t(segment_) * n_vD + j) * n_powers;
      polynomial(coef, s, u[j], unused_rate, unused_second);
    }
  }

  void enter(int segment) {
    segment_ = segment;
    const double* coef = segment_coef();
    for (int j = 0; j < Space::n_v; ++j) still_[j] = is_constant(coef + n_powers * j);
    number();
  }

  int n_ = 0, segment_ = 0;
  bool still_[array_size(Space::n_v)];
  Phase phase_ = BEFORE;
  long long still_number_ = 0, numbers_ = 0;
  std::vector<double> breaks_, coef_, base_, force_;
};

}  // namespace fan
