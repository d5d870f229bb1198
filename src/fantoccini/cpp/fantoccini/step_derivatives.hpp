// Derivatives of a time step (timestepping.hpp, without extrapolation) by its start, its inputs, the
// user's forces and the parameters, with the rows that it holds:
//
//   (M + dt F) dacc + A_D^T dtension = -r_d
//   A_D dacc = -(A_D v+ + A_K rate + min(h/dt, recovery speed))_d / dt
//
//   dv+ = dv + dt dacc,   dq+ = Exp(-dt v+) dq + J_r(dt v+) dt dv+
//
// r is the residual of Eq. 10 with the velocity products of the start, d any of the above. Its
// derivatives are evaluated at several nodes at once (step_bundles.hpp); columns are solved for in
// bundles, as many as a vector holds. Where solids touch, the points that push are held
// in their modes beside the rows (modes_of_step.hpp).
#pragma once

#include <cstring>
#include <type_traits>

#include "derivatives_in_lanes.hpp"
#include "evaluation.hpp"
#include "held_factor.hpp"
#include "modes_of_step.hpp"
#include "step_turn.hpp"
#include "wide.hpp"

namespace fan {

template <class Model>
class StepDerivatives {
 public:
  static constexpr int NQ = Model::n_qD, N = Model::n_vD, K = Model::n_vK, P = Model::n_p;
  static constexpr int S = Model::n_strings, M = Model::n_rows, width = Traits<Wide>::width;

  // Begins with node i of the arrays; its place among the states is a lane's.
  void begin(const StepDerivativeArrays& in, long long i, int lane, StatesInLanes<Model>* states) {
    forces_ = in.forces != 0;
    m_ = 2 * N + 3 * K + (forces_ ? N : 0) + P;
    evaluate(in, i);
    hold(in, i);
    states->place(lane, q_D_, states->q_D, NQ);
    states->place(lane, v_D_, states->v_D, N);
    states->place(lane, acc_, states->acc, N);
    states->place(lane, q_K_, states->q_K, Model::n_qK);
    states->place(lane, rate_, states->v_K, K);
    states->place(lane, mean_, states->acc_K, K);
    states->place(lane, tension_, states->tension, M);
    states->place(lane, p_, states->p, P);
  }

  // For the derivatives of r, column by column; those by the parameters begin at `by_p`.
  double* force(int* by_p) {
    double* push = force_ + N * (2 * N + 3 * K);
    *by_p = int(push - force_) + (forces_ ? N * N : 0);
    for (int k = 0; forces_ && k < N * N; ++k) push[k] = k % (N + 1) == 0 ? -1.0 : 0.0;
    return force_;
  }

  const double* v_next() const { return v_next_; }
  bool holds() const { return rows_.n > 0; }

  // Ends with it, given the derivatives of r and, in a lane, of hdot after the step.
  template <class Rows>
  void end(const StepDerivativeArrays& in, long long i, int lane, const Rows& by) {
    if (holds()) take(lane, by, 1.0 / in.dt, in.recovery_speed);
    // Solved for where it stays near: the results of many nodes are larger than a cache.
    double* motion = in.motion + i * 2 * N * m_;
    double* pull = in.pull ? in.pull + i * M * m_ : nullptr;
    if (!solve_in_modes(in, i, dv_, pull)) solve(in.dt, dv_, pull);
    for (int k = 0; k < N; ++k) dv_[k * m_ + N + k] += 1.0;
    chain(in.dt, dv_, N);
    if (pull) chain(in.dt, pull, M);
    move(in.dt, dv_, motion);
    std::memcpy(motion + N * m_, dv_, sizeof(double) * N * m_);
  }

 private:
  static constexpr int most = 3 * N + 3 * K + P;  // columns
  static constexpr bool touches = Model::n_contacts > 0;

  void evaluate(const StepDerivativeArrays& in, long long i) {
    q_D_ = in.q_D + i * NQ;
    v_D_ = in.v_D + i * N;
    q_K_ = in.q_K + i * Model::n_qK;
    rate_ = in.rate + i * K;
    mean_ = in.mean + i * K;
    tension_ = in.tension + i * M;
    p_ = in.p.first + i * in.p.stride;
    const double* force = in.u_D.first ? in.u_D.first + i * in.u_D.stride : nullptr;
    double u_D[room(N)];
    for (int k = 0; k < N; ++k) u_D[k] = force ? force[k] : 0.0;
    eval_.at(q_D_, v_D_, q_K_, rate_, mean_, u_D, v_D_, in.dt, p_);
  }

  // The rows that are held, their factor, and acc_D under the tensions.
  void hold(const StepDerivativeArrays& in, long long i) {
    const unsigned char* held = in.held + i * M;
    int list[room(M)], n = 0;
    for (int r = 0; r < M; ++r)
      if (held[r] || tension_[r] != 0.0) list[n++] = r;
    rows_.gather(eval_, v_D_, list, n);
    double pull[room(M)], w[room(N)];
    for (int k = 0; k < N; ++k) w[k] = eval_.w0[k];
    for (int a = 0; a < n; ++a) pull[a] = -tension_[rows_.row[a]];
    rows_.add(pull, w);
    if constexpr (touches)
      if (in.n_points) {
        constexpr int E = N + K;
        modes_.begin(
            in.points + i * in.room, in.n_points[i], in.screws + i * 6 * E,
            P > 0 ? in.by_p + i * (Model::n_links + E) * 6 * P : nullptr, in.dt);
        modes_.push(eval_, w);
      }
    acc_ = in.acc_D + i * N;
    eval_.back(w, acc_);
    for (int k = 0; k < N; ++k) v_next_[k] = v_D_[k] + in.dt * acc_[k];
    n = 0;
    for (int a = 0; a < rows_.n; ++a)
      if (held[rows_.row[a]]) list[n++] = rows_.row[a];
    rows_.gather_more(eval_, v_D_, list, n);
    if constexpr (touches)
      if (in.n_points) modes_.move(v_D_, v_next_, rate_);
    factor_.factorise(rows_.problem.G, Complementarity<double, M>::N, rows_.n);
  }

  // The rows' part (rate_by_), column by column.
  template <class Rows>
  void take(int lane, const Rows& by, double per_step, double recovery_speed) {
    for (int a = 0; a < rows_.n; ++a) {
      const int row = rows_.row[a];
      const double h = eval_.height(row), size = rows_.two_sided[a] ? fabs(h) : h;
      const double gap = size * per_step < recovery_speed ? per_step : 0.0;
      const auto of = [&](const Wide* all, int k) { return lane_of(all[M * k + row], lane); };
      double* out = rate_by_[a];
      for (int k = 0; k < N; ++k) *out++ = of(by.hdot_q, k) + gap * of(by.A_D, k);
      for (int k = 0; k < N; ++k) *out++ = of(by.A_D, k);
      for (int k = 0; k < K; ++k) *out++ = of(by.hdot_qK, k) + gap * of(by.A_K, k);
      for (int k = 0; k < K; ++k) *out++ = of(by.A_K, k);
      for (int k = 0; k < K + (forces_ ? N : 0); ++k) *out++ = 0.0;
      for (int k = 0; k < P; ++k) *out++ = of(by.hdot_p, k) + gap * of(by.h_p, k);
      for (int k = 0; k < m_; ++k) rate_by_[a][k] *= per_step;
    }
  }

  // dv (N, m): dt dacc.
  void solve(double dt, double* dv, double* pull) {
    if (pull)
      for (int k = 0; k < M * m_; ++k) pull[k] = 0.0;
    // Where driven coordinates move no mass, dv_K/dt has no part in the step.
    const int mean = 2 * N + 2 * K, after = mean + K;
    if (Model::coupled) {
      solve(dt, 0, m_, dv, pull);
    } else {
      for (int k = 0; k < N; ++k)
        for (int c = mean; c < after; ++c) dv[k * m_ + c] = 0.0;
      solve(dt, 0, mean, dv, pull);
      solve(dt, after, m_, dv, pull);
    }
  }

  // The same where solids touch; false where none do.
  bool solve_in_modes(const StepDerivativeArrays& in, long long i, double* dv, double* pull) {
    if constexpr (touches) {
      const int n_points = in.n_points ? in.n_points[i] : 0;
      if (n_points == 0) return false;
      for (int k = 0; pull && k < M * m_; ++k) pull[k] = 0.0;
      const StepColumns of{force_, m_, dv, pull};
      in.edges[i] |= modes_.solve(eval_, rows_, rate_by_, of);
      return true;
    }
    return false;
  }

  // The columns [begin, end).
  void solve(double dt, int begin, int end, double* dv, double* pull) const {
    for (int first = begin; first < end; first += width) {
      const int n = end - first < width ? end - first : width;
      Wide x[room(N)], w[room(N)], y[room(M)];
      const double* force[width];
      for (int l = 0; l < width; ++l) force[l] = force_ + (first + (l < n ? l : 0)) * N;
      pack(force, N, x);
      for (int k = 0; k < N; ++k) x[k] = -x[k];
      Model::forth_of(eval_.L, x, w);
      multipliers(w, first, n, y);
      Wide opposed[room(M)];
      for (int a = 0; a < rows_.n; ++a) opposed[a] = -y[a];
      rows_.add(opposed, w);
      Model::back_of(eval_.L, w, x);
      for (int k = 0; k < N; ++k) put(dt * x[k], n, dv + k * m_ + first);
      for (int a = 0; pull && a < rows_.n; ++a) put(y[a], n, pull + rows_.row[a] * m_ + first);
    }
  }

  // How many columns from c on a bundle has.
  int columns_from(int c) const { return m_ - c < width ? m_ - c : width; }

  static Wide get(const double* from, int n) {
    Wide x = Wide(0.0);
    if (n == width) std::memcpy(&x, from, sizeof(Wide));
    else
      for (int l = 0; l < n; ++l) lane_of(x, l) = from[l];
    return x;
  }

  // The first n lanes.
  static void put(const Wide& x, int n, double* out) {
    if (n == width) std::memcpy(out, &x, sizeof(Wide));
    else
      for (int l = 0; l < n; ++l) out[l] = lane_of(x, l);
  }

  // y with G y = W^T w + the rows' part.
  void multipliers(const Wide* w, int first, int n, Wide* y) const {
    rows_.along(w, y);
    for (int a = 0; a < rows_.n; ++a) y[a] += get(rate_by_[a] + first, n);
    factor_.solve(y);
  }

  // From rate and mean to v_K and acc_K of scalars, in n rows of columns: rate = v_K + dt/2 acc_K, mean = acc_K.
  void chain(double dt, double* columns, int n) const {
    using Space = typename Model::Driven;
    for (int k = 0; k < n; ++k) {
      double *rate = columns + k * m_ + 2 * N + K, *mean = rate + K;
      for (int i = 0; i < Space::n_scalars; ++i)
        mean[Space::scalar_v[i]] += 0.5 * dt * rate[Space::scalar_v[i]];
    }
  }

  // dq (N, m).
  void move(double dt, const double* dv, double* dq) const {
    using Space = typename Model::Dynamic;
    for (int i = 0; i < Space::n_scalars; ++i) {
      const int k = Space::scalar_v[i];
      for (int c = 0; c < m_; c += width) {
        const int n = columns_from(c);
        put(dt * get(dv + k * m_ + c, n), n, dq + k * m_ + c);
      }
      dq[k * m_ + k] += 1.0;
    }
    for (int i = 0; i < Space::n_quaternions; ++i) {
      const int k = Space::quaternion_v[i];
      double phi[3], J[9], R[9];
      for (int c = 0; c < 3; ++c) phi[c] = dt * v_next_[k + c];
      step_turn(phi, J, R);
      for (int c = 0; c < m_; c += width) {
        const int n = columns_from(c);
        Wide turn[3];
        for (int r = 0; r < 3; ++r) turn[r] = dt * get(dv + (k + r) * m_ + c, n);
        for (int r = 0; r < 3; ++r)
          put(J[3 * r] * turn[0] + J[3 * r + 1] * turn[1] + J[3 * r + 2] * turn[2], n,
              dq + (k + r) * m_ + c);
      }
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c) dq[(k + r) * m_ + k + c] += R[3 * r + c];
    }
  }

  const double *q_D_, *v_D_, *q_K_, *rate_, *mean_, *tension_, *p_;
  double* acc_;
  bool forces_ = false;
  int m_ = 0;
  double v_next_[room(N)];
  Evaluation<Model, double> eval_;
  RowSystem<Model, double> rows_;
  HeldFactor<M> factor_;
  double force_[room(N * most)], rate_by_[room(M)][room(most)], dv_[room(N * most)];
  std::conditional_t<touches, ModesOfStep<Model>, NoContacts> modes_;
};

}  // namespace fan
