// The variational integrator: discrete Euler-Lagrange by the midpoint rule, strings one-sided,
//
//   p_k - A_D(q_k)^T Lambda = p_k(xi),   h(q_k+1) <= 0 complementary to Lambda >= 0     (the step)
//   v_k+1 = M_DD^-1 (p_k+1 - M_DK v_K - A_D^T mu),   hdot <= 0 complementary to mu >= 0  (the node)
//
// with p_k(xi), p_k+1, q_k+1 and h by the generated midpoint_rule (equations/variational.py). The
// first makes lengths hold at every node, the second the velocities there: mu is what the strings'
// impulse in the next step would be larger by.
//
// The step is solved for y = F^-T p at q_k, where M_DD = F^T F. The derivative of p_k(xi) is M_DD / dt
// but for terms of relative size dt times a velocity, so that
//
//   z = y - F^-T p_k(xi) - W Lambda,   h / dt + W^T z <= 0 complementary to Lambda >= 0,
//   xi <- xi + dt F^-1 z
//
// is nearly Newton's iteration and needs no derivative; Broyden's updates make up for the rest. Where
// joints are damped so much that it fails, F takes in half a step of their damping.
//
// Written for any Real: lanes step together, each until its own step is solved.
#pragma once

#include "broyden.hpp"
#include "footing.hpp"
#include "winch.hpp"

namespace fan {

constexpr double kExact = 1e-12;        // of the momenta's size: what a solved step may lack
constexpr double kNearlyExact = 1e-10;  // likewise, where it does not get any better
constexpr double kHeld = 1e-11;         // m or rad by which a solved step may overstep a row
constexpr double kTouching = 1e-10;     // m or rad: a row this near to its bound is at it
constexpr double kFarthestTurn = 2.0;   // rad in one step
constexpr double kAway = 1e30;          // speed at which a row opens in lanes it takes no part in
constexpr int kCorrections = 30;        // of a step

template <class Model, class Real>
struct VariationalStep {
  static constexpr int NQ = Model::n_qD, N = Model::n_vD, S = Model::n_strings;
  static constexpr int M = Model::n_rows, NQK = Model::n_qK, NK = Model::n_vK;
  using Mask = typename Traits<Real>::Mask;

  // At a node.
  struct Inputs {
    Real q_K[room(NQK)], v_K[room(NK)], acc_K[room(NK)], u_D[room(N)];
  };
  // Over a step.
  struct Lead {
    Real q_mid[room(NQK)], v_mid[room(NK)], acc_mid[room(NK)], q_next[room(NQK)], u_D[room(N)];
  };

  double cap;  // N: largest tension of a string without a winch of its own
  Winches<S> winches;
  Real p[room(Model::n_p)];
  Real q_D[room(NQ)], v_D[room(N)];
  Real acc[room(N)];      // (v+ - v) / dt
  Real impulse[room(M)];  // Lambda + mu of the last step
  Mask taut[room(M)], caught[room(M)];
  Real slip[room(S)];  // m, by which winches have given way
  Mask slips[room(S)];    // in the last step
  Real work, loss, impact, slip_loss;  // of the last step
  long long n_corrections = 0;
  Footing<Model, Real> node, firm;

  // How far a row is beyond its bound at the end of the step that was found, and its impulse.
  FAN_FN Real overstep(int r) const { return found_.h[r]; }
  FAN_FN Real found_impulse(int r) const { return found_.lambda[r]; }

  // Begins at q_D, v_D and slip.
  FAN_FN void begin(const Inputs& now) {
    const Mask no = Real(0.0) > Real(1.0);
    for (int r = 0; r < M; ++r) {
      taut[r] = caught[r] = no;
      found_.lambda[r] = impulse[r] = mu_[r] = Real(0.0);
    }
    for (int i = 0; i < S; ++i) {
      slips[i] = no;
      slip_rate_[i] = Real(0.0);
    }
    for (int k = 0; k < N; ++k) acc[k] = Real(0.0);
    work = loss = impact = slip_loss = Real(0.0);
    const Real* arg[] = {q_D, v_D, now.q_K, now.v_K, p};
    Real* res[] = {momentum_};
    Model::momentum(arg, res);
    Real guess[room(N)];
    for (int k = 0; k < N; ++k) guess[k] = v_D[k];
    settle(guess, now, 0.0);
  }

  // Whether a row is at its bound.
  FAN_FN Mask closed(int r) const { return height(r) > Real(-kTouching); }

  // Looks for the step of length dt from the node with the inputs `now`: the lanes in which it was
  // found. Nothing moves yet.
  FAN_FN Mask solve(const Inputs& now, const Lead& lead, double dt) {
    Mask solved = Real(0.0) > Real(1.0);
    if (any(!stiff_)) {
      solved = solve_on(node, lead, dt) && !stiff_;
      balance(now);
      if (!any(!solved)) return solved;
    }
    const Found<Model, Real> first = found_;
    firm.eval.at(q_D, v_D, now.q_K, now.v_K, now.acc_K, now.u_D, Real(0.5 * dt), p);
    firm.forth(momentum_, firm.y);
    gather(firm);
    Real pull[room(M)];
    for (int a = 0; a < firm.rows.n; ++a) pull[a] = -mu_[firm.rows.row[a]];
    firm.rows.add(pull, firm.y);
    const Mask now_solved = solve_on(firm, lead, dt) && !solved;
    stiff_ = stiff_ || now_solved;
    if (any(solved)) found_.keep(first, solved);
    return solved || now_solved;
  }

  // By row of the node, the speed that the row's impulse has to take from a step of length dt.
  FAN_FN void demand(const Lead& lead, double dt, Real* b) {
    Real z[room(N)];
    first_guess(dt);
    evaluate(lead, dt);
    node.forth(before_, z);
    for (int k = 0; k < N; ++k) z[k] = node.y[k] - z[k];
    node.rows.along(z, b);
    for (int a = 0; a < node.rows.n; ++a) b[a] += found_.h[node.rows.row[a]] * (1.0 / dt);
  }

  // Takes the step of length dt that was found.
  FAN_FN void accept(const Lead& lead, const Inputs& coming, double dt) {
    Real before[room(N)], coupled[room(N)], guess[room(N)];
    Mask was_taut[room(M)];
    work = 0.5 * dt * node.eval.power0;
    loss = 0.5 * dt * node.eval.loss;
    for (int k = 0; k < N; ++k) {
      before[k] = v_D[k];
      coupled[k] = node.eval.M_DK_v_K[k];
      guess[k] = found_.xi[k] * (2.0 / dt) - v_D[k];
      momentum_[k] = found_.after[k];
      work += lead.u_D[k] * found_.xi[k];
    }
    for (int r = 0; r < M; ++r) {
      was_taut[r] = taut[r];
      impulse[r] = found_.lambda[r];
      lost_[r] = Real(0.0);
    }
    account(found_.lambda, false);
    for (int i = 0; i < NQ; ++i) q_D[i] = found_.q_next[i];
    for (int i = 0; i < S; ++i) {
      slip_rate_[i] = (found_.slip_next[i] - slip[i]) * (1.0 / dt);
      slip[i] = found_.slip_next[i];
      slips[i] = found_.slips[i];
    }
    settle(guess, coming, dt);
    account(mu_, true);
    work += 0.5 * dt * node.eval.power0;
    loss += 0.5 * dt * node.eval.loss;
    for (int k = 0; k < N; ++k) {
      if (Model::coupled)
        work += 0.5 * (coupled[k] + node.eval.M_DK_v_K[k]) * (v_D[k] - before[k]);
      acc[k] = (v_D[k] - before[k]) * (1.0 / dt);
    }
    impact = slip_loss = Real(0.0);
    for (int r = 0; r < M; ++r) {
      impulse[r] += mu_[r];
      caught[r] = taut[r] && !was_taut[r];
      impact += select(caught[r], lost_[r], Real(0.0));
    }
    for (int i = 0; i < S; ++i) slip_loss += impulse[i] * slip_rate_[i];
  }

 private:
  // The node: velocities from momenta, and the part of the rows' impulse that they need.
  FAN_FN void settle(const Real* guess, const Inputs& in, double dt) {
    const Mask no = Real(0.0) > Real(1.0);
    node.eval.at(q_D, guess, in.q_K, in.v_K, in.acc_K, in.u_D, Real(0.0), p);
    node.forth(momentum_, node.y);
    for (int k = 0; k < N; ++k) moving_[k] = node.y[k];
    if (Model::coupled) {
      Real driven[room(N)];
      node.forth(node.eval.M_DK_v_K, driven);
      for (int k = 0; k < N; ++k) moving_[k] -= driven[k];
    }
    watch(guess, dt);
    gather(node);
    auto& rows = node.rows;
    auto& problem = rows.problem;
    Mask at_bound[room(M)];
    Real rate[room(M)];
    rows.along(moving_, rate);
    for (int a = 0; a < rows.n; ++a) {
      const int r = rows.row[a];
      rate[a] += rows.hdot_K[a];
      if (r < S) rate[a] -= winding(r, dt);
      at_bound[a] = near_[r] && (sides(rows, a) || closed(r));
      problem.b[a] = select(at_bound[a], rate[a], Real(-kAway));
    }
    bound(node, dt);
    for (int a = 0; a < rows.n; ++a) {
      problem.high[a] = no;
      problem.active[a] = at_bound[a] && (found_.lambda[rows.row[a]] > Real(0.0) || sides(rows, a));
    }
    problem.solve(kRaise, 1, kTolerance, 50 + 4 * rows.n);
    for (int r = 0; r < M; ++r) {
      mu_[r] = Real(0.0);
      taut[r] = no;
    }
    Real pull[room(M)];
    for (int a = 0; a < rows.n; ++a) {
      const int r = rows.row[a];
      mu_[r] = select(at_bound[a], clamped(node, a), Real(0.0));
      pull[a] = -mu_[r];
      const Mask pulls = found_.lambda[r] > Real(0.0) || mu_[r] > Real(0.0) || sides(rows, a);
      taut[r] = at_bound[a] && pulls;
    }
    rows.add(pull, node.y);
    rows.add(pull, moving_);
    node.eval.back(moving_, v_D);
  }

  FAN_FN Mask solve_on(Footing<Model, Real>& on, const Lead& lead, double dt) {
    using std::abs;
    auto& rows = on.rows;
    auto& problem = rows.problem;
    const Mask no = Real(0.0) > Real(1.0);
    Real z[room(N)], moved[room(N)], along[room(M)], pull[room(M)];
    for (int i = 0; i < S; ++i) found_.slip_next[i] = slip[i] + dt * winding(i, dt);
    bound(on, dt);
    for (int a = 0; a < rows.n; ++a) {
      problem.high[a] = no;
      problem.active[a] = near_[rows.row[a]] && (taut[rows.row[a]] || sides(rows, a));
    }
    first_guess(dt);
    Real size = squares<N>(on.y) + dt * dt * squares<N>(on.eval.w0);
    size = select(size > Real(1e-280), size, Real(1e-280));
    Mask solved = no, lost = no;
    Real last = Real(kAway);
    for (int r = 0; r < M; ++r) found_.lambda[r] = Real(0.0);
    quick_.begin();
    for (int round = 0; round < kCorrections; ++round) {
      ++n_corrections;
      evaluate(lead, dt);
      on.forth(before_, z);
      for (int k = 0; k < N; ++k) z[k] = on.y[k] - z[k];
      rows.along(z, along);
      Mask was[room(M)], changed = no;
      for (int a = 0; a < rows.n; ++a) {
        const int r = rows.row[a];
        was[a] = problem.active[a];
        problem.b[a] = select(near_[r], Real(found_.h[r] * (1.0 / dt) + along[a]), Real(-kAway));
      }
      problem.solve(kRaise, 1, kTolerance, 50 + 4 * rows.n);
      for (int a = 0; a < rows.n; ++a) {
        const int r = rows.row[a];
        changed = changed || was[a] != problem.active[a];
        found_.lambda[r] = select(solved, found_.lambda[r], clamped(on, a));
        pull[a] = -found_.lambda[r];
      }
      rows.add(pull, z);
      for (int k = 0; k < N; ++k) left_[k] = select(solved, left_[k], z[k]);
      const Real wrong = squares<N>(z);
      const Mask exact = wrong < (kExact * kExact) * size;
      const Mask stuck = wrong < (kNearlyExact * kNearlyExact) * size && !(wrong < 0.1 * last);
      solved = solved || ((exact || stuck) && held(on));
      lost = lost || !(wrong < Real(kAway));
      if (!any(!solved && !lost)) break;
      last = wrong;
      if (any(!solved) && join(on)) bound(on, dt);
      quick_.forget(changed);
      quick_.correct(z);
      on.eval.back(z, moved);
      for (int k = 0; k < N; ++k)
        found_.xi[k] += select(solved || lost, Real(0.0), Real(dt * moved[k]));
    }
    give_way(on);
    for (int k = 0; k < N; ++k)
      if (Model::turns[k]) solved = solved && abs(found_.xi[k]) < Real(kFarthestTurn);
    return solved && !lost;
  }

  // Gives what the momenta at the node lack to those at the end: so symmetries keep theirs to
  // rounding, whatever the iteration leaves.
  FAN_FN void balance(const Inputs& now) {
    Real v[room(N)], still[room(NK)], lacks[room(N)];
    node.eval.back(left_, v);
    for (int j = 0; j < NK; ++j) still[j] = Real(0.0);
    const Real* arg[] = {q_D, v, now.q_K, still, p};
    Real* res[] = {lacks};
    Model::momentum(arg, res);
    for (int k = 0; k < N; ++k) found_.after[k] += lacks[k];
  }

  // What the forces at the node make of the velocities half-way, with mu for Lambda.
  FAN_FN void first_guess(double dt) {
    Real w[room(N)], pull[room(M)];
    for (int k = 0; k < N; ++k) w[k] = moving_[k] + (0.5 * dt) * node.eval.w0[k];
    for (int a = 0; a < node.rows.n; ++a) pull[a] = -mu_[node.rows.row[a]];
    node.rows.add(pull, w);
    node.eval.back(w, found_.xi);
    for (int k = 0; k < N; ++k) found_.xi[k] *= dt;
  }

  FAN_FN void evaluate(const Lead& lead, double dt) {
    const Real step = Real(dt);
    const Real* arg[] = {q_D,         found_.xi, lead.q_mid, lead.v_mid, lead.acc_mid,
                         lead.q_next, lead.u_D,  &step,      p};
    Real* res[] = {before_, found_.after, found_.q_next, found_.h};
    Model::midpoint_rule(arg, res);
    for (int i = 0; i < S; ++i) found_.h[i] -= found_.slip_next[i];
  }

  FAN_FN Real height(int r) const {
    return r < S ? Real(node.eval.h[r] - slip[r]) : node.eval.h_limit[r - S];
  }

  // Strings always take part, limits where they are near; the others are looked at afterwards.
  FAN_FN void watch(const Real* v, double dt) {
    using std::abs;
    Real rate[room(M - S)];
    node.eval.limit_rates(v, rate);
    for (int r = 0; r < S; ++r) near_[r] = Real(0.0) < Real(1.0);
    for (int r = S; r < M; ++r)
      near_[r] = height(r) + 2.0 * dt * abs(rate[r - S]) > Real(-kTouching);
  }

  FAN_FN int watched(int* list) const {
    int n = 0;
    for (int r = 0; r < M; ++r)
      if (r < S || any(near_[r])) list[n++] = r;
    return n;
  }

  FAN_FN void gather(Footing<Model, Real>& on) {
    int list[room(M)];
    on.rows.gather(on.eval, v_D, list, watched(list));
  }

  // Bounds of the rows' impulses over half a step: the other half is that of its other end.
  FAN_FN void bound(Footing<Model, Real>& on, double dt) {
    auto& problem = on.rows.problem;
    for (int a = 0; a < on.rows.n; ++a) {
      const int r = on.rows.row[a];
      const bool winch = winches.slips(r) && winches.max_tension[r] < cap;
      problem.upper[a] = Real(winch ? 0.5 * dt * winches.max_tension[r] : kMostImpulse * cap);
      problem.lower[a] = on.rows.two_sided[a] ? Real(-kMostImpulse * cap) : Real(0.0);
    }
  }

  FAN_FN static Real clamped(const Footing<Model, Real>& on, int a) {
    const auto& problem = on.rows.problem;
    Real x = problem.x[a];
    x = select(x > problem.upper[a], problem.upper[a], x);
    return select(x < problem.lower[a], problem.lower[a], x);
  }

  // The lanes in which no row that takes part or not is overstepped at the end of the step.
  FAN_FN Mask held(const Footing<Model, Real>& on) const {
    using std::abs;
    Mask all = Real(0.0) < Real(1.0);
    for (int r = S; r < M; ++r) all = all && (near_[r] || !(found_.h[r] > Real(kHeld)));
    for (int a = 0; a < on.rows.n; ++a) {
      const int r = on.rows.row[a];
      const Real beyond = on.rows.two_sided[a] ? Real(abs(found_.h[r])) : found_.h[r];
      const Mask free = !near_[r] || (on.rows.problem.high[a] && in_all(winches.slips(r)));
      all = all && (free || beyond < Real(kHeld));
    }
    return all;
  }

  // What is true of a row is true in all lanes.
  FAN_FN static Mask in_all(bool is) { return Real(is ? 1.0 : 0.0) > Real(0.5); }
  FAN_FN static Mask sides(const RowSystem<Model, Real>& rows, int a) {
    return in_all(rows.two_sided[a]);
  }

  // Limits that the step would overstep take part from now on; whether there are any.
  FAN_FN bool join(Footing<Model, Real>& on) {
    bool more = false;
    for (int r = S; r < M; ++r) {
      const Mask joins = !near_[r] && found_.h[r] > Real(kHeld);
      more = more || any(joins);
      near_[r] = near_[r] || joins;
    }
    if (!more) return false;
    auto& problem = on.rows.problem;
    Mask active[room(M)], high[room(M)];
    for (int r = 0; r < M; ++r) active[r] = high[r] = Real(0.0) > Real(1.0);
    for (int a = 0; a < on.rows.n; ++a) {
      active[on.rows.row[a]] = problem.active[a];
      high[on.rows.row[a]] = problem.high[a];
    }
    int list[room(M)];
    on.rows.gather_more(on.eval, v_D, list, watched(list));
    for (int a = 0; a < on.rows.n; ++a) {
      problem.active[a] = active[on.rows.row[a]];
      problem.high[a] = high[on.rows.row[a]];
    }
    return true;
  }

  // The rate at which a winch winds back what has slipped, over a step dt.
  FAN_FN Real winding(int i, double dt) const {
    using std::sqrt;
    if (!(winches.rewind_speed[i] > 0.0) || !(dt > 0.0)) return Real(0.0);
    const Real most = slip[i] * (1.0 / dt), braked = sqrt(Real(2.0 * kBrake) * slip[i]);
    Real speed = Real(winches.rewind_speed[i]);
    speed = select(braked < speed, braked, speed);
    return -select(most < speed, most, speed);
  }

  // A winch at its largest tension gives way by what its string lacks.
  FAN_FN void give_way(const Footing<Model, Real>& on) {
    for (int i = 0; i < S; ++i) found_.slips[i] = Real(0.0) > Real(1.0);
    for (int a = 0; a < on.rows.n; ++a) {
      const int r = on.rows.row[a];
      if (!winches.slips(r)) continue;
      found_.slips[r] = on.rows.problem.high[a] && found_.h[r] > Real(0.0);
      Real& next = found_.slip_next[r];
      next += select(found_.slips[r], found_.h[r], Real(0.0));
      next = select(next > Real(kNoSlip), next, Real(0.0));
    }
  }

  // What impulses at the node do, of which `made` tells whether they have acted on its velocities:
  // work of the driven ends, and the energy that they take.
  FAN_FN void account(const Real* x, bool made) {
    const auto& rows = node.rows;
    Real rate[room(M)];
    rows.along(moving_, rate);
    constexpr int stride = Complementarity<Real, M>::N;
    for (int a = 0; a < rows.n; ++a) {
      const Real own = x[rows.row[a]];
      Real change = Real(0.0);
      for (int b = 0; b < rows.n; ++b) change -= rows.problem.G[a * stride + b] * x[rows.row[b]];
      work += own * rows.hdot_K[a];
      const Real mean = rate[a] + rows.hdot_K[a] + (made ? -0.5 : 0.5) * change;
      lost_[rows.row[a]] += own * mean;
    }
  }

  static constexpr double kRaise = 1e-10, kTolerance = 1e-13, kMostImpulse = 1.0;  // s
  Found<Model, Real> found_;
  Mask stiff_ = Real(0.0) > Real(1.0);  // lanes in which F has to take in the damping
  Real momentum_[room(N)], moving_[room(N)], mu_[room(M)], lost_[room(M)];
  Real before_[room(N)], slip_rate_[room(S)];
  Real left_[room(N)];  // z of the step that was found
  Mask near_[room(M)];
  Broyden<N, Real> quick_;
};

}  // namespace fan
