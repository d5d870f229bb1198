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
#pragma once

#include "cone_law.hpp"
#include "dense_lu.hpp"
#include "real.hpp"

namespace fan {

template <int capacity>
struct ConeProblem : ConeLaw {
  static constexpr int N = room(capacity);

  int n_single = 0, n_contacts = 0;  // n = n_single + 3 n_contacts rows: singles, then contacts
  double G[N * N];                   // row i, column j at i * n + j
  double b[N];                       // solve() sets b below `negligible` to 0
  double lower[N], upper[N];  // of a contact only the upper bound of the normal counts
  double mu[N];               // of contact c
  const bool* slides = nullptr;     // of contact c, whether its direction is given; null for none
  const double* along = nullptr;    // d of contact c at 2 c
  double x[N];                // on entry the guess; of many solutions the result is one near it
  double s[N];
  // The largest g |x - P(x - s / g)| of a row (a speed), relative to the largest |b_i|.
  double residual = unbounded;
  int iterations = 0;  // steps of Newton's method
  int rounds = 0;      // rounds of the method of multipliers

  // Whether the law holds, up to the residual. If not, x is the best that was found within the
  // bounds, or 0 where the problem has numbers that are not finite or bounds that are crossed.
  FAN_FN bool solve() {
    n_ = n_single + 3 * n_contacts;
    iterations = rounds = 0;
    residual = best_residual_ = unbounded;
    if (n_ > capacity || !is_valid()) return false;
    weigh();
    const bool guessed = take_guess();
    for (int i = 0; i < n_; ++i) best_[i] = x[i];
    bool done = newton(Tolerance::raise, Tolerance::steps, Tolerance::steps);
    if (!done && guessed) {
      for (int i = 0; i < n_; ++i) x[i] = 0.0;
      done = newton(Tolerance::raise, Tolerance::steps, Tolerance::steps);
    }
    for (int k = 0; k < Tolerance::attempts && !done; ++k) {
      multipliers(Tolerance::rounds << k);
      done = newton(Tolerance::firm_raise, Tolerance::patience, Tolerance::firm_steps);
    }
    if (done) return true;
    for (int i = 0; i < n_; ++i) x[i] = best_[i];
    bound(x);
    measure();
    return residual <= Tolerance::residual;
  }

  // Solves, from zero, a problem whose rows yield a little: `share` of G's largest diagonal entry is
  // added to its diagonal. Where forces jam, it has a solution although the law has none. s and
  // residual are then those of the law itself. Call it after solve() has failed.
  FAN_FN bool solve_softly(double share) {
    double firm[N];
    for (int i = 0; i < n_; ++i) {
      firm[i] = G[i * (n_ + 1)];
      G[i * (n_ + 1)] += share * top_;
      x[i] = 0.0;
    }
    const bool solved = solve();
    for (int i = 0; i < n_; ++i) G[i * (n_ + 1)] = firm[i];
    if (residual < unbounded) measure();
    return solved;
  }

 private:
  FAN_FN int row_of(int c) const { return n_single + 3 * c; }

  // Whether all numbers are finite and the bounds in order. If not, x and s are 0.
  FAN_FN bool is_valid() {
    bool valid = true;
    for (int i = 0; i < n_ * n_; ++i) valid = valid && is_finite(G[i]);
    for (int i = 0; i < n_; ++i) valid = valid && is_finite(b[i]);
    for (int i = 0; i < n_single; ++i) valid = valid && lower[i] <= upper[i];
    for (int c = 0; c < n_contacts; ++c)
      valid = valid && mu[c] >= 0.0 && is_finite(mu[c]) && upper[row_of(c)] >= 0.0;
    for (int i = 0; i < n_ && !valid; ++i) x[i] = s[i] = 0.0;
    return valid;
  }

  // g of all rows, and the sizes of G and b.
  FAN_FN void weigh() {
    top_ = scale_ = 0.0;
    for (int i = 0; i < n_; ++i) {
      if (fabs(b[i]) < negligible) b[i] = 0.0;
      scale_ = larger(scale_, fabs(b[i]));
      top_ = larger(top_, G[i * n_ + i]);
    }
    if (top_ == 0.0) top_ = 1.0;
    const double least = Tolerance::smallest_influence * top_;
    for (int i = 0; i < n_single; ++i) g_[i] = larger(G[i * n_ + i], least);
    for (int c = 0; c < n_contacts; ++c) {
      const int i = row_of(c);
      double sum = 0.0;
      for (int k = i; k < i + 3; ++k) sum += G[k * n_ + k];
      g_[i] = g_[i + 1] = g_[i + 2] = larger(sum / 3.0, least);
    }
  }

  // Whether there is a guess other than 0.
  FAN_FN bool take_guess() {
    bool guessed = false;
    for (int i = 0; i < n_; ++i) {
      if (!is_finite(x[i])) x[i] = 0.0;
      guessed = guessed || x[i] != 0.0;
    }
    return guessed;
  }

  // y within its bounds; a tangential part outside its disc moves to the nearest point of it.
  FAN_FN void bound(double* y) const {
    for (int i = 0; i < n_single; ++i) y[i] = clip(y[i], lower[i], upper[i]);
    for (int c = 0; c < n_contacts; ++c) {
      const int i = row_of(c);
      y[i] = clip(y[i], 0.0, upper[i]);
      slide(c, y + i, mu[c] * y[i]);
    }
  }

  // The tangential part of y to where friction of this size puts it.
  FAN_FN void slide(int c, double* y, double radius) const {
    if (!(slides && slides[c])) return shorten(y, radius);
    y[1] = radius * along[2 * c];
    y[2] = radius * along[2 * c + 1];
  }

  // s and the residual of x.
  FAN_FN void measure() {
    for (int i = 0; i < n_; ++i) s[i] = -b[i];
    for (int j = 0; j < n_; ++j)
      if (x[j] != 0.0) add_multiple(s, x[j], G + j * n_, n_);
    residual = clip(violation(0.0) / larger(scale_, negligible), 0.0, unbounded);
  }

  // The speed by which x breaks the law of the raised problem.
  FAN_FN double violation(double raise) const {
    double w[N], most = 0.0;
    for (int i = 0; i < n_; ++i) w[i] = ahead(i, raise);
    for (int i = 0; i < n_single; ++i) w[i] = clip(w[i], lower[i], upper[i]);
    for (int c = 0; c < n_contacts; ++c) {
      const int i = row_of(c);
      w[i] = clip(w[i], 0.0, upper[i]);
      slide(c, w + i, mu[c] * larger(x[i], 0.0));
    }
    for (int i = 0; i < n_; ++i) most = larger(most, g_[i] * fabs(x[i] - w[i]));
    return most;
  }

  // x - s / g of row i of the raised problem.
  FAN_FN double ahead(int i, double raise) const {
    return x[i] - (s[i] + raise * (x[i] - centre_[i])) / g_[i];
  }

  // Newton's method from x; `patience` are the steps for one centre, `most` those for all. Whether
  // x is a solution; if not, x is the last centre.
  FAN_FN bool newton(double share, int patience, int most) {
    int tries = 0;
    for (int i = 0; i < n_; ++i) centre_[i] = x[i];
    for (int k = 0; k < most && share < Tolerance::firmest_raise; ++k) {
      measure();
      if (is_solution()) {
        if (tries > 0) refine();
        return true;
      }
      if (tries > 0 && violation(share * top_) < Tolerance::centred * scale_) {
        for (int i = 0; i < n_; ++i) centre_[i] = x[i];
        share = larger(share * Tolerance::softer, Tolerance::raise);
        tries = 0;
      } else if (tries >= patience) {
        for (int i = 0; i < n_; ++i) x[i] = centre_[i];
        measure();
        share *= Tolerance::firmer;
        tries = 0;
      }
      choose(share * top_);
      if (!step(share * top_)) break;
      ++iterations;
      ++tries;
    }
    for (int i = 0; i < n_; ++i) x[i] = centre_[i];
    return false;
  }

  // Whether x, put within its bounds, is a solution. Keeps the best x.
  FAN_FN bool is_solution() {
    if (residual <= Tolerance::residual) {
      bound(x);
      measure();
    }
    if (residual < best_residual_) {
      best_residual_ = residual;
      for (int i = 0; i < n_; ++i) best_[i] = x[i];
    }
    return residual <= Tolerance::residual;
  }

  // What the modes of the rows fix of x (base_), and the unknowns.
  FAN_FN void choose(double raise) {
    m_ = 0;
    for (int i = 0; i < n_; ++i) base_[i] = 0.0;
    for (int i = 0; i < n_single; ++i) {
      const double w = ahead(i, raise);
      if (w > lower[i] && w < upper[i]) add_unknown(i, 1, 1.0, 0.0, 0.0, 0.0);
      else base_[i] = w <= lower[i] ? lower[i] : upper[i];
    }
    for (int c = 0; c < n_contacts; ++c) choose_contact(c, raise);
  }

  FAN_FN void choose_contact(int c, double raise) {
    const int i = row_of(c);
    const double normal = ahead(i, raise), p = ahead(i + 1, raise), q = ahead(i + 2, raise);
    if (!(normal > 0.0)) return;
    const bool full = normal >= upper[i];
    if (full) base_[i] = upper[i];
    if (slides && slides[c]) {
      const double *d = along + 2 * c, size = mu[c] * base_[i];
      base_[i + 1] = size * d[0];
      base_[i + 2] = size * d[1];
      if (!full) add_unknown(i, 3, 1.0, mu[c] * d[0], mu[c] * d[1], 0.0);
      return;
    }
    const double radius = mu[c] * (full ? upper[i] : normal), size = length(p, q);
    if (size <= radius && radius > 0.0) {
      if (!full) add_unknown(i, 3, 1.0, 0.0, 0.0, 0.0);
      add_unknown(i, 3, 0.0, 1.0, 0.0, 0.0);
      add_unknown(i, 3, 0.0, 0.0, 1.0, 0.0);
      return;
    }
    const double along = size > 0.0 ? p / size : 0.0, across = size > 0.0 ? q / size : 0.0;
    base_[i + 1] = mu[c] * base_[i] * along;
    base_[i + 2] = mu[c] * base_[i] * across;
    if (!full) add_unknown(i, 3, 1.0, mu[c] * along, mu[c] * across, 0.0);
    if (radius > Tolerance::smallest_disc * size)
      add_unknown(i, 3, 0.0, -across, along, (size - radius) / radius * g_[i]);
  }

  // An unknown that moves x along a direction over `width` rows, and its own part of its equation.
  FAN_FN void add_unknown(int row, int width, double first, double p, double q, double own) {
    row_[m_] = row;
    width_[m_] = width;
    direction_[m_][0] = first;
    direction_[m_][1] = p;
    direction_[m_][2] = q;
    own_[m_++] = own;
  }

  // x from the equations of the unknowns: s = 0 in the row or, of tangents, along the direction.
  FAN_FN bool step(double raise) {
    double right[N], z[N], y[N];
    for (int i = 0; i < n_; ++i) right[i] = b[i] + raise * (centre_[i] - base_[i]);
    for (int j = 0; j < n_; ++j)
      if (base_[j] != 0.0) add_multiple(right, -base_[j], G + j * n_, n_);
    lu_.n = m_;
    for (int a = 0; a < m_; ++a) z[a] = equation(a, raise, right);
    if (!lu_.factorise()) return false;
    lu_.substitute(z);
    for (int i = 0; i < n_; ++i) y[i] = base_[i];
    add_directions(z, y);
    for (int i = 0; i < n_; ++i)
      if (!is_finite(y[i]) && y[i] != base_[i]) return false;
    for (int i = 0; i < n_; ++i) x[i] = y[i];
    return true;
  }

  // One refinement of a solution with the factor at hand, which removes the raise's part; kept
  // where the residual becomes smaller.
  FAN_FN void refine() {
    double z[N], held[N];
    const double before = residual;
    for (int i = 0; i < n_; ++i) held[i] = x[i];
    for (int a = 0; a < m_; ++a) {
      z[a] = 0.0;
      for (int k = 0; k < width_[a]; ++k)
        z[a] -= part(a, k) * s[row_[a] + k] + own_[a] * direction_[a][k] * x[row_[a] + k];
    }
    lu_.substitute(z);
    add_directions(z, x);
    bound(x);
    measure();
    if (residual < before) return;
    for (int i = 0; i < n_; ++i) x[i] = held[i];
    measure();
  }

  FAN_FN void add_directions(const double* z, double* y) const {
    for (int a = 0; a < m_; ++a)
      for (int k = 0; k < width_[a]; ++k) y[row_[a] + k] += z[a] * direction_[a][k];
  }

  // What row k of unknown a's block counts in its equation; of a normal only itself.
  FAN_FN double part(int a, int k) const {
    return direction_[a][0] == 0.0 ? direction_[a][k] : k == 0 ? 1.0 : 0.0;
  }

  // Row a of the matrix; returns the right side.
  FAN_FN double equation(int a, double raise, const double* right) {
    double image[N], sum = 0.0;
    for (int j = 0; j < n_; ++j) image[j] = 0.0;
    for (int k = 0; k < width_[a]; ++k) {
      const int i = row_[a] + k;
      const double share = part(a, k);
      if (share == 0.0) continue;
      add_multiple(image, share, G + i * n_, n_);
      image[i] += raise * share;
      sum += right[i] * share;
    }
    double* out = lu_.A + a * m_;
    for (int d = 0; d < m_; ++d) {
      const double *w = direction_[d], *y = image + row_[d];
      out[d] = width_[d] == 1 ? y[0] : w[0] * y[0] + w[1] * y[1] + w[2] * y[2];
    }
    out[a] += own_[a];
    return sum;
  }

  // x from the method of multipliers, from x: y is x within the cones; z becomes s, with mu |s_T|
  // added to s_n.
  FAN_FN void multipliers(int most) {
    double y[N], z[N], r[N];
    lu_.n = n_;
    for (int i = 0; i < n_ * n_; ++i) lu_.A[i] = G[i];
    for (int i = 0; i < n_; ++i)
      lu_.A[i * n_ + i] += (Tolerance::penalty + Tolerance::hold) * g_[i];
    if (!lu_.factorise()) return;
    for (int i = 0; i < n_; ++i) {
      y[i] = x[i];
      z[i] = 0.0;
    }
    for (int k = 0; k < most; ++k) {
      for (int i = 0; i < n_; ++i)
        r[i] = b[i] + z[i] + g_[i] * (Tolerance::hold * x[i] + Tolerance::penalty * y[i]);
      for (int c = 0; c < n_contacts; ++c) {
        const int i = row_of(c);
        r[i] -= mu[c] * length(z[i + 1], z[i + 2]);
      }
      lu_.substitute(r);
      for (int i = 0; i < n_; ++i) {
        x[i] = r[i];
        r[i] = y[i] + Tolerance::relaxation * (r[i] - y[i]) - z[i] / (Tolerance::penalty * g_[i]);
        y[i] = r[i];
      }
      for (int c = 0; c < n_contacts; ++c) project(y + row_of(c), mu[c]);
      bound(y);
      for (int i = 0; i < n_; ++i) z[i] = Tolerance::penalty * g_[i] * (y[i] - r[i]);
    }
    rounds += most;
    for (int i = 0; i < n_; ++i) x[i] = y[i];
  }

  int n_ = 0, m_ = 0;  // rows, unknowns
  double top_ = 0.0, scale_ = 0.0;  // the largest G_ii and |b_i|
  double best_residual_ = unbounded;
  double g_[N], centre_[N], best_[N], base_[N], own_[N], direction_[N][3];
  int row_[N], width_[N];
  DenseLu<capacity> lu_;
};

}  // namespace fan
