// A node of a variational run: the state there, and the velocities from the momenta,
//
//   v = M_DD^-1 (p - M_DK v_K - A_D^T mu),   hdot <= 0 complementary to mu >= 0
//
// over the rows at their bound. The next step's impulses are reduced by mu.
//
// The step from a node uses another factor, which includes half a step of the joints' damping
// (step.hpp): `exact` is of M_DD, `firm` of M_DD + dt/2 damping.
//
// Written for any Real: every lane has its own time and step.
#pragma once

#include "fantoccini/model/winch.hpp"
#include "fantoccini/variational/node_factor.hpp"

namespace fan {

struct NodeTolerances {
  // m or rad: -h below which a row is at its bound: ten times the tolerance of a step.
  static constexpr double closed_gap = 1e-10;
  // Relative difference of steps that share a factor.
  static constexpr double same_step = 1e-6;
  // s: largest impulses, also those of a catch, are the tension cap over this time.
  static constexpr double max_impulse_time = 1.0;
};

template <class Model, class Real>
struct VariationalNode {
  static constexpr int NQ = Model::n_qD, N = Model::n_vD, S = Model::n_strings;
  static constexpr int M = Model::n_rows, NQK = Model::n_qK, NK = Model::n_vK;
  using Mask = typename Traits<Real>::Mask;
  using Tolerance = NodeTolerances;
  using Rows = RowSystem<Model, Real>;
  using Problem = decltype(Rows::problem);

  struct Inputs {
    Real q_K[array_size(NQK)], v_K[array_size(NK)], acc_K[array_size(NK)], u_D[array_size(N)];
    long long still = 0;  // of the drive's (runs/drive.hpp); not read here

    FAN_FN void keep(const Inputs& other, const Mask& lanes) {
      for (int i = 0; i < NQK; ++i) q_K[i] = select(lanes, other.q_K[i], q_K[i]);
      for (int j = 0; j < NK; ++j) {
        v_K[j] = select(lanes, other.v_K[j], v_K[j]);
        acc_K[j] = select(lanes, other.acc_K[j], acc_K[j]);
      }
      for (int k = 0; k < N; ++k) u_D[k] = select(lanes, other.u_D[k], u_D[k]);
    }
  };

  double cap;  // N: largest tension of a string on a winch that does not slip
  Winches<S> winches;
  Real p[array_size(Model::n_p)];
  Inputs now;
  Real q_D[array_size(NQ)], v_D[array_size(N)], slip[array_size(S)];
  Real momentum[array_size(N)];  // p_k
  Real guess[array_size(N)];     // of v_D, from the step that ended here
  Real lambda[array_size(M)];    // impulses of that step, by row
  Real since;                    // its length; 0 at the start
  Real ahead;                    // s: length of the next step for which `firm` is computed
  Real moving[array_size(N)];    // F v_D, with the F of `exact`
  Real mu[array_size(M)];
  Mask near[array_size(M)];  // rows that take part
  bool joined;               // whether `exact` lacks some of them
  Mask taut[array_size(M)];
  Mask settled;  // whether mu was found
  NodeFactor<Model, Real> exact, firm;

  // Computes velocities and mu from momenta, and the factors for the next step. Unchanged lanes get
  // the same results again.
  FAN_FN void settle() {
    Real p_own[array_size(N)];
    exact.eval.at_node(q_D, guess, now.q_K, now.v_K, now.acc_K, now.u_D, 0.5 * ahead, p, firm.eval);
    for (int k = 0; k < N; ++k)
      p_own[k] = Model::coupled ? Real(momentum[k] - exact.eval.M_DK_v_K[k]) : momentum[k];
    exact.solve_factor_transposed(p_own, moving);
    watch();
    joined = false;
    int list[array_size(M)];
    const int n = rows_in_some_lane<Model>(near, list);
    exact.rows.gather(exact.eval, guess, list, n);
    firm.rows.gather(firm.eval, guess, list, n);
    hold();
    exact.eval.solve_factor(moving, v_D);
    firm.solve_factor_transposed(momentum, firm.y);
    Real pull[array_size(M)];
    for (int a = 0; a < n; ++a) pull[a] = -mu[list[a]];
    firm.rows.add(pull, firm.y);
  }

  // Computes `firm` for steps of these lengths.
  FAN_FN void expect(const Real& dt) {
    using std::abs;
    const Mask other = abs(ahead - dt) > Tolerance::same_step * dt;
    if (!any(other)) return;
    ahead = select(other, dt, ahead);
    settle();
  }

  FAN_FN Real height(int r) const {
    return r < S ? Real(exact.eval.h[r] - slip[r]) : exact.eval.h_limit[r - S];
  }

  // Whether a row is at its bound.
  FAN_FN Mask closed(int r) const { return height(r) > Real(-Tolerance::closed_gap); }

  // Whether a row is a string whose winch slips.
  FAN_FN bool winch_slips(int r) const { return winches.slips(r) && winches.max_tension[r] < cap; }

  // Bounds of the rows' impulses. A slipping winch's is that of half a step: the other half acts at
  // the step's other end.
  FAN_FN void bound(NodeFactor<Model, Real>& on, const Real& dt) const {
    auto& problem = on.rows.problem;
    for (int a = 0; a < on.rows.n; ++a) {
      const int r = on.rows.row[a];
      const Real most = Real(Tolerance::max_impulse_time * cap);
      problem.upper[a] = winch_slips(r) ? Real((0.5 * winches.max_tension[r]) * dt) : most;
      problem.lower[a] = on.rows.two_sided[a] ? Real(-most) : Real(0.0);
    }
  }

  // Solves for the impulses; `again` with rows and G as the last time. Returns the solved lanes.
  FAN_FN static Mask complement(Problem& problem, bool again) {
    using Pivoting = ComplementarityTolerances;
    return problem.solve(
        Pivoting::raise, 1, Pivoting::pivoting, Pivoting::max_iterations(problem.n), again);
  }

  // A flag that is the same in all lanes, as a mask.
  FAN_FN static Mask in_all(bool is) { return Real(is ? 1.0 : 0.0) > Real(0.5); }
  FAN_FN static Mask sides(const Rows& rows, int a) { return in_all(rows.two_sided[a]); }

  // The rate at which a winch winds back its slip over a step dt; 0 if dt is.
  FAN_FN Real winding(int i, const Real& dt) const {
    using std::sqrt;
    if (!(winches.rewind_speed[i] > 0.0)) return Real(0.0);
    const Mask goes = dt > Real(0.0);
    const Real most = slip[i] / select(goes, dt, Real(1.0));
    const Real braked = sqrt(Real(2.0 * WinchTolerances::brake) * slip[i]);
    Real speed = Real(winches.rewind_speed[i]);
    speed = select(braked < speed, braked, speed);
    return -select(goes, select(most < speed, most, speed), Real(0.0));
  }

  // Adds to `work` the work of impulses x, by row, through driven ends here, and to `lost` the
  // energy each removes. `made`: they have already acted on the velocities.
  FAN_FN void account(const Real* x, bool made, Real& work, Real* lost) const {
    const auto& rows = exact.rows;
    Real rate[array_size(M)];
    rows.along(moving, rate);
    constexpr int stride = Problem::N;
    for (int a = 0; a < rows.n; ++a) {
      const Real own = x[rows.row[a]];
      Real change = Real(0.0);
      for (int b = 0; b < rows.n; ++b) change -= rows.problem.G[a * stride + b] * x[rows.row[b]];
      work += own * rows.hdot_K[a];
      const Real mean = rate[a] + rows.hdot_K[a] + (made ? -0.5 : 0.5) * change;
      lost[rows.row[a]] += own * mean;
    }
  }

 private:
  // Chooses the rows that take part: all strings, and the limits nearby. Steps check the other
  // limits afterwards.
  FAN_FN void watch() {
    using std::abs;
    Real rate[array_size(M - S)];
    exact.eval.limit_rates(guess, rate);
    for (int r = 0; r < S; ++r) near[r] = Real(0.0) < Real(1.0);
    for (int r = S; r < M; ++r)
      near[r] = height(r) + 2.0 * ahead * abs(rate[r - S]) > Real(-Tolerance::closed_gap);
  }

  // mu, and the velocities with it.
  FAN_FN void hold() {
    auto& rows = exact.rows;
    auto& problem = rows.problem;
    const Mask no = Real(0.0) > Real(1.0);
    Mask at_bound[array_size(M)];
    Real rate[array_size(M)], pull[array_size(M)];
    rows.along(moving, rate);
    bound(exact, since);
    for (int a = 0; a < rows.n; ++a) {
      const int r = rows.row[a];
      rate[a] += rows.hdot_K[a];
      if (r < S) rate[a] -= winding(r, since);
      at_bound[a] = near[r] && (sides(rows, a) || closed(r));
      problem.b[a] = select(at_bound[a], rate[a], Real(-ComplementarityTolerances::excluded_speed));
      problem.active[a] = at_bound[a] && (lambda[r] > Real(0.0) || sides(rows, a));
      problem.high[a] = no;
    }
    settled = complement(problem, false);
    for (int r = 0; r < M; ++r) {
      mu[r] = Real(0.0);
      taut[r] = no;
    }
    for (int a = 0; a < rows.n; ++a) {
      const int r = rows.row[a];
      mu[r] = select(at_bound[a], problem.bounded(a), Real(0.0));
      pull[a] = -mu[r];
      const Mask pulls = lambda[r] > Real(0.0) || mu[r] > Real(0.0) || sides(rows, a);
      taut[r] = at_bound[a] && pulls;
    }
    rows.add(pull, moving);
  }
};

}  // namespace fan
