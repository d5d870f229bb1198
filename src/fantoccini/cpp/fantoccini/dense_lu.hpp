// P A = L U with partial pivoting (Golub and Van Loan, Matrix Computations, algorithm 3.4.1), for
// matrices whose size is known at run time. Rows are contiguous; the inner loops run along them.
#pragma once

#include <string.h>

#include "real.hpp"

namespace fan {

// Four doubles that compilers keep in one register, or in two.
typedef double Quad __attribute__((vector_size(32)));

FAN_FN void load(Quad& to, const double* from) { memcpy(&to, from, sizeof(Quad)); }

// y <- y + a x.
FAN_FN void add_multiple(double* y, double a, const double* x, int n) {
  int i = 0;
  for (; i + 4 <= n; i += 4) {
    Quad from, to;
    load(from, x + i);
    load(to, y + i);
    to += a * from;
    memcpy(y + i, &to, sizeof(Quad));
  }
  for (; i < n; ++i) y[i] += a * x[i];
}

// x . y, in four sums.
FAN_FN double product(const double* x, const double* y, int n) {
  Quad sum = {0.0, 0.0, 0.0, 0.0};
  int i = 0;
  for (; i + 4 <= n; i += 4) {
    Quad a, b;
    load(a, x + i);
    load(b, y + i);
    sum += a * b;
  }
  for (; i < n; ++i) sum[0] += x[i] * y[i];
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

template <int capacity>
struct DenseLu {
  static constexpr int N = room(capacity);

  int n = 0;
  double A[N * N];  // row i, column j at i * n + j; factorise() puts L and U in its place

  // False where a pivot is 0 or not finite.
  FAN_FN bool factorise() {
    for (int k = 0; k < n; ++k) {
      int p = k;
      for (int i = k + 1; i < n; ++i)
        if (fabs(A[i * n + k]) > fabs(A[p * n + k])) p = i;
      swap_[k] = p;
      const double pivot = A[p * n + k];
      if (!(fabs(pivot) > 0.0 && fabs(pivot) < unbounded)) return false;
      if (p != k) exchange(p, k);
      inverse_[k] = 1.0 / pivot;
      const double* top = A + k * n;
      for (int i = k + 1; i < n; ++i) {
        double* row = A + i * n;
        if (row[k] == 0.0) continue;
        row[k] *= inverse_[k];
        add_multiple(row + k + 1, -row[k], top + k + 1, n - k - 1);
      }
    }
    return true;
  }

  // r <- A^-1 r.
  FAN_FN void substitute(double* r) const {
    for (int k = 0; k < n; ++k) {
      const double held = r[swap_[k]];
      r[swap_[k]] = r[k];
      r[k] = held;
    }
    for (int i = 1; i < n; ++i) r[i] -= product(A + i * n, r, i);
    for (int i = n - 1; i >= 0; --i) {
      const int k = i + 1;
      r[i] = (r[i] - product(A + i * n + k, r + k, n - k)) * inverse_[i];
    }
  }

 private:
  FAN_FN void exchange(int i, int k) {
    for (int j = 0; j < n; ++j) {
      const double held = A[i * n + j];
      A[i * n + j] = A[k * n + j];
      A[k * n + j] = held;
    }
  }

  int swap_[N];
  double inverse_[N];
};

}  // namespace fan
