// Contacts in the steps of a rollout: stored during the rollout, and held in the modes of each step
// in the backward sweep (rollout_gradient.hpp).
#pragma once

#include <vector>

#include "fantoccini/derivatives/contact_partials.hpp"
#include "fantoccini/derivatives/contact_pull.hpp"
#include "fantoccini/derivatives/step_modes.hpp"
#include "fantoccini/solvers/mode_system.hpp"

namespace fan {

template <class Model>
class RolloutContacts {
 public:
  static constexpr int NQ = Model::n_qD, N = Model::n_vD, NQK = Model::n_qK, K = Model::n_vK;
  static constexpr int P = Model::n_p, M = Model::n_rows, C = Model::n_contacts, R = M + 3 * C;
  static constexpr int L = Model::n_links, E = N + K, n_columns = 2 * E + P;

  void clear() {
    points_.clear();
    delays_.clear();
    first_.assign(1, 0);
  }

  // Stores the contacts of step k, which `run` has made.
  void keep(const GradientArrays& in, long long k, TimeSteppingTrajectory<Model, double>& run) {
    delays_.push_back(run.at.touching.delay);
    if (run.opt.contacts) {
      begin_at(in, k);
      in.n_points[k] = modes_.find(run, in.reference_force, point_);
      in.edges[k] = modes_.edges;
      in.pairs[k] = modes_.pair;
      in.n_sliding[k] = 0;
      for (int i = 0; i < in.n_points[k]; ++i) in.n_sliding[k] += !point_[i].sticks;
      points_.insert(points_.end(), point_, point_ + in.n_points[k]);
    }
    first_.push_back(points_.size());
  }

  // Loads the points of step k, which continues with v_next. Returns whether there are any.
  bool take(const GradientArrays& in, long long k, const double* v_next) {
    n_ = int(first_[k + 1] - first_[k]);
    if (n_ == 0) return false;
    for (int i = 0; i < n_; ++i) point_[i] = points_[first_[k] + i];
    begin_at(in, k);
    modes_.screws(screws_, by_p_);
    partials_.begin(screws_, in.v_D + k * N, v_next, in.rate + k * K, by_p_, in.options.dt);
    pull_.begin(screws_, in.v_D + k * N, v_next, in.rate + k * K, by_p_, in.options.dt);
    return true;
  }

  // Time for which step k continues before any rebound [s].
  double delay(long long k) const { return delays_[k]; }

  // For the current step, as in ModesOfStep.
  const double* touch_by() {
    const int i = first_touch(point_, n_);
    return i < 0 ? nullptr : partials_.gap_by(point_[i]);
  }

  // Holds the points together with the gathered rows. Returns false if friction jams.
  bool hold(const Evaluation<Model, double>& eval, const RowSystem<Model, double>& rows) {
    int n = n_held_ = rows.n, n_turning = 0;
    for (int a = 0; a < n; ++a)
      for (int k = 0; k < N; ++k) system_.C[a][k] = system_.B[a][k] = rows.column[a][k];
    for (int i = 0; i < n_; ++i) {
      double own[3][array_size(N)], forces[3][array_size(N)], drag[array_size(N)];
      int held;
      const bool turns = partials_.hold(point_[i], &held, own, forces, drag);
      for (int d = 0; d < held; ++d, ++n) {
        Call<Model, double>::solve_factor_transposed(eval.L, own[d], system_.C[n]);
        Call<Model, double>::solve_factor_transposed(eval.L, forces[d], system_.B[n]);
      }
      if (turns) Call<Model, double>::solve_factor_transposed(eval.L, drag, system_.Z[n_turning++]);
    }
    system_.n_rows = n;
    system_.n_turning = n_turning;
    return system_.factorise();
  }

  const ModeSystem<R, C, N>& system() const { return system_; }

  bool slides() const {
    for (int i = 0; i < n_; ++i)
      if (!point_[i].sticks) return true;
    return false;
  }

  // Adds the points' contribution to a sum's derivatives by q_D, q_K, v_D, rate and p (n_columns,),
  // from z and the y of all rows. Returns the contribution to that by the time of the touch, in a
  // step of length dt.
  double pull_back(const double* z, const double* y, double dt, double* out) {
    double by_delay = 0.0;
    pull_.take(z);
    for (int i = 0, a = n_held_; i < n_; ++i) {
      double by[3] = {};
      for (int d = 0; d < (point_[i].sticks ? 3 : 1); ++d, ++a) by[d] = -y[a];
      pull_.add(point_[i], by, out);
      by_delay -= by[0] * asked_by_delay(point_[i], dt) / dt;
    }
    return by_delay;
  }

  // Adds `part` of the largest force, distributed by `idle` over the rows, to the points' forces.
  void share_otherwise(const double* idle, double part) {
    fan::share_otherwise(point_, n_, n_held_, idle, part);
  }

  // The pair of the first sliding point.
  int sliding_pair() const {
    for (int i = 0; i < n_; ++i)
      if (!point_[i].sticks) return point_[i].pair;
    return point_[0].pair;
  }

 private:
  void begin_at(const GradientArrays& in, long long k) {
    modes_.begin(
        in.q_D + k * NQ, in.v_D + k * N, in.q_K + k * NQK, in.rate + k * K, in.p, delays_[k]);
  }

  std::vector<StepContact> points_;  // of all steps
  std::vector<size_t> first_;        // (steps + 1,) index of each step's first point
  std::vector<double> delays_;       // s: time until the first touch of a rebounding point, of each
  StepModes<Model> modes_;
  StepContact point_[array_size(C)];  // of one step
  int n_ = 0, n_held_ = 0;            // number of these, and of the rows before theirs
  double screws_[array_size(6 * E)], by_p_[array_size((L + E) * 6 * P)];
  ContactPartials<Model> partials_;
  ContactPull<Model> pull_;
  ModeSystem<R, C, N> system_;
};

}  // namespace fan
