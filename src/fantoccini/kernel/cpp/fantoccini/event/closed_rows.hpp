// An instant: catches with their impulse, and the choice of the next active set.
//
//   v_D+ = v_D- - M_DD^-1 A_D^T Lambda,   Lambda >= 0,   hdot+ <= -e max(hdot-, 0),
//   complementary                                                                   (Eqs. 13-15)
//   tau >= 0, hddot <= 0, tau . hddot = 0   over the rows with h = 0 and hdot = 0       (Sec. IV)
//
// A string on a slipping winch takes no impulse: when caught it begins to slip, and where its
// tension would exceed the winch's largest it slips at that.
#pragma once

#include "fantoccini/event/attempts.hpp"
#include "fantoccini/event/flow.hpp"
#include "fantoccini/solvers/least_norm.hpp"

namespace fan {

template <class Model>
struct ClosedRows {
  using F = Flow<Model>;
  using Tolerance = ClosedRowTolerances;
  static constexpr int N = F::N, NQ = F::NQ, S = F::S, M = F::M;
  using Set = ActiveSet<M, N>;

  double impulse[array_size(M)];  // of the last catch, by row
  double speed[array_size(M)];    // hdot before it
  double lost = 0.0;              // kinetic energy lost in it
  double stopped = 0.0;           // largest |hdot| of a held row before the last hold
  bool brought = false;  // whether the last hold also stopped a closed row that is not held
  double
      attribution[array_size(M)];  // after IMPOSSIBLE_INPUT: rows that no motion satisfies together

  // Brings the held rows to h = 0 and all others nearby to h <= 0, with the smallest change of the
  // configuration at (t, y) in the metric of M_DD. The flow's evaluation must be that of (t, y).
  Status retreat(F& f) {
    int list[array_size(M)] = {}, n = 0;
    for (int r = 0; r < M; ++r)
      if (f.row_state[r] == HELD || f.eval.height(r) > -Tolerance::nearby_gap * f.row_scale(r))
        list[n++] = r;
    f.rows.gather(f.eval, f.y + NQ, list, n);
    double h[array_size(M)];
    for (int r = 0; r < M; ++r)
      h[r] = f.row_state[r] == SLIPPING ? -WinchTolerances::max_length_error - f.slip_now[r]
                                        : f.eval.height(r);
    const auto violation = [&] {
      double worst = 0.0;
      for (int a = 0; a < n; ++a) {
        const bool held = f.row_state[list[a]] == HELD;
        const double relative = (held ? fabs(h[list[a]]) : h[list[a]]) / f.row_scale(list[a]);
        const double beyond = relative - (held ? Tolerance::held_gap : FlowTolerances::closed_gap);
        if (!(beyond <= worst) && worst == worst) worst = beyond;  // a NaN stays
      }
      return worst;
    };
    return correct<NQ>(f.y, violation, [&] {
      begin(Tolerance::contradiction);
      for (int a = 0; a < n; ++a) {
        const bool held = f.row_state[list[a]] == HELD;
        f.rows.two_sided[a] = f.rows.two_sided[a] || held;
        if (f.row_state[list[a]] == SLIPPING) add_floor(f, a, h[list[a]]);
        else add_row(f, a, h[list[a]], unbounded, held ? Set::BASIC : Set::LOW);
      }
      const Status status = settle(f);
      if (status != RUNNING) return status;
      double move[array_size(N)];
      push(f, move);
      retract<typename Model::Dynamic>(f.y, move, f.y);
      f.heights(f.y, h, true);
      return RUNNING;
    });
  }

  // Applies the impulse over the rows `closed` at (t, y) and adds its work. The flow's evaluation
  // must be that of (t, y).
  Status strike(F& f, const bool* closed) {
    int list[array_size(M)], n = 0;
    for (int r = 0; r < M; ++r) {
      impulse[r] = speed[r] = 0.0;
      if (!closed[r]) continue;
      speed[r] = f.rate_of(r, f.y + NQ);
      if (!f.winches.slips(r)) list[n++] = r;
    }
    f.rows.gather(f.eval, f.y + NQ, list, n);
    Status status = bounce(f, 1.0);
    // Unequal restitutions may add energy; all are then scaled down until none is added.
    if (status == RUNNING && lost < 0.0) {
      double low = 0.0, high = 1.0;
      for (int halving = 0; halving < Tolerance::restitution_halvings; ++halving) {
        const double mid = 0.5 * (low + high);
        if (bounce(f, mid) != RUNNING || lost < 0.0) high = mid;
        else low = mid;
      }
      status = bounce(f, low);
    }
    if (status != RUNNING) return status;
    // Impulses of redundant rows are distributed like their tensions.
    bool every[array_size(M)];
    for (int a = 0; a < n; ++a) every[a] = true;
    set_.complete(every);
    least_.apply(set_);
    for (int a = 0; a < n; ++a) impulse[list[a]] = set_.x[a];
    apply(f);
    return RUNNING;
  }

  // Chooses the active set `next` at (t, y) among the rows that are closed and at rest; the flow's
  // own SLACK is unchanged, the caller sets it. Rows in `loose` have just lost their tension and
  // stay held only if they pull. Strings in `strained` have just reached their winch's largest
  // tension and stay held only below it. An implicit step (attempts.hpp) treats closed strings on
  // winches as exactly closed: their slips absorb up to WinchTolerances::max_length_error of either
  // sign.
  Status choose(
      F& f, const bool* loose, const bool* strained, Hold* next,
      double closeness = FlowTolerances::closed_gap, const Attempt& how = Attempts::list[0]) {
    const double ahead = how.ahead;
    double rate[F::NY];
    f.settle_slip(f.t);
    for (int r = 0; r < M; ++r) f.row_state[r] = next[r] = SLACK;
    f.evaluate(f.t, f.y, rate);
    const double max_speed = how.rest_speed * speed_scale(f);
    const double hop_time = Tolerance::max_rest_hop * (how.rest_speed / Tolerance::max_rest_speed);
    double slip_before[array_size(S)];
    for (int i = 0; i < S; ++i) slip_before[i] = f.slip[i];
    if (ahead > 0.0) {
      for (int i = 0; i < S; ++i)
        if (f.winches.slips(i) && fabs(f.eval.h[i]) <= WinchTolerances::max_length_error &&
            fabs(f.eval.hdot[i]) <= max_speed)
          f.slip[i] += f.eval.h[i];
      f.evaluate(f.t, f.y, rate);
    }
    int all[array_size(M)] = {}, list[array_size(M)] = {}, n_all = 0, n = 0;
    for (int r = 0; r < M; ++r)
      if (f.eval.height(r) >= -closeness * f.row_scale(r) || (r < S && Model::wire[r]))
        all[n_all++] = r;
    f.rows.gather(f.eval, f.y + NQ, all, n_all);
    for (int a = 0; a < n_all; ++a) {
      const int r = all[a];
      const double hdot = f.rows.hdot[a];
      const bool hops = hdot < 0.0 && -2.0 * hdot <= hop_time * f.rows.hddot[a];
      const bool rests = ahead > 0.0 || fabs(hdot) <= max_speed || hops || f.rows.two_sided[a];
      if (!rests && f.winches.slips(r) && f.rows.hdot[a] > 0.0) next[r] = SLIPPING;
      if (rests || next[r] == SLIPPING) list[n++] = r;
    }
    f.rows.gather(f.eval, f.y + NQ, list, n);
    begin(Tolerance::contradiction * f.hddot_scale());
    for (int a = 0; a < n; ++a)
      if (next[list[a]] != SLIPPING) {
        add_pull(f, next, a, Set::BASIC);
        if (!(ahead > 0.0)) continue;
        // hdot <= 0 must also hold at the start of the step, where the winch has not braked yet.
        const double hdot = f.rows.hdot[a];
        set_.b[set_.n - 1] += hdot / ahead + (hdot > 0.0 ? f.braking(list[a]) : 0.0);
      }
    Status status = settle(f);
    if (ahead > 0.0 && status == IMPOSSIBLE_INPUT) {
      // Rates of strings on winches that cannot slip may disagree by this much.
      set_.noise += Tolerance::strict_rest_speed * speed_scale(f) / ahead;
      status = settle(f);
    }
    if (status != RUNNING) return status;
    bool stays[array_size(M)];
    for (int i = 0; i < set_.n; ++i) stays[i] = !loose[row_[i]];
    set_.complete(stays);
    double largest = 0.0;
    for (int i = 0; i < set_.n; ++i)
      if (fabs(set_.x[i]) > largest) largest = fabs(set_.x[i]);
    for (int i = 0; i < set_.n; ++i) {
      const int r = row_[i];
      next[r] = state_of(i);
      if (next[r] != HELD || set_.two_sided[i]) continue;
      // A tension that has just reached its bound, and is there up to rounding, will exceed it.
      if (loose[r] && set_.x[i] <= Tolerance::tension_at_bound * largest + rounding(f, i))
        next[r] = SLACK;
      if (strained[r] && set_.x[i] >= set_.upper[i] - Tolerance::tension_at_bound * largest)
        next[r] = SLIPPING;
    }
    // The slip of a slack string absorbs no gap.
    for (int i = 0; i < S; ++i) {
      if (next[i] == SLACK && f.slip[i] < slip_before[i]) f.slip[i] = slip_before[i];
      if (next[i] == SLACK && f.slip[i] < 0.0) f.slip[i] = 0.0;
    }
    return RUNNING;
  }

  // Brings the held rows to h = 0 and hdot = 0 at (t, y), without moving other closed rows past
  // their bounds: hdot = 0 on the held rows, hdot <= 0 on the rest, and a string that begins to
  // slip is not wound back faster than its winch winds. Adds to the work. Bringing nearly dependent
  // rows to rest may take much energy: returns NOT_SETTLED if it adds more than how.gain, after
  // correcting the configuration. The flow's evaluation must be that of (t, y).
  Status hold(F& f, const Attempt& how) {
    double rate[F::NY];
    stopped = 0.0;
    brought = false;
    for (int a = 0; a < f.rows.n; ++a)
      if (f.row_state[f.rows.row[a]] == HELD && fabs(f.rows.hdot[a]) > stopped)
        stopped = fabs(f.rows.hdot[a]);
    const Status status = retreat(f);
    if (status != RUNNING) return status;
    f.evaluate(f.t, f.y, rate);
    int list[array_size(M)] = {}, n = 0;
    for (int r = 0; r < M; ++r) {
      // A row that closes faster is about to be caught, or to slip. At a lower speed the winch
      // would grip immediately, and its string would close again.
      const bool closed = f.eval.height(r) >= -FlowTolerances::closed_gap * f.row_scale(r) &&
                          f.row_state[r] != SLIPPING && f.rate_of(r, f.y + NQ) <= rest_speed(f);
      if (f.row_state[r] == HELD || f.row_state[r] == SLIPPING || closed) list[n++] = r;
    }
    f.rows.gather(f.eval, f.y + NQ, list, n);
    begin(how.disagreement * speed_scale(f));
    for (int a = 0; a < n; ++a) {
      const bool held = f.row_state[list[a]] == HELD;
      f.rows.two_sided[a] = f.rows.two_sided[a] || held;
      if (f.row_state[list[a]] == SLIPPING) add_floor(f, a, f.violation(list[a]));
      else add_row(f, a, f.rows.hdot[a], unbounded, held ? Set::BASIC : Set::LOW);
    }
    const Status settled = settle(f);
    if (settled != RUNNING) return settled;
    double gain = 0.0;
    for (int a = 0; a < n; ++a) gain -= 0.5 * set_.x[a] * (set_.b[a] - set_.s[a]);
    if (f.winches.some_slip) gain = fabs(gain);
    if (gain > how.gain * f.weight()) return NOT_SETTLED;
    for (int a = 0; a < n; ++a)
      brought = brought || (f.row_state[list[a]] == SLACK && set_.place[a] == Set::BASIC);
    apply(f);
    return RUNNING;
  }

  // Whether row r opens at the flow's latest evaluation, faster than a row at rest.
  bool leaves(const F& f, int r) const { return f.rate_of(r, f.y + NQ) < -rest_speed(f); }

  // |hdot| up to which a closed row is at rest.
  double rest_speed(const F& f) const { return Tolerance::max_rest_speed * speed_scale(f); }

  // The tensions of the flow's latest evaluation, by row. If rows are redundant, those of least
  // norm among all that give the same motion.
  void tensions(const F& f, double* out) {
    bool redundant = false;
    for (int r = 0; r < M; ++r) {
      out[r] = f.tension[r];
      redundant = redundant || f.row_state[r] == IDLE || f.row_state[r] == PINNED;
    }
    if (!redundant) return;
    begin(0.0);
    for (int a = 0; a < f.rows.n; ++a) {
      const Hold mode = f.row_state[f.rows.row[a]];
      if (mode == SLIPPING) continue;
      const auto place = mode == HELD ? Set::BASIC : (mode == IDLE ? Set::IDLE : Set::PINNED);
      add_pull(f, f.row_state, a, place);
      set_.x[set_.n - 1] = f.tension[f.rows.row[a]];
    }
    set_.adopt();
    least_.apply(set_);
    for (int i = 0; i < set_.n; ++i) out[row_[i]] = set_.x[i];
  }

 private:
  void begin(double noise) {
    set_.n = 0;
    set_.noise = noise;
  }

  void add_row(const F& f, int a, double b, double upper, typename Set::Place guess) {
    const int i = set_.n++;
    row_[i] = f.rows.row[a];
    set_.column[i] = f.rows.column[a];
    set_.b[i] = b;
    set_.upper[i] = upper;
    sign_[i] = 1.0;
    set_.two_sided[i] = f.rows.two_sided[a];
    set_.place[i] = guess;
  }

  // Adds gathered row a, of a string that slips, with the opposite sign: its slip, or the rate of
  // it, must increase by at least b.
  void add_floor(const F& f, int a, double b) {
    const int i = set_.n;
    add_row(f, a, b, unbounded, Set::LOW);
    for (int j = 0; j < N; ++j) negated_[a][j] = -f.rows.column[a][j];
    set_.column[i] = negated_[a];
    set_.two_sided[i] = false;
    sign_[i] = -1.0;
  }

  // Adds gathered row a to the rows whose tension is unknown; the tensions of slipping ones are
  // known.
  void add_pull(const F& f, const Hold* mode, int a, typename Set::Place guess) {
    constexpr int stride = Complementarity<double, M>::N;
    double hddot = f.rows.hddot[a];
    for (int b = 0; b < f.rows.n; ++b)
      if (mode[f.rows.row[b]] == SLIPPING)
        hddot -= f.rows.problem.G[a * stride + b] * f.winches.max_tension[f.rows.row[b]];
    const int r = f.rows.row[a];
    add_row(f, a, hddot, f.winches.largest(r), guess);
  }

  // Rounding error of row i's tension from that of its hddot.
  double rounding(const F& f, int i) const {
    double square = 0.0;
    for (int j = 0; j < N; ++j) square += set_.column[i][j] * set_.column[i][j];
    return Tolerance::acceleration_rounding * f.hddot_scale() / square;
  }

  // Solves for the impulses with every restitution times `scale`, and the energy that they remove.
  Status bounce(F& f, double scale) {
    begin(Tolerance::contradiction * speed_scale(f));
    for (int a = 0; a < f.rows.n; ++a) {
      const int r = f.rows.row[a];
      const double hdot = f.rows.hdot[a];
      const double back = r < S && hdot > 0.0 ? scale * f.winches.restitution[r] * hdot : 0.0;
      const bool pulls = hdot > 0.0 || f.row_state[r] == HELD;
      add_row(f, a, hdot + back, unbounded, pulls ? Set::BASIC : Set::LOW);
    }
    const Status status = settle(f);
    if (status != RUNNING) return status;
    lost = 0.0;
    double gross = 0.0;
    for (int i = 0; i < set_.n; ++i) {
      const double after = f.rows.hdot[i] - set_.s[i] - set_.b[i];
      lost += set_.x[i] * 0.5 * (f.rows.hdot[i] + after);
      gross += fabs(set_.x[i] * f.rows.hdot[i]);
    }
    if (fabs(lost) < Tolerance::loss_rounding * gross) lost = 0.0;
    return RUNNING;
  }

  Hold state_of(int i) const {
    switch (set_.place[i]) {
      case Set::BASIC: return HELD;
      case Set::IDLE: return IDLE;
      case Set::PINNED: return PINNED;
      case Set::HIGH: return SLIPPING;
      default: return SLACK;
    }
  }

  // Largest |v_D|, at least 1.
  double speed_scale(const F& f) const {
    double largest = 1.0;
    for (int j = 0; j < N; ++j)
      if (fabs(f.y[NQ + j]) > largest) largest = fabs(f.y[NQ + j]);
    return largest;
  }

  // Solves the problem. For impossible inputs, `attribution` gives the rows that cannot hold
  // together.
  Status settle(const F& f) {
    for (int i = 0; i < set_.n; ++i)
      if (!is_finite(set_.b[i])) return NOT_FINITE;
    const Solved solved = set_.solve();
    double largest = 0.0;
    for (int i = 0; i < set_.n; ++i)
      if (!(fabs(set_.x[i]) <= largest) && largest == largest) largest = fabs(set_.x[i]);
    if (solved == Solved::YES && largest <= f.opt.tension_cap) return RUNNING;
    for (int r = 0; r < M; ++r) attribution[r] = 0.0;
    for (int i = 0; i < set_.n; ++i)
      attribution[row_[i]] =
          solved == Solved::YES ? fabs(set_.x[i]) / largest : ray_share(i, solved);
    return solved == Solved::UNSETTLED ? NOT_SETTLED : IMPOSSIBLE_INPUT;
  }

  // Component of row i in the ray that proves the rows contradictory, relative to the largest.
  double ray_share(int i, Solved solved) const {
    if (solved != Solved::INFEASIBLE) return 0.0;
    double largest = 0.0;
    for (int j = 0; j < set_.n; ++j)
      if (fabs(set_.ray[j]) > largest) largest = fabs(set_.ray[j]);
    return (set_.two_sided[i] ? fabs(set_.ray[i]) : set_.ray[i]) / largest;
  }

  // Applies the solved impulses and adds the inputs' work in them. All gathered rows must be in the
  // set, in order.
  void apply(F& f) {
    double change[array_size(N)];
    push(f, change);
    for (int a = 0; a < f.rows.n; ++a) {
      const int r = f.rows.row[a];
      const double x = sign_[a] * set_.x[a];
      f.y[F::WORK] += x * f.rows.hdot_K[a];
      if (f.winches.slips(r)) f.y[F::SLIP_LOSS] += x * f.slip_rate[r];
    }
    for (int j = 0; j < N; ++j) {
      f.y[F::WORK] += f.eval.M_DK_v_K[j] * change[j];
      f.y[NQ + j] += change[j];
    }
  }

  // Sets `change` to -M^-1 A^T x over the gathered rows, all of which must be in the set, in order.
  void push(const F& f, double* change) const {
    double w[array_size(N)], pull[array_size(M)] = {};
    for (int j = 0; j < N; ++j) w[j] = 0.0;
    for (int a = 0; a < f.rows.n; ++a) pull[a] = -sign_[a] * set_.x[a];
    f.rows.add(pull, w);
    f.eval.solve_factor(w, change);
  }

  Set set_;
  int row_[array_size(M)];                        // of each column of the set
  double sign_[array_size(M)];                    // -1 for rows of add_floor(), else 1
  double negated_[array_size(M)][array_size(N)];  // their columns, negated
  LeastNorm<Set> least_;
};

}  // namespace fan
