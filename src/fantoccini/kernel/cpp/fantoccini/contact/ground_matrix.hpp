// The factorisation of math/dense_ldl.hpp for a bundle of lanes: A = U^T D U, without pivoting, of
// symmetric positive definite matrices. The right-hand side is the column after A. A row that, in
// a lane, depends on earlier rows is left out in that lane.
#pragma once

#include "fantoccini/math/lanes.hpp"

FAN_LOOPS_BEGIN

namespace fan {

template <class Real>
class GroundMatrix {
 public:
  using Mask = typename Traits<Real>::Mask;
  static constexpr int capacity = 64;

  FAN_FN void resize(int n) { n_ = n; }

  // Entry (i, j) of A, j >= i; the right-hand side at j = n.
  FAN_FN Real& at(int i, int j) { return A_[i * (n_ + 1) + j]; }

  // Replaces A by D U. A row is left out if its pivot is at most `least` times its diagonal, or
  // not finite. Returns the lanes with such rows.
  FAN_FN Mask factorise(int n, double least) {
    const int stride = n + 1;
    Mask left_out = Real(0.0) > Real(1.0);
    Real least_pivot[capacity];
    for (int i = 0; i < n; ++i) least_pivot[i] = least * A_[i * stride + i];
    for (int k = 0; k < n; ++k) {
      const Real* top = A_ + k * stride;
      const Mask kept = top[k] > least_pivot[k] && top[k] < Real(unbounded);
      left_out = left_out || !kept;
      left_out_[k] = !kept;
      const Real inverse_pivot = inverse_[k] =
          select(kept, Real(1.0) / select(kept, top[k], Real(1.0)), Real(0.0));
      for (int i = k + 1; i < n; ++i) {
        const Real share = top[i] * inverse_pivot;
        Real* own = A_ + i * stride;
        for (int j = i; j <= n; ++j) own[j] -= share * top[j];
      }
    }
    return left_out;
  }

  // r = A^-1 b for the right-hand side b after A; for rows left out, r is the entry of `given`.
  FAN_FN void take_column(Real* r, const Real* given) const {
    for (int i = 0; i < n_; ++i) r[i] = A_[i * (n_ + 1) + n_];
    back_substitute(r, given);
  }

  // r <- A^-1 r, with 0 for the rows left out.
  FAN_FN void substitute(Real* r) const {
    const int stride = n_ + 1;
    for (int k = 0; k < n_; ++k) {
      const Real part = r[k] * inverse_[k];
      for (int j = k + 1; j < n_; ++j) r[j] -= part * A_[k * stride + j];
    }
    back_substitute(r, nullptr);
  }

  // The lanes in which row i was left out.
  FAN_FN const Mask& is_left_out(int i) const { return left_out_[i]; }

 private:
  FAN_FN void back_substitute(Real* r, const Real* given) const {
    const int stride = n_ + 1;
    for (int i = n_ - 1; i >= 0; --i) {
      Real sum = r[i];
      for (int j = i + 1; j < n_; ++j) sum -= A_[i * stride + j] * r[j];
      r[i] = select(left_out_[i], given ? given[i] : Real(0.0), Real(sum * inverse_[i]));
    }
  }

  int n_ = 0;
  Mask left_out_[capacity];
  Real A_[capacity * (capacity + 1)], inverse_[capacity];
};

}  // namespace fan

FAN_LOOPS_END
