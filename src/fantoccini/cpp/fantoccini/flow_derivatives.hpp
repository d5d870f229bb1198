// Derivatives of the motion over a smooth piece of an event-driven run, with the rows that it holds:
//
//   dZ_q/dt = turning(v) Z_q + Z_v,   dZ_v/dt = acc_q Z_q + acc_v Z_v + (acc_q_K, acc_v_K, acc_acc_K, acc_p) U(t)
//
// integrated together with the state by the run's method (tableau.hpp), in equal steps. Driven
// coordinates are scalars under a constant acceleration. The derivatives of acc_D solve
//
//   M dacc + A_D^T dtension = -r_d,   A_D dacc = -hddot_d
#pragma once

#include <cstring>

#include "evaluation.hpp"
#include "held_factor.hpp"
#include "lane_of.hpp"
#include "manifold.hpp"
#include "tableau.hpp"
#include "wide.hpp"

namespace fan {

template <class Model>
class FlowDerivatives {
 public:
  static constexpr int NQ = Model::n_qD, N = Model::n_vD, K = Model::n_vK, P = Model::n_p;
  static constexpr int M = Model::n_rows, width = Traits<Wide>::width;
  static constexpr int m = 2 * N + 3 * K + P;  // columns: q_D, v_D, q_K, v_K, acc_K, p
  static constexpr int size = NQ + N + 2 * N * m;

  void find(const FlowDerivativeArrays& in, long long i) {
    q_K_ = in.q_K + i * Model::n_qK, v_K_ = in.v_K + i * K, acc_K_ = in.acc_K + i * K;
    p_ = in.p.first + i * in.p.stride;
    for (int k = 0; k < N; ++k) u_D_[k] = in.u_D.first ? in.u_D.first[i * in.u_D.stride + k] : 0.0;
    n_held_ = 0;
    for (int r = 0; r < M; ++r)
      if (in.held[i * M + r]) held_[n_held_++] = r;
    for (int k = 0; k < size; ++k) y_[k] = 0.0;
    for (int k = 0; k < NQ; ++k) y_[k] = in.q_D[i * NQ + k];
    for (int k = 0; k < N; ++k) y_[NQ + k] = in.v_D[i * N + k];
    for (int k = 0; k < 2 * N; ++k) y_[NQ + N + k * m + k] = 1.0;
    const int steps = in.steps[i];
    const double h = in.length[i] / steps;
    for (int s = 0; s < steps; ++s) step(s * h, h);
    for (int k = 0; k < NQ; ++k) in.q_D_end[i * NQ + k] = y_[k];
    for (int k = 0; k < N; ++k) in.v_D_end[i * N + k] = y_[NQ + k];
    std::memcpy(in.motion + i * 2 * N * m, y_ + NQ + N, sizeof(double) * 2 * N * m);
  }

 private:
  void step(double t, double h) {
    for (int s = 0; s < dop853::stages; ++s) {
      std::memcpy(at_, y_, sizeof(at_));
      for (int j = 0; j < s; ++j) add(h * dop853::A[s][j], k_[j], at_);
      rate(t + h * dop853::C[s], at_, k_[s]);
    }
    for (int j = 0; j < dop853::stages; ++j) add(h * dop853::B[j], k_[j], y_);
    using Space = typename Model::Dynamic;
    for (int i = 0; i < Space::n_quaternions; ++i) {
      double* q = y_ + Space::quaternion_q[i];
      const double r = 1.0 / std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
      for (int c = 0; c < 4; ++c) q[c] *= r;
    }
  }

  static void add(double a, const double* x, double* y) {
    if (a == 0.0) return;
    for (int k = 0; k < size; ++k) y[k] += a * x[k];
  }

  void rate(double t, const double* y, double* dy) {
    using Space = typename Model::Dynamic;
    using Driven = typename Model::Driven;
    const double *q = y, *v = y + NQ, *Z = y + NQ + N;
    double q_K[room(Model::n_qK)], v_K[room(K)];
    for (int i = 0; i < Driven::n_scalars; ++i) {
      const int a = Driven::scalar_q[i], b = Driven::scalar_v[i];
      q_K[a] = q_K_[a] + t * (v_K_[b] + 0.5 * t * acc_K_[b]);
      v_K[b] = v_K_[b] + t * acc_K_[b];
    }
    linearise(q, v, q_K, v_K, dy + NQ);
    for (int i = 0; i < Space::n_scalars; ++i) dy[Space::scalar_q[i]] = v[Space::scalar_v[i]];
    double* dZ = dy + NQ + N;
    std::memcpy(dZ, Z + N * m, sizeof(double) * N * m);
    for (int i = 0; i < Space::n_quaternions; ++i) {
      const double *a = q + Space::quaternion_q[i], *w = v + Space::quaternion_v[i];
      double* out = dy + Space::quaternion_q[i];
      out[0] = -0.5 * (a[1] * w[0] + a[2] * w[1] + a[3] * w[2]);
      out[1] = 0.5 * (a[0] * w[0] + a[2] * w[2] - a[3] * w[1]);
      out[2] = 0.5 * (a[0] * w[1] + a[3] * w[0] - a[1] * w[2]);
      out[3] = 0.5 * (a[0] * w[2] + a[1] * w[1] - a[2] * w[0]);
      const int k = Space::quaternion_v[i];
      for (int c = 0; c < m; ++c) {
        const double x = Z[k * m + c], y1 = Z[(k + 1) * m + c], z = Z[(k + 2) * m + c];
        dZ[k * m + c] += w[2] * y1 - w[1] * z;
        dZ[(k + 1) * m + c] += w[0] * z - w[2] * x;
        dZ[(k + 2) * m + c] += w[1] * x - w[0] * y1;
      }
    }
    for (int k = 0; k < N; ++k) {
      double* out = dZ + (N + k) * m;
      const double* a = by_acc_[k];
      for (int c = 0; c < 2 * N; ++c) out[c] = 0.0;
      for (int c = 0; c < K; ++c) {
        const double q_c = a[2 * N + c], v_c = a[2 * N + K + c], a_c = a[2 * N + 2 * K + c];
        out[2 * N + c] = q_c;
        out[2 * N + K + c] = t * q_c + v_c;
        out[2 * N + 2 * K + c] = 0.5 * t * t * q_c + t * v_c + a_c;
      }
      for (int c = 2 * N + 3 * K; c < m; ++c) out[c] = a[c];
      for (int j = 0; j < 2 * N; ++j) {
        const double by = a[j];
        const double* row = Z + j * m;
        for (int c = 0; c < m; ++c) out[c] += by * row[c];
      }
    }
  }

  // acc_D and its derivatives by_acc_.
  void linearise(
      const double* q, const double* v, const double* q_K, const double* v_K, double* acc) {
    eval_.at(q, v, q_K, v_K, acc_K_, u_D_, p_);
    rows_.gather(eval_, v, held_, n_held_);
    factor_.factorise(rows_.problem.G, Complementarity<double, M>::N, rows_.n);
    double pull[room(M)], tension[room(M)] = {}, w[room(N)];
    for (int a = 0; a < rows_.n; ++a) pull[a] = rows_.hddot[a];
    factor_.solve(pull);
    for (int a = 0; a < rows_.n; ++a) tension[rows_.row[a]] = pull[a], pull[a] = -pull[a];
    for (int k = 0; k < N; ++k) w[k] = eval_.w0[k];
    rows_.add(pull, w);
    eval_.back(w, acc);
    struct {
      double *r_q, *r_v, *r_qK, *r_vK, *M_DK, *r_p;
    } r;
    double* at = force_;
    r.r_q = at, at += N * N, r.r_v = at, at += N * N, r.r_qK = at, at += N * K;
    r.r_vK = at, at += N * K, r.M_DK = at, at += N * K, r.r_p = at;
    using Of = Call<Model, double>;
    Of::force_by_q(q, v, acc, q_K, v_K, acc_K_, tension, 0.0, p_, r.r_q);
    Of::force_by_v(q, v, acc, q_K, v_K, acc_K_, tension, 0.0, p_, r.r_v);
    Of::force_by_K(q, v, acc, q_K, v_K, acc_K_, tension, 0.0, p_, r);
    if (rows_.n) Of::rows_by(q, v, acc, q_K, v_K, acc_K_, p_, by_);
    for (int a = 0; a < rows_.n; ++a) {
      const int row = rows_.row[a];
      double* out = rate_by_[a];
      for (int k = 0; k < N; ++k) *out++ = by_.hddot_q[M * k + row];
      for (int k = 0; k < N; ++k) *out++ = by_.hddot_v[M * k + row];
      for (int k = 0; k < K; ++k) *out++ = by_.hddot_qK[M * k + row];
      for (int k = 0; k < K; ++k) *out++ = by_.hddot_vK[M * k + row];
      for (int k = 0; k < K; ++k) *out++ = by_.A_K[M * k + row];
      for (int k = 0; k < P; ++k) *out++ = by_.hddot_p[M * k + row];
    }
    for (int first = 0; first < m; first += width) {
      const int n = m - first < width ? m - first : width;
      Wide x[room(N)], f[room(N)], y[room(M)];
      for (int k = 0; k < N; ++k)
        for (int l = 0; l < width; ++l) lane_of(x[k], l) = l < n ? -force_[(first + l) * N + k] : 0.0;
      Model::forth_of(eval_.L, x, f);
      for (int a = 0; a < rows_.n; ++a) {
        Wide sum = Wide(0.0);
        for (int l = 0; l < n; ++l) lane_of(sum, l) = rate_by_[a][first + l];
        for (int k = 0; k < N; ++k) sum += rows_.column[a][k] * f[k];
        y[a] = sum;
      }
      factor_.solve(y);
      for (int a = 0; a < rows_.n; ++a)
        for (int k = 0; k < N; ++k) f[k] -= rows_.column[a][k] * y[a];
      Model::back_of(eval_.L, f, x);
      for (int k = 0; k < N; ++k)
        for (int l = 0; l < n; ++l) by_acc_[k][first + l] = lane_of(x[k], l);
    }
  }

  const double *q_K_, *v_K_, *acc_K_, *p_;
  double u_D_[room(N)];
  int held_[room(M)], n_held_ = 0;
  Evaluation<Model, double> eval_;
  RowSystem<Model, double> rows_;
  HeldFactor<M> factor_;
  double y_[size], at_[size], k_[dop853::stages][size];
  double force_[room(N * m)], rate_by_[room(M)][room(m)], by_acc_[room(N)][room(m)];
  struct {
    double A_D[room(M * N)], A_K[room(M * K)], h_p[room(M * P)], hdot_q[room(M * N)];
    double hdot_qK[room(M * K)], hdot_p[room(M * P)], hddot_q[room(M * N)], hddot_v[room(M * N)];
    double hddot_qK[room(M * K)], hddot_vK[room(M * K)], hddot_p[room(M * P)];
  } by_;
};

}  // namespace fan
