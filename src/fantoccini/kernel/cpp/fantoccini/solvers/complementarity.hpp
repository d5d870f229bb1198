// Complementarity over one-sided rows, for one trajectory or for a bundle of lanes:
//
//   s = G x - b,   s_i >= 0 where x_i = lower_i,   s_i = 0 where lower_i < x_i < upper_i,
//   s_i <= 0 where x_i = upper_i                      (G = A_D M^-1 A_D^T)
//
// Block principal pivoting (Judice and Pires) that falls back to one row a round, the last wrong
// one (Murty), and so terminates for every positive definite G. For nearly redundant rows, G's
// diagonal is raised by eps times its largest entry, so that they have a solution too: as eps goes
// to 0 it becomes the one of least norm (Tikhonov). The pivots are chosen for the raised G;
// refinement against G itself then removes the error of eps from the active rows. active_set.hpp
// solves the same problem exactly, one trajectory at a time.
#pragma once

#include "fantoccini/math/elementary.hpp"
#include "fantoccini/math/unrolled.hpp"

namespace fan {

struct ComplementarityTolerances {
  // Raise of G's diagonal, relative to its largest entry: far above rounding. It changes x by about
  // raise / smallest eigenvalue (also relative); one refinement squares that.
  static constexpr double raise = 1e-10;
  // Raises tried one after another if pivoting does not terminate with that.
  static constexpr double firmer_raises[] = {1e-4, 1e-2};
  // A lane is raised if one of its pivots is below this many raises. A firmer raise thus raises
  // nearly all lanes.
  static constexpr double firm_pivot = 1e4;
  // Largest violation of a bound by x, relative to the largest |x|, and wrong sign of s, relative
  // to its terms.
  static constexpr double pivoting = 1e-13;
  // Residual of an active row, relative to its terms, that needs no refinement: two rounding
  // errors.
  static constexpr double refined_residual = 4e-16;
  // A pivot is at least the sum of these shares of the raise and of its diagonal entry, and an
  // absolute part [1/kg]: the factor stays finite.
  static constexpr double pivot_floor[] = {1e-2, 1e-16, 1e-300};
  static constexpr double smallest_diagonal =
      1e-30;  // 1/kg: the raise is relative to at least this
  // Rounds of block pivoting without fewer wrong rows, before one row a round is changed.
  static constexpr double patience = 3.0;
  // Speed (m/s or rad/s) at which a row opens in lanes in which it takes no part.
  static constexpr double excluded_speed = 1e30;

  // Largest number of rounds of pivoting for n rows.
  static constexpr int max_iterations(int n) { return 50 + 4 * n; }
};

// In a problem for solve() the first `leading` rows always take part: they are processed in
// straight-line code, the same whatever rows follow, so that no lane's sums depend on whether rows
// of its neighbours take part.
template <class Real, int capacity, int leading = 0>
struct Complementarity {
  using Mask = typename Traits<Real>::Mask;
  using Tolerance = ComplementarityTolerances;
  static constexpr int N = array_size(capacity);

  int n = 0;
  Real G[N * N];  // row i, column j at i * N + j
  Real b[N];
  Real x[N];
  Real s[N];  // in rows that are not active
  Real lower[N], upper[N];
  Mask active[N];  // rows between their bounds; on entry the guess
  Mask high[N];    // rows at their upper bound

  // Sets the entries between the first `leading` rows, for solve(): (i, j), j <= i, at i * stride +
  // j.
  FAN_FN void use(const Real* block, int stride) {
    block_ = block;
    stride_ = stride;
  }

  // Entry (i, j) of G of a problem for solve().
  FAN_ALWAYS_INLINE const Real& at(int i, int j) const { return at_with<leading>(i, j); }

  // Factorises the active rows, the diagonal raised by eps times its largest entry.
  FAN_FN void factorise(double eps) {
    list_rows<0>();
    raise_ = eps * largest_;
    factor<0>(0.0);
  }

  // The pivot of row i in the factor; the row must be active in some lane.
  FAN_FN Real pivot(int i) const {
    int c = 0;
    while (rows_[c] != i) ++c;
    return pivots_[c];
  }

  // x_i clipped to its bounds.
  FAN_FN Real bounded(int i) const {
    const Real below = select(x[i] > upper[i], upper[i], x[i]);
    return select(below < lower[i], lower[i], below);
  }

  // r <- (active block)^-1 r; the other rows are unchanged.
  FAN_FN void substitute(Real* r) const { substitute_with<0>(r); }

  // Sets x of the active rows from s_i = 0, of the others from their bounds; then s of all rows.
  // Refines until the residuals are rounding; a converged lane no longer changes.
  FAN_FN void solve_active(double eps, int max_refinements) {
    factorise(eps);
    first_solution<0>();
    const Mask everywhere = Real(0.0) < Real(1.0);
    residuals<0>(everywhere);
    refine<0>(max_refinements, everywhere);
  }

  // Solves the problem from the guess in `active` and `high`. The tolerance is relative to the
  // largest |x| and to the magnitude of the terms of each s. Returns the solved lanes; a lane with
  // NaN counts as solved. `again`: n and G are those of the last call, whose factor is reused while
  // the active rows are the same.
  FAN_FN Mask
  solve(double eps, int max_refinements, double tolerance, int max_iterations, bool again = false) {
    using std::abs;
    Real fewest = Real(double(n + 1)), patience = Real(Tolerance::patience);
    Mask solved = Real(0.0) > Real(1.0);
    rows<leading>([&](auto i)
                      FAN_INLINE { b[i] = select(abs(b[i]) < negligible, Real(0.0), b[i]); });
    if (!again) has_factor_ = false;
    if (!has_factor_) raised_ = solved;
    for (int iteration = 0; iteration < max_iterations; ++iteration) {
      factorise_as_needed(eps);
      first_solution<leading>();
      Real scale = Real(0.0), count = Real(0.0);
      Mask below[N], above[N], wrong[N], any_wrong = Real(0.0) > Real(1.0);
      rows<leading>([&](auto i) FAN_INLINE { scale = maximum(Real(abs(x[i])), scale); });
      const Real slack = tolerance * scale;
      residuals<leading>(raised_);
      rows<leading>([&](auto i) FAN_INLINE {
        const Real sum = s[i] + raise_ * x[i], terms = terms_[i];
        below[i] = active[i] && x[i] < lower[i] - slack;
        above[i] = active[i] && x[i] > upper[i] + slack;
        const Mask freed = (high[i] && sum > tolerance * terms) ||
                           (!active[i] && !high[i] && sum < -tolerance * terms);
        wrong[i] = below[i] || above[i] || freed;
        any_wrong = any_wrong || wrong[i];
      });
      solved = !any_wrong;
      if (!any(any_wrong)) break;
      for (int i = 0; i < n; ++i) count += select(wrong[i], Real(1.0), Real(0.0));
      const Mask better = count < fewest;
      fewest = select(better, count, fewest);
      patience = select(better, Real(Tolerance::patience), Real(patience - 1.0));
      const Mask block = patience > Real(-0.5);
      Mask flipped = block;
      for (int i = n - 1; i >= 0; --i) {
        const Mask flip = wrong[i] && (block || !flipped) && !solved;
        flipped = flipped || wrong[i];
        high[i] = (high[i] && !flip) || (above[i] && flip);
        active[i] = (active[i] && !flip) || (!active[i] && flip);
      }
    }
    refine<leading>(max_refinements, raised_);
    return solved;
  }

  // Solves the problem, with larger raises in lanes in which pivoting does not terminate. Returns
  // the solved lanes and the idle ones.
  FAN_FN Mask solve_firmly(const Mask& idle) {
    const int max_iterations = Tolerance::max_iterations(n);
    Mask settled = solve(Tolerance::raise, 1, Tolerance::pivoting, max_iterations) || idle;
    if (!any(!settled)) return settled;
    Real x_before[N], s_before[N];
    Mask high_before[N];
    for (int i = 0; i < n; ++i) {
      x_before[i] = x[i];
      s_before[i] = s[i];
      high_before[i] = high[i];
    }
    for (const double eps : Tolerance::firmer_raises) {
      const Mask now = solve(eps, 1, Tolerance::pivoting, max_iterations);
      // A lane that was solved before keeps its solution.
      for (int i = 0; i < n; ++i) {
        x[i] = x_before[i] = select(settled, x_before[i], x[i]);
        s[i] = s_before[i] = select(settled, s_before[i], s[i]);
        high[i] = high_before[i] = (settled && high_before[i]) || (!settled && high[i]);
      }
      settled = settled || now;
      if (!any(!settled)) break;
    }
    return settled;
  }

 private:
  template <int first>
  FAN_ALWAYS_INLINE const Real& at_with(int i, int j) const {
    if (i < first && j < first) return j < i ? block_[i * stride_ + j] : block_[j * stride_ + i];
    return G[i * N + j];
  }

  // Calls f with the number of every row; for the first ones as a constant.
  template <int first, class F>
  FAN_ALWAYS_INLINE void rows(const F& f) const {
    unrolled<0, first>(f);
    for (int i = first; i < n; ++i) f(i);
  }

  // Raises the lanes in which a pivot is small, and keeps them raised: pivoting terminates for one
  // matrix, not for two that alternate. The other lanes are solved to rounding and need no
  // refinement.
  FAN_FN void factorise_as_needed(double eps) {
    if (has_factor_ && is_current()) return;
    list_rows<leading>();
    has_factor_ = true;
    rows<leading>([&](auto i) FAN_INLINE { factored_[i] = active[i]; });
    raise_ = select(raised_, eps * largest_, Real(0.0));
    factor<leading>(Tolerance::firm_pivot * eps);
    const Mask now = loose_ && !raised_;
    if (!any(now)) return;
    raised_ = raised_ || now;
    raise_ = select(raised_, eps * largest_, Real(0.0));
    factor<leading>(0.0);
  }

  // Whether the factor is that of the active rows.
  FAN_FN bool is_current() const {
    Mask differs = Real(0.0) > Real(1.0);
    for (int i = 0; i < n; ++i) differs = differs || factored_[i] != active[i];
    return !any(differs);
  }

  // Lists the first rows and those that are active in some lane, and finds the largest diagonal
  // entry of each lane's active rows.
  template <int first>
  FAN_FN void list_rows() {
    largest_ = Real(Tolerance::smallest_diagonal);
    n_rows_ = first;
    rows<first>([&](auto j) FAN_INLINE {
      if (j < first) rows_[j] = j;
      else if (any(active[j])) rows_[n_rows_++] = j;
      else return;
      const Real diagonal = select(active[j], at_with<first>(j, j), Real(0.0));
      largest_ = maximum(diagonal, largest_);
    });
  }

  // Marks the lanes with pivots below `least` times the largest diagonal entry as loose.
  template <int first>
  FAN_FN void factor(double least) {
    loose_ = Real(0.0) > Real(1.0);
    const Real low = least * largest_;
    // The Schur complement of the leading block, for which D L^T is not stored.
    Real complement[array_size(first)][array_size(first)];
    unrolled<0, first>([&](auto d) FAN_INLINE {
      unrolled<0, d + 1>([&](auto c) FAN_INLINE { complement[d][c] = entry<first>(d, c); });
    });
    unrolled<0, first>([&](auto c) FAN_INLINE {
      take_pivot<first>(c, complement[c][c], low);
      unrolled<c + 1, first>([&](auto d) FAN_INLINE {
        const Real part = complement[d][c] * inverse_[c];
        unrolled<d, first>([&](auto e) FAN_INLINE { complement[e][d] -= complement[e][c] * part; });
        factor_[d * N + c] = part;
      });
    });
    for (int c = 0; c < n_rows_; ++c) {
      const int begin = c < first ? first : c;
      for (int d = begin; d < n_rows_; ++d) {
        Real sum = entry<first>(rows_[d], rows_[c]);
        for (int k = 0; k < c; ++k) sum -= factor_[c * N + k] * factor_[k * N + d];
        if (d == c) take_pivot<first>(c, sum, low);
        else take_entry(c, d, sum);
      }
    }
  }

  // Entry (i, j) of the matrix to factorise.
  template <int first>
  FAN_ALWAYS_INLINE Real entry(int i, int j) const {
    const Real& value = at_with<first>(i, j);
    if (i == j) return select(active[i], Real(value + raise_), Real(1.0));
    return select(active[i] && active[j], value, Real(0.0));
  }

  template <int first>
  FAN_ALWAYS_INLINE void take_pivot(int c, const Real& value, const Real& low) {
    // A redundant row leaves rounding here; the floor keeps the factor finite.
    const int j = rows_[c];
    const Real floor = raise_ * Tolerance::pivot_floor[0] +
                       at_with<first>(j, j) * Tolerance::pivot_floor[1] + Tolerance::pivot_floor[2];
    pivots_[c] = maximum(value, floor);
    inverse_[c] = Real(1.0) / pivots_[c];
    loose_ = loose_ || (active[j] && pivots_[c] < low);
  }

  FAN_ALWAYS_INLINE void take_entry(int c, int d, const Real& value) {
    factor_[c * N + d] = value;
    factor_[d * N + c] = value * inverse_[c];
  }

  // r <- (active block)^-1 r, the first rows in straight-line code.
  template <int first>
  FAN_FN void substitute_with(Real* r) const {
    Real y[N];
    unrolled<0, first>([&](auto c) FAN_INLINE { y[c] = r[c]; });
    for (int c = first; c < n_rows_; ++c) y[c] = r[rows_[c]];
    unrolled<0, first>([&](auto c) FAN_INLINE {
      unrolled<c + 1, first>([&](auto d) FAN_INLINE { y[d] -= factor_[d * N + c] * y[c]; });
    });
    for (int d = first; d < n_rows_; ++d)
      for (int c = 0; c < d; ++c) y[d] -= factor_[d * N + c] * y[c];
    for (int c = n_rows_ - 1; c >= first; --c) {
      y[c] *= inverse_[c];
      for (int d = 0; d < c; ++d) y[d] -= factor_[d * N + c] * y[c];
      r[rows_[c]] = y[c];
    }
    unrolled<0, first>([&](auto c) FAN_INLINE { y[c] *= inverse_[c]; });
    unrolled<0, first>([&](auto i) FAN_INLINE {
      constexpr int c = first - 1 - i;
      unrolled<0, c>([&](auto d) FAN_INLINE { y[d] -= factor_[c * N + d] * y[c]; });
      r[c] = y[c];
    });
  }

  template <int first>
  FAN_FN void first_solution() {
    Real known[N];
    Mask any_bound = Real(0.0) > Real(1.0);
    rows<first>([&](auto i) FAN_INLINE {
      known[i] = select(active[i], Real(0.0), select(high[i], upper[i], lower[i]));
      any_bound = any_bound || known[i] != Real(0.0);
      x[i] = select(active[i], b[i], Real(0.0));
    });
    if (any(any_bound))
      for (int j = 0; j < n; ++j)
        if (any(known[j] != Real(0.0)))
          for (int i = 0; i < n; ++i)
            x[i] -= select(active[i], Real(at_with<first>(i, j) * known[j]), Real(0.0));
    substitute_with<first>(x);
    rows<first>([&](auto i) FAN_INLINE { x[i] = select(active[i], x[i], known[i]); });
  }

  // Refines x in the lanes `where` until the residuals are rounding, at most `max_rounds` times. On
  // entry s must be that of x.
  template <int first>
  FAN_FN void refine(int max_rounds, const Mask& where) {
    using std::abs;
    if (!any(where)) return;
    Real r[N];
    for (int round = 0; round < max_rounds; ++round) {
      Mask rough = Real(0.0) > Real(1.0);
      for (int i = 0; i < n; ++i)
        rough =
            rough || (where && active[i] && abs(s[i]) > Tolerance::refined_residual * terms_[i]);
      if (!any(rough)) return;
      for (int i = 0; i < n; ++i) r[i] = select(active[i] && rough, Real(-s[i]), Real(0.0));
      substitute_with<first>(r);
      for (int i = 0; i < n; ++i) x[i] += r[i];
      residuals<first>(where);
    }
  }

  // Sets s and the magnitude of its terms; of active rows, whose s is 0 up to rounding and the
  // raise, only in the lanes `also`.
  template <int first>
  FAN_FN void residuals(const Mask& also) {
    using std::abs;
    Mask needed = also;
    rows<first>([&](auto i) FAN_INLINE {
      s[i] = terms_[i] = Real(0.0);
      needed = needed || !active[i];
    });
    if (!any(needed)) return;
    int pulls[N], n_pulls = 0;
    for (int j = 0; j < n; ++j)
      if (any(x[j] != Real(0.0))) pulls[n_pulls++] = j;
    for (int i = 0; i < n; ++i) {
      if (!any(!active[i] || also)) continue;
      Real sum = -b[i], terms = abs(b[i]);
      for (int k = 0; k < n_pulls; ++k) {
        const Real term = at_with<first>(i, pulls[k]) * x[pulls[k]];
        sum += term;
        terms += abs(term);
      }
      s[i] = sum;
      terms_[i] = terms;
    }
  }

  const Real* block_ = nullptr;
  int stride_ = 0;
  Real raise_, largest_, terms_[N];
  Mask loose_, raised_;
  bool has_factor_ = false;   // whether there is a factor to reuse
  Mask factored_[N];          // active rows of the factor
  int rows_[N], n_rows_ = 0;  // rows of the factor, in order
  // These rows' block is L D L^T with ones on L's diagonal: L below the diagonal, D L^T above it
  // except for the first rows of solve(). A row that is not active in a lane is that of the unit
  // matrix there.
  Real factor_[N * N], pivots_[N], inverse_[N];
};

}  // namespace fan
