// The points that push in a step, held in their modes beside the strings and limits, and what that
// makes of the step's derivatives.
#pragma once

#include "contact_partials.hpp"
#include "contact_push.hpp"
#include "evaluation.hpp"
#include "mode_system.hpp"
#include "wide.hpp"

FAN_LOOPS_BEGIN

namespace fan {

struct ModesOfStepTolerances {
  // Force that is shared otherwise, relative to the largest, to see whether motions depend on it.
  static constexpr double shift = 0.1;
  // Change of a derivative by which it depends on that, relative to the largest by its quantity, and
  // derivatives by one quantity that are rounding, relative to the largest of all.
  static constexpr double depends = 1e-6, rounding = 1e-8;
};

// Columns of a step: the changes `force` (m, N) of the residual; (N, m) dv and, unless null,
// (n_rows, m) pull, to be written.
struct StepColumns {
  double* force;
  int m;
  double *dv, *pull;
};

template <class Model>
class ModesOfStep {
 public:
  static constexpr int N = Model::n_vD, K = Model::n_vK, P = Model::n_p, E = N + K;
  static constexpr int M = Model::n_rows, C = Model::n_contacts, R = M + 3 * C;
  static constexpr int most = 3 * N + 3 * K + P, width = Traits<Wide>::width;
  using Eval = Evaluation<Model, double>;

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
    double Q[room(N)] = {}, out[room(N)];
    partials_.begin(screws_, Q, Q, none_, by_p_, dt_);
    for (int i = 0; i < n_; ++i) partials_.push(point_[i], Q);
    Model::forth_of(eval.L, Q, out);
    for (int k = 0; k < N; ++k) w[k] += out[k];
  }

  // The velocities before and after the step.
  void move(const double* v_D, const double* v_next, const double* rate) {
    partials_.begin(screws_, v_D, v_next, rate, by_p_, dt_);
  }

  // dt dacc and the changes of the tensions, with the held rows and their changes `rate_by`. Returns
  // why these are no derivatives.
  int solve(
      const Eval& eval, const RowSystem<Model, double>& rows,
      const double (*rate_by)[room(most)], const StepColumns& of) {
    m_ = of.m;
    n_held_ = rows.n;
    for (int a = 0; a < rows.n; ++a) {
      for (int k = 0; k < N; ++k) system_.C[a][k] = system_.B[a][k] = rows.column[a][k];
      for (int c = 0; c < m_; ++c) rate_[a][c] = rate_by[a][c];
    }
    assemble(eval, of.force);
    const bool jams = !system_.factorise();
    const bool agrees = solve(eval, rows, of);
    if (jams) return JAMS;
    bool slides = false;
    for (int i = 0; i < n_; ++i) slides = slides || !point_[i].sticks;
    double idle[room(R)];
    const bool shares = slides && system_.idle(idle);
    if (shares && depends(eval, rows, of, idle)) return OPEN_SHARES;
    return agrees ? 0 : CONTRADICTS;
  }

 private:
  using Tolerance = ModesOfStepTolerances;
  using Partials = ContactPartials<Model>;

  // The rows of the points; their changes, and those of `force`.
  void assemble(const Eval& eval, double* force) {
    for (int i = 0; i < Partials::n_columns * N; ++i) by_[i] = 0.0;
    int n = n_held_, n_turning = 0;
    for (int i = 0; i < n_; ++i) {
      double rows[3][room(N)], forces[3][room(N)], drag[room(N)];
      int held;
      const bool turns = partials_.take(point_[i], &held, rows, forces, change_, drag, by_);
      for (int d = 0; d < held; ++d, ++n) {
        Model::forth_of(eval.L, rows[d], system_.C[n]);
        Model::forth_of(eval.L, forces[d], system_.B[n]);
        for (int c = 0; c < m_; ++c) rate_[n][c] = 0.0;
        for (int c = 0; c < Partials::n_columns; ++c) rate_[n][place(c)] = change_[d][c];
      }
      if (turns) Model::forth_of(eval.L, drag, system_.Z[n_turning++]);
    }
    system_.n_rows = n;
    system_.n_turning = n_turning;
    for (int c = 0; c < Partials::n_columns; ++c)
      for (int k = 0; k < N; ++k) force[place(c) * N + k] += by_[c * N + k];
  }

  // Where a column of ContactPartials is among those of the step: q_D, v_D, q_K, dq_K/dt, and p last.
  int place(int c) const {
    if (c < N) return c;
    if (c < E) return N + c;
    if (c < E + N) return c - K;
    if (c < 2 * E) return c;
    return m_ - P + (c - 2 * E);
  }

  // Whether rows that depend on one another agree.
  bool solve(const Eval& eval, const RowSystem<Model, double>& rows, const StepColumns& of) {
    double left = 0.0, size = 1.0;
    for (int a = 0; a < system_.n_rows; ++a)
      for (int c = 0; c < m_; ++c) size = maximum(fabs(rate_[a][c]), size);
    for (int first = 0; first < m_; first += width) {
      const int n = m_ - first < width ? m_ - first : width;
      Wide x[room(N)], w[room(N)], rate[room(R)], y[room(R)];
      for (int k = 0; k < N; ++k)
        for (int l = 0; l < width; ++l)
          lane_of(x[k], l) = l < n ? -of.force[(first + l) * N + k] : 0.0;
      for (int a = 0; a < system_.n_rows; ++a)
        for (int l = 0; l < width; ++l) lane_of(rate[a], l) = l < n ? rate_[a][first + l] : 0.0;
      Model::forth_of(eval.L, x, w);
      system_.solve(w, rate, y, &left);
      Model::back_of(eval.L, w, x);
      for (int l = 0; l < n; ++l) {
        for (int k = 0; k < N; ++k) of.dv[k * m_ + first + l] = dt_ * lane_of(x[k], l);
        for (int a = 0; of.pull && a < n_held_; ++a)
          of.pull[rows.row[a] * m_ + first + l] = lane_of(y[a], l);
      }
    }
    return left <= ModeSystemTolerances::contradicts * size;
  }

  // Whether the motion depends on how redundant points share their force: shares that do nothing,
  // `idle`, are added to it.
  bool depends(
      const Eval& eval, const RowSystem<Model, double>& rows, const StepColumns& of,
      const double* idle) {
    double largest = 0.0;
    for (int i = 0; i < n_; ++i)
      largest = fmax(largest, sqrt(dot3(point_[i].force, point_[i].force)));
    for (int c = 0; c < Partials::n_columns; ++c)
      for (int k = 0; k < N; ++k) of.force[place(c) * N + k] -= by_[c * N + k];
    for (int i = 0, a = n_held_; i < n_; ++i) {
      StepContact& own = point_[i];
      double frame[9];
      for (int c = 0; c < 3; ++c) frame[c] = own.normal[c];
      add_tangents(frame);
      for (int d = 0; d < (own.sticks ? 3 : 1); ++d, ++a)
        for (int c = 0; c < 3; ++c)
          own.force[c] += Tolerance::shift * largest * idle[a] *
                          (frame[3 * d + c] - own.friction * own.along[c]);
    }
    assemble(eval, of.force);
    if (!system_.factorise()) return true;
    solve(eval, rows, {of.force, of.m, other_, nullptr});
    double all = 0.0, size[room(most)];
    for (int c = 0; c < m_; ++c) {
      size[c] = 0.0;
      for (int k = 0; k < N; ++k) size[c] = maximum(fabs(of.dv[k * m_ + c]), size[c]);
      all = maximum(size[c], all);
    }
    for (int c = 0; c < m_; ++c)
      for (int k = 0; k < N; ++k) {
        const double bound = Tolerance::depends * fmax(size[c], Tolerance::rounding * all);
        if (fabs(other_[k * m_ + c] - of.dv[k * m_ + c]) > bound) return true;
      }
    return false;
  }

  StepContact point_[room(C)];
  int n_ = 0, n_held_ = 0, m_ = 0;
  const double *screws_, *by_p_;
  double dt_, none_[room(K)] = {};
  Partials partials_;
  ModeSystem<R, C, N> system_;
  double rate_[room(R)][room(most)], change_[3][room(Partials::n_columns)];
  double by_[room(Partials::n_columns * N)], other_[room(N * most)];
};

}  // namespace fan

FAN_LOOPS_END
