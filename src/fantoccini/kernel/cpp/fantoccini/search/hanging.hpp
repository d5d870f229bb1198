// A hanging pose, and its derivatives by the driven coordinates and the parameters, u:
//
//   r(q_D, q_K, p, T) = g + A_D^T T = 0,   h = 0 where a row pulls, T = 0 elsewhere
//
//   (r_q  A^T) (dq_D)     (r_u)
//   ( A    0 ) ( dT )  = -(h_u) du
//
// over the pulling rows, solved with B = r_q + A^T R A, which is positive definite for a large R
// exactly if V has a minimum on the rows (Nocedal and Wright, Numerical Optimization, section
// 17.3).
#pragma once

#include <cmath>
#include <cstring>

#include "fantoccini/contract.hpp"
#include "fantoccini/math/dense_ldl.hpp"
#include "fantoccini/math/manifold.hpp"

namespace fan {

struct HangingTolerances {
  static constexpr double penalty = 100.0;     // R, relative to the stiffness along the row
  static constexpr double neutral = 1e-12;     // raise of the diagonal: a pose may turn freely
  static constexpr double dependent = 1e-11;   // pivot below which a row depends on others
  static constexpr double last_move = 1e-7;    // last Newton move [rad or m]
  static constexpr double max_move = 0.3;      // longest move [likewise]
  static constexpr double min_tension = 1e-9;  // relative to the weight: rounding
  static constexpr int rounds = 40;            // of Newton's method
  static constexpr double max_gap = 1e-9;      // rounding [m or rad]
};

template <class Model>
class Hanging {
 public:
  using Tolerance = HangingTolerances;
  static constexpr int NQ = Model::n_qD, N = Model::n_vD, KQ = Model::n_qK, K = Model::n_vK;
  static constexpr int P = Model::n_p, M = Model::n_rows, U = K + P, NP = padded(array_size(N));

  struct Pose {
    double q_D[array_size(NQ)], q_K[array_size(KQ)], p[array_size(P)], tension[array_size(M)];
    bool held[array_size(M)];
  } at;
  double weight = 1.0;
  const unsigned char* may_change = nullptr;  // (M,) rows that may begin or cease to pull

  // dq_D (column u at u * NP) and dT (at u * M, of pulling rows; of others dh) by u.
  double by_u[array_size(U) * NP], row_by_u[array_size(U * M)];
  double h[array_size(M)];
  bool stable = false;

  // Computes one Newton step without taking it: `move` of q_D, `row_move` of T for pulling rows and
  // of h for others. Returns false if the equations have no solution.
  double move[NP], row_move[array_size(M)];
  bool aim() {
    Call<Model, double>::hanging(at.q_D, at.q_K, at.tension, at.p, values_);
    for (int j = 0; j < M; ++j) h[j] = values_.h[j];
    if (!factorise()) return false;
    double first[array_size(N)], second[array_size(M)];
    for (int k = 0; k < N; ++k) first[k] = -values_.r[k];
    for (int a = 0; a < n_; ++a) second[a] = -h[rows_[a]];
    solve(first, second, move, pull_);
    for (int j = 0; j < M; ++j) {
      row_move[j] = 0.0;
      for (int k = 0; k < N && !at.held[j]; ++k) row_move[j] += A(j, k) * move[k];
    }
    for (int a = 0; a < n_; ++a) row_move[rows_[a]] = pull_[a];
    return true;
  }

  // Newton's method, with rows that begin or cease to pull. Returns false if it does not converge.
  bool balance() {
    for (int change = 0; change <= 2 * M + 2; ++change) {
      if (!settle()) return false;
      if (!change_row()) return true;
    }
    return false;
  }

  // Factorises the equations at the last evaluation, after a change of the pulling rows.
  bool factorise() {
    gather();
    double top = 0.0;
    for (int k = 0; k < N; ++k) top = maximum(fabs(values_.r_q[k * N + k]), top);
    if (!(top < unbounded)) return false;
    top = maximum(top, 1e-12 * weight);
    for (double shift = 0.0; shift < 1e4; shift = shift > 0.0 ? 10.0 * shift : 1e-4) {
      fill(top, shift);
      stable = shift == 0.0;
      if (!B_.factorise()) continue;
      for (int a = 0; a < n_; ++a) {
        double* z = Z_ + a * NP;
        std::memcpy(z, pulling_ + a * NP, NP * sizeof(double));
        B_.substitute(z);
      }
      schur();
      return true;
    }
    return false;
  }

  // by_u and row_by_u of the chosen coordinates and parameters.
  void differentiate(const int* chosen, int n_chosen) {
    for (int c = 0; c < n_chosen; ++c) {
      const int u = chosen[c];
      const double* r_u = u < K ? values_.r_qK + u * N : values_.r_p + (u - K) * N;
      const double* h_u = u < K ? values_.A_K + u * M : values_.h_p + (u - K) * M;
      double *x = by_u + u * NP, *row = row_by_u + u * M, first[array_size(N)],
             second[array_size(M)];
      for (int k = 0; k < N; ++k) first[k] = -r_u[k];
      for (int a = 0; a < n_; ++a) second[a] = -h_u[rows_[a]];
      solve(first, second, x, pull_);
      for (int j = 0; j < M; ++j) {
        row[j] = h_u[j];
        for (int k = 0; k < N; ++k) row[j] += A(j, k) * x[k];
      }
      for (int a = 0; a < n_; ++a) row[rows_[a]] = pull_[a];
    }
  }

 private:
  double A(int row, int k) const { return values_.A_D[k * M + row]; }

  // Lists the pulling rows.
  void gather() {
    n_ = 0;
    for (int j = 0; j < M; ++j) {
      if (!at.held[j]) continue;
      for (int k = 0; k < NP; ++k) pulling_[n_ * NP + k] = k < N ? A(j, k) : 0.0;
      rows_[n_++] = j;
    }
  }

  bool settle() {
    for (int round = 0; round < Tolerance::rounds; ++round) {
      if (!aim()) return false;
      double most = 0.0;
      for (int k = 0; k < N; ++k) most = maximum(fabs(move[k]), most);
      if (!(most < unbounded)) return false;
      const double share = most > Tolerance::max_move ? Tolerance::max_move / most : 1.0;
      retract<typename Model::Dynamic>(at.q_D, move, share, at.q_D);
      for (int a = 0; a < n_; ++a) at.tension[rows_[a]] += share * row_move[rows_[a]];
      if (most > Tolerance::last_move) continue;
      for (int j = 0; j < M; ++j) h[j] = at.held[j] ? 0.0 : h[j] + row_move[j];
      return stable;
    }
    return false;
  }

  // Releases the row with the largest push, or else holds the one with the largest violation.
  bool change_row() {
    int worst = -1;
    double most = Tolerance::min_tension * weight;
    for (int j = 0; j < M; ++j)
      if (at.held[j] && may_change[j] && -at.tension[j] > most) most = -at.tension[worst = j];
    if (worst < 0) {
      most = Tolerance::max_gap;
      for (int j = 0; j < M; ++j)
        if (!at.held[j] && h[j] > most) most = h[worst = j];
    }
    if (worst < 0) return false;
    at.held[worst] = !at.held[worst];
    at.tension[worst] = 0.0;
    return true;
  }

  void fill(double top, double shift) {
    B_.resize(N);
    for (int i = 0; i < N; ++i)
      for (int j = i / 4 * 4; j < B_.stride; ++j)
        B_.A[i * B_.stride + j] =
            j < N ? 0.5 * (values_.r_q[j * N + i] + values_.r_q[i * N + j]) : 0.0;
    for (int a = 0; a < n_; ++a) {
      const double* row = pulling_ + a * NP;
      double size = 0.0, stiff = 0.0;
      for (int k = 0; k < N; ++k) {
        const double own = row[k] * row[k];
        size += own;
        stiff += own * (fabs(values_.r_q[k * N + k]) + 1e-3 * top);
      }
      penalty_[a] = size > 0.0 ? Tolerance::penalty * stiff / (size * size) : 0.0;
      for (int i = 0; i < N; ++i) {
        const double own = penalty_[a] * row[i];
        if (own == 0.0) continue;
        for (int j = i / 4 * 4; j < N; ++j) B_.A[i * B_.stride + j] += own * row[j];
      }
    }
    for (int k = 0; k < N; ++k)
      B_.A[k * (B_.stride + 1)] +=
          Tolerance::neutral * top + shift * (fabs(values_.r_q[k * N + k]) + 0.01 * top);
  }

  void schur() {
    S_.resize(n_);
    for (int a = 0; a < n_; ++a)
      for (int b = a / 4 * 4; b < S_.stride; ++b) {
        double sum = 0.0;
        if (b < n_)
          for (int k = 0; k < N; ++k) sum += pulling_[a * NP + k] * Z_[b * NP + k];
        S_.A[a * S_.stride + b] = sum;
      }
    if (n_ > 0) S_.factorise(Tolerance::dependent);
  }

  // x (NP,) and t (n_,) with r_q x + A^T t = first, A x = second.
  void solve(const double* first, const double* second, double* x, double* t) const {
    for (int k = 0; k < NP; ++k) x[k] = k < N ? first[k] : 0.0;
    for (int a = 0; a < n_; ++a) {
      const double own = penalty_[a] * second[a];
      if (own == 0.0) continue;
      for (int k = 0; k < N; ++k) x[k] += own * pulling_[a * NP + k];
    }
    B_.substitute(x);
    if (n_ == 0) return;
    double none[array_size(M)];
    for (int a = 0; a < n_; ++a) {
      t[a] = -second[a];
      none[a] = 0.0;
      for (int k = 0; k < N; ++k) t[a] += pulling_[a * NP + k] * x[k];
    }
    S_.substitute(t, none);
    for (int a = 0; a < n_; ++a)
      for (int k = 0; k < N; ++k) x[k] -= t[a] * Z_[a * NP + k];
  }

  struct {
    double r[array_size(N)], h[array_size(M)], r_q[array_size(N * N)], r_qK[array_size(N * K)],
        r_p[array_size(N * P)];
    double A_D[array_size(M * N)], A_K[array_size(M * K)], h_p[array_size(M * P)];
  } values_;
  int n_ = 0, rows_[array_size(M)];
  double penalty_[array_size(M)], pulling_[array_size(M) * NP], Z_[array_size(M) * NP],
      pull_[padded(array_size(M))];
  DenseLdl<N> B_;
  DenseLdl<M> S_;
};

}  // namespace fan
