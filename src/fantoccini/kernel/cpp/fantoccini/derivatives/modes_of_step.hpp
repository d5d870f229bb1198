// The points that push in a step, held in their modes together with the strings and limits, and
// their effect on the step's derivatives.
#pragma once

#include "fantoccini/contact/push.hpp"
#include "fantoccini/derivatives/contact_partials.hpp"
#include "fantoccini/derivatives/step_columns.hpp"
#include "fantoccini/derivatives/step_delay.hpp"
#include "fantoccini/model/evaluation.hpp"
#include "fantoccini/solvers/mode_system.hpp"

FAN_LOOPS_BEGIN

namespace fan {

struct ModesOfStepTolerances {
  // Redistributed force, relative to the largest, to test whether motions depend on the
  // distribution.
  static constexpr double shift = 0.1;
  // Relative change of a derivative that counts as such a dependence, and derivatives that are
  // rounding, relative to the largest of all.
  static constexpr double depends = 1e-6, rounding = 1e-8;
};

template <class Model>
class ModesOfStep {
 public:
  static constexpr int N = Model::n_vD, K = Model::n_vK, P = Model::n_p, E = N + K;
  static constexpr int M = Model::n_rows, C = Model::n_contacts, R = M + 3 * C;
  using Eval = Evaluation<Model, double>;
  using Columns = StepColumns<Model>;

  void begin(
      const StepContact* points, int n, const double* screws, const double* by_p, double dt) {
    n_ = n < C ? n : C;
    for (int i = 0; i < n_; ++i) point_[i] = points[i];
    screws_ = screws;
    by_p_ = by_p;
    dt_ = dt;
  }

  // w <- w + F^-T Q with the generalised forces Q of all points.
  void push(const Eval& eval, double* w) {
    double Q[array_size(N)] = {}, out[array_size(N)];
    partials_.begin(screws_, Q, Q, none_, by_p_, dt_);
    for (int i = 0; i < n_; ++i) partials_.push(point_[i], Q);
    Model::solve_factor_transposed_of(eval.L, Q, out);
    for (int k = 0; k < N; ++k) w[k] += out[k];
  }

  // The velocities before and after the step.
  void move(const double* v_D, const double* v_next, const double* rate) {
    partials_.begin(screws_, v_D, v_next, rate, by_p_, dt_);
  }

  // Changes of the gap of the first rebounding point that touches, as in ContactPartials; null if
  // there is none.
  const double* touch_by() {
    const int i = first_touch(point_, n_);
    return i < 0 ? nullptr : partials_.gap_by(point_[i]);
  }

  // Finds dt dacc and, unless null, writes the changes `pull` of the tensions and `shares` of the
  // points' multipliers, with the held rows and their changes `rate_by` and the changes `force` of
  // the residual, all in bundles. Returns the reason if there are no derivatives.
  int solve(
      const Eval& eval, const RowSystem<Model, double>& rows, const Columns& columns, Wide* force,
      const Wide* rate_by, Wide* pull, Wide* shares) {
    columns_ = &columns;
    n_held_ = rows.n;
    for (int a = 0; a < rows.n; ++a) {
      for (int k = 0; k < N; ++k) system_.C[a][k] = system_.B[a][k] = rows.column[a][k];
      for (int b = 0; b < columns.n_bundles; ++b) rate_[b * R + a] = rate_by[b * M + a];
    }
    assemble(eval, force);
    const bool jams = !system_.factorise();
    solve(eval, force, solution_, pull, shares);
    solve_delay(eval);
    if (jams) return JAMS;
    bool slides = false;
    for (int i = 0; i < n_; ++i) slides = slides || !point_[i].sticks;
    double idle[array_size(R)];
    const bool is_open = slides && system_.idle(idle);
    if (is_open && depends(eval, force, idle)) return OPEN_SHARES;
    return 0;
  }

  // dt dacc, in bundles.
  Wide* solution() { return solution_; }

  // Derivatives by the time of the touch at a fixed place: dt dacc, and of the tensions and the
  // points' multipliers, in the order of solve().
  const double* solution_by_delay() const { return by_delay_; }
  const double* pull_by_delay() const { return pull_by_delay_; }
  const double* shares_by_delay() const { return pull_by_delay_ + n_held_; }

  // Number of multipliers of all points.
  int n_shares() const { return system_.n_rows - n_held_; }

 private:
  using Tolerance = ModesOfStepTolerances;
  using Partials = ContactPartials<Model>;

  // The rows of the points; their changes, and those of `force`.
  void assemble(const Eval& eval, Wide* force) {
    for (int i = 0; i < Partials::n_columns * N; ++i) by_[i] = 0.0;
    int n = n_held_, n_turning = 0;
    for (int i = 0; i < n_; ++i) {
      double rows[3][array_size(N)], forces[3][array_size(N)], drag[array_size(N)];
      int held;
      const bool turns = partials_.take(point_[i], &held, rows, forces, change_, drag, by_);
      for (int d = 0; d < held; ++d, ++n) {
        Model::solve_factor_transposed_of(eval.L, rows[d], system_.C[n]);
        Model::solve_factor_transposed_of(eval.L, forces[d], system_.B[n]);
        for (int b = 0; b < columns_->n_bundles; ++b) rate_[b * R + n] = Wide(0.0);
        for (int c = 0; c < Partials::n_columns; ++c)
          Columns::at(rate_, R, place(c), n) = change_[d][c];
      }
      if (turns) Model::solve_factor_transposed_of(eval.L, drag, system_.Z[n_turning++]);
    }
    system_.n_rows = n;
    system_.n_turning = n_turning;
    for (int c = 0; c < Partials::n_columns; ++c)
      for (int k = 0; k < N; ++k) Columns::at(force, N, place(c), k) += by_[c * N + k];
  }

  // Index of a column of ContactPartials among those of the step: q_D, v_D, q_K, dq_K/dt, and p
  // last.
  int place(int c) const {
    if (c < N) return c;
    if (c < E) return N + c;
    if (c < E + N) return c - K;
    if (c < 2 * E) return c;
    return columns_->n - P + (c - 2 * E);
  }

  // dt dacc and, unless null, the changes `pull` of the tensions and `shares` of the multipliers.
  void solve(const Eval& eval, const Wide* force, Wide* solution, Wide* pull, Wide* shares) {
    for (int b = 0; b < columns_->n_bundles; ++b) {
      if (!Columns::acts(b)) continue;
      const Wide* rate = rate_ + b * R;
      Wide x[array_size(N)], w[array_size(N)], y[array_size(R)];
      for (int k = 0; k < N; ++k) x[k] = -force[b * N + k];
      Model::solve_factor_transposed_of(eval.L, x, w);
      system_.solve(w, rate, y);
      Model::solve_factor_of(eval.L, w, x);
      for (int k = 0; k < N; ++k) solution[b * N + k] = dt_ * x[k];
      for (int a = 0; pull && a < n_held_; ++a) pull[b * M + a] = y[a];
      for (int a = 0; shares && a < n_shares(); ++a) shares[b * 3 * C + a] = y[n_held_ + a];
    }
  }

  void solve_delay(const Eval& eval) {
    double rate[array_size(R)] = {}, w[array_size(N)] = {};
    for (int i = 0, n = n_held_; i < n_; n += point_[i].sticks ? 3 : 1, ++i)
      rate[n] = -asked_by_delay(point_[i], dt_) / dt_;
    system_.solve(w, rate, pull_by_delay_);
    eval.solve_factor(w, by_delay_);
    for (int k = 0; k < N; ++k) by_delay_[k] *= dt_;
  }

  // Whether the motion depends on the distribution of force among redundant points: shares `idle`,
  // without effect on the step, are added.
  bool depends(const Eval& eval, Wide* force, const double* idle) {
    for (int c = 0; c < Partials::n_columns; ++c)
      for (int k = 0; k < N; ++k) Columns::at(force, N, place(c), k) -= by_[c * N + k];
    share_otherwise(point_, n_, n_held_, idle, Tolerance::shift);
    assemble(eval, force);
    if (!system_.factorise()) return true;
    solve(eval, force, other_, nullptr, nullptr);
    Wide all = Wide(0.0), size[array_size(Columns::most)];
    for (int b = 0; b < columns_->n_bundles; ++b) {
      size[b] = Wide(0.0);
      if (!Columns::acts(b)) continue;
      for (int k = 0; k < N; ++k) size[b] = maximum(fabs(solution_[b * N + k]), size[b]);
      all = maximum(size[b], all);
    }
    double most = 0.0;
    for (int l = 0; l < Columns::width; ++l) most = maximum(lane_of(all, l), most);
    for (int b = 0; b < columns_->n_bundles; ++b) {
      if (!Columns::acts(b)) continue;
      const Wide bound = Tolerance::depends * maximum(size[b], Wide(Tolerance::rounding * most));
      for (int k = 0; k < N; ++k)
        if (any(fabs(other_[b * N + k] - solution_[b * N + k]) > bound)) return true;
    }
    return false;
  }

  StepContact point_[array_size(C)];
  int n_ = 0, n_held_ = 0;
  const Columns* columns_ = nullptr;
  const double *screws_, *by_p_;
  double dt_, none_[array_size(K)] = {};
  Partials partials_;
  ModeSystem<R, C, N> system_;
  double change_[3][array_size(Partials::n_columns)], by_[array_size(Partials::n_columns * N)];
  Wide rate_[array_size(Columns::most * R)],
      solution_[array_size(Columns::most * N)];  // in bundles
  Wide other_[array_size(Columns::most * N)];
  double by_delay_[array_size(N)], pull_by_delay_[array_size(R)];
};

}  // namespace fan

FAN_LOOPS_END
