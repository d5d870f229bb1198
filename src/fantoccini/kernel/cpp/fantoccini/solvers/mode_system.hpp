// Changes of a step's acceleration under rows held in their modes:
//
//   (M + Z^T Z) x + B^T y = -force,   C x = -rate
//
// C are the held rows and B the forces that hold them; they differ if solids slide. Z is the effect
// of friction that turns with the velocity. Rows may depend on one another: y is then the shortest,
// and x that of least squares. All rows are given as W = F^-T A^T, with M = F^T F.
#pragma once

#include <cmath>

#include "fantoccini/math/lane_of.hpp"
#include "fantoccini/math/pseudo_inverse.hpp"

FAN_LOOPS_BEGIN

namespace fan {

struct ModeSystemTolerances {
  // Singular value of C M^-1 B^T, and of C M^-1 C^T, relative to the largest, below which rows are
  // dependent.
  static constexpr double dependent = 1e-9;
};

// Capacity of `capacity` rows and `turning` that turn, of n numbers each.
template <int capacity, int turning, int n>
class ModeSystem {
 public:
  int n_rows = 0, n_turning = 0;
  double C[array_size(capacity)][array_size(n)], B[array_size(capacity)][array_size(n)],
      Z[array_size(turning)][array_size(n)];

  // Whether forces keep the modes; otherwise friction jams.
  bool factorise() {
    soften_forces();
    double* S = inverse_.matrix(n_rows);
    for (int a = 0; a < n_rows; ++a)
      for (int b = 0; b < n_rows; ++b) S[a * n_rows + b] = dot(C[a], soft_B_[b]);
    inverse_.find(Tolerance::dependent);
    if (n_turning == 0 && same()) return true;
    double* own = rank_.matrix(n_rows);
    for (int a = 0; a < n_rows; ++a)
      for (int b = 0; b < n_rows; ++b) own[a * n_rows + b] = dot(C[a], C[b]);
    rank_.factorise(Tolerance::dependent);
    return inverse_.rank >= rank_.rank;
  }

  // Whether some forces have no effect; writes a combination of all of these (n_rows,).
  bool idle(double* forces) const { return inverse_.null_vector(forces); }

  // From -w (n,), with w = F^-T force, and the rows' `rate` (n_rows,) to the multipliers y and
  // w <- F x.
  template <class Real>
  void solve(Real* w, const Real* rate, Real* y) const {
    Real right[array_size(capacity)];
    soften(w);
    for (int a = 0; a < n_rows; ++a) right[a] = rate[a] + along(C[a], w);
    inverse_.apply(right, y);
    for (int a = 0; a < n_rows; ++a)
      for (int k = 0; k < n; ++k) w[k] -= soft_B_[a][k] * y[a];
  }

  // The transpose of solve(), for a sum with derivatives g by x and -y by the multipliers. On entry
  // w = F^-T g; results: its derivatives -y by `rate`, and w = F^-T z with z those by -force.
  void solve_transposed(double* w, double* y) const {
    double left[array_size(capacity)], own[array_size(n)];
    for (int k = 0; k < n; ++k) own[k] = w[k];
    soften(own);
    for (int a = 0; a < n_rows; ++a) left[a] = y[a] + along(B[a], own);
    inverse_.apply_transposed(left, y);
    for (int a = 0; a < n_rows; ++a)
      for (int k = 0; k < n; ++k) w[k] -= C[a][k] * y[a];
    soften(w);
  }

 private:
  using Tolerance = ModeSystemTolerances;

  // w <- (1 + Z Z^T)^-1 w = w - Z (1 + Z^T Z)^-1 Z^T w, both sides of which have n numbers.
  template <class Real>
  void soften(Real* w) const {
    Real turned[array_size(turning)];
    for (int j = 0; j < n_turning; ++j) turned[j] = along(Z[j], w);
    for (int j = 0; j < n_turning; ++j)
      for (int k = 0; k < n; ++k) w[k] -= soft_Z_[j][k] * turned[j];
  }

  static double dot(const double* a, const double* b) {
    double sum = 0.0;
    for (int k = 0; k < n; ++k) sum += a[k] * b[k];
    return sum;
  }

  template <class Real>
  static Real along(const double* row, const Real* w) {
    Real even = Real(0.0), odd = Real(0.0);
    int k = 0;
    for (; k + 2 <= n; k += 2) {
      even += row[k] * w[k];
      odd += row[k + 1] * w[k + 1];
    }
    if (k < n) even += row[k] * w[k];
    return even + odd;
  }

  // Whether the forces that hold the rows are along the rows.
  bool same() const {
    for (int a = 0; a < n_rows; ++a)
      for (int k = 0; k < n; ++k)
        if (B[a][k] != C[a][k]) return false;
    return true;
  }

  // soft_Z_ = Z (1 + Z^T Z)^-1, soft_B_ = (1 + Z Z^T)^-1 B.
  void soften_forces() {
    double* T = turn_.matrix(n_turning);
    for (int i = 0; i < n_turning; ++i)
      for (int j = 0; j < n_turning; ++j) T[i * n_turning + j] = double(i == j) + dot(Z[i], Z[j]);
    turn_.find(0.0);
    for (int i = 0; i < n_turning; ++i)
      for (int k = 0; k < n; ++k) {
        double sum = 0.0;
        for (int j = 0; j < n_turning; ++j) sum += turn_.inverse[i * n_turning + j] * Z[j][k];
        soft_Z_[i][k] = sum;
      }
    for (int a = 0; a < n_rows; ++a) {
      for (int k = 0; k < n; ++k) soft_B_[a][k] = B[a][k];
      for (int j = 0; j < n_turning; ++j) {
        const double part = dot(Z[j], B[a]);
        for (int k = 0; k < n; ++k) soft_B_[a][k] -= soft_Z_[j][k] * part;
      }
    }
  }

  double soft_B_[array_size(capacity)][array_size(n)], soft_Z_[array_size(turning)][array_size(n)];
  PseudoInverse<capacity> inverse_, rank_;
  PseudoInverse<turning> turn_;
};

}  // namespace fan

FAN_LOOPS_END
