// Motions of a planner: in segments of constant driven accelerations, given or by a law, looked at in
// equal times, until they are done, reach the goal, or come into collision. A motion a lane; a lane
// that is free takes the next motion, and a motion does not depend on its neighbours.
#pragma once

#include <vector>

#include "clearance.hpp"
#include "feedback.hpp"
#include "goal.hpp"
#include "timestepping_trajectory.hpp"

namespace fan {

// The next motion to make.
inline long long take(SweepProgress& progress) {
  return __atomic_fetch_add(&progress.next, 1, __ATOMIC_RELAXED);
}

inline long long reached(const SweepProgress& progress) {
  return __atomic_load_n(&progress.reached, __ATOMIC_RELAXED);
}

// A motion has reached the goal. Those after the first that has are given up, so that what is kept
// does not depend on the workers.
inline void reach(SweepProgress& progress, long long i) {
  long long known = reached(progress);
  while (i < known && !__atomic_compare_exchange_n(
                          &progress.reached, &known, i, true, __ATOMIC_RELAXED, __ATOMIC_RELAXED)) {
  }
}

template <class Model, class Real>
class Sweep {
 public:
  static constexpr int width = Traits<Real>::width;

  // Makes motions until none is left.
  void work(const SweepArrays& in, SweepProgress& progress) {
    placed_.resize(in.solids->n_moving);
    led_.opt = in.options;
    led_.winches.set(in.winches);
    for (int i = 0; i < Model::n_p; ++i) clearance_.p[i] = led_.p[i] = Real(in.p[i]);
    for (int l = 0; l < width; ++l) motion_[l] = -1;
    while (fill(in, progress)) segment(in, progress);
  }

 private:
  static constexpr int NQ = Model::n_qD, N = Model::n_vD, S = Model::n_strings;
  static constexpr int M = Model::n_rows, QK = Model::n_qK, NK = Model::n_vK;
  using Mask = typename Traits<Real>::Mask;

  // Gives free lanes motions; false where none is left at all. Lanes without one repeat another.
  bool fill(const SweepArrays& in, SweepProgress& progress) {
    int some = -1;
    for (int l = 0; l < width; ++l) {
      if (motion_[l] >= 0 && motion_[l] > reached(progress)) motion_[l] = -1;
      if (motion_[l] < 0) {
        const long long i = take(progress);
        if (i < in.n && i <= reached(progress)) {
          motion_[l] = i;
          segment_[l] = 0;
          const long long row = in.begins[i];
          put(led_.state().q_D, NQ, l, in.q_D + row * NQ);
          put(led_.state().v_D, N, l, in.v_D + row * N);
          put(led_.at.slip, S, l, in.slip + row * S);
          put(led_.inputs().q_K, QK, l, in.q_K + row * QK);
          put(led_.inputs().v_K, NK, l, in.v_K + row * NK);
        }
      }
      if (motion_[l] >= 0) some = l;
    }
    if (some < 0) return false;
    for (int l = 0; l < width; ++l) {
      if (motion_[l] >= 0) continue;
      const auto repeat = [&](Real* x, int n) {
        for (int k = 0; k < n; ++k) lane_of(x[k], l) = lane_of(x[k], some);
      };
      repeat(led_.state().q_D, NQ);
      repeat(led_.state().v_D, N);
      repeat(led_.at.slip, S);
      repeat(led_.inputs().q_K, QK);
      repeat(led_.inputs().v_K, NK);
    }
    return true;
  }

  // The next segment of all lanes.
  void segment(const SweepArrays& in, SweepProgress& progress) {
    const double dt = in.options.dt;
    for (int l = 0; l < width; ++l) {
      choose(in, l);
      goes_[l] = motion_[l] >= 0;
      caught_[l] = 0;
      slackened_[l] = false;
    }
    for (int j = 0; j < NK; ++j) still_[j] = is_constant(coef_ + n_powers * j);
    put_inputs(0.0);
    led_.take_inputs();
    led_.begin();
    int look = 0;
    bool some = true;
    while (some && look < in.looks) {
      for (int s = 1; s <= in.steps; ++s) {
        if (reached(progress) < 0) return;
        Mask was[room(M)];
        for (int r = 0; r < M; ++r) was[r] = led_.at.taut[r];
        put_inputs(dt * (double(look) * in.steps + s));
        led_.advance(dt);
        count(was);
      }
      ++look;
      some = judge(in, progress, look);
    }
  }

  // The accelerations of a lane's segment, and the polynomials that they make.
  void choose(const SweepArrays& in, int l) {
    double q_D[room(NQ)], v_D[room(N)], q_K[room(QK)], v_K[room(NK)], acc[room(NK)] = {};
    get(led_.state().q_D, NQ, l, q_D);
    get(led_.state().v_D, N, l, v_D);
    get(led_.inputs().q_K, QK, l, q_K);
    get(led_.inputs().v_K, NK, l, v_K);
    if (motion_[l] >= 0) {
      const long long i = motion_[l];
      double* acc_K = in.acc_K + (i * in.segments + segment_[l]) * NK;
      if (segment_[l] >= in.given[i])
        equilibrium_feedback<Model>(
            in.funnels[in.which[i]], in.bounds, in.reach[i],
            double(in.looks) * in.steps * in.options.dt, q_D, v_D, q_K, v_K, acc_K);
      for (int k = 0; k < NK; ++k) acc[k] = acc_K[k];
    }
    using Space = typename Model::Driven;
    put(base_, QK, l, q_K);
    for (int j = 0; j < NK; ++j) {
      for (int k = 0; k < n_powers; ++k) lane_of(coef_[n_powers * j + k], l) = 0.0;
      lane_of(coef_[n_powers * j + 1], l) = v_K[j];
      lane_of(coef_[n_powers * j + 2], l) = 0.5 * acc[j];
    }
    for (int k = 0; k < Space::n_scalars; ++k)
      lane_of(coef_[n_powers * Space::scalar_v[k]], l) = q_K[Space::scalar_q[k]];
  }

  // The inputs s seconds after the segment began, as those that come.
  void put_inputs(double s) {
    auto& to = led_.coming();
    motion_of<typename Model::Driven>(coef_, base_, still_, Real(s), to.q_K, to.v_K, to.acc_K);
  }

  void count(const Mask* was) {
    for (int r = 0; r < M; ++r) {
      if (!any(led_.at.taut[r] != was[r])) continue;
      for (int l = 0; l < width; ++l) {
        const bool before = lane_of(was[r], l), after = lane_of(led_.at.taut[r], l);
        caught_[l] += goes_[l] && after && !before;
        slackened_[l] = slackened_[l] || (r < S && before && !after);
      }
    }
  }

  // Looks at every lane; whether any goes on in this segment.
  bool judge(const SweepArrays& in, SweepProgress& progress, int look) {
    auto& state = led_.state();
    auto& inputs = led_.inputs();
    for (int i = 0; i < NQ; ++i) clearance_.q_D[i] = state.q_D[i];
    for (int i = 0; i < QK; ++i) clearance_.q_K[i] = inputs.q_K[i];
    Real counts = Real(0.0);
    for (int l = 0; l < width; ++l) lane_of(counts, l) = goes_[l];
    clearance_.measure(*in.solids, placed_.data(), counts > Real(0.5), in.margin);
    bool some = false;
    for (int l = 0; l < width; ++l) {
      if (!goes_[l]) continue;
      double q_D[room(NQ)], v_D[room(N)], v_K[room(NK)], pose[12] = {};
      get(state.q_D, NQ, l, q_D);
      get(state.v_D, N, l, v_D);
      get(inputs.v_K, NK, l, v_K);
      const double clear = lane_of(clearance_.least, l);
      const bool slack = slackened_[l] && !in.may_slacken;
      const bool weak = led_.motors.verdict(l) != DONE;
      if (lane_of(led_.status, l) > RUNNING + 0.5 || slack || weak || !(clear >= in.margin) ||
          !within(in, l)) {
        leave(l);
        continue;
      }
      double distance = 1e300;
      if (in.goal.kind != UNKNOWN) {
        if (in.goal.kind == POINT) get(clearance_.pose(in.goal.link), 12, l, pose);
        distance = goal_distance<Model>(in.goal, q_D, v_D, v_K, pose);
      }
      const bool there = distance <= in.goal.tolerance;
      some = some || (!there && look < in.looks);
      if (!there && look < in.looks) continue;
      write(in, l, look, distance);
      if (there) reach(progress, motion_[l]);
      if (there || ++segment_[l] == in.made[motion_[l]]) leave(l);
    }
    return some;
  }

  bool within(const SweepArrays& in, int l) {
    const auto& at = led_.inputs();
    bool inside = true;
    for (int k = 0; k < QK; ++k) {
      const double q = lane_of(at.q_K[k], l);
      inside = inside && q >= in.bounds.low[k] && q <= in.bounds.high[k];
    }
    for (int k = 0; k < NK; ++k)
      inside = inside && std::abs(lane_of(at.v_K[k], l)) <= in.bounds.speed[k] * (1.0 + 1e-12);
    return inside;
  }

  // The lane is free; until the segment's end it stands still.
  void leave(int l) {
    motion_[l] = -1;
    goes_[l] = false;
    lane_of(led_.status, l) = STOPPED;
  }

  void write(const SweepArrays& in, int l, int look, double distance) {
    const long long at = motion_[l] * in.segments + segment_[l];
    get(led_.state().q_D, NQ, l, in.out.q_D + at * NQ);
    get(led_.state().v_D, N, l, in.out.v_D + at * N);
    get(led_.at.slip, S, l, in.out.slip + at * S);
    get(led_.inputs().q_K, QK, l, in.out.q_K + at * QK);
    get(led_.inputs().v_K, NK, l, in.out.v_K + at * NK);
    in.out.distance[at] = distance;
    in.out.looks[at] = look;
    in.out.catches[at] = caught_[l];
  }

  static void put(Real* to, int n, int lane, const double* from) {
    for (int k = 0; k < n; ++k) lane_of(to[k], lane) = from[k];
  }

  static void get(const Real* from, int n, int lane, double* to) {
    for (int k = 0; k < n; ++k) to[k] = lane_of(from[k], lane);
  }

  TimeSteppingTrajectory<Model, Real> led_;
  Clearance<Model, Real> clearance_;
  std::vector<Placed<Real>> placed_;
  Real coef_[room(NK * n_powers)], base_[room(QK)];
  bool still_[room(NK)], goes_[width], slackened_[width];
  long long motion_[width];
  int segment_[width], caught_[width];
};

}  // namespace fan
