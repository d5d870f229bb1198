// Distribution of contact forces: of all impulses with the same motion, those of least norm.
//
//   x -> x + D (y* - y),   y* the projection of y on the range of A = D^T G D
//
// The columns of D are unit vectors: the three of a point at rest, and, for a sliding point, the
// direction of its force on the edge of the friction cone. A y* = A y, so the velocities are
// unchanged. If y* leaves a cone, x moves towards it as far as all cones allow. Strings keep their
// tensions.
#pragma once

#include "fantoccini/solvers/cone.hpp"

namespace fan {

struct ContactShareTolerances {
  // Speed below which a point is at rest, relative to the largest in the problem.
  static constexpr double rest_speed = 1e-8;
  // Added to A's diagonal, relative to its largest entry, and iterations of refinement that remove
  // its error.
  static constexpr double diagonal_shift = 1e-8;
  static constexpr int refinements = 3;
  // Bisections of the step to the least norm; relative distance by which |x_T| may exceed its cone.
  static constexpr int bisections = 30;
  static constexpr double rounding = 1e-12;
};

template <int capacity>
class ContactShare {
 public:
  using Problem = ConeProblem<capacity>;

  // Replaces the impulses (3 n_contacts) of a solved problem.
  void find(const Problem& problem, double* x) {
    n_ = problem.n_single + 3 * problem.n_contacts;
    const int first = problem.n_single;
    set_columns(problem);
    for (int i = first; i < n_; ++i) x[i - first] = problem.x[i];
    if (m_ < 2 || !factorise(problem)) return;
    double y[capacity], least[capacity], residual[capacity];
    for (int a = 0; a < m_; ++a) {
      y[a] = component(a, problem.x);
      least[a] = 0.0;
    }
    for (int k = 0; k < Tolerance::refinements; ++k) {
      for (int a = 0; a < m_; ++a) {
        residual[a] = 0.0;
        for (int b = 0; b < m_; ++b) residual[a] += A_[a * m_ + b] * (y[b] - least[b]);
      }
      lu_.substitute(residual);
      for (int a = 0; a < m_; ++a) least[a] += residual[a];
    }
    double step[capacity] = {};
    for (int a = 0; a < m_; ++a)
      for (int d = 0; d < width_[a]; ++d)
        step[row_[a] + d - first] += (least[a] - y[a]) * direction_[a][d];
    double fraction = 1.0;
    if (!allowed(problem, x, step, 1.0)) {
      double low = 0.0, high = 1.0;
      for (int k = 0; k < Tolerance::bisections; ++k) {
        fraction = 0.5 * (low + high);
        (allowed(problem, x, step, fraction) ? low : high) = fraction;
      }
      fraction = low;
    }
    for (int i = 0; i < 3 * problem.n_contacts; ++i) x[i] += fraction * step[i];
  }

 private:
  using Tolerance = ContactShareTolerances;

  // Sets the columns of D.
  void set_columns(const Problem& problem) {
    double largest = 0.0;
    for (int i = 0; i < n_; ++i)
      largest = fabs(problem.b[i]) > largest ? fabs(problem.b[i]) : largest;
    const double rest_speed = Tolerance::rest_speed * largest;
    m_ = 0;
    for (int c = 0; c < problem.n_contacts; ++c) {
      const int i = problem.n_single + 3 * c;
      const double p = problem.s[i + 1], q = problem.s[i + 2], slip_speed = sqrt(p * p + q * q),
                   mu = problem.mu[c];
      if (fabs(problem.s[i]) > rest_speed) continue;
      if (problem.slides && problem.slides[c]) {
        const double size = 1.0 / sqrt(1.0 + mu * mu);
        add_column(
            i, 3, size, size * mu * problem.along[2 * c], size * mu * problem.along[2 * c + 1]);
      } else if (slip_speed <= rest_speed && mu > 0.0) {
        add_column(i, 3, 1.0, 0.0, 0.0);
        add_column(i, 3, 0.0, 1.0, 0.0);
        add_column(i, 3, 0.0, 0.0, 1.0);
      } else {
        const double size = 1.0 / sqrt(1.0 + mu * mu),
                     share = slip_speed > 0.0 ? mu / slip_speed : 0.0;
        add_column(i, 3, size, -size * share * p, -size * share * q);
      }
    }
  }

  void add_column(int row, int width, double n, double p, double q) {
    row_[m_] = row;
    width_[m_] = width;
    direction_[m_][0] = n;
    direction_[m_][1] = p;
    direction_[m_++][2] = q;
  }

  // Column a of D times x.
  double component(int a, const double* x) const {
    double sum = 0.0;
    for (int d = 0; d < width_[a]; ++d) sum += direction_[a][d] * x[row_[a] + d];
    return sum;
  }

  // Factorises A. Returns whether it is regular.
  bool factorise(const Problem& problem) {
    double largest = 0.0;
    for (int a = 0; a < m_; ++a) {
      double image[capacity] = {};
      for (int d = 0; d < width_[a]; ++d)
        for (int j = 0; j < n_; ++j)
          image[j] += direction_[a][d] * problem.G[(row_[a] + d) * problem.stride + j];
      for (int b = 0; b < m_; ++b) A_[a * m_ + b] = component(b, image);
      largest = A_[a * (m_ + 1)] > largest ? A_[a * (m_ + 1)] : largest;
    }
    lu_.resize(m_);
    for (int a = 0; a < m_; ++a) {
      double* row = lu_.A + a * lu_.stride;
      for (int b = 0; b < lu_.stride; ++b) row[b] = b < m_ ? A_[a * m_ + b] : 0.0;
      row[a] += Tolerance::diagonal_shift * largest;
    }
    return lu_.factorise();
  }

  // Whether x + fraction * step lies in all cones.
  static bool allowed(
      const Problem& problem, const double* x, const double* step, double fraction) {
    for (int c = 0; c < problem.n_contacts; ++c) {
      double y[3];
      for (int d = 0; d < 3; ++d) y[d] = x[3 * c + d] + fraction * step[3 * c + d];
      const double radius = problem.mu[c] * y[0] * (1.0 + Tolerance::rounding);
      const double tiny = Tolerance::rounding * fabs(x[3 * c]);
      if (y[0] < 0.0 || sqrt(y[1] * y[1] + y[2] * y[2]) > radius + tiny) return false;
    }
    return true;
  }

  int n_ = 0, m_ = 0;
  int row_[array_size(capacity)], width_[array_size(capacity)];
  double direction_[array_size(capacity)][3], A_[array_size(capacity) * array_size(capacity)];
  DenseLu<capacity> lu_;
};

}  // namespace fan
