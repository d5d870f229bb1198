// A = U^T D U with ones on U's diagonal, for symmetric positive definite matrices whose size is
// known at run time (Golub and Van Loan, Matrix Computations, section 4.1), without pivoting.
// Columns are padded to a multiple of four; four rows are eliminated at a time. A right-hand side b
// may be stored in the column after A, and is eliminated with it.
#pragma once

#include "fantoccini/math/dense_lu.hpp"

FAN_LOOPS_BEGIN

namespace fan {

template <int capacity>
struct DenseLdl {
  static constexpr int N = padded(array_size(capacity) + 1);

  int n = 0, stride = 0;
  int n_left_out = 0;  // number of rows left out
  double
      A[N * N];  // row i, column j >= i at i * stride + j; also j >= the multiple of four below i

  // Sets the sizes, optionally with a column n after A. The entries are written afterwards.
  FAN_FN void resize(int rows, bool with_column = false) {
    n = rows;
    stride = padded(rows + with_column);
  }

  // Replaces A by D U; false if a pivot is not positive or not finite. With `least`, a row is left
  // out if its pivot is at most this share of its diagonal entry: it depends on earlier rows.
  FAN_FN bool factorise(double least = 0.0) {
    n_left_out = 0;
    for (int i = 0; i < n && least > 0.0; ++i) inverse_[i] = least * A[i * (stride + 1)];
    const int stride = this->stride;  // in registers: stores may alias the members
    for (int k = 0; k < n; k += 4) {
      double* row[4];
      FAN_UNROLL for (int r = 0; r < 4; ++r) row[r] = A + (k + r) * stride;
      const int rows = n - k < 4 ? n - k : 4;
      for (int r = 0; r < rows; ++r) {
        const double pivot = row[r][k + r];
        const double too_small = least > 0.0 ? inverse_[k + r] : 0.0;
        if (!(pivot > too_small && pivot < unbounded)) {
          if (least == 0.0) return false;
          inverse_[k + r] = 0.0;
          ++n_left_out;
          continue;
        }
        inverse_[k + r] = 1.0 / pivot;
        for (int i = r + 1; i < rows; ++i) {
          const double share = row[r][k + i] * inverse_[k + r];
          for (int j = k; j < stride; j += 4) quad(row[i] + j) -= share * quad(row[r] + j);
        }
      }
      for (int i = k + 4; i < n; ++i) {
        double* below = A + i * stride;
        double share[4];
        FAN_UNROLL for (int r = 0; r < 4; ++r) share[r] = row[r][i] * inverse_[k + r];
        for (int j = i / 4 * 4; j < stride; j += 4) {
          const Quad a = quad(below + j) - share[0] * quad(row[0] + j);
          const Quad b = share[1] * quad(row[1] + j) + share[2] * quad(row[2] + j);
          quad(below + j) = a - (b + share[3] * quad(row[3] + j));
        }
      }
    }
    return true;
  }

  // r <- A^-1 r; entries of rows left out are given, or 0. r has the padded length.
  FAN_FN void substitute(double* r, const double* given = nullptr) const {
    const int stride = this->stride;
    for (int k = 0; k < n; k += 4) {
      const double* row[4];
      FAN_UNROLL for (int i = 0; i < 4; ++i) row[i] = A + (k + i) * stride;
      FAN_UNROLL for (int i = 0; i < 4; ++i) {
        r[k + i] *= inverse_[k + i];
        FAN_UNROLL for (int j = i + 1; j < 4; ++j) r[k + j] -= r[k + i] * row[i][k + j];
      }
      if (k + 4 > n) break;
      for (int j = k + 4; j < stride; j += 4) {
        const Quad a = quad(r + j) - r[k] * quad(row[0] + j);
        const Quad b = r[k + 1] * quad(row[1] + j) + r[k + 2] * quad(row[2] + j);
        quad(r + j) = a - (b + r[k + 3] * quad(row[3] + j));
      }
    }
    back_substitute(r, given);
  }

  // r <- A^-1 b, with b from column n when A was factorised.
  FAN_FN void take_column(double* r, const double* given = nullptr) const {
    for (int i = 0; i < n; ++i) r[i] = A[i * stride + n] * inverse_[i];
    back_substitute(r, given);
  }

  // Whether row i was left out.
  FAN_FN bool is_left_out(int i) const { return inverse_[i] == 0.0; }

 private:
  // r <- U^-1 r.
  FAN_FN void back_substitute(double* r, const double* given) const {
    const int stride = this->stride;
    for (int i = n; i < stride; ++i) r[i] = 0.0;
    for (int i = 0; i < n && given && n_left_out > 0; ++i)
      if (inverse_[i] == 0.0) r[i] = given[i];
    for (int k = (n - 1) / 4 * 4; k >= 0; k -= 4) {
      Quad sum[4] = {};
      double solved[4] = {};
      const int rows = n - k < 4 ? n - k : 4;
      for (int j = k + 4; j < stride; j += 4) {
        const Quad known = quad(r + j);
        FAN_UNROLL for (int i = 0; i < 4; ++i) sum[i] += quad(A + (k + i) * stride + j) * known;
      }
      FAN_UNROLL for (int i = 3; i >= 0; --i) {
        if (i >= rows) continue;
        double products = (sum[i][0] + sum[i][1]) + (sum[i][2] + sum[i][3]);
        for (int j = i + 1; j < rows; ++j) products += A[(k + i) * stride + k + j] * solved[j];
        solved[i] = r[k + i] - products * inverse_[k + i];
      }
      quad(r + k) = Quad{solved[0], solved[1], solved[2], solved[3]};
    }
  }

  double inverse_[N];
};

}  // namespace fan

FAN_LOOPS_END
