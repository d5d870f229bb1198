// Time-stepping: a fixed step with complementarity on velocities and the position term,
//
//   (M + dt D) (v+ - v) = dt (u - c(q, v_ahead) - D v) - A_D^T Lambda,   Lambda >= 0
//   h/dt + A_D v+ + A_K dq_K/dt <= 0, complementary to Lambda;          q+ = q moved by dt v+
//
// with dq_K the exact increment of the inputs, damping and drag D implicit, and Lambda capped, so
// that every step has a solution. The speed at which a violated row recovers is limited, and at
// most h over a full step: a short last step would make it an impact. The velocity products in c
// are evaluated half a step ahead, extrapolated from the accelerations a of the two previous steps,
//
//   v_ahead = v + dt (a/2 + (a - a-)/4)
//
// At v they would add energy to spinning bodies, by exp((w dt)^2 t/dt); with a/2 alone by exp((w
// dt)^4 t/2dt), which the quarter removes. At the start, after a catch and where the speed was
// limited, v_ahead is v. Without `extrapolates` it always is, and a step depends on its state
// alone.
//
// A slipping winch caps Lambda at its largest tension times dt; the remaining speed lengthens its
// slip. Once a row has been violated by stirred_violation, all velocities are scaled down if a step
// would turn a coordinate by more than max_turn_per_step or move one by more than
// max_move_per_step; before, by unstirred_factor times as much. Contacts that rebound touch first:
// touching_step.hpp. Written for any Real: lanes step together, each with its own rows.
#pragma once

#include <type_traits>

#include "fantoccini/model/evaluation.hpp"
#include "fantoccini/model/winch.hpp"
#include "fantoccini/timestepping/position_term.hpp"
#include "fantoccini/timestepping/single_lanes.hpp"
#include "fantoccini/timestepping/speed_limit.hpp"
#include "fantoccini/timestepping/tolerances.hpp"
#include "fantoccini/timestepping/touching_step.hpp"

namespace fan {

template <class Model, class Real>
struct TimeStep {
  static constexpr int NQ = Model::n_qD, N = Model::n_vD, S = Model::n_strings;
  static constexpr int M = Model::n_rows;
  using Mask = typename Traits<Real>::Mask;
  using Tolerance = TimeSteppingTolerances;
  static constexpr bool touches = Model::n_contacts > 0;
  using Rows = RowSystem<Model, Real>;

  Evaluation<Model, Real> eval;
  Rows rows;
  // Whether lanes may make separate steps, for their contacts.
  static constexpr bool separate_lanes = touches && (Traits<Real>::width > 1);
  using Contacts =
      std::conditional_t<separate_lanes, ContactLanes<Model, Real>, ContactStep<Model, Real>>;
  std::conditional_t<touches, Contacts, NoContacts> contacts;
  std::conditional_t<touches && !separate_lanes, TouchingStep<Model>, NoTouchingStep> touching;
  const ContactArrays* solids = nullptr;  // null: no contacts
  double whole = 0.0;                     // s: the run's step; its last one may be shorter
  bool forced = true;                     // whether u_D is not 0
  bool extrapolates = true;  // otherwise v_ahead is v: a step depends on its state alone
  // Whether the next step may extrapolate the last one, and whether the last one could.
  Mask steady = Real(0.0) > Real(1.0), was_steady = steady;
  Real tension[array_size(M)];  // Lambda / dt
  Mask taut[array_size(M)];     // rows that pulled in the last step; set by set_row()
  Mask pulled[array_size(M)];   // the same, except for rows that the first step of a run catches
  Mask held[array_size(M)];     // rows that pulled in the last two steps
  Real slip[array_size(S)];     // m, >= 0
  Mask slips[array_size(S)];    // in the last step
  Real work, impact, slip_loss, friction, violation;
  Real speed_bound;                   // at least |v|^2 after the last step
  Mask settled;                       // whether the last step's complementarity was solved
  Mask idle = Real(0.0) > Real(1.0);  // lanes that have stopped: no row takes part in them
  // Whether a row has ever been violated by more than stirred_violation.
  Mask was_violated = Real(0.0) > Real(1.0);

  // Sets the options of a run and starts without any contact.
  FAN_FN void ready(const Options& options) {
    extrapolates = options.extrapolate != 0;
    whole = options.dt;
    solids = options.contacts;
    limits_near_ = limits_pull_ = limits_pulled_ = true;
    if constexpr (touches)
      if (solids) contacts.begin(*solids);
    if constexpr (touches) contacts.looks_ahead = extrapolates;
    if constexpr (separate_lanes)
      if (solids) singles_.ready(options);
  }

  // Steps from q_D, v_D to q_next, v_next, which are other arrays. (q_K, v_K, acc_K) are the inputs
  // at the start of the step with v_K = dq_K/dt and acc_K the mean acceleration; `taut` is the
  // active set of the previous step.
  FAN_FN void step(
      const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K, const Real* acc_K,
      const Real* u_D, double dt, double recovery_speed, double cap, const Winches<S>& winches,
      const Real* p, Real* q_next, Real* v_next) {
    if constexpr (separate_lanes)
      if (solids) singles_.save(*this);
    const auto begin = [&](auto* q, auto* v, auto* q_in, double part, double left) {
      begin_step(q, v, q_in, v_K, acc_K, u_D, part, left, recovery_speed, winches, p);
    };
    begin(q_D, v_D, q_K, dt, dt);
    const auto end = [&](auto* v, double part, bool may_part) {
      const double part_cap = cap * (dt / part);
      return respond(v, v_K, u_D, part, recovery_speed, part_cap, winches, may_part, v_next);
    };
    if constexpr (touches && !separate_lanes)
      if (solids)
        return touching.step(*this, begin, end, q_D, v_D, q_K, v_K, p, dt, q_next, v_next);
    end(v_D, dt, false);
    retract<typename Model::Dynamic>(q_D, v_next, dt, q_next);
    if constexpr (separate_lanes)
      if (any(separate()))
        singles_.step(
            *this, separate(), q_D, v_D, q_K, v_K, acc_K, u_D, dt, recovery_speed, cap, winches, p,
            q_next, v_next);
  }

  // Whether gathered row a closes faster than the forces of a step dt move it.
  FAN_FN Mask closes_fast(int a, double dt) const {
    const Real forced = dt * rows.free_acc[a];
    return rows.hdot[a] > maximum(forced, Real(0.0)) + Real(Tolerance::catching_speed);
  }

  // closes_fast() of row r in the last step, for lanes that made it separately.
  FAN_FN Mask closed_fast_singly(int r) const {
    if constexpr (separate_lanes) return singles_.fast[r] && separate();
    else return Real(0.0) > Real(1.0);
  }

  template <class Memory>
  FAN_FN void remember(Memory& memory) {
    memory.keep(
        accs_[acc_at_], accs_[1 - acc_at_], steady, was_steady, was_violated, tension, taut, pulled,
        held);
    if constexpr (touches) contacts.remember(memory);
  }

  // Sets whether row r pulled in the last step, and in the one before.
  FAN_FN void set_row(int r, const Mask& last, const Mask& before) {
    taut[r] = pulled[r] = last;
    held[r] = last && before;
    limits_pull_ = limits_pulled_ = true;
  }

  // Stops extrapolation in the next step of these lanes.
  FAN_FN void forget(const Mask& where) { steady = steady && !where; }

  // (v+ - v) / dt of the last step.
  FAN_FN const Real* acc() const { return accs_[acc_at_]; }

  // Sets acc() to zero before the first step.
  FAN_FN void clear_acc() {
    for (int k = 0; k < N; ++k) accs_[0][k] = accs_[1][k] = Real(0.0);
  }

 private:
  template <class, class>
  friend class SingleLanes;
  template <class>
  friend class TouchingStep;

  // Lanes that make the step separately.
  FAN_FN Mask separate() const {
    if constexpr (separate_lanes) return solids ? contacts.apart : Real(0.0) > Real(1.0);
    else return Real(0.0) > Real(1.0);
  }

  // Lanes in which this step does nothing: stopped or separate.
  FAN_FN Mask inactive() const { return idle || separate(); }

  // Evaluates the equations of a step of length dt, the violations of rows and contacts, and the
  // contact points; the velocities hold for `left` [s].
  FAN_FN void begin_step(
      const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K, const Real* acc_K,
      const Real* u_D, double dt, double left, double recovery_speed, const Winches<S>& winches,
      const Real* p) {
    evaluate(q_D, v_D, q_K, v_K, acc_K, u_D, dt, p);
    apply_slips(winches, dt);
    violation =
        maximum(largest_of<M - S>([&](int i) FAN_INLINE { return eval.h_limit[i]; }), Real(0.0));
    for (int i = 0; i < S; ++i) violation = maximum(string_violation(i), violation);
    was_violated = was_violated || violation > Real(Tolerance::limiting_violation);
    if constexpr (touches)
      if (solids) {
        const auto& in = *solids;
        if constexpr (separate_lanes)
          contacts.find(in, q_D, v_D, q_K, v_K, p, dt, whole, recovery_speed, idle);
        else contacts.find(in, eval, q_D, v_D, q_K, v_K, p, dt, left, whole, recovery_speed, idle);
        violation = select(contacts.violation > violation, contacts.violation, violation);
      }
  }

  FAN_OUT_OF_LINE void evaluate(
      const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K, const Real* acc_K,
      const Real* u_D, double dt, const Real* p) {
    Real v_ahead[array_size(N)];
    const Real *a = acc(), *before = accs_[1 - acc_at_];
    const Real half = select(steady, Real(0.5 * dt), Real(0.0));
    const Real quarter = select(steady && was_steady, Real(0.25 * dt), Real(0.0));
    each<N>([&](int k)
                FAN_INLINE { v_ahead[k] = v_D[k] + (half * a[k] + quarter * (a[k] - before[k])); });
    eval.at(q_D, v_D, q_K, v_K, acc_K, u_D, v_ahead, Real(dt), p);
  }

  // Computes the impulses, v_next and the step's entries of the ledger from the evaluation. Returns
  // false, with nothing done, if the step has to be made in parts and may be.
  FAN_OUT_OF_LINE bool respond(
      const Real* v_D, const Real* v_K, const Real* u_D, double dt, double recovery_speed,
      double cap, const Winches<S>& winches, bool may_part, Real* v_next) {
    Real change[array_size(N)];  // v+ - v
    choose_rows(v_D, dt);
    rows.gather_leading(eval);
    if constexpr (touches)
      if (solids) rows.copy_leading(eval);
    gather(v_D);
    solve_impulses(dt, recovery_speed, cap, winches, change);
    while (add_passed_limits(v_D, change, dt, recovery_speed, v_next) ||
           add_passed_contacts(v_D, change, v_K, dt, recovery_speed)) {
      gather(v_D);
      solve_impulses(dt, recovery_speed, cap, winches, change);
    }
    if constexpr (touches && !separate_lanes)
      if (may_part && contacts.next_strike() < unbounded) return false;
    update_slips(winches, cap, dt);
    const Mask caught = record_step(v_D, change, u_D, dt);
    Real* acc = accs_[1 - acc_at_];
    each<N>([&](int k) FAN_INLINE { acc[k] = change[k] * (1.0 / dt); });
    acc_at_ = 1 - acc_at_;
    was_steady = steady;
    steady = !caught;
    const Real factor = select(was_violated, Real(1.0), Real(Tolerance::initial_factor));
    const Mask limited = limit_speed<Model>(factor, dt, v_next, speed_bound);
    steady = steady && !limited;
    if (!extrapolates) steady = Real(0.0) > Real(1.0);
    return true;
  }

  // Converts the strings' h and hdot to the length L + slip, with the rates at which winches rewind
  // their slip.
  FAN_FN void apply_slips(const Winches<S>& winches, double dt) {
    Mask has_slip = Real(0.0) > Real(1.0);
    for (int i = 0; i < S; ++i) has_slip = has_slip || slip[i] != Real(0.0);
    may_slip_ = winches.some_slip || any(has_slip);
    if (!may_slip_) return;
    for (int i = 0; i < S; ++i) {
      winding_[i] = winches.winding(i, slip[i], dt);
      eval.h[i] -= slip[i];
      eval.hdot[i] -= winding_[i];
    }
  }

  // Adds to the slips: with Lambda at its winch's bound, -s > 0 is the speed at which a string
  // slips.
  FAN_FN void update_slips(const Winches<S>& winches, double cap, double dt) {
    slip_loss = Real(0.0);
    for (int i = 0; i < S; ++i) slips[i] = Real(0.0) > Real(1.0);
    if (!may_slip_) return;
    for (int i = 0; i < S; ++i) slip_rate_[i] = winding_[i];
    for (int a = 0; a < rows.n; ++a) {
      const int r = rows.row[a];
      if (!winches.slips(r) || winches.max_tension[r] >= cap) continue;
      const Mask slipping = rows.problem.high[a] && rows.problem.s[a] < Real(0.0);
      slips[r] = slipping;
      slip_rate_[r] -= select(slipping, rows.problem.s[a], Real(0.0));
      slip_loss -= minus_lambda_[a] * slip_rate_[r];
    }
    // The last step of unwinding ends at 0 up to rounding.
    for (int i = 0; i < S; ++i) slip[i] = maximum(Real(slip[i] + dt * slip_rate_[i]), Real(0.0));
  }

  // Chooses the rows that take part: all strings, and the limits that pulled in the previous step
  // or would be passed at the present velocity. Each lane has its own, so that its result does not
  // depend on its neighbours.
  FAN_FN void choose_rows(const Real* v_D, double dt) {
    const Mask here = !inactive();
    for (int r = 0; r < S; ++r) near_[r] = here;
    Real rate[array_size(M - S)];
    eval.limit_rates(v_D, rate);
    const auto ahead = [&](int i) FAN_INLINE { return Real(eval.h_limit[i] + dt * rate[i]); };
    if (!limits_pull_ && !limits_near_ &&
        !any(largest_of<M - S>(ahead) > Real(-Tolerance::safe_distance)))
      return;
    limits_near_ = false;
    for (int i = 0; i < M - S; ++i) {
      near_[S + i] = here && (taut[S + i] || ahead(i) > Real(0.0));
      limits_near_ = limits_near_ || any(near_[S + i]);
    }
  }

  // Sets v, the velocity with the impulses, and adds the limits that it would pass. Returns whether
  // there are any.
  FAN_FN bool add_passed_limits(
      const Real* v_D, const Real* change, double dt, double recovery_speed, Real* v) {
    Real rate[array_size(M - S)];
    each<N>([&](int k) FAN_INLINE { v[k] = v_D[k] + change[k]; });
    eval.limit_rates(v, rate);
    const PositionTerm<Real> term(dt, whole, recovery_speed);
    const auto closing = [&](int i) FAN_INLINE { return Real(rate[i] + term(eval.h_limit[i])); };
    bool more = false;
    if (any(largest_of<M - S>(closing) > Real(-Tolerance::safe_distance)))
      for (int i = 0; i < M - S; ++i) {
        const Mask passes =
            !inactive() && !near_[S + i] && closing(i) > Real(Tolerance::passing_speed);
        if (!any(passes)) continue;
        near_[S + i] = near_[S + i] || passes;
        limits_near_ = more = true;
      }
    if constexpr (touches)
      if (solids) more = contacts.watch(v) || more;
    return more;
  }

  // Adds the contact points that accelerated links would pass. Returns whether there are any.
  FAN_FN bool add_passed_contacts(
      const Real* v_D, const Real* change, const Real* v_K, double dt, double recovery_speed) {
    if constexpr (touches)
      if (!solids) return false;
      else if constexpr (separate_lanes) return contacts.look_again(change, dt);
      else return contacts.look_again(eval, v_D, change, v_K, dt, recovery_speed, idle);
    else return false;
  }

  FAN_FN void gather(const Real* v_D) {
    int list[array_size(M)];
    rows.gather_others(eval, v_D, list, list_rows(list));
  }

  // Lists the rows that take part in some lane. Returns their number.
  FAN_FN int list_rows(int* list) const {
    if (limits_near_) return rows_in_some_lane<Model>(near_, list);
    for (int r = 0; r < S; ++r) list[r] = r;
    return S;
  }

  // Violation of a string, if positive. For a wire h < 0 counts, too.
  FAN_FN Real string_violation(int i) const {
    using std::abs;
    return is_wire(i) ? Real(abs(eval.h[i])) : eval.h[i];
  }

  FAN_FN static bool is_wire(int r) { return r < S && Model::wire[r]; }

  // Solves for the impulses of the rows that take part. Sets v+ - v.
  FAN_FN void solve_impulses(
      double dt, double recovery_speed, double cap, const Winches<S>& winches, Real* change) {
    auto& problem = rows.problem;
    const PositionTerm<Real> term(dt, whole, recovery_speed);
    const Mask here = !inactive();
    const auto set_problem = [&](auto a) FAN_INLINE {
      const int r = a < Rows::leading ? int(a) : rows.row[a];
      const Mask takes_part = near_[r] && here;
      free_rate_[a] = rows.hdot[a] + dt * rows.free_acc[a];
      const Real h = eval.height(r);
      const Real closing = free_rate_[a] + (is_wire(r) ? term.of_wire(h) : term(h));
      const bool winch = winches.slips(r) && winches.max_tension[r] < cap;
      problem.b[a] = select(takes_part, closing, Real(-ComplementarityTolerances::excluded_speed));
      problem.upper[a] = Real(dt * (winch ? winches.max_tension[r] : cap));
      problem.lower[a] = is_wire(r) ? select(takes_part, Real(-cap * dt), Real(0.0)) : Real(0.0);
      problem.active[a] = is_wire(r) ? takes_part : takes_part && taut[r];
      problem.high[a] = Real(0.0) > Real(1.0);
    };
    unrolled<0, Rows::leading>(set_problem);
    for (int a = Rows::leading; a < rows.n; ++a) set_problem(a);
    const bool all = all_touch();
    settled = all ? inactive() : rows.problem.solve_firmly(inactive());
    for (int a = 0; all && a < rows.n; ++a) problem.x[a] = problem.s[a] = Real(0.0);
    if constexpr (touches)
      if (solids) solve_contacts(dt, cap);
    Real w[array_size(N)];
    for (int a = 0; a < rows.n; ++a) minus_lambda_[a] = -problem.bounded(a);
    rows.push(eval, dt, minus_lambda_, w);
    if constexpr (touches)
      if (solids) contacts.add(w);
    eval.solve_factor(w, change);
  }

  // Whether contacts take part in every active lane: the rows' problem is then part of theirs.
  FAN_FN bool all_touch() const {
    if constexpr (touches) return solids && contacts.take_part(inactive());
    else return false;
  }

  // Solves for the impulses of contacts, with those of the rows.
  FAN_FN void solve_contacts(double dt, double cap) {
    Real guess[array_size(M)];
    for (int r = 0; r < M; ++r) guess[r] = tension[r] * dt;
    if constexpr (separate_lanes) contacts.settle(eval, rows, near_, guess, dt * cap, settled);
    else contacts.settle(eval, rows, near_, guess, free_rate_, dt * cap, settled);
  }

  // Sets tensions, the active set and the step's entries of the ledger. Returns the lanes in which
  // a row was caught.
  FAN_FN Mask record_step(const Real* v_D, const Real* change, const Real* u_D, double dt) {
    Mask fresh[array_size(M)], some_caught = Real(0.0) > Real(1.0);
    // Limits that pull neither now nor in the last two steps need no change.
    const bool limits = limits_pull_ || limits_pulled_ || rows.n > S;
    limits_pulled_ = limits_pull_;
    limits_pull_ = rows.n > S;
    for (int r = 0; r < (limits ? M : S); ++r) {
      fresh[r] = !held[r];
      tension[r] = Real(0.0);
      taut[r] = Real(0.0) > Real(1.0);
    }
    work = work_of_step<Model>(eval, forced ? u_D : nullptr, v_D, change, dt);
    impact = friction = Real(0.0);
    for (int a = 0; a < rows.n; ++a) {
      const int r = rows.row[a];
      const Real x = -minus_lambda_[a];
      tension[r] = x * (1.0 / dt);
      taut[r] = rows.two_sided[a] ? Real(1.0) > Real(0.0) : x > Real(0.0);
      work += x * rows.hdot_K[a];
      // A catch takes two steps: the first ends where the row closes, the second stops it.
      fresh[r] = fresh[r] && taut[r];
      some_caught = some_caught || fresh[r];
    }
    if (any(some_caught))
      for (int a = 0; a < rows.n; ++a) add_catch_loss(a, fresh[rows.row[a]]);
    for (int r = 0; r < (limits ? M : S); ++r) {
      held[r] = taut[r] && pulled[r];
      pulled[r] = taut[r];
    }
    if constexpr (touches)
      if (solids) {
        const Real struck = contacts.account();
        some_caught = some_caught || struck > Real(0.5);
        work += contacts.work;
        impact += contacts.impact;
        friction = contacts.friction;
        if constexpr (!separate_lanes) violation = maximum(violation, Real(contacts.early));
      }
    return some_caught;
  }

  // Adds the energy lost when gathered row a is caught in the lanes `caught`.
  FAN_FN void add_catch_loss(int a, const Mask& caught) {
    if (!any(caught)) return;
    Real after = free_rate_[a];
    for (int b = 0; b < rows.n; ++b) after += rows.problem.at(a, b) * minus_lambda_[b];
    if constexpr (touches)
      if (solids) after -= contacts.rate_by_impulses(rows, a);
    Real lost = 0.5 * (rows.hdot[a] + after);
    const int r = rows.row[a];
    if (r < S) lost -= select(slips[r], slip_rate_[r], Real(0.0));  // that is in slip_loss
    impact -= select(caught, Real(minus_lambda_[a] * lost), Real(0.0));
  }

  std::conditional_t<separate_lanes, SingleLanes<Model, Real>, NoContacts> singles_;
  Real accs_[2][array_size(N)] = {};                // (v+ - v) / dt of the last two steps
  int acc_at_ = 0;                                  // index of the last one's
  bool may_slip_ = false;                           // whether a string slips in some lane, or may
  bool limits_near_ = true;                         // whether a limit may take part in some lane
  bool limits_pull_ = true, limits_pulled_ = true;  // in the last two steps
  Real winding_[array_size(S)], slip_rate_[array_size(S)];
  Mask near_[array_size(M)];          // lanes in which the row takes part in this step
  Real minus_lambda_[array_size(M)];  // -Lambda, by gathered row
  Real free_rate_[array_size(M)];  // hdot at the end of the step without impulses, by gathered row
};

}  // namespace fan
