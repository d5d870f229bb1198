// C += L^T R for matrices whose rows are contiguous, one block of C in registers at a time (Goto
// and van de Geijn, ACM Trans. Math. Softw. 34, 2008, section 4). Sizes are known at run time; the
// length and the number of rows are padded to a multiple of eight with zeros.
#pragma once

#include "fantoccini/math/wide.hpp"

namespace fan {

#if FAN_WIDTH > 1
typedef double Vec __attribute__((vector_size(8 * FAN_WIDTH)));
typedef double VecInPlace __attribute__((vector_size(8 * FAN_WIDTH), aligned(8), may_alias));
#else
typedef double Vec;
typedef double VecInPlace;
#endif

FAN_FN VecInPlace& vec(double* at) { return *reinterpret_cast<VecInPlace*>(at); }
FAN_FN const VecInPlace& vec(const double* at) { return *reinterpret_cast<const VecInPlace*>(at); }

// Padded length of a row of n numbers.
constexpr int in_eights(int n) { return (n + 7) / 8 * 8; }

// y += a x over a padded length.
FAN_FN void add_scaled(double a, const double* x, double* y, int n) {
  for (int j = 0; j < n; j += FAN_WIDTH) vec(y + j) += a * vec(x + j);
}

// x . y over a padded length.
FAN_FN double dot(const double* x, const double* y, int n) {
  Vec sum = vec(x) * vec(y);
  for (int j = FAN_WIDTH; j < n; j += FAN_WIDTH) sum += vec(x + j) * vec(y + j);
#if FAN_WIDTH > 1
  double total = sum[0];
  for (int j = 1; j < FAN_WIDTH; ++j) total += sum[j];
  return total;
#else
  return sum;
#endif
}

constexpr int block_rows = FAN_WIDTH == 8 ? 8 : 4;
constexpr int block_vecs = FAN_WIDTH == 8 ? 3 : 2;

// A block of block_rows rows and n vectors.
template <int n>
FAN_FN void add_block(
    int count, const double* L, const double* R, double* C, int ld_L, int ld_R, int ld_C) {
  Vec sum[block_rows][n];
  FAN_UNROLL for (int i = 0; i < block_rows; ++i) {
    FAN_UNROLL for (int j = 0; j < n; ++j) sum[i][j] = vec(C + i * ld_C + j * FAN_WIDTH);
  }
  for (int r = 0; r < count; ++r) {
    Vec right[n];
    FAN_UNROLL for (int j = 0; j < n; ++j) right[j] = vec(R + r * ld_R + j * FAN_WIDTH);
    FAN_UNROLL for (int i = 0; i < block_rows; ++i) {
      FAN_UNROLL for (int j = 0; j < n; ++j) sum[i][j] += L[r * ld_L + i] * right[j];
    }
  }
  FAN_UNROLL for (int i = 0; i < block_rows; ++i) {
    FAN_UNROLL for (int j = 0; j < n; ++j) vec(C + i * ld_C + j * FAN_WIDTH) = sum[i][j];
  }
}

// C[i][j] += sum over r < count of L[r][i] R[r][j], i < rows, j < columns; if `lower`, only blocks
// that touch the lower triangle.
FAN_FN void add_product(
    int count, const double* L, int ld_L, const double* R, int ld_R, double* C, int ld_C, int rows,
    int columns, bool lower = false) {
  constexpr int step = block_vecs * FAN_WIDTH;
  for (int i = 0; i < rows; i += block_rows) {
    const int end = lower && i + block_rows < columns ? i + block_rows : columns;
    int j = 0;
    for (; j + step <= in_eights(end); j += step) {
      add_block<block_vecs>(count, L + i, R + j, C + i * ld_C + j, ld_L, ld_R, ld_C);
    }
    for (; j < end; j += FAN_WIDTH) {
      add_block<1>(count, L + i, R + j, C + i * ld_C + j, ld_L, ld_R, ld_C);
    }
  }
}

// Copies the lower triangle of a square matrix to its upper one.
FAN_FN void mirror(double* P, int ld, int n) {
  for (int i = 0; i < n; i += 8) {
    for (int j = 0; j < i + 8; j += 8) {
      for (int a = i; a < i + 8; ++a) {
        for (int b = j; b < j + 8 && b < a; ++b) P[b * ld + a] = P[a * ld + b];
      }
    }
  }
}

}  // namespace fan
