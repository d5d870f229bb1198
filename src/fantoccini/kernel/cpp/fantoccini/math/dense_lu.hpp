// P A = L U with partial pivoting (Golub and Van Loan, Matrix Computations, algorithm 3.4.1), for
// matrices whose size is known at run time. Rows are contiguous and padded with zeros to a multiple
// of four, so that the inner loops use whole registers.
#pragma once

#include "fantoccini/math/real.hpp"

namespace fan {

// Four doubles in one or two registers, and four doubles in an array.
typedef double Quad __attribute__((vector_size(32)));
typedef double QuadInPlace __attribute__((vector_size(32), aligned(8), may_alias));

FAN_FN QuadInPlace& quad(double* at) { return *reinterpret_cast<QuadInPlace*>(at); }
FAN_FN const QuadInPlace& quad(const double* at) {
  return *reinterpret_cast<const QuadInPlace*>(at);
}

// Padded length of a row of n numbers.
constexpr int padded(int n) { return (n + 3) / 4 * 4; }

// x . y over padded lengths.
FAN_FN double product(const double* x, const double* y, int n) {
  Quad sum = {0.0, 0.0, 0.0, 0.0};
  for (int i = 0; i < n; i += 4) sum += quad(x + i) * quad(y + i);
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

template <int capacity>
struct DenseLu {
  static constexpr int N = padded(array_size(capacity));

  int n = 0, stride = 0;
  double A[N * N];  // row i, column j at i * stride + j; entries of a row after column n must be 0

  FAN_FN void resize(int rows) {
    n = rows;
    stride = padded(rows);
  }

  // Replaces A by its factors; false if a pivot is 0 or not finite.
  FAN_FN bool factorise() {
    const int n = this->n, stride = this->stride;  // in registers: stores may alias the members
    double top[N];                                 // the pivot's row, right of the pivot
    for (int k = 0; k < n; ++k) {
      int p = k;
      double largest = fabs(A[k * stride + k]);
      const double* below = A + k * stride + k;
      for (int i = k + 1; i < n; ++i) {
        below += stride;
        if (!(fabs(*below) > largest)) continue;
        largest = fabs(*below);
        p = i;
      }
      swap_[k] = p;
      const double pivot = A[p * stride + k];
      if (!(fabs(pivot) > 0.0 && fabs(pivot) < unbounded)) return false;
      if (p != k) exchange(A + p * stride, A + k * stride);
      inverse_[k] = 1.0 / pivot;
      const int first = (k + 1) / 4 * 4;
      for (int j = first; j < stride; j += 4) quad(top + j) = quad(A + k * stride + j);
      for (int j = first; j <= k; ++j) top[j] = 0.0;
      for (int i = k + 1; i < n; ++i) multiplier_[i] = A[i * stride + k] * inverse_[k];
      int j = first;
      for (; j + 16 <= stride; j += 16) eliminate<4>(k, j, top + j);
      if (j + 8 <= stride) {
        eliminate<2>(k, j, top + j);
        j += 8;
      }
      if (j < stride) eliminate<1>(k, j, top + j);
      for (int i = k + 1; i < n; ++i) A[i * stride + k] = multiplier_[i];
    }
    return true;
  }

  // r <- A^-1 r, four rows at a time.
  FAN_FN void substitute(double* r) const {
    const int n = this->n, stride = this->stride;
    double y[N], sum[4];
    for (int k = 0; k < n; ++k) {
      const double saved = r[swap_[k]];
      r[swap_[k]] = r[k];
      r[k] = saved;
    }
    for (int i = n; i < stride; ++i) y[i] = 0.0;
    for (int i = 0; i < n; i += 4) {
      const int rows = n - i < 4 ? n - i : 4;
      products(i, rows, y, 0, i, sum);
      for (int k = 0; k < rows; ++k) {
        const double* row = A + (i + k) * stride + i;
        double remainder = r[i + k] - sum[k];
        for (int m = 0; m < k; ++m) remainder -= row[m] * y[i + m];
        y[i + k] = remainder;
      }
    }
    for (int i = stride - 4; i >= 0; i -= 4) {
      const int rows = n - i < 4 ? n - i : 4;
      products(i, rows, y, i + 4, stride, sum);
      for (int k = rows - 1; k >= 0; --k) {
        const double* row = A + (i + k) * stride + i;
        double remainder = y[i + k] - sum[k];
        for (int m = rows - 1; m > k; --m) remainder -= row[m] * y[i + m];
        y[i + k] = remainder * inverse_[i + k];
      }
    }
    for (int i = 0; i < n; ++i) r[i] = y[i];
  }

 private:
  // Products of up to four rows from `first` with y, over columns from `begin` to `end`.
  FAN_FN void products(
      int first, int rows, const double* y, int begin, int end, double* out) const {
    const double* row = A + first * stride;
    if (rows < 4) {
      for (int k = 0; k < rows; ++k)
        out[k] = product(row + k * stride + begin, y + begin, end - begin);
      return;
    }
    Quad sum[4] = {};
    for (int j = begin; j < end; j += 4) {
      const Quad factor = quad(y + j);
      FAN_UNROLL for (int k = 0; k < 4; ++k) sum[k] += quad(row + k * stride + j) * factor;
    }
    FAN_UNROLL for (int k = 0; k < 4; ++k) out[k] =
        (sum[k][0] + sum[k][1]) + (sum[k][2] + sum[k][3]);
  }

  // Subtracts multiples of `top` from the rows below k, in 4 `quads` columns from j.
  template <int quads>
  FAN_FN void eliminate(int k, int j, const double* top) {
    Quad saved[quads];
    FAN_UNROLL for (int q = 0; q < quads; ++q) saved[q] = quad(top + 4 * q);
    const int step = stride;
    double* row = A + (k + 1) * step + j;
    const double *multiplier = multiplier_ + k + 1, *const end = multiplier_ + n;
    for (; multiplier < end; ++multiplier, row += step)
      FAN_UNROLL for (int q = 0; q < quads; ++q) quad(row + 4 * q) -= *multiplier * saved[q];
  }

  // Exchanges two rows.
  FAN_FN void exchange(double* a, double* b) const {
    for (int j = 0; j < stride; j += 4) {
      const Quad saved = quad(a + j);
      quad(a + j) = quad(b + j);
      quad(b + j) = saved;
    }
  }

  int swap_[N];
  double inverse_[N], multiplier_[N];
};

}  // namespace fan
