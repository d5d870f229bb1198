// The pseudo-inverse of a small square matrix that may be singular, by a complete orthogonal
// decomposition: A P = Q [T 0; 0 0] V^T with reflections from both sides, the largest column first.
#pragma once

#include <math.h>

#include "fantoccini/math/real.hpp"

FAN_LOOPS_BEGIN

namespace fan {

// All loops run along rows, so that several sums over rows are computed at once.
template <int capacity>
class PseudoInverse {
 public:
  int rank = 0;
  double inverse[array_size(capacity * capacity)];  // (n, n), row by row

  // The n by n matrix, to be written row by row.
  double* matrix(int n) {
    n_ = n;
    return A_;
  }

  // The rank: all remaining columns are shorter than this share of the longest.
  void factorise(double dependent) {
    double first = 0.0;
    for (int j = 0; j < n_; ++j) from_[j] = j;
    for (rank = 0; rank < n_; ++rank) {
      const int best = longest();
      const double length = sqrt(sum_[best]);
      if (rank == 0) first = length;
      if (!(length > dependent * first)) return;
      for (int i = 0; i < n_; ++i) swap(at(i, best), at(i, rank));
      const int j = from_[best];
      from_[best] = from_[rank];
      from_[rank] = j;
      // The reflection that maps the column to a multiple of its first entry.
      double* v = left_[rank];
      for (int i = rank; i < n_; ++i) v[i] = at(i, rank);
      make_unit(v, rank, rank + 1, length);
      reflect(v, rank, A_, rank);
    }
  }

  // Computes `inverse` from the matrix that was written.
  void find(double dependent) {
    factorise(dependent);
    // From the right: the first `rank` rows [R11 R12] become [T 0], beginning with the last one.
    for (int r = rank - 1; rank < n_ && r >= 0; --r) {
      double* v = right_[r];
      v[r] = at(r, r);
      double square = v[r] * v[r];
      for (int j = rank; j < n_; ++j) {
        v[j] = at(r, j);
        square += v[j] * v[j];
      }
      make_unit(v, r, rank, sqrt(square));
      for (int i = 0; i <= r; ++i) {
        double part = v[r] * at(i, r);
        for (int j = rank; j < n_; ++j) part += v[j] * at(i, j);
        at(i, r) -= 2.0 * part * v[r];
        for (int j = rank; j < n_; ++j) at(i, j) -= 2.0 * part * v[j];
      }
    }
    double* X = X_;
    for (int i = 0; i < n_ * n_; ++i) X[i] = 0.0;
    for (int i = 0; i < n_; ++i) X[i * n_ + i] = 1.0;
    for (int r = 0; r < rank; ++r) reflect(left_[r], r, X, 0);
    for (int r = rank - 1; r >= 0; --r) {
      double* own = X + r * n_;
      for (int j = r + 1; j < rank; ++j) take(at(r, j), X + j * n_, own, 0);
      const double scale = 1.0 / at(r, r);
      for (int c = 0; c < n_; ++c) own[c] *= scale;
    }
    for (int i = rank * n_; i < n_ * n_; ++i) X[i] = 0.0;
    for (int r = 0; rank < n_ && r < rank; ++r) {
      const double* v = right_[r];
      for (int c = 0; c < n_; ++c) sum_[c] = v[r] * X[r * n_ + c];
      for (int j = rank; j < n_; ++j) take(-v[j], X + j * n_, sum_, 0);
      take(2.0 * v[r], sum_, X + r * n_, 0);
      for (int j = rank; j < n_; ++j) take(2.0 * v[j], sum_, X + j * n_, 0);
    }
    for (int i = 0; i < n_; ++i)
      for (int c = 0; c < n_; ++c) inverse[from_[i] * n_ + c] = X[i * n_ + c];
  }

  // y = inverse x.
  template <class Real>
  void apply(const Real* x, Real* y) const {
    for (int i = 0; i < n_; ++i) {
      Real sum = Real(0.0);
      for (int j = 0; j < n_; ++j) sum += inverse[i * n_ + j] * x[j];
      y[i] = sum;
    }
  }

  // y = inverse^T x.
  void apply_transposed(const double* x, double* y) const {
    for (int i = 0; i < n_; ++i) y[i] = 0.0;
    for (int i = 0; i < n_; ++i)
      for (int j = 0; j < n_; ++j) y[j] += inverse[i * n_ + j] * x[i];
  }

  // A null vector of the matrix, after find(); false if the matrix is regular.
  bool null_vector(double* out) const {
    if (rank == n_) return false;
    double x[array_size(capacity)] = {};
    // A sum of all basis vectors, with different weights, so that none cancels.
    for (int j = rank; j < n_; ++j) x[j] = cos(double(j - rank));
    for (int r = 0; r < rank; ++r) {
      const double* v = right_[r];
      double sum = v[r] * x[r];
      for (int j = rank; j < n_; ++j) sum += v[j] * x[j];
      x[r] -= 2.0 * sum * v[r];
      for (int j = rank; j < n_; ++j) x[j] -= 2.0 * sum * v[j];
    }
    for (int i = 0; i < n_; ++i) out[from_[i]] = x[i];
    return true;
  }

 private:
  double& at(int i, int j) { return A_[i * n_ + j]; }

  static void swap(double& a, double& b) {
    const double x = a;
    a = b;
    b = x;
  }

  // The longest of the columns from `rank` on, from row `rank` on; sum_ has the squared lengths.
  int longest() {
    for (int j = rank; j < n_; ++j) sum_[j] = 0.0;
    for (int i = rank; i < n_; ++i) {
      const double* row = A_ + i * n_;
      FAN_INDEPENDENT
      for (int j = rank; j < n_; ++j) sum_[j] += row[j] * row[j];
    }
    int best = rank;
    for (int j = rank; j < n_; ++j)
      if (sum_[j] > sum_[best]) best = j;
    return best;
  }

  // to <- to - by x, from column `first` on.
  void take(double by, const double* x, double* to, int first) const {
    FAN_INDEPENDENT
    for (int c = first; c < n_; ++c) to[c] -= by * x[c];
  }

  // Reflects the rows of X by v, from row `first` and column `column` on.
  void reflect(const double* v, int first, double* X, int column) {
    for (int c = column; c < n_; ++c) sum_[c] = 0.0;
    for (int i = first; i < n_; ++i) take(-v[i], X + i * n_, sum_, column);
    for (int i = first; i < n_; ++i) take(2.0 * v[i], sum_, X + i * n_, column);
  }

  // The unit vector of the reflection that maps v, of this length, to a multiple of its entry
  // `first`; its other nonzero entries are those from `next` on.
  void make_unit(double* v, int first, int next, double length) const {
    v[first] += v[first] < 0.0 ? -length : length;
    double sum = v[first] * v[first];
    for (int i = next; i < n_; ++i) sum += v[i] * v[i];
    const double scale = sum > 0.0 ? 1.0 / sqrt(sum) : 0.0;
    v[first] *= scale;
    for (int i = next; i < n_; ++i) v[i] *= scale;
  }

  int n_ = 0, from_[array_size(capacity)];
  double A_[array_size(capacity * capacity)], X_[array_size(capacity * capacity)],
      sum_[array_size(capacity)];
  double left_[array_size(capacity)][array_size(capacity)],
      right_[array_size(capacity)][array_size(capacity)];
};

}  // namespace fan

FAN_LOOPS_END
