// W = F^-T A_D^T of contact points, three columns each, and the products of columns that make the
// Delassus matrix of a time step.
#pragma once

#include "evaluation.hpp"
#include "moved_by.hpp"

namespace fan {

template <class Model, class Real>
struct ContactColumns {
  static constexpr int C = Model::n_contacts, N = Model::n_vD, M = Model::n_rows;

  Real W[room(3 * C)][room(N)];
  Real across[room(3 * C)][room(M)];  // products with the gathered rows

  FAN_FN void begin() { made_ = 0; }

  // Point i is another one in some lane: its columns are made anew.
  FAN_FN void renew(int i) { has_[i] = false; }

  // Makes the columns of the points i < n with some[i], from their rows of A_D and what moves them.
  FAN_FN void make(
      const Evaluation<Model, Real>& eval, const RowSystem<Model, Real>& rows,
      const Real (*row)[room(N)], const MovedBy<N>* moved, const bool* some, int n) {
    for (int i = 0; i < n; ++i) {
      if (i >= made_) has_[i] = false;
      if (some[i] && !has_[i]) {
        for (int d = 3 * i; d < 3 * i + 3; ++d) Call<Model, Real>::forth(eval.L, row[d], W[d]);
        for (int j = 0; j <= i; ++j)
          if (j == i || has_[j]) multiply(i, j, moved);
        for (int j = i + 1; j < made_; ++j)
          if (has_[j]) multiply(j, i, moved);
      }
      has_[i] = has_[i] || some[i];
      if (some[i]) multiply(i, rows, moved[i]);
    }
    made_ = n;
  }

  // The product of columns d and e.
  FAN_FN const Real& G(int d, int e) const { return d < e ? G_[e][d] : G_[d][e]; }

  // w <- w - W_d x, column d being of a point that these move.
  FAN_FN void take(int d, const Real& x, const MovedBy<N>& moved, Real* w) const {
    for (int j = 0; j < moved.n; ++j) w[moved.entry[j]] -= W[d][moved.entry[j]] * x;
  }

 private:
  // The products of the columns of points i and j <= i.
  FAN_FN void multiply(int i, int j, const MovedBy<N>* moved) {
    const bool apart = moved[i].is_apart(moved[j]);
    for (int e = 3 * j; e < 3 * j + 3; ++e) {
      Real out[3] = {Real(0.0), Real(0.0), Real(0.0)};
      if (!apart) moved[i].products(W + 3 * i, W[e], out);
      for (int d = 0; d < 3; ++d) G_[3 * i + d][e] = out[d];
    }
  }

  // Those of point i and the gathered rows.
  FAN_FN void multiply(int i, const RowSystem<Model, Real>& rows, const MovedBy<N>& moved) {
    for (int a = 0; a < rows.n; ++a) {
      Real out[3];
      moved.products(W + 3 * i, rows.column[a], out);
      for (int d = 0; d < 3; ++d) across[3 * i + d][a] = out[d];
    }
  }

  int made_ = 0;
  bool has_[room(C)];  // whether a point's columns are made
  Real G_[room(3 * C)][room(3 * C)];
};

}  // namespace fan
