// The dynamics of intervals that consist of time steps, from the derivatives of the steps:
//
//   X <- F_D X + F_K K + F_a,   likewise K of the driven coordinates
//
// X (n_d, n_d + 3 k) are derivatives of the dynamic part of the state after some steps by (q_D,
// v_D, q_K, v_K) at the start of the interval and by its accelerations.
#pragma once

#include <algorithm>
#include <vector>

#include "fantoccini/contract.hpp"
#include "fantoccini/math/row_products.hpp"

namespace fan {

class StageDynamics {
 public:
  int ld = 0;

  // Row r of X of interval i.
  const double* row(int i, int r) const { return X_.data() + (size_t(i) * n_d_ + r) * ld; }

  // Adds a time step to every interval. May throw std::bad_alloc.
  void add(const StageStepArrays& in) {
    const int n = in.n_d, width = n + 3 * in.k;
    if (in.is_first) {
      n_d_ = n, ld = in_eights(width);
      X_.resize(size_t(in.N) * n * ld), T_.resize(size_t(in_eights(n)) * ld);
      left_.assign(size_t(n) * in_eights(n), 0.0);
    }
    for (int i = 0; i < int(in.N); ++i) {
      const double* F = in.motion + size_t(i) * n * in.columns;
      double* X = X_.data() + size_t(i) * n * ld;
      if (in.is_first) {
        for (int r = 0; r < n; ++r) {
          std::copy_n(F + size_t(r) * in.columns, width, X + r * ld);
          std::fill(X + r * ld + width, X + (r + 1) * ld, 0.0);
        }
        continue;
      }
      const int rows = in_eights(n);
      for (int r = 0; r < n; ++r) {
        for (int c = 0; c < n; ++c) left_[c * rows + r] = F[size_t(r) * in.columns + c];
      }
      std::fill(T_.begin(), T_.end(), 0.0);
      add_product(n, left_.data(), rows, X, ld, T_.data(), ld, rows, ld);
      if (i == 0 || in.driven.stride) find_entries(in.driven.first + i * in.driven.stride, in.k);
      for (int r = 0; r < n; ++r) {
        const double* f = F + size_t(r) * in.columns + n;
        double* t = T_.data() + r * ld + n;
        for (const Entry& e : entries_) t[e.column] += e.value * f[e.row];
        for (int j = 2 * in.k; j < 3 * in.k; ++j) t[j] += f[j];
      }
      std::copy_n(T_.data(), size_t(n) * ld, X);
    }
  }

 private:
  struct Entry {
    int row, column;
    double value;
  };
  int n_d_ = 0;
  std::vector<double> X_, T_, left_;
  std::vector<Entry> entries_;

  void find_entries(const double* K, int k) {
    entries_.clear();
    for (int r = 0; r < 2 * k; ++r) {
      for (int c = 0; c < 3 * k; ++c) {
        if (K[r * 3 * k + c] != 0.0) entries_.push_back({r, c, K[r * 3 * k + c]});
      }
    }
  }
};

}  // namespace fan
