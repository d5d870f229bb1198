// W = F^-T A_D^T of contact points, three columns each, and the products of columns that make the
// Delassus matrix of a time step.
#pragma once

#include "fantoccini/contact/moved_by.hpp"
#include "fantoccini/model/evaluation.hpp"

FAN_LOOPS_BEGIN

namespace fan {

template <class Model, class Real>
struct ContactColumns {
  static constexpr int C = Model::n_contacts, N = Model::n_vD, M = Model::n_rows;
  using Moved = MovedBy<N>;

  Triple<Real> W[array_size(C)][array_size(N)];
  Triple<Real> across[array_size(C)]
                     [array_size(M)];  // products with the gathered rows that were crossed

  FAN_FN void begin() { n_computed_ = 0; }

  // Discards the columns of point i, which is another one in some lane.
  FAN_FN void renew(int i) { has_[i] = false; }

  // Computes the columns of the points i < n with needed[i], from their rows of A_D.
  FAN_FN void make(
      const Evaluation<Model, Real>& eval, const Triple<Real> (*row)[array_size(N)],
      const Moved* moved, const bool* needed, int n) {
    for (int i = 0; i < n; ++i) {
      if (i >= n_computed_) has_[i] = false;
      if (needed[i] && !has_[i]) {
        push(eval.L, row[i], moved[i], W[i]);
        for (int j = 0; j <= i; ++j)
          if (j == i || has_[j]) multiply(i, j, moved);
        for (int j = i + 1; j < n_computed_; ++j)
          if (has_[j]) multiply(j, i, moved);
      }
      has_[i] = has_[i] || needed[i];
    }
    n_computed_ = n;
  }

  // Computes the products of all columns with gathered row a.
  FAN_FN void cross(const RowSystem<Model, Real>& rows, int a, const Moved* moved) {
    for (int i = 0; i < n_computed_; ++i) {
      if (!has_[i]) continue;
      if (rows.is_apart(a, moved[i])) across[i][a].clear();
      else across[i][a] = moved[i].along(W[i], rows.column[a]);
    }
  }

  // Products of column d of point i with those of point j <= i.
  FAN_FN const Triple<Real>& row_of_block(int i, int j, int d) const { return G_[i][j][d]; }

  // Product of columns d and e.
  FAN_FN Real G(int d, int e) const {
    return d < e ? G_[e / 3][d / 3][e % 3][d % 3] : G_[d / 3][e / 3][d % 3][e % 3];
  }

  // w <- w - W x over the columns of point i, with nonzero entries `moved`.
  FAN_FN void take(int i, const Real* x, const MovedBy<N>& moved, Real* w) const {
    take(W[i], x, moved, w);
  }

  FAN_FN static void take(
      const Triple<Real>* own, const Real* x, const MovedBy<N>& moved, Real* w) {
    const int* entry = moved.entries();
    for (int j = 0; j < moved.n; ++j) {
      const int k = entry[j];
      w[k] -= own[k][0] * x[0] + own[k][1] * x[1] + own[k][2] * x[2];
    }
  }

  // w = F^-T x of three columns; x is zero except at the velocities that move it.
  FAN_FN static void push(
      const Real* L, const Triple<Real>* x, const Moved& moved, Triple<Real>* w) {
    const Quad* own = reinterpret_cast<const Quad*>(x);
    Quad* out = reinterpret_cast<Quad*>(w);
    Model::push(moved.apart ? moved.link[0] : all_links, L, own, out);
    if (moved.link[1] < 0 || !moved.apart) return;
    Quad more[array_size(N)];
    Model::push(moved.link[1], L, own, more);
    const int* entry = moved.entries();
    for (int j = 0; j < moved.n; ++j) out[entry[j]] += more[entry[j]];
  }

 private:
  // Products of the columns of points i and j <= i.
  FAN_FN void multiply(int i, int j, const Moved* moved) {
    if (moved[i].is_apart(moved[j])) {
      for (int d = 0; d < 3; ++d) G_[i][j][d].clear();
      return;
    }
    const MovedBy<N>& shorter = moved[moved[i].n <= moved[j].n ? i : j];  // W is 0 beyond
    shorter.products(W[i], W[j], G_[i][j], shorter.n);
  }

  static constexpr int all_links = -1;

  int n_computed_ = 0;
  bool has_[array_size(C)];  // whether a point's columns are computed
  Triple<Real> G_[array_size(C)][array_size(C)][3];
};

}  // namespace fan

FAN_LOOPS_END
