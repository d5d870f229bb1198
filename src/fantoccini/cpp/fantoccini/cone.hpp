// Impulses of strings and of contacts with exact Coulomb friction, at one instant:
//
//   s = G x - b      (G symmetric, positive semidefinite, often singular: redundant contacts)
//
// Single rows (strings, limits):  lower <= x <= upper,  s >= 0 where x = lower,  s <= 0 where
// x = upper,  s = 0 between. Contacts of three rows, the normal n and two tangents T:
//
//   0 <= x_n <= upper_n, with s_n as above;   |x_T| <= mu x_n,
//   s_T = 0 where |x_T| < mu x_n,   x_T = -mu x_n s_T / |s_T| elsewhere
//
// The law holds where x is a fixed point of x <- P(x - s / g), with g > 0 the mean of G's diagonal
// over a row or a contact, and P onto the bounds and the disc of radius mu x_n (Alart and Curnier,
// Computer Methods in Applied Mechanics and Engineering 92, 1991). Semi-smooth Newton: x - s / g
// says which rows are at a bound, which contacts are open, stick or slide; these fix some of x and
// leave linear equations for the rest. A sliding contact keeps two unknowns: x_n, which takes
// mu x_n d with it along the direction d of sliding, and the part of x_T across d.
//
// A contact may have a given direction d of sliding instead: x_T = mu x_n d whatever s_T is.
//
// G + raise takes the place of G and b + raise centre that of b (proximal point: Rockafellar, SIAM
// Journal on Control and Optimization 14, 1976). When that problem is solved the centre moves to
// its solution, so that the limit is exact. The raise is small at first. Where Newton cycles, the
// start comes from the alternating direction method of multipliers, for the form of the law with
// the second-order cone (De Saxce; Acary, Bremond and Huber, Lecture Notes in Applied and
// Computational Mechanics 86, 2018), and the raise adapts itself: firmer after each failure, softer
// after each success.
//
// Rows that do not influence one another, even through others, are islands: each is solved by
// itself (cone_island.hpp).
#pragma once

#include "cone_island.hpp"

namespace fan {

template <int capacity>
struct ConeProblem : ConeLaw {
  static constexpr int N = room(capacity);

  int n_single = 0, n_contacts = 0;  // n = n_single + 3 n_contacts rows: singles, then contacts
  double G[N * N + 1];               // row i, column j at i * n + j; whoever writes may pass its end
  double b[N];                       // solve() sets b below `negligible` to 0
  double lower[N], upper[N];  // of a contact only the upper bound of the normal counts
  double mu[N];               // of contact c
  const bool* slides = nullptr;   // of contact c, whether its direction is given; null for none
  const double* along = nullptr;  // d of contact c at 2 c
  bool is_hard = false;       // Newton's method has failed on it: others go first
  double x[N];                // on entry the guess; of many solutions the result is one near it
  double s[N];
  // The largest g |x - P(x - s / g)| of a row (a speed), relative to the largest |b_i|.
  double residual = unbounded;
  int iterations = 0;  // steps of Newton's method
  int rounds = 0;      // rounds of the method of multipliers

  // Whether the law holds, up to the residual. If not, x is the best that was found within the
  // bounds, or 0 where the problem has numbers that are not finite or bounds that are crossed.
  FAN_FN bool solve() { return solve_islands(0.0); }

  // Solves, from zero, a problem whose rows yield a little: `share` of G's largest diagonal entry is
  // added to its diagonal. Where forces jam, it has a solution although the law has none. s and
  // residual are then those of the law itself. Call it after solve() has failed.
  FAN_FN bool solve_softly(double share) {
    for (int i = 0; i < n_; ++i) x[i] = 0.0;
    double top = 0.0;
    for (int i = 0; i < n_; ++i) top = larger(top, G[i * n_ + i]);
    return solve_islands(share * (top > 0.0 ? top : 1.0));
  }

 private:
  FAN_FN bool solve_islands(double yielding) {
    n_ = n_single + 3 * n_contacts;
    iterations = rounds = 0;
    residual = unbounded;
    if (n_ > capacity || !is_valid()) return false;
    double scale = negligible, worst = 0.0;
    for (int i = 0; i < n_; ++i) {
      if (fabs(b[i]) < negligible) b[i] = 0.0;
      scale = larger(scale, fabs(b[i]));
      is_taken_[i] = false;
    }
    bool solved = true;
    for (int i = 0; i < n_; ++i) {
      if (is_taken_[i]) continue;
      collect(i);
      fill(yielding);
      solved = island_.solve(is_hard) && solved;
      if (yielding > 0.0) {
        for (int k = 0; k < island_.n; ++k) island_.G[k * (island_.stride + 1)] = G[own_[k] * (n_ + 1)];
        island_.measure();
      }
      for (int k = 0; k < island_.n; ++k) {
        x[own_[k]] = island_.x[k];
        s[own_[k]] = island_.s[k];
      }
      iterations += island_.iterations;
      rounds += island_.rounds;
      worst = larger(worst, island_.speed);
    }
    residual = clip(worst / scale, 0.0, unbounded);
    return solved;
  }

  // Whether all numbers are finite and the bounds in order. If not, x and s are 0.
  FAN_FN bool is_valid() {
    const double size = sum_of_squares(G, n_ * n_);  // nan with a number that is nan
    bool valid = size < Tolerance::largest_number * Tolerance::largest_number;
    for (int i = 0; i < n_; ++i) valid = valid && is_finite(b[i]);
    for (int i = 0; i < n_single; ++i) valid = valid && lower[i] <= upper[i];
    for (int c = 0; c < n_contacts; ++c)
      valid = valid && mu[c] >= 0.0 && is_finite(mu[c]) && upper[n_single + 3 * c] >= 0.0;
    for (int i = 0; i < n_ && !valid; ++i) x[i] = s[i] = 0.0;
    return valid;
  }

  // Four sums of four at a time: each addition waits for the one before.
  FAN_FN static double sum_of_squares(const double* x, int n) {
    Quad sum[4] = {};
    int i = 0;
    for (; i + 16 <= n; i += 16)
      FAN_UNROLL for (int q = 0; q < 4; ++q) sum[q] += quad(x + i + 4 * q) * quad(x + i + 4 * q);
    const Quad all = (sum[0] + sum[1]) + (sum[2] + sum[3]);
    double rest = 0.0;
    for (; i < n; ++i) rest += x[i] * x[i];
    return (all[0] + all[1]) + (all[2] + all[3]) + rest;
  }

  // Lists in own_ the rows of the island of row `first`, in order; rows of one contact go together.
  FAN_FN void collect(int first) {
    int found[N], n_found = 0;
    bool is_own[N];
    for (int i = 0; i < n_; ++i) is_own[i] = false;
    const auto add = [&](int i) {
      const bool single = i < n_single;
      const int begin = single ? i : i - (i - n_single) % 3;
      for (int j = begin; j < begin + (single ? 1 : 3); ++j) {
        is_own[j] = is_taken_[j] = true;
        found[n_found++] = j;
      }
    };
    add(first);
    int left = 0;  // rows that are not taken
    int rest[N];
    for (int j = 0; j < n_; ++j)
      if (!is_taken_[j]) rest[left++] = j;
    for (int done = 0; done < n_found && left > 0;) {
      double influence[N];  // of all that were found last: 0 where there is none
      for (int j = 0; j < n_; ++j) influence[j] = 0.0;
      for (; done < n_found; ++done) {
        const double* row = G + found[done] * n_;
        for (int j = 0; j < n_; ++j) influence[j] += fabs(row[j]);
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
    for (int i = 0; i < n_; ++i)
      if (is_own[i]) own_[n_own_++] = i;
  }

  // Gives the rows of own_ to island_, with more on G's diagonal.
  FAN_FN void fill(double yielding) {
    int singles = 0;
    while (singles < n_own_ && own_[singles] < n_single) ++singles;
    island_.resize(singles, (n_own_ - singles) / 3);
    for (int c = 0; c < island_.n_contacts; ++c) {
      const int from = (own_[singles + 3 * c] - n_single) / 3;
      island_.mu[c] = mu[from];
      island_.slides[c] = slides && slides[from];
      if (!island_.slides[c]) continue;
      island_.along[2 * c] = along[2 * from];
      island_.along[2 * c + 1] = along[2 * from + 1];
    }
    for (int first = 0, end = 0; first < n_own_; first = end) {
      // Columns that follow one another in G, too.
      while (++end < n_own_ && own_[end] == own_[end - 1] + 1) {}
      for (int k = 0; k < n_own_; ++k)
        copy(G + own_[k] * n_ + own_[first], end - first,
             island_.G + k * island_.stride + first);
    }
    for (int k = 0; k < n_own_; ++k) {
      const int i = own_[k];
      island_.G[k * (island_.stride + 1)] += yielding;
      island_.b[k] = b[i];
      island_.lower[k] = lower[i];
      island_.upper[k] = upper[i];
      island_.x[k] = x[i];
    }
  }

  FAN_FN static void copy(const double* from, int n, double* to) {
    int i = 0;
    for (; i + 4 <= n; i += 4) quad(to + i) = quad(from + i);
    for (; i < n; ++i) to[i] = from[i];
  }

  int n_ = 0, n_own_ = 0;
  int own_[N];
  bool is_taken_[N];
  ConeIsland<capacity> island_;
};

}  // namespace fan
