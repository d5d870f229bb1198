// Derivatives of a time step (timestepping/step.hpp, without extrapolation) by its start, its
// inputs, the user's forces and the parameters, with its held rows:
//
//   (M + dt F) dacc + A_D^T dtension = -r_d
//   A_D dacc = -(A_D v+ + A_K rate + min(h/dt, recovery speed))_d / dt
//
//   dv+ = dv + dt dacc,   dq+ = Exp(-dt v+) dq + J_r(dt v+) dt dv+
//
// r is the residual of Eq. 10 with the velocity products of the start, d any of the above. Its
// derivatives are evaluated at several nodes at once (step_bundles.hpp); columns are solved in
// bundles, one per lane. With contacts, the points that push are held in their modes together with
// the rows (modes_of_step.hpp); if points rebound, all this is evaluated where they touch
// (step_delay.hpp).
#pragma once

#include <type_traits>

#include "fantoccini/derivatives/in_lanes.hpp"
#include "fantoccini/derivatives/modes_of_step.hpp"
#include "fantoccini/derivatives/step_columns.hpp"
#include "fantoccini/derivatives/step_delay.hpp"
#include "fantoccini/derivatives/step_turn.hpp"
#include "fantoccini/math/wide.hpp"
#include "fantoccini/model/evaluation.hpp"
#include "fantoccini/runs/shared.hpp"
#include "fantoccini/solvers/held_factor.hpp"

namespace fan {

template <class Model>
class StepDerivatives {
 public:
  static constexpr int NQ = Model::n_qD, N = Model::n_vD, K = Model::n_vK, P = Model::n_p;
  static constexpr int S = Model::n_strings, M = Model::n_rows, width = Traits<Wide>::width;

  using Columns = StepColumns<Model>;

  Columns columns;

  // Loads node i of the arrays, and writes its state to a lane of `states`.
  void begin(const StepDerivativeArrays& in, long long i, int lane, StatesInLanes<Model>* states) {
    columns.set(in.forces != 0);
    evaluate(in, i);
    hold(in, i);
    put_lane(q_D_, NQ, lane, states->q_D);
    put_lane(v_D_, N, lane, states->v_D);
    put_lane(acc_, N, lane, states->acc);
    put_lane(q_K_, Model::n_qK, lane, states->q_K);
    put_lane(rate_, K, lane, states->v_K);
    put_lane(mean_, K, lane, states->acc_K);
    put_lane(tension_, M, lane, states->tension);
    put_lane(p_, P, lane, states->p);
  }

  // Bundles for the derivatives of r, and for those of the held rows, A_D v+ + A_K rate + ...
  Wide* force() { return change_; }
  Wide* rate() { return rate_by_; }

  const double* v_next() const { return v_next_; }
  // Index of a row among the held ones; -1 if it is not held.
  int place(int row) const { return place_[row]; }
  // Derivative of a held row's min(h/dt, recovery speed) by h.
  double gap(int row, double per_step, double recovery_speed) const {
    const double h = eval_.height(row) - (row < S ? slip_[row] : 0.0),
                 size = rows_.two_sided[place_[row]] ? fabs(h) : h;
    return size * per_step < recovery_speed ? per_step : 0.0;
  }

  // The parameter that is the tension of a slipping row; -1 if there is none.
  int slips_by(const StepDerivativeArrays& in, int row) const {
    return place_[row] < 0 && tension_[row] != 0.0 ? in.cap_by[row] : -1;
  }

  // Completes node i, given these derivatives.
  void end(const StepDerivativeArrays& in, long long i) {
    double* motion = in.motion + i * 2 * N * columns.n;
    double* pull = in.pull ? in.pull + i * M * columns.n : nullptr;
    // Solved in a small buffer: the results of many nodes are larger than a cache.
    Wide* dv = solve_in_modes(in, i, pull);
    if (!dv) {
      dv = change_;
      for (int b = 0; b < columns.n_bundles; ++b)
        if (columns.acts(b)) solve(in.dt, b, pull);
    }
    chain(in.dt, dv, N, N);
    for (int k = 0; k < N; ++k) columns.at(dv, N, N + k, k) += 1.0;
    for (int k = 0; k < N; ++k)
      columns.write(motion + (N + k) * columns.n, [&](int b) FAN_INLINE { return dv[b * N + k]; });
    write_dq(in.dt - delay_.time, dv, motion);
    if (pull) write_pull(in, pull);
    if constexpr (touches) {
      if (in.shares) write_shares(in, i);
      if (delay_.time > 0.0) add_delay(in, i, motion, pull);
    }
  }

 private:
  static constexpr int C = Model::n_contacts;
  static constexpr bool touches = C > 0;

  void evaluate(const StepDerivativeArrays& in, long long i) {
    v_D_ = in.v_D + i * N;
    rate_ = in.rate + i * K;
    delay_.begin(
        in.q_D + i * NQ, v_D_, in.q_K + i * Model::n_qK, rate_, in.delay ? in.delay[i] : 0.0);
    q_D_ = delay_.q_D();
    q_K_ = delay_.q_K();
    mean_ = in.mean + i * K;
    slip_ = in.slip + i * S;
    tension_ = in.tension + i * M;
    p_ = in.p.first + i * in.p.stride;
    const double* force = of(in.u_D, i);
    double u_D[array_size(N)];
    for (int k = 0; k < N; ++k) u_D[k] = force ? force[k] : 0.0;
    eval_.at(q_D_, v_D_, q_K_, rate_, mean_, u_D, v_D_, in.dt, p_);
  }

  // Gathers the held rows, factorises them, and solves for acc_D under the tensions.
  void hold(const StepDerivativeArrays& in, long long i) {
    const unsigned char* held = in.held + i * M;
    int list[array_size(M)], n = 0;
    for (int r = 0; r < M; ++r)
      if (held[r] || tension_[r] != 0.0) list[n++] = r;
    rows_.gather(eval_, v_D_, list, n);
    double pull[array_size(M)], w[array_size(N)];
    for (int k = 0; k < N; ++k) w[k] = eval_.w0[k];
    for (int a = 0; a < n; ++a) pull[a] = -tension_[rows_.row[a]];
    rows_.add(pull, w);
    if constexpr (touches)
      if (in.n_points) {
        constexpr int E = N + K;
        modes_.begin(
            in.points + i * in.capacity, in.n_points[i], in.screws + i * 6 * E,
            P > 0 ? in.by_p + i * (Model::n_links + E) * 6 * P : nullptr, in.dt);
        modes_.push(eval_, w);
      }
    acc_ = in.acc_D + i * N;
    eval_.solve_factor(w, acc_);
    for (int k = 0; k < N; ++k) v_next_[k] = v_D_[k] + in.dt * acc_[k];
    n = 0;
    for (int a = 0; a < rows_.n; ++a)
      if (held[rows_.row[a]]) list[n++] = rows_.row[a];
    rows_.gather_more(eval_, v_D_, list, n);
    if constexpr (touches)
      if (in.n_points) modes_.move(v_D_, v_next_, rate_);
    for (int r = 0; r < M; ++r) place_[r] = -1;
    for (int a = 0; a < rows_.n; ++a) place_[rows_.row[a]] = a;
    factor_.factorise(rows_.problem.G, Complementarity<double, M>::N, rows_.n);
  }

  // Solves for dt dacc with contacts. Returns null without contacts.
  Wide* solve_in_modes(const StepDerivativeArrays& in, long long i, double* pull) {
    if constexpr (touches) {
      if (!in.n_points || in.n_points[i] == 0) return nullptr;
      in.edges[i] |= modes_.solve(
          eval_, rows_, columns, change_, rate_by_, pull ? pull_ : nullptr,
          in.shares ? shares_ : nullptr);
      return modes_.solution();
    }
    return nullptr;
  }

  // Replaces the derivatives of r in a bundle by dt dacc.
  void solve(double dt, int b, const double* pull) {
    Wide *x = change_ + b * N, w[array_size(N)], y[array_size(M)];
    for (int k = 0; k < N; ++k) x[k] = -x[k];
    Model::solve_factor_transposed_of(eval_.L, x, w);
    // G y = W^T w + the rows' part
    rows_.along(w, y);
    for (int a = 0; a < rows_.n; ++a) y[a] += rate_by_[b * M + a];
    factor_.solve(y);
    for (int a = 0; pull && a < rows_.n; ++a) pull_[b * M + a] = y[a];
    for (int a = 0; a < rows_.n; ++a) y[a] = -y[a];
    rows_.add(y, w);
    Model::solve_factor_of(eval_.L, w, x);
    for (int k = 0; k < N; ++k) x[k] = dt * x[k];
  }

  // Converts derivatives by rate and mean to those by v_K and acc_K of scalars, in the first n of
  // `height` numbers of each bundle: rate = v_K + dt/2 acc_K, mean = acc_K.
  void chain(double dt, Wide* bundles, int height, int n) const {
    using Space = typename Model::Driven;
    Wide half[array_size(Columns::bundles_of(K))] = {};
    for (int i = 0; i < Space::n_scalars; ++i)
      lane_of(half[Space::scalar_v[i] / width], Space::scalar_v[i] % width) = 0.5 * dt;
    for (int j = 0; j < Columns::bundles_of(K); ++j) {
      const Wide* rate = bundles + (Columns::bundle[Columns::BY_V_K] + j) * height;
      Wide* mean = bundles + (Columns::bundle[Columns::BY_ACC_K] + j) * height;
      for (int k = 0; k < n; ++k)
        mean[k] = Model::accelerated ? mean[k] + half[j] * rate[k] : half[j] * rate[k];
    }
  }

  // Writes the derivatives of the tensions; 0 for rows that are not held, except by the parameter
  // that is their tension.
  void write_pull(const StepDerivativeArrays& in, double* pull) {
    chain(in.dt, pull_, M, rows_.n);
    for (int r = 0; r < M; ++r) {
      double* out = pull + r * columns.n;
      if (place_[r] < 0) {
        for (int c = 0; c < columns.n; ++c) out[c] = 0.0;
        if (const int j = slips_by(in, r); j >= 0) out[columns.n - P + j] = 1.0;
      } else {
        columns.write(out, [&](int b) FAN_INLINE { return pull_[b * M + place_[r]]; });
      }
    }
  }

  // Writes the derivatives of the points' multipliers.
  void write_shares(const StepDerivativeArrays& in, long long i) {
    if (in.n_points[i] == 0) return;
    chain(in.dt, shares_, 3 * C, modes_.n_shares());
    double* out = in.shares + i * 3 * in.capacity * columns.n;
    for (int a = 0; a < modes_.n_shares(); ++a)
      columns.write(out + a * columns.n, [&](int b) FAN_INLINE { return shares_[b * 3 * C + a]; });
  }

  // Converts derivatives by the state at the touch to those by the start of the step.
  void add_delay(const StepDerivativeArrays& in, long long i, double* motion, double* pull) {
    delay_.set_gap(modes_.touch_by());
    const double *dv = modes_.solution_by_delay(), *dx = modes_.pull_by_delay();
    double dq[array_size(N)];
    move_by(in.dt - delay_.time, dv, dq);
    for (int k = 0; k < N; ++k) add_delay(in.dt, motion + k * columns.n, dq[k] - v_next_[k]);
    for (int k = 0; k < N; ++k) add_delay(in.dt, motion + (N + k) * columns.n, dv[k]);
    for (int r = 0; pull && r < M; ++r)
      add_delay(in.dt, pull + r * columns.n, place_[r] < 0 ? 0.0 : dx[place_[r]]);
    if (!in.shares) return;
    double* shares = in.shares + i * 3 * in.capacity * columns.n;
    for (int a = 0; a < modes_.n_shares(); ++a)
      add_delay(in.dt, shares + a * columns.n, modes_.shares_by_delay()[a]);
    double* moved = in.moved + i * (N + K) * columns.n;
    for (int k = 0; k < N + K; ++k) {
      for (int c = 0; c < columns.n; ++c) moved[k * columns.n + c] = 0.0;
      moved[k * columns.n + (k < N ? k : N + k)] = 1.0;
      add_delay(in.dt, moved + k * columns.n, 0.0);
    }
  }

  // Converts one row of derivatives; `by_time`: its derivative by the delay.
  void add_delay(double dt, double* row, double by_time) const {
    using Space = typename Model::Driven;
    double *by_rate = row + Columns::first[Columns::BY_V_K], before[array_size(K)];
    double* by_mean = row + Columns::first[Columns::BY_ACC_K];
    for (int k = 0; k < K; ++k) before[k] = by_rate[k];
    delay_.pull(row, row + N, row + 2 * N, by_rate, row + columns.n - P, by_time);
    for (int j = 0; j < Space::n_scalars; ++j) {
      const int k = Space::scalar_v[j];
      by_mean[k] += 0.5 * dt * (by_rate[k] - before[k]);
    }
  }

  // Sets dq (N,) for a change of velocity dv (N,).
  void move_by(double dt, const double* dv, double* dq) const {
    using Space = typename Model::Dynamic;
    for (int k = 0; k < N; ++k) dq[k] = dt * dv[k];
    for (int i = 0; i < Space::n_quaternions; ++i) {
      const int k = Space::quaternion_v[i];
      double phi[3], J[9], R[9];
      for (int c = 0; c < 3; ++c) phi[c] = dt * v_next_[k + c];
      step_turn(phi, J, R);
      for (int r = 0; r < 3; ++r) dq[k + r] = dt * dot3(J + 3 * r, dv + k);
    }
  }

  // Writes the derivatives of the configuration after the step, dq (N, m).
  void write_dq(double dt, const Wide* dv, double* dq) const {
    using Space = typename Model::Dynamic;
    const int m = columns.n;
    for (int i = 0; i < Space::n_scalars; ++i) {
      const int k = Space::scalar_v[i];
      columns.write(dq + k * m, [&](int b) FAN_INLINE { return dt * dv[b * N + k]; });
      dq[k * m + k] += 1.0;
    }
    for (int i = 0; i < Space::n_quaternions; ++i) {
      const int k = Space::quaternion_v[i];
      double phi[3], J[9], R[9];
      for (int c = 0; c < 3; ++c) phi[c] = dt * v_next_[k + c];
      step_turn(phi, J, R);
      for (int r = 0; r < 3; ++r) {
        columns.write(dq + (k + r) * m, [&](int b) FAN_INLINE {
          const Wide* turn = dv + b * N + k;
          return J[3 * r] * (dt * turn[0]) + J[3 * r + 1] * (dt * turn[1]) +
                 J[3 * r + 2] * (dt * turn[2]);
        });
        for (int c = 0; c < 3; ++c) dq[(k + r) * m + k + c] += R[3 * r + c];
      }
    }
  }

  StepDelay<Model> delay_;
  const double *q_D_, *v_D_, *q_K_, *rate_, *mean_, *slip_, *tension_, *p_;
  double* acc_;
  double v_next_[array_size(N)];
  int place_[array_size(M)];
  Evaluation<Model, double> eval_;
  RowSystem<Model, double> rows_;
  HeldFactor<M> factor_;
  // In bundles: the derivatives of r and then dt dacc, those of the rows, and those of the
  // tensions.
  Wide change_[array_size(Columns::most * N)], rate_by_[array_size(Columns::most * M)];
  Wide pull_[array_size(Columns::most * M)];
  Wide shares_[array_size(Columns::most * 3 * C)];  // of the points' multipliers, in bundles
  std::conditional_t<touches, ModesOfStep<Model>, NoContacts> modes_;
};

}  // namespace fan
