// Impulses of strings and of contacts with exact Coulomb friction, at one instant:
//
//   s = G x - b      (G symmetric, positive semi-definite, often singular: redundant contacts)
//
// Single rows (strings, limits):  lower <= x <= upper,  s >= 0 where x = lower,  s <= 0 where
// x = upper,  s = 0 between. Contacts of three rows, the normal n and two tangents T:
//
//   0 <= x_n <= upper_n, with s_n as above;   |x_T| <= mu x_n,
//   s_T = 0 where |x_T| < mu x_n,   x_T = -mu x_n s_T / |s_T| elsewhere
//
// The law holds where x is a fixed point of x <- P(x - s / g), with g > 0 the mean of G's diagonal
// over a row or a contact, and P the projection onto the bounds and the disc of radius mu x_n
// (Alart and Curnier, Computer Methods in Applied Mechanics and Engineering 92, 1991). Semi-smooth
// Newton: x - s / g decides which rows are at a bound, which contacts are open, stick or slide;
// these fix some of x and leave linear equations for the rest. A sliding contact keeps two
// unknowns: x_n, together with mu x_n d along the direction d of sliding, and the part of x_T
// across d.
//
// The direction d of sliding of a contact may be given instead: x_T = mu x_n d whatever s_T is.
//
// G + raise replaces G and b + raise centre replaces b (proximal point: Rockafellar, SIAM Journal
// on Control and Optimization 14, 1976). When that problem is solved the centre moves to its
// solution, so that the limit is exact. The raise is small at first. If Newton cycles, the start
// comes from the alternating direction method of multipliers, for the form of the law with the
// second-order cone (De Saxce; Acary, Bremond and Huber, Lecture Notes in Applied and Computational
// Mechanics 86, 2018), and the raise adapts: larger after each failure, smaller after each success.
//
// Rows that do not influence one another, even through others, are islands, which are solved
// separately (cone_island.hpp).
#pragma once

#include "fantoccini/solvers/cone_island.hpp"

namespace fan {

template <int capacity>
struct ConeProblem : private ConeIsland<capacity> {
  using Island = ConeIsland<capacity>;
  using Tolerance = ConeTolerances;
  static constexpr int N = Island::N;

  // Call resize() first, then fill the arrays; a row of G may be written one entry past its end.
  using Island::along, Island::x, Island::s;
  using Island::G, Island::b, Island::lower, Island::upper, Island::mu, Island::slides;
  using Island::resize, Island::n_single, Island::n_contacts, Island::n, Island::stride;
  bool quick = false;  // whether another start is tried after few steps from the guess
  // The largest g |x - P(x - s / g)| of a row (a speed), relative to the largest |b_i|.
  using Island::find_s;
  using Island::residual;
  int iterations = 0;  // Newton steps
  int rounds = 0;      // rounds of the method of multipliers

  // Whether the law holds, up to the residual. If not, x is the best iterate within the bounds, or
  // 0 if the problem has numbers that are not finite or bounds in the wrong order.
  FAN_FN bool solve() { return solve_islands(0.0); }

  // Solves, from zero, a problem with compliant rows: `share` of G's largest diagonal entry is
  // added to its diagonal. Where forces jam, it has a solution although the law has none. s and
  // residual are then those of the law itself. Call it after solve() has failed.
  FAN_FN bool solve_softly(double share) {
    for (int i = 0; i < n; ++i) x[i] = 0.0;
    double top = 0.0;
    for (int i = 0; i < n; ++i) top = larger(top, G[i * (stride + 1)]);
    return solve_islands(share * (top > 0.0 ? top : 1.0));
  }

 private:
  using Island::clip, Island::is_finite, Island::larger, Island::speed;

  FAN_FN bool solve_islands(double yielding) {
    iterations = rounds = 0;
    residual = unbounded;
    if (n > capacity || !is_valid()) return false;
    double scale = negligible, worst = 0.0;
    for (int i = 0; i < n; ++i) {
      if (fabs(b[i]) < negligible) b[i] = 0.0;
      scale = larger(scale, fabs(b[i]));
      is_taken_[i] = false;
    }
    bool solved = true;
    const bool is_single = is_one_island();
    if (is_single) {
      solved = solve_one(*this, yielding);
      worst = speed;
    }
    for (int i = 0; i < n && !is_single; ++i) {
      if (is_taken_[i]) continue;
      collect(i);
      fill();
      solved = solve_one(part_, yielding) && solved;
      for (int k = 0; k < part_.n; ++k) {
        x[own_[k]] = part_.x[k];
        s[own_[k]] = part_.s[k];
      }
      worst = larger(worst, part_.speed);
    }
    residual = clip(worst / scale, 0.0, unbounded);
    return solved;
  }

  // Solves an island with an addition to G's diagonal; s and speed exclude that.
  FAN_FN bool solve_one(Island& island, double yielding) {
    double held[N];
    if (yielding > 0.0)
      for (int i = 0; i < island.n; ++i) {
        held[i] = island.G[i * (island.stride + 1)];
        island.G[i * (island.stride + 1)] += yielding;
      }
    const bool solved = island.solve(quick);
    if (yielding > 0.0) {
      for (int i = 0; i < island.n; ++i) island.G[i * (island.stride + 1)] = held[i];
      island.measure();
    }
    iterations += island.iterations;
    rounds += island.rounds;
    return solved;
  }

  // Whether the first row influences all others, as when one body carries them.
  FAN_FN bool is_one_island() const {
    bool all = true;
    for (int i = 1; i < n; ++i) all = all && G[i] != 0.0;
    return all;
  }

  // Whether all numbers are finite and the bounds in order. If not, x and s are 0.
  FAN_FN bool is_valid() {
    const double size = sum_of_squares(G, n * stride);  // NaN if any number is
    bool valid = size < Tolerance::largest_number * Tolerance::largest_number;
    for (int i = 0; i < n; ++i) valid = valid && is_finite(b[i]);
    for (int i = 0; i < n_single; ++i) valid = valid && lower[i] <= upper[i];
    for (int c = 0; c < n_contacts; ++c)
      valid = valid && mu[c] >= 0.0 && is_finite(mu[c]) && upper[n_single + 3 * c] >= 0.0;
    for (int i = 0; i < n && !valid; ++i) x[i] = s[i] = 0.0;
    return valid;
  }

  // Four sums of four at a time: each addition waits for the previous one.
  FAN_FN static double sum_of_squares(const double* x, int n) {
    Quad sum[4] = {};
    int i = 0;
    for (; i + 16 <= n; i += 16)
      FAN_UNROLL for (int q = 0; q < 4; ++q) sum[q] += quad(x + i + 4 * q) * quad(x + i + 4 * q);
    for (; i < n; i += 4) sum[0] += quad(x + i) * quad(x + i);
    const Quad all = (sum[0] + sum[1]) + (sum[2] + sum[3]);
    return (all[0] + all[1]) + (all[2] + all[3]);
  }

  // Lists in own_ the rows of the island of row `first`, in order, with all rows of a contact.
  FAN_FN void collect(int first) {
    int reached[N], n_reached = 0;
    bool is_own[N];
    for (int i = 0; i < n; ++i) is_own[i] = false;
    const auto add = [&](int i) {
      const bool single = i < n_single;
      const int begin = single ? i : i - (i - n_single) % 3;
      for (int j = begin; j < begin + (single ? 1 : 3); ++j) {
        is_own[j] = is_taken_[j] = true;
        reached[n_reached++] = j;
      }
    };
    add(first);
    int left = 0;  // number of remaining rows
    int rest[N];
    for (int j = 0; j < n; ++j)
      if (!is_taken_[j]) rest[left++] = j;
    for (int done = 0; done < n_reached && left > 0;) {
      double influence[N];  // of all listed rows: 0 where there is none
      for (int j = 0; j < n; ++j) influence[j] = 0.0;
      for (; done < n_reached; ++done) {
        const double* row = G + reached[done] * stride;
        for (int j = 0; j < n; ++j) influence[j] += fabs(row[j]);
      }
      int kept = 0;
      for (int r = 0; r < left; ++r) {
        const int j = rest[r];
        if (is_taken_[j]) continue;
        if (influence[j] != 0.0) add(j);
        else rest[kept++] = j;
      }
      left = kept;
    }
    n_own_ = 0;
    for (int i = 0; i < n; ++i)
      if (is_own[i]) own_[n_own_++] = i;
  }

  // Copies the rows of own_ to part_.
  FAN_FN void fill() {
    int singles = 0;
    while (singles < n_own_ && own_[singles] < n_single) ++singles;
    part_.resize(singles, (n_own_ - singles) / 3);
    part_.slides = slides ? slides_ : nullptr;
    part_.along = along_;
    for (int c = 0; c < part_.n_contacts; ++c) {
      const int from = (own_[singles + 3 * c] - n_single) / 3;
      part_.mu[c] = mu[from];
      slides_[c] = slides && slides[from];
      if (!slides_[c]) continue;
      along_[2 * c] = along[2 * from];
      along_[2 * c + 1] = along[2 * from + 1];
    }
    for (int first = 0, end = 0; first < n_own_; first = end) {
      // Columns that are adjacent in G, too.
      while (++end < n_own_ && own_[end] == own_[end - 1] + 1) {
      }
      for (int k = 0; k < n_own_; ++k)
        copy(G + own_[k] * stride + own_[first], end - first, part_.G + k * part_.stride + first);
    }
    for (int k = 0; k < n_own_; ++k) {
      const int i = own_[k];
      part_.b[k] = b[i];
      part_.lower[k] = lower[i];
      part_.upper[k] = upper[i];
      part_.x[k] = x[i];
    }
  }

  FAN_FN static void copy(const double* from, int n, double* to) {
    int i = 0;
    for (; i + 4 <= n; i += 4) quad(to + i) = quad(from + i);
    for (; i < n; ++i) to[i] = from[i];
  }

  int n_own_ = 0;
  int own_[N];
  bool is_taken_[N];
  bool slides_[N];  // of part_
  double along_[2 * N];
  Island part_;  // the current one of several islands
};

}  // namespace fan
