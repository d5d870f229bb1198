// The pseudo-inverse of a small square matrix that may be singular, by a complete orthogonal
// decomposition: A P = Q [T 0; 0 0] V^T with reflections from both sides, the largest column first.
#pragma once

#include <math.h>

#include "real.hpp"

namespace fan {

template <int capacity>
class PseudoInverse {
 public:
  int rank = 0;
  double inverse[room(capacity * capacity)];  // (n, n), row by row

  // The n by n matrix, column by column, to be written.
  double* matrix(int n) {
    n_ = n;
    return A_;
  }

  // The rank: columns that are left are shorter than this part of the longest.
  void factorise(double dependent) {
    double first = 0.0;
    for (int j = 0; j < n_; ++j) from_[j] = j;
    for (rank = 0; rank < n_; ++rank) {
      int best = rank;
      double most = -1.0;
      for (int j = rank; j < n_; ++j) {
        double sum = 0.0;
        for (int i = rank; i < n_; ++i) sum += at(i, j) * at(i, j);
        if (sum > most) most = sum, best = j;
      }
      const double length = sqrt(most);
      if (rank == 0) first = length;
      if (!(length > dependent * first)) return;
      for (int i = 0; i < n_; ++i) swap(at(i, best), at(i, rank));
      const int j = from_[best];
      from_[best] = from_[rank];
      from_[rank] = j;
      // The reflection that takes the column to its first entry; its vector stays below the diagonal.
      double* v = left_[rank];
      for (int i = rank; i < n_; ++i) v[i] = at(i, rank);
      reflection(v, rank, n_, length);
      for (int c = rank; c < n_; ++c) {
        double sum = 0.0;
        for (int i = rank; i < n_; ++i) sum += v[i] * at(i, c);
        for (int i = rank; i < n_; ++i) at(i, c) -= 2.0 * sum * v[i];
      }
    }
  }

  // `inverse`, of the matrix that was written.
  void find(double dependent) {
    factorise(dependent);
    // From the right: rows [R11 R12] of rank many become [T 0], from the last one on.
    for (int r = rank - 1; rank < n_ && r >= 0; --r) {
      double* v = right_[r];
      v[r] = at(r, r);
      double square = v[r] * v[r];
      for (int j = rank; j < n_; ++j) {
        v[j] = at(r, j);
        square += v[j] * v[j];
      }
      const double length = sqrt(square);
      v[r] += v[r] < 0.0 ? -length : length;
      double sum = v[r] * v[r];
      for (int j = rank; j < n_; ++j) sum += v[j] * v[j];
      const double scale = sum > 0.0 ? 1.0 / sqrt(sum) : 0.0;
      v[r] *= scale;
      for (int j = rank; j < n_; ++j) v[j] *= scale;
      for (int i = 0; i <= r; ++i) {
        double part = v[r] * at(i, r);
        for (int j = rank; j < n_; ++j) part += v[j] * at(i, j);
        at(i, r) -= 2.0 * part * v[r];
        for (int j = rank; j < n_; ++j) at(i, j) -= 2.0 * part * v[j];
      }
    }
    double x[room(capacity)];
    for (int c = 0; c < n_; ++c) {
      for (int i = 0; i < n_; ++i) x[i] = i == c ? 1.0 : 0.0;
      for (int r = 0; r < rank; ++r) {
        double sum = 0.0;
        for (int i = r; i < n_; ++i) sum += left_[r][i] * x[i];
        for (int i = r; i < n_; ++i) x[i] -= 2.0 * sum * left_[r][i];
      }
      for (int r = rank - 1; r >= 0; --r) {
        for (int j = r + 1; j < rank; ++j) x[r] -= at(r, j) * x[j];
        x[r] /= at(r, r);
      }
      for (int i = rank; i < n_; ++i) x[i] = 0.0;
      turn_back(x);
      for (int i = 0; i < n_; ++i) inverse[from_[i] * n_ + c] = x[i];
    }
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

  // A vector that the matrix takes to 0, after find(); false where there is none but 0.
  bool null_vector(double* out) const {
    if (rank == n_) return false;
    double x[room(capacity)] = {};
    // A sum of all of them that hides none.
    for (int j = rank; j < n_; ++j) x[j] = cos(double(j - rank));
    turn_back(x);
    for (int i = 0; i < n_; ++i) out[from_[i]] = x[i];
    return true;
  }

 private:
  double& at(int i, int j) { return A_[j * n_ + i]; }
  double at(int i, int j) const { return A_[j * n_ + i]; }

  static void swap(double& a, double& b) {
    const double x = a;
    a = b;
    b = x;
  }

  // The unit vector of the reflection that takes v to a multiple of its entry `first`.
  static void reflection(double* v, int first, int n, double length) {
    v[first] += v[first] < 0.0 ? -length : length;
    double sum = 0.0;
    for (int i = first; i < n; ++i) sum += v[i] * v[i];
    const double scale = sum > 0.0 ? 1.0 / sqrt(sum) : 0.0;
    for (int i = first; i < n; ++i) v[i] *= scale;
  }

  // V x.
  void turn_back(double* x) const {
    for (int r = 0; rank < n_ && r < rank; ++r) {
      const double* v = right_[r];
      double sum = v[r] * x[r];
      for (int j = rank; j < n_; ++j) sum += v[j] * x[j];
      x[r] -= 2.0 * sum * v[r];
      for (int j = rank; j < n_; ++j) x[j] -= 2.0 * sum * v[j];
    }
  }

  int n_ = 0, from_[room(capacity)];
  double A_[room(capacity * capacity)];
  double left_[room(capacity)][room(capacity)], right_[room(capacity)][room(capacity)];
};

}  // namespace fan
