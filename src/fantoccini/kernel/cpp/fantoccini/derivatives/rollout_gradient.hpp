// A rollout of the time-stepper, and the gradient of its cost by one backward sweep. With l the
// cost's derivatives by the results of a step, and g = dt l_v+ + l_a by its mean acceleration,
//
//   [M + dt F, A_D^T; A_D, 0] (z, y) = (g, l_tension),   l <- l+ - d(z . r + y/dt . R)
//
// where r is the residual of Eq. 10 with the velocity products of v_ahead (timestepping/step.hpp)
// and R = A_D v+ + A_K rate + min(h/dt, recovery speed) that of the step's held rows. The matrix is
// that of the step itself, so each step of a sweep costs one factorisation and one gradient of a
// scalar.
//
// With contacts, A_D is C in the second equation, the rows held by the step and by its points in
// their modes, and the transpose of B, the forces that hold them, in the first; Z^T Z is added to M
// (solvers/mode_system.hpp). The sweep also detects steps without derivative.
#pragma once

#include "fantoccini/derivatives/rollout_contacts.hpp"
#include "fantoccini/derivatives/step_delay.hpp"
#include "fantoccini/derivatives/step_turn.hpp"
#include "fantoccini/model/evaluation.hpp"
#include "fantoccini/runs/shared.hpp"
#include "fantoccini/runs/stepping.hpp"
#include "fantoccini/solvers/held_factor.hpp"
#include "fantoccini/timestepping/trajectory.hpp"

namespace fan {

template <class Model>
class RolloutGradient {
 public:
  static constexpr int NQ = Model::n_qD, N = Model::n_vD, NQK = Model::n_qK, K = Model::n_vK;
  static constexpr int P = Model::n_p, S = Model::n_strings, M = Model::n_rows;
  static constexpr bool touches = Model::n_contacts > 0;

  // The rollout from the first node.
  void roll(GradientArrays& in) {
    run_.set(0.0, in.options, in.winches);
    put_lane(in.p, P, 0, run_.p());
    put_lane(in.q_D, NQ, 0, run_.q_D());
    put_lane(in.v_D, N, 0, run_.v_D());
    for (int i = 0; i < S; ++i) run_.slip()[i] = 0.0;
    if constexpr (touches) contacts_.clear();
    in.slip = 0.0;
    in.shortened = in.n;
    Nodes nodes{in};
    Tape tape{*this, in};
    StepCount count{0.0, in.options.dt};
    run_.begin(nodes);
    if constexpr (touches) run_.at.contacts.looks_ahead = false;
    make_steps(run_, nodes, EvenSteps{in.options.dt, in.n}, count, tape);
    in.n_steps = count.n_total;
    in.status = verdict(run_, 0);
  }

  // Computes the gradient of the last rollout; ends at a step without derivative.
  void sweep(const GradientArrays& in) {
    const double dt = in.options.dt;
    double l_a[2][array_size(N)] = {};  // by the accelerations of the last two steps
    for (int j = 0; j < N; ++j) {
      l_q_[j] = in.l_q[in.n * N + j];
      l_v_[j] = in.l_v[in.n * N + j];
    }
    for (int j = 0; j < P; ++j) in.g_p[j] = 0.0;
    for (long long k = in.n - 1; k >= 0; --k) {
      double w[array_size(N)], z[array_size(N)], y[array_size(rows)];
      evaluate(in, k);
      by_delay_ = 0.0;
      for (int j = 0; j < N; ++j) by_delay_ -= l_q_[j] * in.v_D[(k + 1) * N + j];
      turn_back<typename Model::Dynamic>(in.v_D + (k + 1) * N, dt - delay_.time, l_q_, l_v_);
      for (int j = 0; j < N; ++j) l_a[0][j] += dt * l_v_[j];
      Call<Model, double>::solve_factor_transposed(eval_.L, l_a[0], w);
      if (take_contacts(in, k)) {
        in.edges[k] |= fault(in, k);
        if (in.edges[k] >= LAW_CHANGED) return;
        for (int a = 0; a < rows; ++a)
          y[a] = in.l_tension && a < rows_.n ? -in.l_tension[k * M + rows_.row[a]] : 0.0;
        solve_contacts(w, y);
        eval_.solve_factor(w, z);
      } else {
        rows_.along(w, y);
        for (int a = 0; in.l_tension && a < rows_.n; ++a)
          y[a] -= in.l_tension[k * M + rows_.row[a]];
        factor_.factorise(rows_.problem.G, Complementarity<double, M>::N, rows_.n);
        factor_.solve(y);
        double less[array_size(M)];
        for (int a = 0; a < rows_.n; ++a) less[a] = -y[a];
        rows_.add(less, w);
        eval_.solve_factor(w, z);
      }
      take_back(in, k, z, y, l_a);
    }
    for (int j = 0; j < N; ++j) {
      in.g_q[j] = l_q_[j];
      in.g_v[j] = l_v_[j];
    }
  }

 private:
  // Relative difference between a step's velocity and its equations' above which it was cut short.
  static constexpr double shortened = 1e-9;
  // Redistributed force, relative to the largest, to test whether motions depend on the
  // distribution; relative change of a derivative that counts as such a dependence; rounding,
  // relative to the largest.
  static constexpr double shift = 0.1, depends = 1e-6, rounding = 1e-4;

  // Largest number of held rows of a step, and number of the quantities of its derivatives.
  static constexpr int rows = M + 3 * Model::n_contacts, n_by = 2 * N + 3 * K + P;

  // d(z . r + y/dt . R) by the quantities of a step; that by v_D is in parts.
  struct Products {
    double g_q[array_size(N)], g_v[array_size(N)], g_ahead[array_size(N)], g_next[array_size(N)],
        g_p[array_size(P)];
    double *g_qK, *g_vK, *g_aK;
    double by_delay = 0.0;  // of the held rows and points, by the time of the touch

    double by_v(int j) const { return g_v[j] + g_ahead[j] + g_next[j]; }
  };

  // Inputs of successive nodes, with the forces and accelerations of the step that begins there.
  struct Nodes {
    const GradientArrays& in;
    long long k = 0;

    template <class Inputs>
    void start(double, Inputs& out) {
      const long long step = k < in.n ? k : in.n - 1;
      put_lane(in.q_K + k * NQK, NQK, 0, out.q_K);
      put_lane(in.v_K + k * K, K, 0, out.v_K);
      put_lane(in.mean + step * K, K, 0, out.acc_K);
      const double* force = of(in.u_D, step);
      for (int j = 0; j < N; ++j) out.u_D[j] = force ? force[j] : 0.0;
    }

    template <class Inputs>
    void fill(double t, Inputs& out) {
      ++k;
      start(t, out);
    }
  };

  // Data of every step for the sweep.
  struct Tape {
    RolloutGradient& all;
    GradientArrays& in;

    bool ready(const StepCount& count) {
      const long long k = count.n_total;
      const bool steady = all.run_.at.steady, was_steady = all.run_.at.was_steady;
      in.ahead[2 * k] = steady ? 0.5 * in.options.dt : 0.0;
      in.ahead[2 * k + 1] = steady && was_steady ? 0.25 * in.options.dt : 0.0;
      return true;
    }

    void record(const StepCount& count, bool moved) {
      if (moved) all.keep(in, count.n_total - 1);
    }
  };

  // Stores step k of the rollout.
  void keep(GradientArrays& in, long long k) {
    if constexpr (touches) contacts_.keep(in, k, run_);
    const auto& state = run_.state();
    const double *v = in.v_D + k * N, dt = in.options.dt;
    double apart = 0.0, size = 1.0;
    for (int j = 0; j < N; ++j) {
      in.acc_D[k * N + j] = run_.acc()[j];
      in.v_D[(k + 1) * N + j] = state.v_D[j];
      apart = fmax(apart, fabs(v[j] + dt * run_.acc()[j] - state.v_D[j]));
      size = fmax(size, 1.0 + fabs(state.v_D[j]));
    }
    if (apart > shortened * size && k < in.shortened) in.shortened = k;
    for (int j = 0; j < NQ; ++j) in.q_D[(k + 1) * NQ + j] = state.q_D[j];
    for (int r = 0; r < M; ++r) in.tension[k * M + r] = run_.tension()[r];
    for (int i = 0; i < S; ++i) in.slip = fmax(in.slip, run_.slip()[i]);
  }

  // The equations of step k and the rows that it holds.
  void evaluate(const GradientArrays& in, long long k) {
    const double *v = in.v_D + k * N, *half = in.ahead + 2 * k;
    const double* force = of(in.u_D, k);
    double u_D[array_size(N)], delay = 0.0;
    if constexpr (touches) delay = contacts_.delay(k);
    delay_.begin(in.q_D + k * NQ, v, in.q_K + k * NQK, in.rate + k * K, delay);
    for (int j = 0; j < N; ++j) {
      u_D[j] = force ? force[j] : 0.0;
      const double a = k > 0 ? in.acc_D[(k - 1) * N + j] : 0.0;
      const double before = k > 1 ? in.acc_D[(k - 2) * N + j] : 0.0;
      v_ahead_[j] = v[j] + (half[0] * a + half[1] * (a - before));
    }
    eval_.at(
        delay_.q_D(), v, delay_.q_K(), in.rate + k * K, in.mean + k * K, u_D, v_ahead_,
        in.options.dt, in.p);
    const unsigned char* held = in.held + k * M;
    int list[array_size(M)], n = 0;
    for (int r = 0; r < M; ++r)
      if (held[r]) list[n++] = r;
    rows_.gather(eval_, v, list, n);
  }

  // Propagates from step k to the node before it.
  void take_back(
      const GradientArrays& in, long long k, const double* z, const double* y,
      double (*l_a)[array_size(N)]) {
    Products to;
    to.g_qK = in.g_qK + k * K;
    to.g_vK = in.g_rate + k * K;
    to.g_aK = in.g_mean + k * K;
    multiply(in, k, z, y, to);
    const double* half = in.ahead + 2 * k;
    for (int j = 0; j < K; ++j) {
      to.g_qK[j] = -to.g_qK[j];
      to.g_vK[j] = -to.g_vK[j];
      to.g_aK[j] = -to.g_aK[j];
    }
    for (int j = 0; j < P; ++j) to.g_p[j] = -to.g_p[j];
    for (int j = 0; j < N; ++j) {
      l_q_[j] -= to.g_q[j];
      l_v_[j] -= to.by_v(j);
    }
    if constexpr (touches)
      if (delay_.time > 0.0) {
        delay_.set_gap(contacts_.touch_by());
        delay_.pull(l_q_, l_v_, to.g_qK, to.g_vK, to.g_p, by_delay_ - to.by_delay);
      }
    for (int j = 0; j < P; ++j) in.g_p[j] += to.g_p[j];
    for (int j = 0; j < N; ++j) {
      in.g_u[k * N + j] = z[j];
      l_q_[j] += in.l_q[k * N + j];
      l_v_[j] += in.l_v[k * N + j];
      l_a[0][j] = l_a[1][j] - (half[0] + half[1]) * to.g_ahead[j];
      l_a[1][j] = half[1] * to.g_ahead[j];
    }
  }

  // The products of step k.
  void multiply(
      const GradientArrays& in, long long k, const double* z, const double* y, Products& to) {
    const double *v = in.v_D + k * N, dt = in.options.dt;
    double pull[array_size(M)], pull_h[array_size(M)], v_next[array_size(N)];
    for (int r = 0; r < M; ++r) pull[r] = pull_h[r] = 0.0;
    for (int a = 0; a < rows_.n; ++a) {
      const int r = rows_.row[a];
      const double h = eval_.height(r), size = rows_.two_sided[a] ? fabs(h) : h;
      pull[r] = y[a] / dt;
      pull_h[r] = size < dt * in.options.recovery_speed ? pull[r] / dt : 0.0;
    }
    equation_velocity(in, k, v_next);
    Call<Model, double>::step_back(
        delay_.q_D(), v, v_ahead_, v_next, in.acc_D + k * N, delay_.q_K(), in.rate + k * K,
        in.mean + k * K, in.tension + k * M, z, pull, pull_h, dt, in.p, to);
    if constexpr (touches) {
      if (in.n_points[k] == 0) return;
      double own[RolloutContacts<Model>::n_columns] = {};
      to.by_delay = -contacts_.pull_back(z, y, dt, own);
      const double* from = own;
      for (int j = 0; j < N; ++j) to.g_q[j] -= *from++;
      for (int j = 0; j < K; ++j) to.g_qK[j] -= *from++;
      for (int j = 0; j < N; ++j) to.g_v[j] -= *from++;
      for (int j = 0; j < K; ++j) to.g_vK[j] -= *from++;
      for (int j = 0; j < P; ++j) to.g_p[j] -= *from++;
    }
  }

  // The same as one array (n_by,).
  void list_products(
      const GradientArrays& in, long long k, const double* z, const double* y, double* out) {
    Products to;
    to.g_qK = out + 2 * N;
    to.g_vK = to.g_qK + K;
    to.g_aK = to.g_vK + K;
    multiply(in, k, z, y, to);
    for (int j = 0; j < N; ++j) {
      out[j] = to.g_q[j];
      out[N + j] = to.by_v(j);
    }
    for (int j = 0; j < P; ++j) out[2 * N + 3 * K + j] = to.g_p[j];
  }

  // v+ by the equations of step k. It differs from the rollout's if the step was cut short; the
  // caller checks that.
  void equation_velocity(const GradientArrays& in, long long k, double* v_next) const {
    for (int j = 0; j < N; ++j) v_next[j] = in.v_D[k * N + j] + in.options.dt * in.acc_D[k * N + j];
  }

  // Whether solids push in step k; loads its points.
  bool take_contacts(const GradientArrays& in, long long k) {
    if constexpr (touches) {
      double v_next[array_size(N)];
      equation_velocity(in, k, v_next);
      return contacts_.take(in, k, v_next);
    }
    return false;
  }

  void solve_contacts(double* w, double* y) const {
    if constexpr (touches) contacts_.system().solve_transposed(w, y);
  }

  // Holds the rows and points of step k. Returns the reason if it has no derivative, and the pair.
  int fault(const GradientArrays& in, long long k) {
    if constexpr (touches) {
      if (!contacts_.hold(eval_, rows_)) {
        in.pairs[k] = contacts_.sliding_pair();
        return JAMS;
      }
      double idle[array_size(rows)];
      if (!contacts_.slides() || !contacts_.system().idle(idle)) return 0;
      if (depends_on(in, k, idle)) {
        in.pairs[k] = contacts_.sliding_pair();
        return OPEN_SHARES;
      }
    }
    return 0;
  }

  // Whether the motion after step k depends on the distribution of force among its points, whose
  // shares `idle` have no effect on the step; tested on a sum of all velocities in which no change
  // cancels.
  bool depends_on(const GradientArrays& in, long long k, const double* idle) {
    double by[2][array_size(n_by)];
    for (int shifted = 0; shifted < 2; ++shifted) {
      if (shifted) contacts_.share_otherwise(idle, shift);
      if (shifted && !contacts_.hold(eval_, rows_)) return true;
      double sum[array_size(N)], w[array_size(N)], y[array_size(rows)] = {}, z[array_size(N)];
      for (int j = 0; j < N; ++j) sum[j] = cos(double(j));
      Call<Model, double>::solve_factor_transposed(eval_.L, sum, w);
      solve_contacts(w, y);
      eval_.solve_factor(w, z);
      list_products(in, k, z, y, by[shifted]);
    }
    take_contacts(in, k);
    contacts_.hold(eval_, rows_);
    double most = 0.0;
    for (int j = 0; j < n_by; ++j) most = fmax(fabs(by[0][j]), most);
    for (int j = 0; j < n_by; ++j)
      if (fabs(by[1][j] - by[0][j]) > depends * fmax(fabs(by[0][j]), rounding * most)) return true;
    return false;
  }

  TimeSteppingTrajectory<Model, double> run_;
  Evaluation<Model, double> eval_;
  RowSystem<Model, double> rows_;
  HeldFactor<M> factor_;
  std::conditional_t<touches, RolloutContacts<Model>, NoContacts> contacts_;
  StepDelay<Model> delay_;
  double l_q_[array_size(N)], l_v_[array_size(N)], v_ahead_[array_size(N)];
  double by_delay_ = 0.0;  // the cost's derivative by the time of the touch, at a fixed motion
};

}  // namespace fan
