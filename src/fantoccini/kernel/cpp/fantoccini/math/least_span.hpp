// A basis of the span of rows, by the Gram-Schmidt method with the longest row first.
#pragma once

#include <math.h>

#include "fantoccini/math/real.hpp"

namespace fan {

struct LeastSpanTolerances {
  // Smallest remainder of an independent row, relative to the longest row.
  static constexpr double dependent = 1e-7;
};

// The span of up to `capacity` rows of n numbers.
template <int capacity, int n>
class LeastSpan {
 public:
  void begin() { n_ = 0; }

  // Memory of the next row, to be written.
  double* next() { return row_[n_++]; }

  // Computes the basis of the rows that were written.
  void find() {
    double longest = 0.0;
    for (rank_ = 0; rank_ < n_; ++rank_) {
      int best = rank_;
      for (int i = rank_; i < n_; ++i)
        if (size(row_[i]) > size(row_[best])) best = i;
      const double length = size(row_[best]);
      if (rank_ == 0) longest = length;
      if (!(length > LeastSpanTolerances::dependent * longest)) return;
      for (int k = 0; k < n; ++k) {
        const double x = row_[best][k];
        row_[best][k] = row_[rank_][k];
        row_[rank_][k] = x / length;
      }
      for (int i = rank_ + 1; i < n_; ++i)
        for (int twice = 0; twice < 2; ++twice) take_out(rank_, row_[i]);
    }
  }

  // Whether a row is linearly independent of them.
  bool leaves(const double* row) const {
    double rest[array_size(n)];
    for (int k = 0; k < n; ++k) rest[k] = row[k];
    for (int twice = 0; twice < 2; ++twice)
      for (int j = 0; j < rank_; ++j) take_out(j, rest);
    return size(rest) > LeastSpanTolerances::dependent * size(row);
  }

 private:
  static double size(const double* x) {
    double sum = 0.0;
    for (int k = 0; k < n; ++k) sum += x[k] * x[k];
    return sqrt(sum);
  }

  void take_out(int j, double* x) const {
    double part = 0.0;
    for (int k = 0; k < n; ++k) part += row_[j][k] * x[k];
    for (int k = 0; k < n; ++k) x[k] -= part * row_[j][k];
  }

  int n_ = 0, rank_ = 0;
  double row_[array_size(capacity)][array_size(n)];
};

}  // namespace fan
