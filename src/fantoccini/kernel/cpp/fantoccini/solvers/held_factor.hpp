// The factor of held rows, G = U^T D U, in which rows that depend on earlier ones are left out.
#pragma once

#include "fantoccini/math/real.hpp"

namespace fan {

struct HeldFactorTolerances {
  // Pivot of a row, relative to its diagonal entry, below which it depends on earlier ones.
  static constexpr double dependent = 1e-12;
};

template <int capacity>
class HeldFactor {
 public:
  // Of n rows; G is symmetric, row by row.
  void factorise(const double* G, int stride, int n) {
    n_ = n;
    for (int a = 0; a < n; ++a) {
      double pivot = G[a * stride + a];
      for (int b = 0; b < a; ++b) {
        double sum = G[a * stride + b];
        for (int c = 0; c < b; ++c) sum -= factor_[a][c] * factor_[b][c] * pivot_[c];
        factor_[a][b] = pivot_[b] > 0.0 ? sum / pivot_[b] : 0.0;
        pivot -= factor_[a][b] * sum;
      }
      const bool depends = !(pivot > HeldFactorTolerances::dependent * G[a * stride + a]);
      pivot_[a] = depends ? 0.0 : pivot;
      inverse_[a] = depends ? 0.0 : 1.0 / pivot;
    }
  }

  // y <- G^-1 y, with 0 for rows that are left out.
  template <class Real>
  void solve(Real* y) const {
    for (int a = 0; a < n_; ++a)
      for (int b = 0; b < a; ++b) y[a] -= factor_[a][b] * y[b];
    for (int a = 0; a < n_; ++a) y[a] *= inverse_[a];
    for (int a = n_ - 1; a >= 0; --a)
      for (int b = 0; b < a; ++b) y[b] -= factor_[a][b] * y[a];
  }

 private:
  int n_ = 0;
  double factor_[array_size(capacity)][array_size(capacity)], pivot_[array_size(capacity)],
      inverse_[array_size(capacity)];
};

}  // namespace fan
