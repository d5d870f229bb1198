// A = U^T D U with ones on U's diagonal, for symmetric positive definite matrices whose size is known
// at run time (Golub and Van Loan, Matrix Computations, section 4.1), without pivoting. Rows and
// columns are filled up with those of the unit matrix to a multiple of four; four rows at a time are
// eliminated.
#pragma once

#include "dense_lu.hpp"

namespace fan {

template <int capacity>
struct DenseLdl {
  static constexpr int N = padded(room(capacity));

  int n = 0, stride = 0;
  int n_left_out = 0;  // rows
  double A[N * N];  // row i, column j >= i at i * stride + j; also j >= the multiple of four below i

  // The sizes; rows and columns beyond n are those of the unit matrix. Write the rest afterwards, with
  // zeros beyond column n.
  FAN_FN void resize(int rows) {
    n = rows;
    stride = padded(rows);
    for (int i = n; i < stride; ++i) {
      for (int j = i / 4 * 4; j < stride; ++j) A[i * stride + j] = 0.0;
      A[i * stride + i] = 1.0;
    }
  }

  // Replaces A by D U; false where a pivot is not positive or not finite. With `least`, rows whose
  // pivot falls to that share of their diagonal entry depend on those before: they are left out.
  FAN_FN bool factorise(double least = 0.0) {
    n_left_out = 0;
    for (int i = 0; i < n && least > 0.0; ++i) inverse_[i] = least * A[i * (stride + 1)];
    const int stride = this->stride;  // in registers: stores may alias the members
    for (int k = 0; k < stride; k += 4) {
      double* row[4];
      FAN_UNROLL for (int r = 0; r < 4; ++r) row[r] = A + (k + r) * stride;
      for (int r = 0; r < 4; ++r) {
        const double pivot = row[r][k + r];
        const double too_small = least > 0.0 && k + r < n ? inverse_[k + r] : 0.0;
        if (!(pivot > too_small && pivot < unbounded)) {
          if (least == 0.0) return false;
          inverse_[k + r] = 0.0;
          ++n_left_out;
          continue;
        }
        inverse_[k + r] = 1.0 / pivot;
        for (int i = r + 1; i < 4; ++i) {
          const double share = row[r][k + i] * inverse_[k + r];
          for (int j = k; j < stride; j += 4) quad(row[i] + j) -= share * quad(row[r] + j);
        }
      }
      for (int i = k + 4; i < n; ++i) {
        double* own = A + i * stride;
        double share[4];
        FAN_UNROLL for (int r = 0; r < 4; ++r) share[r] = row[r][i] * inverse_[k + r];
        for (int j = i / 4 * 4; j < stride; j += 4) {
          const Quad a = quad(own + j) - share[0] * quad(row[0] + j);
          const Quad b = share[1] * quad(row[1] + j) + share[2] * quad(row[2] + j);
          quad(own + j) = a - (b + share[3] * quad(row[3] + j));
        }
      }
    }
    return true;
  }

  // r <- A^-1 r, with numbers that are given, or 0, for the rows left out; r has room for the padded
  // length.
  FAN_FN void substitute(double* r, const double* given = nullptr) const {
    const int stride = this->stride;
    for (int i = n; i < stride; ++i) r[i] = 0.0;
    for (int k = 0; k < stride; k += 4) {
      const double* row[4];
      FAN_UNROLL for (int i = 0; i < 4; ++i) row[i] = A + (k + i) * stride;
      FAN_UNROLL for (int i = 0; i < 4; ++i) {
        r[k + i] *= inverse_[k + i];
        FAN_UNROLL for (int j = i + 1; j < 4; ++j) r[k + j] -= r[k + i] * row[i][k + j];
      }
      for (int j = k + 4; j < stride; j += 4) {
        const Quad a = quad(r + j) - r[k] * quad(row[0] + j);
        const Quad b = r[k + 1] * quad(row[1] + j) + r[k + 2] * quad(row[2] + j);
        quad(r + j) = a - (b + r[k + 3] * quad(row[3] + j));
      }
    }
    for (int i = 0; i < n && given && n_left_out > 0; ++i)
      if (inverse_[i] == 0.0) r[i] = given[i];
    for (int k = stride - 4; k >= 0; k -= 4) {
      Quad sum[4] = {};
      for (int j = k + 4; j < stride; j += 4) {
        const Quad by = quad(r + j);
        FAN_UNROLL for (int i = 0; i < 4; ++i) sum[i] += quad(A + (k + i) * stride + j) * by;
      }
      FAN_UNROLL for (int i = 3; i >= 0; --i) {
        double left = (sum[i][0] + sum[i][1]) + (sum[i][2] + sum[i][3]);
        for (int j = i + 1; j < 4; ++j) left += A[(k + i) * stride + k + j] * r[k + j];
        r[k + i] -= left * inverse_[k + i];
      }
    }
  }

 private:
  double inverse_[N];
};

}  // namespace fan
