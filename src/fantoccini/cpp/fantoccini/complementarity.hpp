// Complementarity over one-sided rows, for one trajectory or for a bundle of lanes:
//
//   s = G x - b,   s_i >= 0 where x_i = lower_i,   s_i = 0 where lower_i < x_i < upper_i,
//   s_i <= 0 where x_i = upper_i                      (G = A_D M^-1 A_D^T)
//
// Block principal pivoting with a least-index fallback (Judice and Pires), which ends for every
// positive definite G. G's diagonal is raised by eps times its largest entry, so redundant rows
// have a solution too: as eps goes to 0 it becomes the one of least norm (Tikhonov). The pivots are
// chosen for the raised G; refinement against G itself then takes eps' error from the free rows.
// active_set.hpp solves the same problem exactly, one trajectory at a time.
#pragma once

#include "real.hpp"

namespace fan {

constexpr double kRounding = 4e-16;  // of a row's residual, relative to the sum of its terms

template <class Real, int capacity>
struct Complementarity {
  using Mask = typename Traits<Real>::Mask;
  static constexpr int N = room(capacity);

  int n = 0;
  Real G[N * N];       // row i, column j at i * N + j
  Real b[N];
  Real x[N];
  Real s[N];
  Real lower[N], upper[N];
  Mask active[N];      // rows between their bounds; on entry the guess
  Mask high[N];        // rows at their upper bound
  Real factor[N * N];  // lower Cholesky factor of the active block, reciprocals on the diagonal

  FAN_FN void factorise(double eps) {
    // Against the largest diagonal: a row without any influence of its own then gets no multiplier.
    raise_ = Real(1e-30);
    n_some_ = 0;
    for (int j = 0; j < n; ++j) {
      if (!any(active[j])) continue;
      some_[n_some_++] = j;
      const Real own = select(active[j], G[j * N + j], Real(0.0));
      raise_ = select(own > raise_, own, raise_);
    }
    raise_ *= eps;
    for (int c = 0; c < n_some_; ++c) {
      const int j = some_[c];
      factor[j * N + j] = select(active[j], Real(G[j * N + j] + raise_), Real(1.0));
      for (int d = c + 1; d < n_some_; ++d) {
        const int i = some_[d];
        factor[i * N + j] = select(active[i] && active[j], G[i * N + j], Real(0.0));
      }
    }
    // Column by column, each taken out of all that follow: their updates do not wait on another.
    for (int c = 0; c < n_some_; ++c) {
      using std::sqrt;
      const int j = some_[c];
      // A redundant row leaves rounding here; the floor keeps the factor finite.
      const Real floor = raise_ * 1e-2 + G[j * N + j] * 1e-16 + 1e-300;
      const Real sum = factor[j * N + j];
      const Real pivot = factor[j * N + j] = Real(1.0) / sqrt(select(sum > floor, sum, floor));
      for (int d = c + 1; d < n_some_; ++d) factor[some_[d] * N + j] *= pivot;
      for (int d = c + 1; d < n_some_; ++d) {
        Real* row = factor + some_[d] * N;
        const Real part = row[j];
        for (int e = c + 1; e <= d; ++e) row[some_[e]] -= part * factor[some_[e] * N + j];
      }
    }
  }

  // r <- (active block)^-1 r; the other rows stay as they are.
  FAN_FN void substitute(Real* r) const {
    for (int c = 0; c < n_some_; ++c) {
      const int j = some_[c];
      r[j] *= factor[j * N + j];
      for (int d = c + 1; d < n_some_; ++d) r[some_[d]] -= factor[some_[d] * N + j] * r[j];
    }
    for (int c = n_some_ - 1; c >= 0; --c) {
      const int i = some_[c];
      r[i] *= factor[i * N + i];
      for (int d = 0; d < c; ++d) r[some_[d]] -= factor[i * N + some_[d]] * r[i];
    }
  }

  // x of the active rows from s_i = 0, of the others from their bounds; then s of all rows.
  // Refines until what is left is rounding; a lane that is done does not change any more.
  FAN_FN void solve_active(double eps, int max_refinements) {
    factorise(eps);
    first_solution();
    refine(max_refinements);
  }

  // Solves the problem from the guess in `active` and `high`. tolerance is relative to the largest
  // |x| and to the size of the terms of each s. Returns the lanes that were solved.
  FAN_FN Mask solve(double eps, int max_refinements, double tolerance, int max_iterations) {
    using std::abs;
    Real fewest = Real(double(n + 1)), patience = Real(3.0);
    Mask solved = Real(0.0) > Real(1.0);
    for (int iteration = 0; iteration < max_iterations; ++iteration) {
      factorise(eps);
      first_solution();
      Real scale = Real(0.0), count = Real(0.0);
      for (int i = 0; i < n; ++i) scale = select(abs(x[i]) > scale, Real(abs(x[i])), scale);
      Mask below[N], above[N], wrong[N];
      const int n_pull = pulling();
      for (int i = 0; i < n; ++i) {
        // What s says of a row matters only where the row is at a bound.
        Real sum = Real(0.0), terms = Real(0.0);
        if (any(!active[i])) {
          residual(i, n_pull, sum, terms);
          sum += raise_ * x[i];
        }
        below[i] = active[i] && x[i] < lower[i] - tolerance * scale;
        above[i] = active[i] && x[i] > upper[i] + tolerance * scale;
        const Mask freed = (high[i] && sum > tolerance * terms) ||
                           (!active[i] && !high[i] && sum < -tolerance * terms);
        wrong[i] = below[i] || above[i] || freed;
        count += select(wrong[i], Real(1.0), Real(0.0));
      }
      solved = count < Real(0.5);
      if (!any(!solved)) break;
      const Mask better = count < fewest;
      fewest = select(better, count, fewest);
      patience = select(better, Real(3.0), Real(patience - 1.0));
      const Mask block = patience > Real(-0.5);
      Mask taken = block;
      for (int i = n - 1; i >= 0; --i) {
        const Mask flip = wrong[i] && (block || !taken) && !solved;
        taken = taken || wrong[i];
        high[i] = (high[i] && !flip) || (above[i] && flip);
        active[i] = (active[i] && !flip) || (!active[i] && flip);
      }
    }
    refine(max_refinements);
    return solved;
  }

 private:
  FAN_FN void first_solution() {
    Real known[N];
    for (int i = 0; i < n; ++i) known[i] = select(high[i], upper[i], lower[i]);
    for (int i = 0; i < n; ++i) x[i] = select(active[i], b[i], Real(0.0));
    for (int j = 0; j < n; ++j) {
      const Real fixed = select(active[j], Real(0.0), known[j]);
      if (!any(fixed != Real(0.0))) continue;
      for (int i = 0; i < n; ++i) x[i] -= select(active[i], Real(G[i * N + j] * fixed), Real(0.0));
    }
    substitute(x);
    for (int i = 0; i < n; ++i) x[i] = select(active[i], x[i], known[i]);
  }

  FAN_FN void refine(int max_refinements) {
    using std::abs;
    Real r[N];
    for (int round = 0;; ++round) {
      Mask rough = Real(0.0) > Real(1.0);
      const int n_pull = pulling();
      for (int i = 0; i < n; ++i) {
        Real terms;
        residual(i, n_pull, s[i], terms);
        rough = rough || (active[i] && abs(s[i]) > kRounding * terms);
      }
      if (round == max_refinements || !any(rough)) break;
      for (int i = 0; i < n; ++i) r[i] = select(active[i] && rough, Real(-s[i]), Real(0.0));
      substitute(r);
      for (int i = 0; i < n; ++i) x[i] += r[i];
    }
  }

  // Rows with x other than 0 in some lane, in pull_.
  FAN_FN int pulling() {
    int count = 0;
    for (int j = 0; j < n; ++j)
      if (any(x[j] != Real(0.0))) pull_[count++] = j;
    return count;
  }

  // s_i and the size of its terms.
  FAN_FN void residual(int i, int n_pull, Real& sum, Real& terms) const {
    using std::abs;
    sum = -b[i];
    terms = abs(b[i]);
    for (int k = 0; k < n_pull; ++k) {
      const Real term = G[i * N + pull_[k]] * x[pull_[k]];
      sum += term;
      terms += abs(term);
    }
  }

  Real raise_;
  int some_[N], n_some_ = 0;  // rows active in some lane, in order
  int pull_[N];
};

}  // namespace fan
