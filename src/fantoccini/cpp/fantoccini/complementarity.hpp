// Complementarity over one-sided rows:
//
//   s = G x - b >= 0,   x >= 0,   x . s = 0          (two-sided rows: s = 0, x of any sign)
//
// G = A_D M^-1 A_D^T. With b the rows' hddot at zero tension, x are tensions and -s is hddot; with
// b their hdot before a catch, x are impulses and -s is hdot after it. For one string this is the
// paper's delta_1 delta_2 rule and Eq. 15.
//
// Block principal pivoting with a least-index fallback (Judice and Pires), which ends for every
// positive definite G. The diagonal is raised by eps times its largest entry, so that redundant
// rows have a solution, and refinement against the unraised G takes the error of that away again: among
// redundant rows what is left is the solution of least norm in the range of G.
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
  Mask active[N];      // rows with s = 0; on entry the guess
  bool two_sided[N];
  Real factor[N * N];  // lower Cholesky factor of the active block, reciprocals on the diagonal

  FAN_FN void factorise(double eps) {
    // Against the largest diagonal: a row without any influence of its own then gets no multiplier.
    Real top = Real(1e-30);
    for (int j = 0; j < n; ++j) {
      const Real own = select(active[j], G[j * N + j], Real(0.0));
      top = select(own > top, own, top);
    }
    const Real raise = top * eps, floor = top * (eps * 1e-2);
    for (int j = 0; j < n; ++j) {
      for (int i = j; i < n; ++i) {
        Real sum = i == j ? select(active[j], Real(G[j * N + j] + raise), Real(1.0))
                          : select(active[i] && active[j], G[i * N + j], Real(0.0));
        for (int k = 0; k < j; ++k) sum -= factor[i * N + k] * factor[j * N + k];
        if (i == j) {
          using std::sqrt;
          // A redundant row leaves rounding here; the floor keeps the factor finite.
          factor[j * N + j] = Real(1.0) / sqrt(select(sum > floor, sum, floor));
        } else {
          factor[i * N + j] = sum * factor[j * N + j];
        }
      }
    }
  }

  FAN_FN void substitute(Real* r) const {
    for (int i = 0; i < n; ++i) {
      for (int k = 0; k < i; ++k) r[i] -= factor[i * N + k] * r[k];
      r[i] *= factor[i * N + i];
    }
    for (int i = n - 1; i >= 0; --i) {
      for (int k = i + 1; k < n; ++k) r[i] -= factor[k * N + i] * r[k];
      r[i] *= factor[i * N + i];
    }
  }

  // x on the active rows from (G x)_i = b_i, zero elsewhere; then s of all rows. Refines until
  // what is left is rounding; a lane that is done does not change any more.
  FAN_FN void solve_active(double eps, int max_refinements) {
    using std::abs;
    Real r[N];
    factorise(eps);
    for (int i = 0; i < n; ++i) x[i] = select(active[i], b[i], Real(0.0));
    substitute(x);
    for (int round = 0;; ++round) {
      Mask rough = Real(0.0) > Real(1.0);
      for (int i = 0; i < n; ++i) {
        Real sum = -b[i], terms = abs(b[i]);
        for (int j = 0; j < n; ++j) {
          const Real term = G[i * N + j] * x[j];
          sum += term;
          terms += abs(term);
        }
        s[i] = sum;
        rough = rough || (active[i] && abs(sum) > kRounding * terms);
      }
      if (round == max_refinements || !any(rough)) break;
      for (int i = 0; i < n; ++i) r[i] = select(active[i] && rough, Real(-s[i]), Real(0.0));
      substitute(r);
      for (int i = 0; i < n; ++i) x[i] += r[i];
    }
  }

  // Solves the problem from the guess in `active`. tolerance is relative to the largest |x| and to
  // the size of the terms of each s. Returns the lanes that were solved.
  FAN_FN Mask solve(double eps, int max_refinements, double tolerance, int max_iterations) {
    using std::abs;
    Real fewest = Real(double(n + 1)), patience = Real(3.0);
    Mask solved = Real(0.0) > Real(1.0);
    for (int i = 0; i < n; ++i)
      if (two_sided[i]) active[i] = Real(1.0) > Real(0.0);
    for (int iteration = 0; iteration < max_iterations; ++iteration) {
      solve_active(eps, max_refinements);
      Real scale = Real(0.0), count = Real(0.0);
      for (int i = 0; i < n; ++i) scale = select(abs(x[i]) > scale, Real(abs(x[i])), scale);
      Mask bad[N];
      for (int i = 0; i < n; ++i) {
        Real terms = abs(b[i]);
        for (int j = 0; j < n; ++j) terms += abs(G[i * N + j] * x[j]);
        bad[i] = (active[i] && x[i] < -tolerance * scale) ||
                 (!active[i] && s[i] < -tolerance * terms);
        if (two_sided[i]) bad[i] = Real(0.0) > Real(1.0);
        count += select(bad[i], Real(1.0), Real(0.0));
      }
      solved = count < Real(0.5);
      if (!any(!solved)) break;
      const Mask better = count < fewest;
      fewest = select(better, count, fewest);
      patience = select(better, Real(3.0), Real(patience - 1.0));
      const Mask block = patience > Real(-0.5);
      Mask taken = block;
      for (int i = n - 1; i >= 0; --i) {
        const Mask flip = bad[i] && (block || !taken) && !solved;
        taken = taken || bad[i];
        active[i] = (active[i] && !flip) || (!active[i] && flip);
      }
    }
    return solved;
  }
};

}  // namespace fan
