// Distribution of contact forces: of all impulses with the same motion, those of least norm.
//
//   x -> x + D (y* - y),   y* the projection of y on the range of A = D^T G D
//
// The columns of D are unit vectors: the three of a point at rest, and, for a sliding point, the
// one along which it keeps its friction. A y* = A y, so the velocities are unchanged. If y* leaves
// a cone, x moves towards it as far as all cones allow. Strings keep their tensions.
#pragma once

#include "fantoccini/solvers/cone.hpp"

namespace fan {

struct ContactShareTolerances {
  // Speed below which a point is at rest, relative to the largest in the problem.
  static constexpr double still = 1e-8;
  // Raise of A's diagonal, relative to its largest entry, and rounds of refinement that remove its
  // error.
  static constexpr double raise = 1e-8;
  static constexpr int rounds = 3;
  // Bisections of the step to the least norm; relative distance by which |x_T| may exceed its cone.
  static constexpr int halvings = 30;
  static constexpr double rounding = 1e-12;
};

template <int capacity>
class ContactShare {
 public:
  using Problem = ConeProblem<capacity>;

  // Replaces the impulses (3 n_contacts) of a solved problem.
  void find(const Problem& of, double* x) {
    n_ = of.n_single + 3 * of.n_contacts;
    const int first = of.n_single;
    choose(of);
    for (int i = first; i < n_; ++i) x[i - first] = of.x[i];
    if (m_ < 2 || !factorise(of)) return;
    double y[capacity], least[capacity], left[capacity];
    for (int a = 0; a < m_; ++a) {
      y[a] = along(a, of.x);
      least[a] = 0.0;
    }
    for (int k = 0; k < Tolerance::rounds; ++k) {
      for (int a = 0; a < m_; ++a) {
        left[a] = 0.0;
        for (int b = 0; b < m_; ++b) left[a] += A_[a * m_ + b] * (y[b] - least[b]);
      }
      lu_.substitute(left);
      for (int a = 0; a < m_; ++a) least[a] += left[a];
    }
    double step[capacity] = {};
    for (int a = 0; a < m_; ++a)
      for (int d = 0; d < width_[a]; ++d)
        step[row_[a] + d - first] += (least[a] - y[a]) * direction_[a][d];
    double part = 1.0;
    if (!allowed(of, x, step, 1.0)) {
      double low = 0.0, high = 1.0;
      for (int k = 0; k < Tolerance::halvings; ++k) {
        part = 0.5 * (low + high);
        (allowed(of, x, step, part) ? low : high) = part;
      }
      part = low;
    }
    for (int i = 0; i < 3 * of.n_contacts; ++i) x[i] += part * step[i];
  }

 private:
  using Tolerance = ContactShareTolerances;

  // The columns of D.
  void choose(const Problem& of) {
    double most = 0.0;
    for (int i = 0; i < n_; ++i) most = fabs(of.b[i]) > most ? fabs(of.b[i]) : most;
    const double still = Tolerance::still * most;
    m_ = 0;
    for (int c = 0; c < of.n_contacts; ++c) {
      const int i = of.n_single + 3 * c;
      const double p = of.s[i + 1], q = of.s[i + 2], slides = sqrt(p * p + q * q), mu = of.mu[c];
      if (fabs(of.s[i]) > still) continue;
      if (of.slides && of.slides[c]) {
        const double size = 1.0 / sqrt(1.0 + mu * mu);
        add(i, 3, size, size * mu * of.along[2 * c], size * mu * of.along[2 * c + 1]);
      } else if (slides <= still && mu > 0.0) {
        add(i, 3, 1.0, 0.0, 0.0);
        add(i, 3, 0.0, 1.0, 0.0);
        add(i, 3, 0.0, 0.0, 1.0);
      } else {
        const double size = 1.0 / sqrt(1.0 + mu * mu), share = slides > 0.0 ? mu / slides : 0.0;
        add(i, 3, size, -size * share * p, -size * share * q);
      }
    }
  }

  void add(int row, int width, double n, double p, double q) {
    row_[m_] = row;
    width_[m_] = width;
    direction_[m_][0] = n;
    direction_[m_][1] = p;
    direction_[m_++][2] = q;
  }

  double along(int a, const double* x) const {
    double sum = 0.0;
    for (int d = 0; d < width_[a]; ++d) sum += direction_[a][d] * x[row_[a] + d];
    return sum;
  }

  bool factorise(const Problem& of) {
    double most = 0.0;
    for (int a = 0; a < m_; ++a) {
      double image[capacity] = {};
      for (int d = 0; d < width_[a]; ++d)
        for (int j = 0; j < n_; ++j)
          image[j] += direction_[a][d] * of.G[(row_[a] + d) * of.stride + j];
      for (int b = 0; b < m_; ++b) A_[a * m_ + b] = along(b, image);
      most = A_[a * (m_ + 1)] > most ? A_[a * (m_ + 1)] : most;
    }
    lu_.resize(m_);
    for (int a = 0; a < m_; ++a) {
      double* row = lu_.A + a * lu_.stride;
      for (int b = 0; b < lu_.stride; ++b) row[b] = b < m_ ? A_[a * m_ + b] : 0.0;
      row[a] += Tolerance::raise * most;
    }
    return lu_.factorise();
  }

  // Whether x + part step lies in all cones.
  static bool allowed(const Problem& of, const double* x, const double* step, double part) {
    for (int c = 0; c < of.n_contacts; ++c) {
      double y[3];
      for (int d = 0; d < 3; ++d) y[d] = x[3 * c + d] + part * step[3 * c + d];
      const double most = of.mu[c] * y[0] * (1.0 + Tolerance::rounding);
      const double tiny = Tolerance::rounding * fabs(x[3 * c]);
      if (y[0] < 0.0 || sqrt(y[1] * y[1] + y[2] * y[2]) > most + tiny) return false;
    }
    return true;
  }

  int n_ = 0, m_ = 0;
  int row_[array_size(capacity)], width_[array_size(capacity)];
  double direction_[array_size(capacity)][3], A_[array_size(capacity) * array_size(capacity)];
  DenseLu<capacity> lu_;
};

}  // namespace fan
