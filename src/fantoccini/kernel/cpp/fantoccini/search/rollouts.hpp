// A planner's rollouts: segments of constant driven accelerations, given or from a feedback law,
// checked at equal intervals until the rollout is complete, reaches the goal, collides or leaves
// its bounds. Between checks, coordinates are interpolated linearly from step to step; a step that
// may come nearer than the margin is halved until it is proved clear or not (conservative
// advancement). One rollout per lane; a free lane takes the next one. No rollout depends on its
// neighbours.
#pragma once

#include <cstddef>
#include <vector>

#include "fantoccini/collision/clearance.hpp"
#include "fantoccini/runs/held_drive.hpp"
#include "fantoccini/runs/stepping.hpp"
#include "fantoccini/search/feedback.hpp"
#include "fantoccini/search/goal.hpp"
#include "fantoccini/timestepping/trajectory.hpp"

namespace fan {

// Index of the next rollout, for the calling thread only.
inline long long take_next(RolloutProgress& progress) {
  return __atomic_fetch_add(&progress.next, 1, __ATOMIC_RELAXED);
}

// Index of the first rollout known to have reached the goal.
inline long long first_reached(const RolloutProgress& progress) {
  return __atomic_load_n(&progress.reached, __ATOMIC_RELAXED);
}

// Records that rollout i has reached the goal. Rollouts after the first one that has are abandoned,
// so that the result does not depend on the threads.
inline void record_reached(RolloutProgress& progress, long long i) {
  long long known = first_reached(progress);
  while (i < known && !__atomic_compare_exchange_n(
                          &progress.reached, &known, i, true, __ATOMIC_RELAXED, __ATOMIC_RELAXED)) {
  }
}

struct RolloutTolerances {
  static constexpr double speed_rounding = 1e-12;  // relative to a bound of speed
  // m or rad: violation above which strings count as jammed against touched solids; half of that
  // allowed in a run.
  static constexpr double max_violation = 0.01;
  static constexpr double unknown_distance = 1e300;  // of a goal that only Python can measure
  static constexpr double min_move = 1e-5;  // m: shorter paths between checks are not halved
  static constexpr int max_halvings = 30;   // of a step
};

template <class Model, class Real>
class Rollouts {
 public:
  static constexpr int width = Traits<Real>::width;

  // Simulates rollouts until none is left.
  void work(const RolloutArrays& in, RolloutProgress& progress) {
    placed_.resize(in.solids->n_moving);
    for (int i = 0; i < Model::n_p; ++i) clearance_.p[i] = lanes_.p()[i] = Real(in.p[i]);
    for (int l = 0; l < width; ++l) rollout_[l] = -1;
    while (assign(in, progress)) simulate_segment(in, progress);
  }

 private:
  static constexpr int NQ = Model::n_qD, N = Model::n_vD, S = Model::n_strings;
  static constexpr int M = Model::n_rows, QK = Model::n_qK, NK = Model::n_vK;
  using Mask = typename Traits<Real>::Mask;
  using Held = HeldDrive<typename Model::Driven, N, Real>;

  // Assigns rollouts to free lanes. Returns false if none is left. Lanes without one repeat
  // another's state.
  bool assign(const RolloutArrays& in, RolloutProgress& progress) {
    int occupied = -1;
    for (int l = 0; l < width; ++l) {
      if (rollout_[l] >= 0 && rollout_[l] > first_reached(progress)) rollout_[l] = -1;
      if (rollout_[l] < 0) {
        const long long i = take_next(progress);
        if (i < in.n && i <= first_reached(progress)) {
          rollout_[l] = i;
          segment_[l] = 0;
          const long long start = in.start[i];
          each_part(
              [&](Real* x, int n, const double* from, double*) {
                put_lane(from + start * n, n, l, x);
              },
              in);
        }
      }
      if (rollout_[l] >= 0) occupied = l;
    }
    if (occupied < 0) return false;
    for (int l = 0; l < width; ++l) {
      if (rollout_[l] >= 0) continue;
      each_part(
          [&](Real* x, int n, const double*, double*) {
            for (int k = 0; k < n; ++k) lane_of(x[k], l) = lane_of(x[k], occupied);
          },
          in);
    }
    return true;
  }

  // Simulates the next segment of all lanes.
  void simulate_segment(const RolloutArrays& in, RolloutProgress& progress) {
    const double dt = in.options.dt;
    Real acc_K[array_size(NK)];
    for (int l = 0; l < width; ++l) {
      set_accelerations(in, l, acc_K);
      active_[l] = rollout_[l] >= 0;
      caught_[l] = 0;
      slackened_[l] = touched_wrongly_[l] = false;
    }
    held_.set(lanes_.inputs(), acc_K);
    Inputs inputs{held_};
    lanes_.set(0.0, in.options, in.winches);
    lanes_.begin(inputs);
    StepCount count{0.0, dt};
    Watch watch{*this, in, progress};
    int check_index = 0;
    bool running = true;
    while (running && check_index < in.n_checks) {
      path_.clear();
      record_configuration();
      clearance_.moves.clear();
      ++check_index;
      make_steps(lanes_, inputs, EvenSteps{dt, (long long)check_index * in.steps}, count, watch);
      if (first_reached(progress) < 0) return;
      running = any(lanes_.runs()) ? check(in, progress, check_index) : release_all();
    }
  }

  // Sets the accelerations of a lane's segment.
  void set_accelerations(const RolloutArrays& in, int l, Real* out) {
    double acc[array_size(NK)] = {};
    if (rollout_[l] >= 0) {
      double q_D[array_size(NQ)], v_D[array_size(N)], q_K[array_size(QK)], v_K[array_size(NK)];
      take_lane(lanes_.state().q_D, NQ, l, q_D);
      take_lane(lanes_.state().v_D, N, l, v_D);
      take_lane(lanes_.inputs().q_K, QK, l, q_K);
      take_lane(lanes_.inputs().v_K, NK, l, v_K);
      const long long i = rollout_[l];
      double* acc_K = in.acc_K + (i * in.segments + segment_[l]) * NK;
      if (segment_[l] >= in.n_given[i])
        equilibrium_feedback<Model>(
            in.laws[in.law[i]], in.bounds, in.lead_time[i],
            double(in.n_checks) * in.steps * in.options.dt, q_D, v_D, q_K, v_K, acc_K);
      for (int k = 0; k < NK; ++k) acc[k] = acc_K[k];
    }
    put_lane(acc, NK, l, out);
  }

  // The inputs of a segment, evaluated in every step: whether they are constant in all lanes
  // depends on the neighbours.
  struct Inputs {
    const Held& held;

    template <class To>
    void start(const Real& t, To& in) const {
      held.at(t, in);
    }
    template <class To>
    void fill(const Real& t, To& in) const {
      held.at(t, in);
    }
  };

  // Follows the steps until a rollout is known to have reached the goal before all others.
  struct Watch {
    Rollouts& rollouts;
    const RolloutArrays& in;
    const RolloutProgress& progress;

    bool ready(const StepCount&) const { return first_reached(progress) >= 0; }

    void record(const StepCount&, bool) {
      rollouts.count_catches();
      if (in.kept_off) rollouts.mark_forbidden_touches(in);
      rollouts.record_configuration();
      const Real* now = rollouts.path_.data() + rollouts.path_.size() - (NQ + QK);
      const Real* before = now - (NQ + QK);
      rollouts.clearance_.moves.add(*in.solids, before, before + NQ, now, now + NQ);
    }
  };

  void count_catches() {
    for (int r = 0; r < M; ++r) {
      const Mask caught = lanes_.caught(r), released = lanes_.released(r);
      if (!any(caught || released)) continue;
      for (int l = 0; l < width; ++l) {
        caught_[l] += active_[l] && lane_of(caught, l);
        slackened_[l] = slackened_[l] || (r < S && lane_of(released, l));
      }
    }
  }

  // Marks the lanes in which a forbidden contact pushes.
  void mark_forbidden_touches(const RolloutArrays& in) {
    each_push(
        [&](int l, int pair) { touched_wrongly_[l] = touched_wrongly_[l] || in.kept_off[pair]; });
  }

  // Whether strings are violated, as those that pull a link against a solid are.
  bool jammed(int lane) {
    return lanes_.opt.contacts &&
           lane_of(lanes_.worst_violation, lane) > RolloutTolerances::max_violation;
  }

  // Whether all contacts that the goal requires push in a lane.
  bool has_goal_touches(const GoalArrays& goal, int lane) {
    int n_pushing = 0;
    for (int k = 0; k < goal.n_touches; ++k) {
      bool pushes = false;
      each_push(
          [&](int l, int pair) { pushes = pushes || (l == lane && goal.touches[pair] == k); });
      n_pushing += pushes;
    }
    return n_pushing == goal.n_touches;
  }

  // Calls `f` with the lane and the pair of every point that pushes.
  template <class F>
  void each_push(const F& f) {
    if constexpr (TimeStep<Model, Real>::touches) lanes_.at.contacts.each_push(f);
  }

  // Checks every lane. Returns whether any is still in its segment.
  bool check(const RolloutArrays& in, RolloutProgress& progress, int check_index) {
    auto& state = lanes_.state();
    auto& inputs = lanes_.inputs();
    for (int i = 0; i < NQ; ++i) clearance_.q_D[i] = state.q_D[i];
    for (int i = 0; i < QK; ++i) clearance_.q_K[i] = inputs.q_K[i];
    Real counts = Real(0.0);
    for (int l = 0; l < width; ++l) lane_of(counts, l) = active_[l];
    for (int s = 0; s <= in.steps; ++s)
      clearance_.include_excess(configuration(s), configuration(s) + NQ);
    clearance_.measure(*in.solids, placed_.data(), counts > Real(0.5), in.margin, true);
    const Real least = clearance_.least;
    Real pose_of_goal[12] = {};
    if (in.goal.kind == POINT)
      for (int k = 0; k < 12; ++k) pose_of_goal[k] = clearance_.pose(in.goal.link)[k];
    bool doubtful = false;
    for (int l = 0; l < width; ++l) {
      too_near_[l] = false;
      const bool clear = lane_of(least, l) >= in.margin;
      lane_of(counts, l) = active_[l] && clear && !(lane_of(clearance_.lower, l) >= in.margin);
      doubtful = doubtful || lane_of(counts, l) > 0.5;
    }
    for (int s = 0; s < in.steps && doubtful; ++s)
      check_between(in, configuration(s), configuration(s + 1), counts, 0);
    bool running = false;
    for (int l = 0; l < width; ++l) {
      if (!active_[l]) continue;
      double q_D[array_size(NQ)], v_D[array_size(N)], v_K[array_size(NK)], pose[12];
      take_lane(state.q_D, NQ, l, q_D);
      take_lane(state.v_D, N, l, v_D);
      take_lane(inputs.v_K, NK, l, v_K);
      const double clear = lane_of(least, l);
      const bool slack = slackened_[l] && !in.may_slacken;
      const bool motor_failed = lanes_.motors.verdict(l) != DONE;
      const bool touches_wrongly = touched_wrongly_[l] || jammed(l);
      if (lane_of(lanes_.status, l) > RUNNING + 0.5 || slack || motor_failed || touches_wrongly ||
          !(clear >= in.margin) || too_near_[l] || !within_bounds(in, l)) {
        release(l);
        continue;
      }
      double distance = RolloutTolerances::unknown_distance;
      if (in.goal.kind != UNKNOWN) {
        take_lane(pose_of_goal, 12, l, pose);
        distance = goal_distance<Model>(in.goal, q_D, v_D, v_K, pose);
        if (in.goal.n_touches && !has_goal_touches(in.goal, l)) distance += in.goal.open;
      }
      const bool at_goal = distance <= in.goal.tolerance;
      if (!at_goal && check_index < in.n_checks) {
        running = true;
        continue;
      }
      write(in, l, check_index, distance);
      if (at_goal) record_reached(progress, rollout_[l]);
      if (at_goal || ++segment_[l] == in.n_segments[rollout_[l]]) release(l);
    }
    return running;
  }

  // Marks, among the requested lanes (1.0), those that may come nearer than the margin on the
  // linear path between two configurations.
  void check_between(
      const RolloutArrays& in, const Real* from, const Real* to, const Real& requested,
      int halvings) {
    Real middle[array_size(NQ + QK)];
    mean<typename Model::Dynamic>(from, to, middle);
    mean<typename Model::Driven>(from + NQ, to + NQ, middle + NQ);
    for (int i = 0; i < NQ; ++i) clearance_.q_D[i] = middle[i];
    for (int i = 0; i < QK; ++i) clearance_.q_K[i] = middle[NQ + i];
    clearance_.moves.clear();
    clearance_.moves.add(*in.solids, from, from + NQ, to, to + NQ, 0.5);
    clearance_.include_excess(from, from + NQ);
    clearance_.include_excess(to, to + NQ);
    clearance_.measure(*in.solids, placed_.data(), requested > Real(0.5), in.margin, true);
    Real uncertain = Real(0.0);
    bool any_uncertain = false;
    for (int l = 0; l < width; ++l) {
      if (lane_of(requested, l) < 0.5 || too_near_[l]) continue;
      const double least = lane_of(clearance_.least, l), lower = lane_of(clearance_.lower, l);
      if (lower >= in.margin) continue;
      using Tol = RolloutTolerances;
      // Short moves may violate the margin slightly, but must not touch anything.
      const bool last = !(least - lower > Tol::min_move) || halvings == Tol::max_halvings;
      too_near_[l] = !(least >= in.margin) || (last && !(lower >= 0.0));
      if (last || too_near_[l]) continue;
      lane_of(uncertain, l) = 1.0;
      any_uncertain = true;
    }
    if (!any_uncertain) return;
    check_between(in, from, middle, uncertain, halvings + 1);
    check_between(in, middle, to, uncertain, halvings + 1);
  }

  // Midpoint of two configurations.
  template <class Space>
  static void mean(const Real* a, const Real* b, Real* out) {
    for (int i = 0; i < Space::n_scalars; ++i) {
      const int k = Space::scalar_q[i];
      out[k] = 0.5 * (a[k] + b[k]);
    }
    for (int i = 0; i < Space::n_quaternions; ++i) {
      const Real *p = a + Space::quaternion_q[i], *q = b + Space::quaternion_q[i];
      const Real along = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3];
      const Real sign = select(along < Real(0.0), Real(-1.0), Real(1.0));
      Real* to = out + Space::quaternion_q[i];
      for (int k = 0; k < 4; ++k) to[k] = p[k] + sign * q[k];
      normalise(to);
    }
  }

  // Records the present configuration for the check of the path.
  void record_configuration() {
    for (int i = 0; i < NQ; ++i) path_.push_back(lanes_.state().q_D[i]);
    for (int i = 0; i < QK; ++i) path_.push_back(lanes_.inputs().q_K[i]);
  }

  // q_D and q_K after a step since the last check.
  const Real* configuration(int step) const { return path_.data() + std::size_t(step) * (NQ + QK); }

  bool within_bounds(const RolloutArrays& in, int l) {
    const auto& at = lanes_.inputs();
    constexpr double allowed = 1.0 + RolloutTolerances::speed_rounding;
    bool inside = true;
    for (int k = 0; k < QK; ++k) {
      const double q = lane_of(at.q_K[k], l);
      inside = inside && q >= in.bounds.low[k] && q <= in.bounds.high[k];
    }
    for (int k = 0; k < NK; ++k)
      inside = inside && std::abs(lane_of(at.v_K[k], l)) <= in.bounds.speed[k] * allowed;
    return inside;
  }

  // Frees the lane. Its state stays constant until the end of the segment.
  void release(int l) {
    rollout_[l] = -1;
    active_[l] = false;
    lane_of(lanes_.status, l) = STOPPED;
  }

  // Frees all lanes. Returns false: none runs.
  bool release_all() {
    for (int l = 0; l < width; ++l)
      if (active_[l]) release(l);
    return false;
  }

  // Writes the end of a lane's segment to the output.
  void write(const RolloutArrays& in, int l, int check_index, double distance) {
    const long long at = rollout_[l] * in.segments + segment_[l];
    each_part(
        [&](const Real* x, int n, const double*, double* to) { take_lane(x, n, l, to + at * n); },
        in);
    in.out.distance[at] = distance;
    in.out.n_checks[at] = check_index;
    in.out.catches[at] = caught_[l];
  }

  // Calls `f` with every part of the state: its values, width, starts and output.
  template <class F>
  void each_part(const F& f, const RolloutArrays& in) {
    f(lanes_.state().q_D, NQ, in.q_D, in.out.q_D);
    f(lanes_.state().v_D, N, in.v_D, in.out.v_D);
    f(lanes_.at.slip, S, in.slip, in.out.slip);
    f(lanes_.inputs().q_K, QK, in.q_K, in.out.q_K);
    f(lanes_.inputs().v_K, NK, in.v_K, in.out.v_K);
  }

  TimeSteppingTrajectory<Model, Real> lanes_;
  Clearance<Model, Real> clearance_;
  std::vector<Placed<Real>> placed_;
  std::vector<Real> path_;  // configurations since the last check: q_D and q_K after every step
  Held held_;
  bool active_[width], slackened_[width], touched_wrongly_[width], too_near_[width];
  long long rollout_[width];
  int segment_[width], caught_[width];
};

}  // namespace fan
