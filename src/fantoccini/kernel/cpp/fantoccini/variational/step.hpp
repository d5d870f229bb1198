// The variational integrator: discrete Euler-Lagrange by the midpoint rule, one-sided strings,
//
//   p_k - A_D(q_k)^T Lambda = p_k(xi),   h(q_k+1) <= 0 complementary to Lambda >= 0
//
// with p_k(xi), p_k+1, q_k+1 and h from the generated midpoint_rule (equations/variational.py).
// Lengths hold at every node; the velocities there are those of node.hpp.
//
// The step is solved for y = F^-T p at q_k, where F^T F = M_DD + dt/2 damping of the joints. The
// derivative of p_k(xi) is F^T F / dt except for terms of relative size dt times a velocity, so
// that
//
//   z = y - F^-T p_k(xi) - W Lambda,   h / dt + W^T z <= 0 complementary to Lambda >= 0,
//   xi <- xi + dt F^-1 z
//
// is nearly Newton's iteration and needs no derivative; Broyden's updates correct the difference.
//
// Written for any Real: lanes step together, each with its own step length.
#pragma once

#include "fantoccini/variational/broyden.hpp"
#include "fantoccini/variational/extrapolation.hpp"
#include "fantoccini/variational/node.hpp"

namespace fan {

struct VariationalTolerances {
  // Residual |z| of a solved step, relative to the size of y: near rounding.
  static constexpr double momentum_residual = 1e-12;
  // The same for a step whose residual no longer shrinks,
  static constexpr double stalled_residual = 1e-10;
  // that is, whose |z|^2 exceeds this share of the previous round's.
  static constexpr double stalled_share = 0.1;
  // m or rad: rounding of a row's height. Over dt it is a speed that |z| may also have,
  static constexpr double height_rounding = 1e-14;
  // for rows with at least this share of G's largest diagonal entry: others hardly move anything.
  static constexpr double moving_row = 1e-6;
  // m or rad: largest violation of a row in a solved step.
  static constexpr double violation = 1e-11;
  // rad (of xi): largest turn of a coordinate in one step; larger steps gain energy.
  static constexpr double max_turn_per_step = 1.0;
  // rad: largest swing of a string in one step, likewise.
  static constexpr double max_swing_per_step = 0.7;
  static constexpr int max_corrections = 30;
  // kg m^2/s^2: |z|^2 above which a step has diverged.
  static constexpr double diverged = 1e30;
};

template <class Model, class Real>
struct VariationalStep {
  static constexpr int NQ = Model::n_qD, N = Model::n_vD, S = Model::n_strings;
  static constexpr int M = Model::n_rows, NQK = Model::n_qK, NK = Model::n_vK;
  using Mask = typename Traits<Real>::Mask;
  using Tolerance = VariationalTolerances;
  using Node = VariationalNode<Model, Real>;
  using Inputs = typename Node::Inputs;

  // The inputs at the middle of a step.
  struct Lead {
    Real q_mid[array_size(NQK)], v_mid[array_size(NK)], acc_mid[array_size(NK)], u_D[array_size(N)];
  };

  Node here;
  double least = negligible;  // kg m^2/s^2: lower bound of the |y|^2 that residuals are relative to
  Lead lead;
  Inputs next_inputs;  // at the end of the step
  // Of the last step, in the lanes that made it.
  Real acc[array_size(N)];      // (v+ - v) / dt
  Real impulse[array_size(M)];  // Lambda + mu
  Mask caught[array_size(M)], slips[array_size(S)];
  Real work, loss, impact, slip_loss;
  long long n_corrections = 0;

  // Violation of a row's bound at the end of the last solved step, and its impulse.
  FAN_FN Real overstep(int r) const {
    using std::abs;
    return r < S && Model::wire[r] ? Real(abs(trial_.h[r])) : trial_.h[r];
  }
  FAN_FN Real solved_impulse(int r) const { return trial_.lambda[r]; }

  // Begins at q_D, v_D, slip and the inputs of `here`, before steps of length dt.
  FAN_FN void begin(const Real& dt) {
    const Mask no = Real(0.0) > Real(1.0);
    for (int r = 0; r < M; ++r) {
      caught[r] = no;
      here.lambda[r] = impulse[r] = Real(0.0);
    }
    for (int i = 0; i < S; ++i) slips[i] = no;
    for (int k = 0; k < N; ++k) {
      acc[k] = Real(0.0);
      here.guess[k] = here.v_D[k];
    }
    work = loss = impact = slip_loss = Real(0.0);
    Call<Model, Real>::momenta(
        here.q_D, here.v_D, here.now.q_K, here.now.v_K, here.p, here.momentum);
    extrapolation_.begin();
    here.since = Real(0.0);
    here.ahead = dt;
    here.settle();
  }

  // Solves the step of length dt in the lanes `wanted`. Returns the solved lanes. The state is
  // unchanged.
  FAN_FN Mask solve(const Real& dt, const Mask& wanted) {
    using std::abs;
    here.expect(select(wanted, dt, here.ahead));
    auto& rows = here.firm.rows;
    auto& problem = rows.problem;
    const Mask no = Real(0.0) > Real(1.0);
    const Real rate = 1.0 / dt;
    Real z[array_size(N)], moved[array_size(N)], along[array_size(M)], pull[array_size(M)];
    for (int i = 0; i < S; ++i) trial_.slip_next[i] = here.slip[i] + dt * here.winding(i, dt);
    here.bound(here.firm, dt);
    for (int a = 0; a < rows.n; ++a) {
      const int r = rows.row[a];
      problem.active[a] = here.near[r] && (here.taut[r] || Node::sides(rows, a));
      problem.high[a] = no;
    }
    first_guess(dt);
    Real size = squares<N>(here.firm.y) + dt * dt * squares<N>(here.exact.eval.w0);
    size = select(size > Real(least), size, Real(least));
    const Real near =
        Tolerance::stalled_residual * Tolerance::stalled_residual * size + rounding(dt);
    Mask solved = no, lost = !wanted;
    Real last = Real(Tolerance::diverged);
    for (int r = 0; r < M; ++r) trial_.lambda[r] = Real(0.0);
    quick_.begin();
    bool again = false;
    for (int round = 0; round < Tolerance::max_corrections; ++round) {
      ++n_corrections;
      evaluate(dt);
      here.firm.solve_factor_transposed(trial_.before, z);
      for (int k = 0; k < N; ++k) z[k] = here.firm.y[k] - z[k];
      rows.along(z, along);
      Mask was[array_size(M)], changed = no;
      for (int a = 0; a < rows.n; ++a) {
        const int r = rows.row[a];
        was[a] = problem.active[a];
        problem.b[a] = select(
            here.near[r], Real(trial_.h[r] * rate + along[a]),
            Real(-ComplementarityTolerances::excluded_speed));
      }
      const Mask settled = Node::complement(problem, again);
      again = true;
      for (int a = 0; a < rows.n; ++a) {
        const int r = rows.row[a];
        changed = changed || was[a] != problem.active[a];
        trial_.lambda[r] = select(solved, trial_.lambda[r], problem.bounded(a));
        pull[a] = -trial_.lambda[r];
      }
      rows.add(pull, z);
      for (int k = 0; k < N; ++k) left_[k] = select(solved, left_[k], z[k]);
      const Real wrong = squares<N>(z);
      const Mask exact =
          wrong < (Tolerance::momentum_residual * Tolerance::momentum_residual) * size;
      const Mask stuck = wrong < near && !(wrong < Tolerance::stalled_share * last);
      solved = solved || ((exact || stuck) && settled && !lost && held());
      lost = lost || !(wrong < Real(Tolerance::diverged));
      if (!any(!solved && !lost)) break;
      last = wrong;
      if (any(!solved && !lost) && join(!lost)) {
        here.bound(here.firm, dt);
        again = false;
      }
      quick_.forget(changed);
      quick_.correct(z);
      here.firm.eval.solve_factor(z, moved);
      for (int k = 0; k < N; ++k)
        trial_.xi[k] += select(solved || lost, Real(0.0), Real(dt * moved[k]));
    }
    update_slips();
    for (int k = 0; k < N; ++k)
      if (Model::turns[k])
        solved = solved && abs(trial_.xi[k]) < Real(Tolerance::max_turn_per_step);
    balance();
    return solved && !lost;
  }

  // Whether the solved step resolves the swing of its strings. A string of length L under tension
  // turns by the angle dt sqrt(tension G / L), with tension = 2 Lambda / dt, as half of the impulse
  // acts at each end.
  FAN_FN Mask resolves(const Real& dt) const {
    using std::abs;
    const auto& rows = here.firm.rows;
    Mask all = Real(0.0) < Real(1.0);
    for (int a = 0; a < rows.n && rows.row[a] < S; ++a) {
      const int r = rows.row[a];
      const Real length = string_length<Model, Real>(r, here.q_D, next_inputs.q_K);
      const Real own = rows.problem.G[a * Node::Problem::N + a];
      const Real square = 2.0 * dt * abs(trial_.lambda[r]) * own;
      constexpr double most = Tolerance::max_swing_per_step * Tolerance::max_swing_per_step;
      all = all && !(square > most * (length + here.slip[r]));
    }
    return all;
  }

  // By row of `firm`, the closing speed that impulses have to remove in a step of length dt. The
  // solved step is kept.
  FAN_FN void demand(const Real& dt, Real* b) {
    const TrialStep<Model, Real> solved_trial = trial_;
    auto& rows = here.firm.rows;
    Real z[array_size(N)], guess_error[array_size(N)];
    for (int k = 0; k < N; ++k) guess_error[k] = guess_error_[k];
    first_guess(dt);
    evaluate(dt);
    here.firm.solve_factor_transposed(trial_.before, z);
    for (int k = 0; k < N; ++k) z[k] = here.firm.y[k] - z[k];
    rows.along(z, b);
    for (int a = 0; a < rows.n; ++a) b[a] += trial_.h[rows.row[a]] / dt;
    trial_ = solved_trial;
    for (int k = 0; k < N; ++k) guess_error_[k] = guess_error[k];
  }

  // Makes the solved step of length dt, in the lanes `goes`.
  FAN_FN void accept(const Real& dt, const Mask& goes) {
    Real before[array_size(N)], coupled[array_size(N)], lost[array_size(M)];
    Mask was_taut[array_size(M)];
    const Real rate = 1.0 / dt;
    if (here.joined) look_again();
    work = 0.5 * dt * here.exact.eval.power0 + trial_.work_M;
    loss = 0.5 * dt * here.exact.eval.loss;
    for (int r = 0; r < M; ++r) {
      was_taut[r] = here.taut[r];
      impulse[r] = trial_.lambda[r];
      lost[r] = Real(0.0);
    }
    here.account(trial_.lambda, false, work, lost);
    for (int k = 0; k < N; ++k) {
      before[k] = here.v_D[k];
      coupled[k] = here.exact.eval.M_DK_v_K[k];
      work += lead.u_D[k] * trial_.xi[k];
      const Real coming_v = trial_.xi[k] * (2.0 * rate) - here.v_D[k];
      here.guess[k] = select(goes, coming_v, here.guess[k]);
      here.momentum[k] = select(goes, trial_.after[k], here.momentum[k]);
      guess_error_[k] = trial_.xi[k] - guess_error_[k];
    }
    for (int i = 0; i < NQ; ++i) here.q_D[i] = select(goes, trial_.q_next[i], here.q_D[i]);
    for (int r = 0; r < M; ++r) here.lambda[r] = select(goes, trial_.lambda[r], here.lambda[r]);
    Real slip_rate[array_size(S)];
    for (int i = 0; i < S; ++i) {
      slip_rate[i] = (trial_.slip_next[i] - here.slip[i]) * rate;
      here.slip[i] = select(goes, trial_.slip_next[i], here.slip[i]);
      slips[i] = trial_.slips[i];
    }
    here.since = select(goes, dt, here.since);
    here.now.keep(next_inputs, goes);
    here.settle();
    here.account(here.mu, true, work, lost);
    work += 0.5 * dt * here.exact.eval.power0;
    loss += 0.5 * dt * here.exact.eval.loss;
    for (int k = 0; k < N; ++k) {
      if (Model::coupled)
        work += 0.5 * (coupled[k] + here.exact.eval.M_DK_v_K[k]) * (here.v_D[k] - before[k]);
      acc[k] = select(goes, (here.v_D[k] - before[k]) * rate, acc[k]);
    }
    impact = slip_loss = Real(0.0);
    extrapolation_.store_error(dt, guess_error_, goes);
    Mask changes = Real(0.0) > Real(1.0);
    for (int r = 0; r < M; ++r) {
      impulse[r] += here.mu[r];
      caught[r] = here.taut[r] && !was_taut[r];
      impact += select(caught[r], lost[r], Real(0.0));
      changes = changes || here.taut[r] != was_taut[r];
    }
    extrapolation_.forget(goes && changes);
    for (int i = 0; i < S; ++i) slip_loss += impulse[i] * slip_rate[i];
  }

 private:
  // Adds the residual of the momenta at the node to those at the end, so that conserved momenta are
  // kept to rounding whatever the residual of the iteration.
  FAN_FN void balance() {
    Real v[array_size(N)], still[array_size(NK)], lacks[array_size(N)];
    here.firm.eval.solve_factor(left_, v);
    for (int j = 0; j < NK; ++j) still[j] = Real(0.0);
    Call<Model, Real>::momenta(here.q_D, v, here.now.q_K, still, here.p, lacks);
    for (int k = 0; k < N; ++k) trial_.after[k] += lacks[k];
  }

  // |z|^2 from rounding of the rows' heights: divided by a short step it is a speed.
  FAN_FN Real rounding(const Real& dt) const {
    const auto& rows = here.firm.rows;
    const Real speed = Tolerance::height_rounding / dt;
    Real largest = Real(0.0), most = Real(0.0);
    for (int pass = 0; pass < 2; ++pass)
      for (int a = 0; a < rows.n; ++a) {
        Real own = rows.problem.G[a * Node::Problem::N + a];
        own = select(here.near[rows.row[a]], own, Real(0.0));
        largest = select(own > largest, own, largest);
        // Rows that hardly move anything do not count.
        const Real heavy = select(own > Tolerance::moving_row * largest, 1.0 / own, Real(0.0));
        most = select(heavy > most && Node::in_all(pass > 0), heavy, most);
      }
    return speed * speed * most;
  }

  // The first xi: dt times the velocities half-way by the forces at the node and mu, for Lambda,
  // corrected by the extrapolated errors of such guesses.
  FAN_FN void first_guess(const Real& dt) {
    const auto& on = here.exact;
    Real w[array_size(N)], pull[array_size(M)];
    for (int k = 0; k < N; ++k) w[k] = here.moving[k] + (0.5 * dt) * on.eval.w0[k];
    for (int a = 0; a < on.rows.n; ++a) pull[a] = -here.mu[on.rows.row[a]];
    on.rows.add(pull, w);
    on.eval.solve_factor(w, trial_.xi);
    for (int k = 0; k < N; ++k) guess_error_[k] = trial_.xi[k] *= dt;
    extrapolation_.add(dt, trial_.xi);
  }

  FAN_FN void evaluate(const Real& dt) {
    Call<Model, Real>::midpoint_rule(
        here.q_D, trial_.xi, lead.q_mid, lead.v_mid, lead.acc_mid, next_inputs.q_K, lead.u_D, dt,
        here.p, trial_);
    for (int i = 0; i < S; ++i) trial_.h[i] -= trial_.slip_next[i];
  }

  // Lanes in which no row is violated at the end of the step, whether it takes part or not.
  FAN_FN Mask held() const {
    using std::abs;
    const auto& rows = here.firm.rows;
    Mask all = Real(0.0) < Real(1.0);
    for (int r = S; r < M; ++r)
      all = all && (here.near[r] || !(trial_.h[r] > Real(Tolerance::violation)));
    for (int a = 0; a < rows.n; ++a) {
      const int r = rows.row[a];
      const Real beyond = rows.two_sided[a] ? Real(abs(trial_.h[r])) : trial_.h[r];
      const Mask slipping = rows.problem.high[a] && Node::in_all(here.winch_slips(r));
      all = all && (!here.near[r] || slipping || beyond < Real(Tolerance::violation));
    }
    return all;
  }

  // Adds the limits that the step would violate to the rows that take part. Returns whether there
  // are any.
  FAN_FN bool join(const Mask& lanes) {
    bool more = false;
    for (int r = S; r < M; ++r) {
      const Mask joins = lanes && !here.near[r] && trial_.h[r] > Real(Tolerance::violation);
      more = more || any(joins);
      here.near[r] = here.near[r] || joins;
    }
    if (!more) return false;
    here.joined = true;
    auto& rows = here.firm.rows;
    auto& problem = rows.problem;
    Mask active[array_size(M)], high[array_size(M)];
    for (int r = 0; r < M; ++r) active[r] = high[r] = Real(0.0) > Real(1.0);
    for (int a = 0; a < rows.n; ++a) {
      active[rows.row[a]] = problem.active[a];
      high[rows.row[a]] = problem.high[a];
    }
    int list[array_size(M)];
    rows.gather_more(here.firm.eval, here.guess, list, rows_in_some_lane<Model>(here.near, list));
    for (int a = 0; a < rows.n; ++a) {
      problem.active[a] = active[rows.row[a]];
      problem.high[a] = high[rows.row[a]];
    }
    return true;
  }

  // Adds the limits that have joined to the rows of `exact`.
  FAN_FN void look_again() {
    here.joined = false;
    int list[array_size(M)];
    const int n = rows_in_some_lane<Model>(here.near, list);
    here.exact.rows.gather_more(here.exact.eval, here.guess, list, n);
  }

  // A winch at its largest tension slips by the missing length of its string.
  FAN_FN void update_slips() {
    const auto& rows = here.firm.rows;
    for (int i = 0; i < S; ++i) trial_.slips[i] = Real(0.0) > Real(1.0);
    for (int a = 0; a < rows.n; ++a) {
      const int r = rows.row[a];
      if (!here.winch_slips(r)) continue;
      trial_.slips[r] = rows.problem.high[a] && trial_.h[r] > Real(0.0);
      Real& next = trial_.slip_next[r];
      const Real before = next;
      next += select(trial_.slips[r], trial_.h[r], Real(0.0));
      next = select(next > Real(WinchTolerances::negligible_slip), next, Real(0.0));
      trial_.h[r] -= next - before;
    }
  }

  TrialStep<Model, Real> trial_;
  Real left_[array_size(N)];  // z of the solved step
  Real
      guess_error_[array_size(N)];  // the guess of xi without extrapolation; in accept(), its error
  Extrapolation<N, Real> extrapolation_;
  Broyden<N, Real> quick_;
};

}  // namespace fan
