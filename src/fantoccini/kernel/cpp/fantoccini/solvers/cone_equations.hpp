// A problem of cone.hpp whose rows all influence one another: its law, the modes of its rows, and
// their linear equations for a Newton step. Rows of G are padded with zeros to a multiple of four.
#pragma once

#include "fantoccini/math/dense_ldl.hpp"
#include "fantoccini/math/real.hpp"
#include "fantoccini/solvers/cone_law.hpp"

namespace fan {

template <int capacity>
struct ConeEquations : ConeLaw {
  static constexpr int N = padded(array_size(capacity));

  int n_single = 0, n_contacts = 0;
  int n = 0, stride = 0;          // rows; the length of a row of G
  double G[N * N + 1];            // row i, column j at i * stride + j
  double b[N];                    // b below `negligible` becomes 0; padded with zeros
  double lower[N], upper[N];      // of a contact only the upper bound of the normal is used
  double mu[N];                   // of contact c
  const bool* slides = nullptr;   // whether the direction of contact c is given; null for none
  const double* along = nullptr;  // d of contact c at 2 c
  double x[N];                    // on entry the guess; of several solutions, one near it results
  double s[N];
  double speed = unbounded;     // the largest g |x - P(x - s / g)| of a row
  double residual = unbounded;  // the same relative to the largest |b_i|

  // Sets the sizes, before the arrays are filled; their padding is 0 then.
  FAN_FN void resize(int singles, int contacts) {
    n_single = singles;
    n_contacts = contacts;
    n = singles + 3 * contacts;
    stride = padded(n);
    if (stride == n) return;
    for (int end = stride; end <= n * stride; end += stride) quad(G + end - 4) = Quad{};
    quad(b + stride - 4) = Quad{};
  }

  // s of x.
  FAN_FN void find_s() {
    int i = 0;
    for (; i + 16 <= stride; i += 16) image<4>(i);
    for (; i + 8 <= stride; i += 8) image<2>(i);
    for (; i < stride; i += 4) image<1>(i);
  }

  // s, speed and residual of x.
  FAN_FN void measure() {
    find_s();
    speed = violation(0.0);
    residual = clip(speed / larger(scale_, negligible), 0.0, unbounded);
    known_to_ = residual > Tolerance::centred ? rounding() : 0.0;
  }

  // Whether the residual is within its tolerance, or as small as possible.
  FAN_FN bool is_exact() const { return residual <= larger(Tolerance::residual, known_to_); }

 protected:
  // An unknown of a sliding contact: x_n, or the part of x_T across the direction of sliding.
  struct Mixed {
    int unknown;
    bool is_normal;
    double direction[3], own;
  };

  // Rounding of s, relative to the largest |b_i|.
  FAN_FN double rounding() const {
    double most = 0.0;
    for (int i = 0; i < n; ++i) {
      double sum = 0.0;
      for (int j = 0; j < n; ++j) sum += fabs(G[i * stride + j] * x[j]);
      most = larger(most, sum);
    }
    const double relative = Tolerance::rounding_of_sum * most / larger(scale_, negligible);
    return relative < Tolerance::largest_rounding ? relative : Tolerance::largest_rounding;
  }

  FAN_FN bool is_given(int c) const { return slides && slides[c]; }

  FAN_FN int row_of(int c) const { return n_single + 3 * c; }

  // g of all rows, and the magnitudes of G and b.
  FAN_FN void weigh() {
    top_ = scale_ = 0.0;
    for (int i = 0; i < n; ++i) {
      scale_ = larger(scale_, fabs(b[i]));
      top_ = larger(top_, G[i * stride + i]);
    }
    if (top_ == 0.0) top_ = 1.0;
    const double least = Tolerance::smallest_influence * top_;
    for (int i = 0; i < n_single; ++i) g_[i] = larger(G[i * stride + i], least);
    for (int c = 0; c < n_contacts; ++c) {
      const int i = row_of(c);
      double sum = 0.0;
      for (int k = i; k < i + 3; ++k) sum += G[k * stride + k];
      g_[i] = g_[i + 1] = g_[i + 2] = larger(sum / 3.0, least);
    }
    for (int i = 0; i < n; ++i) inverse_g_[i] = 1.0 / g_[i];
  }

  // Clips y to its bounds, and moves a tangential part outside its disc to the nearest point of it.
  // Returns whether that changed anything.
  FAN_FN bool bound(double* y) const {
    bool changed = false;
    const auto set = [&](double& to, double value) {
      changed = changed || to != value;
      to = value;
    };
    for (int i = 0; i < n_single; ++i) set(y[i], clip(y[i], lower[i], upper[i]));
    for (int c = 0; c < n_contacts; ++c) {
      const int i = row_of(c);
      set(y[i], clip(y[i], 0.0, upper[i]));
      changed = slide(c, y + i, mu[c] * y[i]) || changed;
    }
    return changed;
  }

  // Moves the tangential part of y onto friction of this magnitude. Returns whether that changed
  // it.
  FAN_FN bool slide(int c, double* y, double radius) const {
    if (!is_given(c)) return shorten(y, radius);
    const double p = radius * along[2 * c], q = radius * along[2 * c + 1];
    const bool changed = y[1] != p || y[2] != q;
    y[1] = p;
    y[2] = q;
    return changed;
  }

  // s = G x - b of 4 `quads` rows from `first`; G is symmetric.
  template <int quads>
  FAN_FN void image(int first) {
    Quad sum[quads];
    FAN_UNROLL for (int q = 0; q < quads; ++q) sum[q] = -quad(b + first + 4 * q);
    const double *row = G + first, *const end = x + n;
    const int step = stride;
    for (const double* by = x; by < end; ++by, row += step) {
      FAN_UNROLL for (int q = 0; q < quads; ++q) sum[q] += *by * quad(row + 4 * q);
    }
    FAN_UNROLL for (int q = 0; q < quads; ++q) quad(s + first + 4 * q) = sum[q];
  }

  // Speed of the violation of the raised problem's law by x.
  FAN_FN double violation(double raise) const {
    double w[N], most = 0.0;
    for (int i = 0; i < n; ++i) w[i] = ahead(i, raise);
    for (int i = 0; i < n_single; ++i) w[i] = clip(w[i], lower[i], upper[i]);
    for (int c = 0; c < n_contacts; ++c) {
      const int i = row_of(c);
      w[i] = clip(w[i], 0.0, upper[i]);
      slide(c, w + i, mu[c] * larger(x[i], 0.0));
    }
    double sum = 0.0;  // NaN if any is
    for (int i = 0; i < n; ++i) {
      const double own = g_[i] * fabs(x[i] - w[i]);
      most = larger(most, own);
      sum += own;
    }
    return is_finite(sum) ? most : unbounded;
  }

  // x - s / g of row i of the raised problem.
  FAN_FN double ahead(int i, double raise) const {
    return x[i] - (s[i] + raise * (x[i] - centre_[i])) * inverse_g_[i];
  }

  // Finds the part of x that the modes of the rows fix (base_), and the unknowns.
  FAN_FN void choose(double raise) {
    m_ = n_mixed_ = 0;
    fixed_ = false;
    for (int i = 0; i < n; ++i) base_[i] = 0.0;
    for (int i = 0; i < n_single; ++i) {
      const double w = ahead(i, raise);
      if (w > lower[i] && w < upper[i]) row_[m_++] = i;
      else fix(i, w <= lower[i] ? lower[i] : upper[i]);
    }
    for (int c = 0; c < n_contacts; ++c) choose_contact(c, raise);
  }

  FAN_FN void choose_contact(int c, double raise) {
    const int i = row_of(c);
    const double normal = ahead(i, raise), p = ahead(i + 1, raise), q = ahead(i + 2, raise);
    if (!(normal > 0.0)) return;
    const bool full = normal >= upper[i];
    if (full) fix(i, upper[i]);
    if (is_given(c)) {
      const double *d = along + 2 * c, size = mu[c] * base_[i];
      fix(i + 1, size * d[0]);
      fix(i + 2, size * d[1]);
      if (!full) mix(i, 1.0, mu[c] * d[0], mu[c] * d[1], 0.0);
      return;
    }
    const double radius = mu[c] * (full ? upper[i] : normal), size = length(p, q);
    if (size <= radius && radius > 0.0) {
      for (int k = full; k < 3; ++k) row_[m_++] = i + k;
      return;
    }
    const double along = size > 0.0 ? p / size : 0.0, across = size > 0.0 ? q / size : 0.0;
    fix(i + 1, mu[c] * base_[i] * along);
    fix(i + 2, mu[c] * base_[i] * across);
    if (!full) mix(i, 1.0, mu[c] * along, mu[c] * across, 0.0);
    if (radius > Tolerance::smallest_disc * size)
      mix(i, 0.0, -across, along, (size - radius) / radius * g_[i]);
  }

  FAN_FN void fix(int i, double value) {
    base_[i] = value;
    fixed_ = fixed_ || value != 0.0;
  }

  // Adds an unknown that moves x along a direction in the rows of a contact, and its own part of
  // its equation. The equation is that of the normal, or of the tangents along the direction.
  FAN_FN void mix(int row, double normal, double p, double q, double own) {
    mixed_[n_mixed_++] = {m_, normal != 0.0, {normal, p, q}, own};
    row_[m_++] = row;
  }

  // x from the equations of the unknowns: s = 0 in the row or, of tangents, along the direction.
  FAN_FN bool step(double raise) {
    double right[N], z[N], y[N];
    for (int i = 0; i < n; ++i) right[i] = b[i] + raise * (centre_[i] - base_[i]);
    for (int j = 0; j < n && fixed_; ++j)
      for (int i = 0; i < n && base_[j] != 0.0; ++i) right[i] -= base_[j] * G[j * stride + i];
    if (n_mixed_ == 0 && factorise_symmetric(raise)) {
      for (int a = 0; a < m_; ++a) z[a] = right[row_[a]];
    } else if (!factorise(raise, right, z)) {
      return false;
    }
    substitute(z);
    for (int i = 0; i < n; ++i) y[i] = base_[i];
    add_unknowns(z, y);
    for (int i = 0; i < n; ++i)
      if (!is_finite(y[i]) && y[i] != base_[i]) return false;
    for (int i = 0; i < n; ++i) x[i] = y[i];
    return true;
  }

  FAN_FN void substitute(double* z) const {
    if (is_symmetric_) ldl_.substitute(z);
    else lu_.substitute(z);
  }

  // The factor of the equations if no unknown is mixed.
  FAN_FN bool factorise_symmetric(double raise) {
    ldl_.resize(m_);
    for (int a = 0; a < m_; ++a) {
      const double* image = G + row_[a] * stride;
      double* out = ldl_.A + a * ldl_.stride;
      const int first = a / 4 * 4;
      if (m_ == n)
        for (int d = first; d < stride; d += 4) quad(out + d) = quad(image + d);
      else
        for (int d = first; d < ldl_.stride; ++d) out[d] = d < m_ ? image[row_[d]] : 0.0;
      out[a] += raise;
    }
    return is_symmetric_ = ldl_.factorise();
  }

  // The factor of all equations, and their right-hand side.
  FAN_FN bool factorise(double raise, const double* right, double* z) {
    is_symmetric_ = false;
    lu_.resize(m_);
    for (int a = 0, next = 0; a < m_; ++a) {
      if (next < n_mixed_ && mixed_[next].unknown == a) {
        z[a] = equation(mixed_[next++], raise, right);
        continue;
      }
      double* out = lu_.A + a * lu_.stride;
      write(G + row_[a] * stride, out);
      out[a] += raise;
      z[a] = right[row_[a]];
    }
    return lu_.factorise();
  }

  // One refinement of a solution with the current factor, which removes the raise's part; kept if
  // the residual decreases.
  FAN_FN void refine() {
    double z[N], held[N];
    const double before = residual;
    for (int i = 0; i < n; ++i) held[i] = x[i];
    for (int a = 0; a < m_; ++a) z[a] = -s[row_[a]];
    for (int k = 0; k < n_mixed_; ++k) {
      const Mixed& mixed = mixed_[k];
      const double *w = mixed.direction, *own = x + row_[mixed.unknown];
      if (!mixed.is_normal)
        z[mixed.unknown] = -w[1] * (s[row_[mixed.unknown] + 1] + mixed.own * own[1]) -
                           w[2] * (s[row_[mixed.unknown] + 2] + mixed.own * own[2]);
    }
    substitute(z);
    add_unknowns(z, x);
    bound(x);
    measure();
    if (residual < before) return;
    for (int i = 0; i < n; ++i) x[i] = held[i];
    measure();
  }

  // y <- y + contribution of the unknowns z to x.
  FAN_FN void add_unknowns(double* z, double* y) const {
    for (int k = 0; k < n_mixed_; ++k) {
      const Mixed& mixed = mixed_[k];
      for (int j = 0; j < 3; ++j)
        y[row_[mixed.unknown] + j] += z[mixed.unknown] * mixed.direction[j];
      z[mixed.unknown] = 0.0;
    }
    for (int a = 0; a < m_; ++a) y[row_[a]] += z[a];
  }

  // The parts of the unknowns in a row of G.
  FAN_FN void write(const double* image, double* out) const {
    for (int d = 0; d < m_; ++d) out[d] = image[row_[d]];
    for (int d = m_; d < lu_.stride; ++d) out[d] = 0.0;
    for (int k = 0; k < n_mixed_; ++k) {
      const double *w = mixed_[k].direction, *y = image + row_[mixed_[k].unknown];
      out[mixed_[k].unknown] = w[0] * y[0] + w[1] * y[1] + w[2] * y[2];
    }
  }

  // The row of the matrix of a mixed unknown; returns the right-hand side.
  FAN_FN double equation(const Mixed& of, double raise, const double* right) {
    const int i = row_[of.unknown];
    const double share[3] = {
        double(of.is_normal), of.is_normal ? 0.0 : of.direction[1],
        of.is_normal ? 0.0 : of.direction[2]};
    double image[N], sum = 0.0;
    for (int j = 0; j < n; ++j)
      image[j] = share[0] * G[i * stride + j] + share[1] * G[(i + 1) * stride + j] +
                 share[2] * G[(i + 2) * stride + j];
    for (int k = 0; k < 3; ++k) {
      image[i + k] += raise * share[k];
      sum += share[k] * right[i + k];
    }
    double* out = lu_.A + of.unknown * lu_.stride;
    write(image, out);
    out[of.unknown] += of.own;
    return sum;
  }

  int m_ = 0, n_mixed_ = 0;         // unknowns, and mixed ones
  double top_ = 0.0, scale_ = 0.0;  // the largest G_ii and |b_i|
  double known_to_ = 0.0;           // rounding of the residual, if not small
  double g_[N], inverse_g_[N], centre_[N], base_[N];
  bool fixed_ = false;  // whether base_ has nonzero numbers
  Mixed mixed_[N];
  int row_[N];                 // of every unknown; of a mixed one the first of its contact
  bool is_symmetric_ = false;  // kind of the last step's factor
  DenseLdl<capacity> ldl_;
  DenseLu<capacity> lu_;
};

}  // namespace fan
