// A trajectory of the variational integrator: follows the inputs, halves steps that do not
// converge, computes the ledger and sets the status. Written for any Real, with the interface of
// runs/stepping.hpp: every lane halves its own step, and waits for the others at the end of the
// whole one.
#pragma once

#include "fantoccini/contract.hpp"
#include "fantoccini/math/lane_of.hpp"
#include "fantoccini/model/motor_watch.hpp"
#include "fantoccini/solvers/active_set.hpp"
#include "fantoccini/variational/step.hpp"

namespace fan {

struct StepHalvingTolerances {
  // Smallest part of a step that is tried; a step that fails there stops the run.
  static constexpr double smallest_part = 1.0 / 4096.0;
  // Parts down to this are halved if only inaccurate (VariationalStep::resolves); smaller ones are
  // accepted.
  static constexpr double smallest_accurate_part = 1.0 / 512.0;
  // s: bound of the impulse of a catch, and of impulses it causes: the tension cap over this time.
  static constexpr double catch_time = NodeTolerances::max_impulse_time;
};

template <class Model_, class Real_>
struct VariationalTrajectory {
  using Model = Model_;
  using Real = Real_;
  using Step = VariationalStep<Model, Real>;
  using Inputs = typename Step::Inputs;
  using Mask = typename Traits<Real>::Mask;
  using Tolerance = StepHalvingTolerances;
  static constexpr int width = Traits<Real>::width, NQ = Model::n_qD, N = Model::n_vD;
  static constexpr int S = Model::n_strings, M = Model::n_rows, NK = Model::n_vK;
  static constexpr bool touches = false;
  static constexpr bool makes_parts = true;  // a run may stop within a step

  Step at;
  MotorWatch<Model, Real> motors;
  Options opt;
  Real t;  // s
  Real work, damping, impact, slip_loss, worst_violation;
  Real status;  // a Status: RUNNING, or the reason for the trajectory's stop
  double attribution[width][array_size(M)];
  // Of the last whole step.
  Real pull[array_size(M)];  // N or N m: mean tensions

  // Sets the time and options of all lanes; states and parameters are set afterwards.
  void set(double start, const Options& options, const double* winches) {
    t = Real(start);
    opt = options;
    node().cap = options.tension_cap;
    const double least = options.force_scale * options.dt;
    at.least = fmax(least * least, negligible);
    node().winches.set(winches);
  }

  auto& node() { return at.here; }
  Real* q_D() { return node().q_D; }
  Real* v_D() { return node().v_D; }
  Real* slip() { return node().slip; }
  Real contact_residual() const { return Real(0.0); }
  Real* p() { return node().p; }
  const Real* acc() const { return at.acc; }
  const Mask* taut() const { return at.here.taut; }
  const Real* tension() const { return pull; }
  Inputs& inputs() { return node().now; }

  // Work, damping, impact, slip loss and friction.
  void energy_terms(Real* out) const {
    out[0] = work;
    out[1] = damping;
    out[2] = impact;
    out[3] = slip_loss;
    out[4] = Real(0.0);
  }

  // Begins at node() and the inputs at t. The tensions there are those of the first step, which is
  // tried and not made.
  template <class Drive>
  void begin(Drive& drive) {
    const Mask all = Real(0.0) < Real(1.0);
    status = Real(RUNNING);
    work = damping = impact = slip_loss = worst_violation = Real(0.0);
    for (int r = 0; r < M; ++r) {
      pull[r] = catch_impulse_[r] = Real(0.0);
      for (int l = 0; l < width; ++l) attribution[l][r] = 0.0;
    }
    for (int i = 0; i < S; ++i) slips_[i] = slipped_[i] = !all;
    drive.start(t, node().now);
    const Real dt = Real(opt.dt);
    at.begin(dt);
    const Mask solved = solve_part(drive, dt, all);
    for (int r = 0; r < M; ++r) {
      was_[r] = node().taut[r];
      const Mask pulls = solved && node().closed(r);
      node().lambda[r] = select(pulls, at.solved_impulse(r), node().lambda[r]);
      pull[r] = select(pulls, Real(at.solved_impulse(r) * (2.0 / opt.dt)), pull[r]);
    }
    restart(drive);
    motors.begin(q_D(), inputs().q_K, p());
  }

  // Call it after its bytes were read (runs/snapshot.hpp): pointers among them are invalid.
  void attach(const ContactArrays* solids) { opt.contacts = solids; }

  // Sets new inputs from here on. The momenta are unchanged, so the driven velocities must be
  // continuous.
  template <class Drive>
  void restart(Drive& drive) {
    drive.start(t, node().now);
    node().settle();
    stop(!node().settled, NOT_SETTLED);
  }

  // Advances all trajectories that still run by a step of length `whole` to the time `next`. One
  // that cannot be advanced is stopped and keeps its state.
  template <class Drive>
  void advance(Drive& drive, double next, double whole) {
    const Mask no = Real(0.0) > Real(1.0);
    const Real start = t;
    Real part = Real(whole), impulse[array_size(M)];
    for (int r = 0; r < M; ++r) {
      was_[r] = node().taut[r];
      impulse[r] = catch_impulse_[r] = Real(0.0);
    }
    for (int i = 0; i < S; ++i) {
      slipped_[i] = slips_[i];
      slips_[i] = no;
    }
    Mask goes = runs() && t < Real(next);
    const Mask went = goes;
    while (any(goes)) {
      const Mask last = !(next - t > part * (1.0 + 1e-9));
      const Real end = select(last, Real(next), Real(t + part));
      const Real dt = select(goes, Real(end - t), Real(opt.dt));
      const Mask solved = solve_part(drive, dt, goes);
      const Mask accepted =
          solved && (at.resolves(dt) || dt < Real(Tolerance::smallest_accurate_part * whole));
      const Mask rejected = goes && !accepted;
      part = select(rejected, 0.5 * dt, select(last, part, Real(2.0 * part)));
      const Mask stuck = rejected && part < Real(Tolerance::smallest_part * whole);
      for (int l = 0; any(stuck) && l < width; ++l)
        if (lane_of(stuck, l)) lane_of(status, l) = reason(l, dt);
      if (any(accepted)) take(dt, end, accepted, impulse);
      goes = runs() && t < Real(next);
    }
    const Mask moved = t > start, ends = went && moved;
    const Real rate = 1.0 / select(moved, Real(t - start), Real(1.0));
    for (int r = 0; r < M; ++r) {
      // A row that pulled in a part of the step and is slack at its end has no tension there.
      const Real mean = select(node().taut[r], Real(impulse[r] * rate), Real(0.0));
      pull[r] = select(ends, mean, pull[r]);
    }
    for (int i = 0; i < S; ++i) slips_[i] = (ends && slips_[i]) || (!ends && slipped_[i]);
    const Inputs& in = inputs();
    motors.observe(q_D(), v_D(), in.q_K, in.v_K, in.acc_K, p(), ends);
    stop(ends && motors.gone, RUNAWAY);
  }

  Mask runs() const { return status < Real(RUNNING + 0.5); }

  // Rows that the last whole step has caught and released.
  Mask caught(int r) const { return catch_impulse_[r] > Real(0.0); }
  Mask released(int r) const { return !at.here.taut[r] && (was_[r] || caught(r)); }
  Real catch_impulse(int r, double) const { return catch_impulse_[r]; }
  Mask slip_begun(int i) const { return slips_[i] && !slipped_[i]; }
  Mask slip_ended(int i) const { return slipped_[i] && !slips_[i]; }

 private:
  // Solves a part of length dt in some lanes. Returns the solved lanes.
  template <class Drive>
  Mask solve_part(Drive& drive, const Real& dt, const Mask& lanes) {
    drive.force(Real(t + 0.5 * dt), at.lead.u_D);
    drive.at(Real(t + dt), at.next_inputs);
    half_way<typename Model::Driven>(
        node().now.q_K, at.next_inputs.q_K, at.lead.q_mid, at.lead.v_mid);
    for (int j = 0; j < NK; ++j) {
      at.lead.v_mid[j] *= 1.0 / dt;
      at.lead.acc_mid[j] = (at.next_inputs.v_K[j] - node().now.v_K[j]) / dt;
    }
    return at.solve(dt, lanes);
  }

  // Makes the solved part.
  void take(const Real& dt, const Real& end, const Mask& lanes, Real* impulse) {
    at.accept(dt, lanes);
    t = select(lanes, end, t);
    const auto book = [&](Real& sum, const Real& part) { sum += select(lanes, part, Real(0.0)); };
    book(work, at.work);
    book(damping, at.loss);
    book(impact, at.impact);
    book(slip_loss, at.slip_loss);
    for (int r = 0; r < M; ++r) {
      const Real beyond = at.overstep(r);
      worst_violation = select(lanes && beyond > worst_violation, beyond, worst_violation);
      book(catch_impulse_[r], select(at.caught[r], at.impulse[r], Real(0.0)));
      book(impulse[r], select(at.caught[r], Real(0.0), at.impulse[r]));
    }
    for (int i = 0; i < S; ++i) slips_[i] = slips_[i] || (lanes && at.slips[i]);
    judge(dt, lanes);
  }

  // Checks the state after a part of a step. The cap applies to the mean tension over a whole step:
  // in a short part, the rest of a previous catch would look like a tension.
  void judge(const Real& dt, const Mask& lanes) {
    using std::abs;
    const Real square = squares<NQ>(node().q_D) + squares<N>(node().v_D);
    Real most = Real(0.0), span = select(dt > Real(opt.dt), dt, Real(opt.dt));
    for (int r = 0; r < M; ++r) {
      const Real size = abs(at.impulse[r]);
      span = select(
          at.caught[r], Real(Tolerance::catch_time),
          span);  // rows that pull share a catch's impulse
      most = select(!at.caught[r] && size > most, size, most);
    }
    stop(lanes && !(square < Real(max_state_norm * max_state_norm)), NOT_FINITE);
    stop(lanes && !node().settled, NOT_SETTLED);
    const Mask empty = lanes && is_empty(node().now) && runs();
    for (int l = 0; any(empty) && l < width; ++l)
      if (lane_of(empty, l)) attribute_to_empty(l, node().now);
    stop(empty, LENGTH_NOT_POSITIVE);
    const Mask capped = lanes && most > node().cap * span && runs();
    for (int l = 0; any(capped) && l < width; ++l)
      for (int r = 0; lane_of(capped, l) && r < M; ++r) {
        const double share = fabs(lane_of(at.impulse[r], l)) / lane_of(most, l);
        attribution[l][r] = lane_of(at.caught[r], l) ? 0.0 : share;
      }
    stop(capped, TENSION_CAP);
  }

  void stop(const Mask& lanes, Status why) { status = select(lanes && runs(), Real(why), status); }

  Mask is_empty(const Inputs& in) const {
    Mask empty = Real(0.0) > Real(1.0);
    for (int i = 0; i < S; ++i) empty = empty || is_empty(i, in);
    return empty;
  }

  // Whether the length of string i has run out, or is NaN.
  Mask is_empty(int i, const Inputs& in) const {
    const bool varies = Model::length_q[i] >= 0 || Model::wound_q[i] >= 0;
    const Real length = string_length<Model, Real>(i, at.here.q_D, in.q_K);
    return !(length > Real(varies ? LengthTolerances::min_length : -1.0));
  }

  void attribute_to_empty(int lane, const Inputs& in) {
    for (int i = 0; i < S; ++i) attribution[lane][i] = lane_of(is_empty(i, in), lane) ? 1.0 : 0.0;
  }

  // The status of a lane for which even the shortest part has no solution; sets its rows'
  // attribution.
  Status reason(int lane, const Real& parts) {
    for (int j = 0; j < NK; ++j)
      if (!(fabs(lane_of(at.next_inputs.v_K[j], lane)) < max_state_norm)) return NOT_FINITE;
    if (lane_of(is_empty(at.next_inputs), lane)) {
      attribute_to_empty(lane, at.next_inputs);
      return LENGTH_NOT_POSITIVE;
    }
    const auto& rows = node().firm.rows;
    const double dt = lane_of(parts, lane);
    ActiveSet<M, N> set;
    double columns[array_size(M)][array_size(N)];
    int row[array_size(M)];
    Real b[array_size(M)];
    at.demand(parts, b);
    node().bound(node().firm, parts);
    set.n = 0;
    for (int a = 0; a < rows.n; ++a) {
      const int r = rows.row[a];
      if (!lane_of(node().near[r], lane)) continue;
      const int place = set.n++;
      row[place] = r;
      for (int k = 0; k < N; ++k) columns[place][k] = lane_of(rows.column[a][k], lane);
      set.column[place] = columns[place];
      set.b[place] = lane_of(b[a], lane);
      set.upper[place] = node().winch_slips(r) ? lane_of(rows.problem.upper[a], lane) : unbounded;
      set.two_sided[place] = rows.two_sided[a];
      set.place[place] = ActiveSet<M, N>::LOW;
    }
    const Solved solved = set.solve();
    if (solved == Solved::UNSETTLED) return NOT_SETTLED;
    const double* share = solved == Solved::INFEASIBLE ? set.ray : set.x;
    double most = 0.0, span = 0.5 * dt;  // as Node::bound
    for (int a = 0; a < set.n; ++a) {
      // The impulse of a catch may be larger than that of a tension.
      if (share[a] != 0.0 && !lane_of(node().taut[row[a]], lane)) span = Tolerance::catch_time;
      most = fmax(most, fabs(share[a]));
    }
    for (int a = 0; a < set.n && most > 0.0; ++a) attribution[lane][row[a]] = fabs(share[a]) / most;
    if (solved == Solved::INFEASIBLE) return IMPOSSIBLE_INPUT;
    return most > node().cap * span ? TENSION_CAP : NOT_SETTLED;
  }

  // Of the last whole step.
  Real catch_impulse_[array_size(M)];  // N s or N m s: impulses of caught rows
  Mask was_[array_size(M)];            // rows that were taut before it
  Mask slips_[array_size(S)],
      slipped_[array_size(S)];  // winches that slip in it, and in the previous one
};

}  // namespace fan
