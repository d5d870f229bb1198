// Tensions of rows that are nearly dependent. Solving G x = b with G = W^T W loses twice the digits
// that W has to lose; with W = Q R and b = W^T w + gamma,
//
//   x = R^-1 (Q^T w + R^-T gamma)
//
// loses them once, except on gamma, which is small where this matters: near rest.
#pragma once

#include "real.hpp"

namespace fan {

template <int n_columns, int n_dimensions>
struct Orthogonal {
  static constexpr int C = room(n_columns), D = room(n_dimensions);

  // Gram and Schmidt, twice over.
  void factorise(const double* const* columns, int n) {
    n_ = n;
    for (int j = 0; j < n; ++j) {
      for (int a = 0; a < n_dimensions; ++a) Q_[j][a] = columns[j][a];
      for (int l = 0; l < j; ++l) R_[l][j] = 0.0;
      for (int twice = 0; twice < 2; ++twice)
        for (int l = 0; l < j; ++l) {
          const double part = product(Q_[l], Q_[j]);
          R_[l][j] += part;
          for (int a = 0; a < n_dimensions; ++a) Q_[j][a] -= part * Q_[l][a];
        }
      R_[j][j] = sqrt(product(Q_[j], Q_[j])) + 1e-300;
      for (int a = 0; a < n_dimensions; ++a) Q_[j][a] /= R_[j][j];
    }
  }

  void solve(const double* w, const double* gamma, double* x) const {
    for (int j = 0; j < n_; ++j) {
      x[j] = gamma[j];
      for (int l = 0; l < j; ++l) x[j] -= R_[l][j] * x[l];
      x[j] /= R_[j][j];
    }
    for (int j = 0; j < n_; ++j) x[j] += product(Q_[j], w);
    for (int j = n_ - 1; j >= 0; --j) {
      for (int l = j + 1; l < n_; ++l) x[j] -= R_[j][l] * x[l];
      x[j] /= R_[j][j];
    }
  }

 private:
  static double product(const double* p, const double* q) {
    double sum = 0.0;
    for (int a = 0; a < n_dimensions; ++a) sum += p[a] * q[a];
    return sum;
  }

  int n_ = 0;
  double Q_[C][D], R_[C][C];
};

}  // namespace fan
