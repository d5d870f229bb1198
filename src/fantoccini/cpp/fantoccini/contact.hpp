// What happens at an instant: catches with their impulse, and the choice of the next mode.
//
//   v_D+ = v_D- - M_DD^-1 A_D^T Lambda,  Lambda >= 0, hdot+ <= 0, Lambda . hdot+ = 0   (Eqs. 13-15)
//   tau >= 0, hddot <= 0, tau . hddot = 0   over the rows with h = 0 and hdot = 0         (Sec. IV)
#pragma once

#include "flow.hpp"

namespace fan {

constexpr double kTouch = 1e-12;  // gap below which a row counts as closed at an event, relative
// |hdot| below which a closed row counts as at rest. A row that a catch elsewhere loosens by less
// and that pulls again at once would be slack for some 2 |hdot| / hddot = 2 us; holding it instead
// changes the state by the product of both, some 1e-11, and spares a cascade of catches.
constexpr double kStill = 1e-5;
constexpr int kPivots = 200;      // bound on the pivoting of one complementarity problem

template <class Model>
struct Contact {
  using F = Flow<Model>;
  static constexpr int N = F::N, NQ = F::NQ, M = F::M;

  double impulse[room(M)];  // of the last catch, by row
  double speed[room(M)];    // hdot before it
  double lost = 0.0;        // kinetic energy lost in it
  double stopped = 0.0;     // largest |hdot| that the last hold took from a taut row

  // Applies the impulse over the rows `closed` at (t, y) and books its work. The flow's evaluation
  // must be that of (t, y).
  Status strike(F& f, const bool* closed) {
    int list[room(M)], n = 0;
    for (int r = 0; r < M; ++r) {
      impulse[r] = speed[r] = 0.0;
      if (closed[r]) list[n++] = r;
    }
    lost = 0.0;
    f.rows.gather(f.eval, f.y + NQ, list, n);
    auto& problem = f.rows.problem;
    for (int a = 0; a < n; ++a) {
      problem.b[a] = f.rows.hdot[a];
      problem.active[a] = f.rows.hdot[a] > 0.0 || f.taut[list[a]];
    }
    if (!settle(problem)) return IMPOSSIBLE_INPUT;
    for (int a = 0; a < n; ++a) {
      const double x = problem.x[a];
      if (!(fabs(x) <= f.opt.tension_cap)) return IMPOSSIBLE_INPUT;
      impulse[list[a]] = x;
      speed[list[a]] = f.rows.hdot[a];
      lost += x * 0.5 * (f.rows.hdot[a] - problem.s[a]);
    }
    double change[room(N)];
    f.y[F::WORK] += apply(f, change);
    for (int j = 0; j < N; ++j) f.y[NQ + j] += change[j];
    return RUNNING;
  }

  // Chooses which of the rows that are closed and at rest stay taut, at (t, y). Rows in `loose`
  // have just lost their tension: they stay only if they pull.
  Status choose(F& f, const bool* loose, bool* taut, double closeness = kTouch) {
    double rate[F::NY], speed_scale = 1.0;
    for (int r = 0; r < M; ++r) f.taut[r] = false;
    f.evaluate(f.t, f.y, rate);
    for (int j = 0; j < N; ++j)
      if (fabs(f.y[NQ + j]) > speed_scale) speed_scale = fabs(f.y[NQ + j]);
    int all[room(M)] = {}, list[room(M)] = {}, n_all = 0, n = 0;
    for (int r = 0; r < M; ++r)
      if (f.eval.height(r) >= -closeness * f.row_scale(r) || (r < F::S && Model::wire[r]))
        all[n_all++] = r;
    f.rows.gather(f.eval, f.y + NQ, all, n_all);
    for (int a = 0; a < n_all; ++a)
      if (fabs(f.rows.hdot[a]) <= kStill * speed_scale || f.rows.problem.two_sided[a])
        list[n++] = all[a];
    f.rows.gather(f.eval, f.y + NQ, list, n);
    auto& problem = f.rows.problem;
    double scale = 0.0;
    for (int a = 0; a < n; ++a) {
      problem.b[a] = f.rows.hddot[a];
      problem.active[a] = true;
      if (fabs(problem.b[a]) > scale) scale = fabs(problem.b[a]);
    }
    if (!settle(problem)) return IMPOSSIBLE_INPUT;
    for (int r = 0; r < M; ++r) taut[r] = false;
    for (int a = 0; a < n; ++a) {
      if (!(fabs(problem.x[a]) <= f.opt.tension_cap)) return IMPOSSIBLE_INPUT;
      // A row without tension whose ends do not come closer stays in the taut set.
      const bool pulls = problem.active[a] && (problem.x[a] > 0.0 || problem.two_sided[a]);
      taut[list[a]] = pulls || (!loose[list[a]] && problem.s[a] <= 1e-10 * scale);
    }
    return RUNNING;
  }

  // Brings the rows chosen to h = 0 and hdot = 0 at (t, y), without setting other closed rows in
  // motion past their bounds: hdot = 0 on the taut rows, hdot <= 0 on the rest. `work` is what the
  // inputs do meanwhile.
  Status hold(F& f, double* work) {
    double rate[F::NY];
    stopped = 0.0;
    if (f.rows.n == 0) return RUNNING;
    for (int a = 0; a < f.rows.n; ++a)
      if (fabs(f.rows.hdot[a]) > stopped) stopped = fabs(f.rows.hdot[a]);
    const Status status = f.pull_back(f.y);
    if (status != RUNNING) return status;
    f.evaluate(f.t, f.y, rate);
    int list[room(M)] = {}, n = 0;
    for (int r = 0; r < M; ++r)
      if (f.taut[r] || f.eval.height(r) >= -kTouch * f.row_scale(r)) list[n++] = r;
    f.rows.gather(f.eval, f.y + NQ, list, n);
    auto& problem = f.rows.problem;
    for (int a = 0; a < n; ++a) {
      problem.b[a] = f.rows.hdot[a];
      problem.two_sided[a] = problem.two_sided[a] || f.taut[list[a]];
      problem.active[a] = problem.two_sided[a];
    }
    if (!settle(problem)) return IMPOSSIBLE_INPUT;
    double change[room(N)];
    *work = apply(f, change);
    for (int j = 0; j < N; ++j) f.y[NQ + j] += change[j];
    return RUNNING;
  }

 private:
  // The change of velocity by the impulses solved for, and the work of the inputs in it.
  double apply(F& f, double* change) {
    double w[room(N)], pull[room(M)] = {}, work = 0.0;
    for (int j = 0; j < N; ++j) w[j] = 0.0;
    for (int a = 0; a < f.rows.n; ++a) {
      pull[a] = -f.rows.problem.x[a];
      work += f.rows.problem.x[a] * f.rows.hdot_K[a];
    }
    f.rows.add(pull, w);
    f.eval.back(w, change);
    for (int j = 0; j < N; ++j) work += f.eval.M_DK_v_K[j] * change[j];
    return work;
  }

  // Solves to rounding, or near it where rounding itself keeps rows from settling.
  template <class Problem>
  static bool settle(Problem& problem) {
    return problem.solve(kEps, kRefinements, 1e-12, kPivots) ||
           problem.solve(kEps, kRefinements, 1e-9, kPivots);
  }
};

}  // namespace fan
