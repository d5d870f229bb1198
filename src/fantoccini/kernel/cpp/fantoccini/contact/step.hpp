// Contacts of a time step, solved as one problem with the strings and limits that take part:
//
//   gap/dt + u_n >= 0, complementary to x_n >= 0;   |x_t| <= mu x_n,
//   x_t = -mu x_n u_t/|u_t| where u_t != 0                    (Signorini, Coulomb;
//   solvers/cone.hpp)
//
// with u the velocity of the first solid relative to the second after the step, x the impulse on
// the first. As for strings, overlapping solids part at most at the recovery speed. A new contact
// with restitution e leaves with at least u_n+ = -e u_n-, unless the forces of one step would
// reverse the rebound, from where it touches (timestepping/touching_step.hpp). With friction, or
// unequal e, that may add energy; all are then scaled down until none is added. For one trajectory;
// for bundles of lanes see lanes.hpp.
#pragma once

#include "fantoccini/contact/patches.hpp"
#include "fantoccini/contact/problem.hpp"
#include "fantoccini/contact/rolling.hpp"
#include "fantoccini/contact/share.hpp"
#include "fantoccini/contact/state.hpp"

FAN_LOOPS_BEGIN

namespace fan {

template <class Model, class Real>
class ContactStep {
  using State = ContactState<Model, Real>;
  using Points = typename State::Points;

 public:
  static constexpr int C = Model::n_contacts, N = Model::n_vD, M = Model::n_rows;
  static constexpr int width = Traits<Real>::width;
  using Mask = typename Traits<Real>::Mask;
  using Tolerance = ContactStepTolerances;
  using Push = ContactPush;
  using Rates = typename Points::Rates;

  int n[width] = {};  // points that push
  Push push[width][array_size(C)];
  Real violation, work, impact, friction;  // depth; energies of the step
  Real residual = Real(0.0);               // of the law, in the last step
  double early = 0.0;  // m: largest gap across which a point rebounds; of one trajectory

  bool looks_ahead = true;  // whether points that roll are to stop in the middle of a step

  // The points considered in the last step.
  const Points& candidates() const { return state_.points; }

  // Whether patches hold in the last step.
  bool has_patches() const { return patches_.holds_some(); }

  bool too_many(int lane) const { return state_.points.too_many[lane]; }

  // Starts without any contact.
  FAN_FN void begin(const ContactArrays& in) {
    state_.points.begin(in);
    rolling_.begin(in);
    for (int l = 0; l < width; ++l) {
      n[l] = 0;
      state_.points.too_many[l] = false;
    }
    state_.points.n_max = 0;
  }

  template <class Memory>
  FAN_FN void remember(Memory& memory) {
    memory.keep_of_lanes(n);
    memory.keep_of_lanes(push);
    memory.keep_of_lanes(state_.points.too_many);
  }

  // Points at rest that push count as having pushed for long; all others are discarded.
  FAN_FN void take_as_resting() { n[0] = keep_resting(push[0], n[0]); }

  // Loads the points that pushed in the previous step and the list of near pairs; hand_over()
  // stores them after the step.
  template <class Near>
  FAN_FN void take(const Push* pushes, int n_pushes, const Near& near) {
    n[0] = n_pushes;
    for (int i = 0; i < n_pushes; ++i) push[0][i] = pushes[i];
    state_.points.near() = near;
    state_.points.too_many[0] = false;
  }
  template <class Near>
  FAN_FN int hand_over(Push* pushes, Near& near) {
    for (int i = 0; i < n[0]; ++i) pushes[i] = push[0][i];
    near = state_.points.near();
    return n[0];
  }

  // Finds the points of a step dt, which continues for `left` with its velocities, and their speeds
  // without impulses. `eval` is that of the step.
  FAN_FN void find(
      const ContactArrays& in, const Evaluation<Model, Real>& eval, const Real* q_D,
      const Real* v_D, const Real* q_K, const Real* v_K, const Real* p, double dt, double left,
      double whole, double recovery_speed, const Mask& idle) {
    state_.in = &in;
    state_.dt = dt;
    state_.left = left;
    state_.whole = whole;
    state_.points.find(
        in, q_D, v_D, q_K, v_K, p, dt, idle, [&](int l) { state_.recognise(l, push[l], n[l]); });
    violation = work = impact = friction = residual = Real(0.0);
    early = 0.0;
    for (int l = 0; l < width; ++l) {
      state_.chosen[l] = 0;
      for (int i = 0; i < state_.points.n[l]; ++i) {
        if (!state_.points.has(l, i)) continue;
        const double depth = -state_.points.point[l][i].gap;
        if (depth > lane_of(violation, l)) lane_of(violation, l) = depth;
      }
    }
    for (int r = 0; r < M; ++r) row_x_[r] = row_s_[r] = Real(0.0);
    problem_.begin();
    n_searches_ = 0;
    next_strike_ = unbounded;
    is_joined_ = false;
    for (int l = 0; l < width; ++l) {
      for (int r = 0; r < M; ++r) state_.pulls[l][r] = false;
      state_.bounces[l] = false;
      state_.scale[l] = 1.0;
      solved_with_[l] = 0;
    }
    patches_.remove_all(state_);
    if (state_.points.n_max == 0) return;
    for (int i = 0; i < state_.points.n_max; ++i) {
      const Triple<Real> start = state_.points.rate(i, v_D);
      for (int d = 0; d < 3; ++d) {
        state_.x[3 * i + d] = Real(0.0);
        state_.hdot[3 * i + d] = start[d];
      }
    }
    for (int l = 0; l < width; ++l) state_.recall(l, push[l]);
    for (int i = 0; i < state_.points.n[0]; ++i) state_.require(0, i, recovery_speed);
    if (looks_ahead) rolling_.require(state_, q_D, v_D, q_K, v_K, p, dt);
    state_.is_before_known = !state_.all_pushed();
    if (state_.is_before_known) state_.compute_before(eval);
    for (int i = 0; i < state_.points.n[0]; ++i) state_.aim(0, i);
    if (state_.is_before_known) state_.compute_required();
  }

  // Whether a point rebounds, of one trajectory.
  FAN_FN bool has_rebound() const { return state_.points.n_max > 0 && state_.bounces[0]; }

  // Times until the first rebounding point touches (negative if it overlaps), and until the next,
  // by more than `same` after that and the start [s]; unbounded if there is none.
  struct Touches {
    double first, second;
  };
  Touches touches(double same) const {
    Touches times{unbounded, unbounded};
    for (int i = 0; i < state_.points.n[0]; ++i)
      if (state_.rebound[0][i] != 0.0) times.first = fmin(times.first, touch_time(i));
    for (int i = 0; i < state_.points.n[0]; ++i)
      if (state_.rebound[0][i] != 0.0 && touch_time(i) > fmax(times.first, 0.0) + same)
        times.second = fmin(times.second, touch_time(i));
    return times;
  }

  // Whether a new point that does not rebound closes before a time t [s].
  bool closes_before(double t) const {
    for (int i = 0; i < state_.points.n[0]; ++i)
      if (state_.steps[0][i] == 0 && state_.rebound[0][i] == 0.0 && state_.near[0][i] &&
          state_.points.point[0][i].gap > 0.0 && lane_of(state_.hdot[3 * i], 0) > 0.0 &&
          touch_time(i) < t)
        return true;
    return false;
  }

  // With `held`, points that would rebound only close their gaps.
  void hold_back(bool held) { state_.holds_back = held; }

  // Time until a point that would rebound is struck by a link that impulses of the step have
  // accelerated [s]; unbounded if there is none.
  FAN_FN double next_strike() const { return next_strike_; }

  // Adds points that pushed in earlier parts of a step, of one trajectory.
  void join(const Push* earlier, int n_earlier) {
    for (int k = 0; k < n_earlier; ++k) {
      int place = 0;
      while (place < n[0] && is_before(push[0][place], earlier[k])) ++place;
      if (place < n[0] && !is_before(earlier[k], push[0][place])) {
        for (int c = 0; c < 3; ++c) push[0][place].impulse[c] += earlier[k].impulse[c];
      } else if (n[0] < C) {
        for (int j = n[0]++; j > place; --j) push[0][j] = push[0][j - 1];
        push[0][place] = earlier[k];
      }
    }
    is_joined_ = true;
  }

  // Searches again where impulses have accelerated links, by acc over the step from v_D, beyond the
  // margins of find(). Adds the points that would be passed. Returns whether there are any.
  FAN_FN bool look_again(
      const Evaluation<Model, Real>& eval, const Real* v_D, const Real* acc, const Real* v_K,
      double dt, double recovery_speed, const Mask& idle) {
    const Mask lanes = !idle && state_.points.outruns(acc, dt);
    if (!any(lanes) || n_searches_ == Tolerance::max_searches) return false;
    ++n_searches_;
    Real v[array_size(N)];
    int known[width];
    const int n_known = state_.points.n_max;
    for (int l = 0; l < width; ++l) known[l] = state_.points.n[l];
    for (int k = 0; k < N; ++k) v[k] = v_D[k] + acc[k];
    if (!state_.points.find_more(*state_.in, v, v_K, dt, lanes)) return false;
    for (int i = 3 * n_known; i < 3 * state_.points.n_max; ++i) state_.x[i] = Real(0.0);
    state_.need_before(eval);
    Real dv[array_size(N)];
    state_.unhindered(eval, dv);
    Rates free(state_.points, dv), now_at(state_.points, v_D), then(state_.points, v);
    for (int l = 0; l < width; ++l)
      for (int i = known[l]; i < state_.points.n[l]; ++i) {
        problem_.renew(i);
        const Triple<Real> start = now_at(i), by_forces = free.change(i);
        for (int d = 0; d < 3; ++d) {
          lane_of(state_.hdot[3 * i + d], l) = lane_of(start[d], l);
          lane_of(state_.b[3 * i + d], l) = lane_of(state_.before[3 * i + d], l) =
              lane_of(start[d], l) + lane_of(by_forces[d], l);
        }
        state_.steps[l][i] = state_.wait[l][i] = 0;
        state_.near[l][i] = true;
        state_.is_carried[l][i] = false;
        state_.require(l, i, recovery_speed);
        state_.aim(l, i);
        lane_of(state_.b[3 * i], l) += lane_of(state_.required[i], l);
        record_strike(l, i, lane_of(then(i)[0], l));
      }
    return true;
  }

  // Whether points take part in all lanes except `idle`.
  FAN_FN bool take_part(const Mask& idle) const {
    for (int l = 0; l < width; ++l)
      if (state_.chosen[l] == 0 && !lane_of(idle, l)) return false;
    return true;
  }

  // Adds the points that would be passed at the velocity v. Returns whether there are any.
  FAN_FN bool watch(const Real* v) {
    bool more = false;
    Rates rates(state_.points, v);
    for (int i = 0; i < state_.points.n_max; ++i) {
      const Real now = rates(i)[0];
      for (int l = 0; l < width; ++l) {
        if (!state_.points.has(l, i) || state_.near[l][i]) continue;
        const double closing = lane_of(now, l) + lane_of(state_.required[i], l);
        if (!(closing > Tolerance::passing_speed)) continue;
        state_.near[l][i] = more = true;
        record_strike(l, i, lane_of(now, l));
        ++state_.chosen[l];
      }
    }
    return more;
  }

  // Solves for the impulses of the points and of the gathered rows that take part, in lanes with
  // points. The rows' problem contains their bounds, then their impulses x and s. `near` marks the
  // rows that take part; a lane without additions since the last solve keeps its solution. `guess`
  // (n_rows) are initial impulses of the rows, `before` is the gathered rows' hdot after the step
  // without impulses.
  FAN_FN void settle(
      const Evaluation<Model, Real>& eval, RowSystem<Model, Real>& rows, const Mask* near,
      Real* guess, const Real* before, double cap, Mask& settled) {
    Real row_impulses[array_size(M)], s[array_size(M)], of_lane = Real(0.0), solved = Real(0.0);
    int taking_part[width];
    Real n_near = Real(0.0);
    for (int a = 0; a < rows.n; ++a) n_near += select(near[rows.row[a]], Real(1.0), Real(0.0));
    for (int l = 0; l < width; ++l) taking_part[l] = state_.chosen[l] + int(lane_of(n_near, l));
    bool held = false;  // whether patches solve all of it
    if (state_.chosen[0] != 0 && taking_part[0] != solved_with_[0] && !rolling_.any_rolls)
      held = patches_.hold(state_, eval, rows, near, guess, cap, row_impulses, s);
    if (!held) state_.need_before(eval);
    if (!held) problem_.make_columns(state_, eval, rows, near, guess);
    for (int l = 0; l < width; ++l) {
      if (state_.chosen[l] == 0) continue;
      if (taking_part[l] != solved_with_[l]) {
        solved_with_[l] = taking_part[l];
        is_solved_[l] =
            held || problem_.bounce(state_, l, rows, near, guess, before, cap, row_impulses, s);
        lane_of(residual, l) = held ? state_.held_residual : lane_of(problem_.residual, l);
        for (int a = 0; a < rows.n; ++a) {
          lane_of(row_x_[rows.row[a]], l) = lane_of(row_impulses[a], l);
          lane_of(row_s_[rows.row[a]], l) = lane_of(s[a], l);
        }
      }
      lane_of(of_lane, l) = 1.0;
      if (is_solved_[l]) lane_of(solved, l) = 1.0;
    }
    const Mask here = of_lane > Real(0.5);
    settled = (settled && !here) || (here && solved > Real(0.5));
    auto& problem = rows.problem;
    for (int a = 0; a < rows.n; ++a) {
      const Real x = row_x_[rows.row[a]];
      problem.x[a] = select(here, x, problem.x[a]);
      problem.s[a] = select(here, row_s_[rows.row[a]], problem.s[a]);
      problem.high[a] = (problem.high[a] && !here) ||
                        (here && !(x < problem.upper[a] * (1.0 - Tolerance::at_bound)));
    }
  }

  // w <- w - W x over the points.
  FAN_FN void add(Real* w) const {
    for (int i = 0; i < state_.points.n_max; ++i)
      if (pushes(i)) problem_.columns().take(i, state_.x + 3 * i, state_.points.moved[i], w);
    patches_.add(w);
  }

  // Reduction of hdot of gathered row a by the impulses.
  FAN_FN Real rate_by_impulses(const RowSystem<Model, Real>& rows, int a) const {
    Real sum = Real(0.0);
    for (int i = 0; i < state_.points.n_max; ++i) {
      if (!pushes(i)) continue;
      const Triple<Real>& by = problem_.columns().across[i][a];
      sum += by[0] * state_.x[3 * i] + by[1] * state_.x[3 * i + 1] + by[2] * state_.x[3 * i + 2];
    }
    sum += patches_.rate_by_impulses(rows, a);
    return sum;
  }

  // Sets the energies of the step, and the points that push at its end. Returns 1 in lanes with an
  // impact.
  FAN_FN Real account() {
    Real struck = Real(0.0);
    for (int l = 0; l < width; ++l)
      for (int i = 0; i < state_.points.n[l]; ++i)
        if (lane_of(state_.x[3 * i], l) > 0.0 && state_.strikes(l, i)) lane_of(struck, l) = 1.0;
    for (int l = 0; l < width; ++l) {
      int pushes = 0;
      for (int i = 0; i < state_.points.n[l]; ++i)
        if (lane_of(state_.x[3 * i], l) > 0.0) {
          const double x[3] = {
              lane_of(state_.x[3 * i], l), lane_of(state_.x[3 * i + 1], l),
              lane_of(state_.x[3 * i + 2], l)};
          add_push(l, i, x, push[l], pushes);
          if (state_.rebound[l][i] != 0.0) early = fmax(early, state_.points.point[l][i].gap);
          if (lane_of(struck, l) > 0.5) add_impact_loss(l, i);
          else add_friction_loss(l, i);
        }
      n[l] = pushes;
    }
    return struck;
  }

  // Writes the pushes to report at the end of the step, of one trajectory: where redundant points
  // share a force, the impulses of least norm. Returns their number.
  int shared(
      const Evaluation<Model, Real>& eval, const RowSystem<Model, Real>& rows,
      ContactShare<M + 3 * C>& share, Push* out) {
    int n_pushing = 0, n_out = 0;
    for (int i = 0; i < state_.points.n[0]; ++i) n_pushing += lane_of(state_.x[3 * i], 0) > 0.0;
    if (state_.chosen[0] == 0 || n_pushing != n[0] || is_joined_) {
      for (int i = 0; i < n[0]; ++i) out[i] = push[0][i];
      return n[0];
    }
    patches_.remove_all(state_);
    state_.need_before(eval);
    problem_.take_all(state_, eval, rows);
    for (int g = 0; g < problem_.groups(); ++g) {
      if (!problem_.restore(state_, g, rows)) continue;
      double x[array_size(3 * C)];
      share.find(problem_.cone(), x);
      for (int k = 0; k < problem_.points(); ++k) {
        if (!(x[3 * k] > 0.0)) continue;
        add_push(0, problem_.point(k), x + 3 * k, out, n_out);
      }
    }
    return n_out;
  }

 private:
  // Records the time at which a point that closes at this speed, by the impulses of the step, is
  // struck and would rebound, unless that is immediately.
  void record_strike(int l, int i, double closing) {
    const auto& point = state_.points.point[l][i];
    const bool is_new = state_.steps[l][i] == 0 && state_.rebound[l][i] == 0.0;
    if (!is_new || !state_.is_before_known || !(state_.rebound_of(l, i, closing) > 0.0)) return;
    if (!(point.gap > Tolerance::same_touch * state_.whole * closing)) return;
    if (!(point.gap < state_.left * closing)) return;
    next_strike_ = fmin(next_strike_, point.gap / closing);
  }

  // Time until point i of one trajectory touches, at its closing speed.
  double touch_time(int i) const {
    return state_.points.point[0][i].gap / lane_of(state_.hdot[3 * i], 0);
  }

  // Whether point i has an impulse of its own in some lane.
  FAN_FN bool pushes(int i) const {
    const Real* x = state_.x + 3 * i;
    return !state_.held[i] && any(x[0] != Real(0.0) || x[1] != Real(0.0) || x[2] != Real(0.0));
  }

  // Adds point i of lane l, with the impulse x, to a list, in order.
  FAN_FN void add_push(int l, int i, const double* x, Push* list, int& n_list) const {
    const auto& from = state_.points.point[l][i];
    int place = n_list++;
    for (; place > 0 && !is_before(list[place - 1], from); --place) list[place] = list[place - 1];
    Push& out = list[place];
    out.pair = from.pair;
    out.feature = from.feature;
    const int steps = state_.steps[l][i];
    out.steps = state_.closes(l, i) ? 1 : steps + (steps <= Tolerance::steps_of_impact);
    out.wait = state_.wait[l][i];
    out.rested = state_.rested(l, i);
    out.rebounds = state_.rebound[l][i] != 0.0 || state_.withheld[l][i];
    out.gap = from.gap;
    const double u[3] = {
        state_.after(l, 3 * i), state_.after(l, 3 * i + 1), state_.after(l, 3 * i + 2)};
    for (int c = 0; c < 3; ++c) {
      out.at[c] = from.at[c];
      out.normal[c] = from.frame[c];
      out.impulse[c] = x[0] * from.frame[c] + x[1] * from.frame[3 + c] + x[2] * from.frame[6 + c];
      out.velocity[c] = -u[0] * from.frame[c] - u[1] * from.frame[3 + c] - u[2] * from.frame[6 + c];
    }
  }

  // Adds the energy taken by the friction of point i, at the velocity after the step.
  FAN_FN void add_friction_loss(int l, int i) {
    for (int d = 3 * i; d < 3 * i + 3; ++d) {
      const double x = lane_of(state_.x[d], l);
      lane_of(work, l) += x * lane_of(state_.points.rate_K[i][d - 3 * i], l);
      if (d != 3 * i) lane_of(friction, l) += x * state_.after(l, d);
    }
  }

  // Adds the energies of point i in a step with an impact. Its impulses also act on resting solids:
  // each takes energy at the mean of the velocities before and after the step.
  FAN_FN void add_impact_loss(int l, int i) {
    for (int d = 3 * i; d < 3 * i + 3; ++d) {
      const double x = lane_of(state_.x[d], l), end = state_.after(l, d);
      const double friction_loss = d == 3 * i || state_.strikes(l, i) ? 0.0 : x * end;
      lane_of(work, l) += x * lane_of(state_.points.rate_K[i][d - 3 * i], l);
      lane_of(friction, l) += friction_loss;
      lane_of(impact, l) += 0.5 * x * (lane_of(state_.hdot[d], l) + end) - friction_loss;
    }
  }

  State state_;
  RollingPoints<Model, Real> rolling_;
  ContactPatches<Model, Real> patches_;
  ContactProblem<Model, Real> problem_;
  int n_searches_ = 0;  // number of further searches
  double next_strike_ = unbounded;
  bool is_joined_ = false;  // whether `push` contains earlier parts of the step
  // Of each lane's last solve in the step: number of rows and points that took part, success;
  // impulses and s of the rows.
  int solved_with_[width];
  bool is_solved_[width];
  Real row_x_[array_size(M)], row_s_[array_size(M)];
};

}  // namespace fan

FAN_LOOPS_END
