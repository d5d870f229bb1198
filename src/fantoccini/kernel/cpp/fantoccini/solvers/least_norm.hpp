// Tensions of least norm. For redundant strings the motion is unique and the tensions are not; of
// all tensions within their bounds with that motion, the shortest vector is reported:
//
//   min |x|   over W x = z, 0 <= x_i <= upper_i
//
// With Z an orthonormal basis of the null space of W and x_p the part of any solution orthogonal to
// it, x = x_p + Z y. y is the shortest vector with -x_p <= Z y <= upper - x_p: an ActiveSet again.
#pragma once

#include "fantoccini/solvers/active_set.hpp"

namespace fan {

template <class Set>
struct LeastNorm {
  static constexpr int C = Set::C;

  // Replaces x of a solved and completed (or adopted) problem by the least-norm one; keeps it if
  // none is found.
  void apply(Set& set) {
    n_null_ = 0;
    for (int i = 0; i < set.n; ++i)
      if (set.place[i] == Set::IDLE || set.place[i] == Set::PINNED) add_null_vector(set, i);
    if (n_null_ == 0) return;
    double across[C];
    for (int i = 0; i < set.n; ++i) across[i] = set.x[i];
    for (int k = 0; k < n_null_; ++k) {
      const double part = along(null_[k], across, set.n);
      for (int i = 0; i < set.n; ++i) across[i] -= part * null_[k][i];
    }
    bounds_.n = 0;
    bounds_.dim = n_null_;
    for (int i = 0; i < set.n; ++i) {
      if (set.two_sided[i] || set.place[i] == Set::LOW || set.place[i] == Set::HIGH) continue;
      bound(i, 1.0, -across[i]);
      if (set.upper[i] < unbounded) bound(i, -1.0, across[i] - set.upper[i]);
    }
    if (bounds_.solve() != Solved::YES) return;
    double y[C] = {};
    for (int b = 0; b < bounds_.n; ++b)
      for (int k = 0; k < n_null_; ++k) y[k] += bounds_.column[b][k] * bounds_.x[b];
    for (int i = 0; i < set.n; ++i) {
      if (set.place[i] == Set::LOW || set.place[i] == Set::HIGH) continue;
      double x = across[i];
      for (int k = 0; k < n_null_; ++k) x += null_[k][i] * y[k];
      if (!set.two_sided[i]) x = x < 0.0 ? 0.0 : (x > set.upper[i] ? set.upper[i] : x);
      set.x[i] = x;
    }
  }

 private:
  // Column i = sum_j c_j column[basis[j]], so that e_i - sum_j c_j e_basis[j] is a null vector.
  void add_null_vector(Set& set, int i) {
    double c[Set::D], v[C] = {};
    if (set.coefficients(i, c) > ActiveSetTolerances::sharing_distance) return;
    v[i] = 1.0;
    for (int j = 0; j < set.basis_size(); ++j) v[set.basis(j)] -= c[j];
    for (int twice = 0; twice < 2; ++twice)
      for (int k = 0; k < n_null_; ++k) {
        const double part = along(null_[k], v, set.n);
        for (int a = 0; a < set.n; ++a) v[a] -= part * null_[k][a];
      }
    const double size = sqrt(along(v, v, set.n));
    for (int a = 0; a < set.n; ++a) null_[n_null_][a] = v[a] / size;
    ++n_null_;
  }

  void bound(int i, double sign, double value) {
    const int at = bounds_.n++;
    for (int k = 0; k < n_null_; ++k) rows_[at][k] = sign * null_[k][i];
    bounds_.column[at] = rows_[at];
    bounds_.b[at] = value;
    bounds_.upper[at] = unbounded;
    bounds_.two_sided[at] = false;
    bounds_.place[at] = Bounds::LOW;
  }

  static double along(const double* a, const double* b, int n) {
    double sum = 0.0;
    for (int i = 0; i < n; ++i) sum += a[i] * b[i];
    return sum;
  }

  using Bounds = ActiveSet<2 * C, C>;
  Bounds bounds_;
  int n_null_ = 0;
  double null_[C][C], rows_[2 * C][C];
};

}  // namespace fan
