// W = F^-T A_D^T of contact points, three columns each, and the products of columns that make the
// Delassus matrix of a time step.
#pragma once

#include "evaluation.hpp"

namespace fan {

template <class Model, class Real>
struct ContactColumns {
  static constexpr int C = Model::n_contacts, N = Model::n_vD, M = Model::n_rows;

  Real W[room(3 * C)][room(N)];
  Real across[room(3 * C)][room(M)];  // products with the gathered rows

  FAN_FN void begin() { made_ = 0; }

  // Point i is another one in some lane: its columns are made anew.
  FAN_FN void renew(int i) { has_[i] = false; }

  // Makes the columns of the points i < n with some[i], from their rows of A_D.
  FAN_FN void make(
      const Evaluation<Model, Real>& eval, const RowSystem<Model, Real>& rows,
      const Real (*row)[room(N)], const bool* some, int n) {
    for (int i = 0; i < n; ++i) {
      if (i >= made_) has_[i] = false;
      if (some[i] && !has_[i])
        for (int d = 3 * i; d < 3 * i + 3; ++d) {
          Call<Model, Real>::forth(eval.L, row[d], W[d]);
          for (int j = 0; j <= i; ++j)
            if (j == i || has_[j])
              for (int e = 3 * j; e < 3 * j + 3 && e <= d; ++e) G_[d][e] = product(W[d], W[e]);
          for (int j = i + 1; j < made_; ++j)
            if (has_[j])
              for (int e = 3 * j; e < 3 * j + 3; ++e) G_[e][d] = product(W[d], W[e]);
        }
      has_[i] = has_[i] || some[i];
      if (!some[i]) continue;
      for (int d = 3 * i; d < 3 * i + 3; ++d)
        for (int a = 0; a < rows.n; ++a) across[d][a] = product(W[d], rows.column[a]);
    }
    made_ = n;
  }

  // The product of columns d and e.
  FAN_FN const Real& G(int d, int e) const { return d < e ? G_[e][d] : G_[d][e]; }

 private:
  FAN_FN static Real product(const Real* a, const Real* b) {
    Real even = Real(0.0), odd = Real(0.0);
    int k = 0;
    for (; k + 2 <= N; k += 2) {
      even += a[k] * b[k];
      odd += a[k + 1] * b[k + 1];
    }
    if (k < N) even += a[k] * b[k];
    return even + odd;
  }

  int made_ = 0;
  bool has_[room(C)];  // whether a point's columns are made
  Real G_[room(3 * C)][room(3 * C)];
};

}  // namespace fan
