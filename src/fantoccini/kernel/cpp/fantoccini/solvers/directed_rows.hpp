// Linear equations over rows whose multipliers act along given directions:
//
//   T^T (b - G y) = 0,   y = y_0 + D z
//
// D has a column for every unknown, T its equation's row: the first of its direction. A sliding
// contact's force acts along its normal and its friction, and its equation is that of the normal.
// An unknown across two rows has the equation along its direction e: e^T (b - G y) + goal = firm z.
// If rows are redundant, z is that of least norm, each unknown in units of its own influence.
#pragma once

#include "fantoccini/math/dense_lu.hpp"

namespace fan {

struct DirectedRowTolerances {
  // Raise of the diagonal, relative to it, and refinements that remove its effect.
  static constexpr double raise = 1e-8;
  static constexpr int refinements = 4;
};

template <int capacity>
class DirectedRows {
 public:
  static constexpr int R = array_size(capacity);
  using Tolerance = DirectedRowTolerances;

  int n = 0;  // unknowns

  // Adds an unknown that acts over `width` rows from `row` on.
  void add(int row, int width, double first, double second, double third) {
    unknown_[n++] = {row, width, {first, second, third}, false, 0.0, 0.0};
  }

  // Adds one across the second and third row from `row` on, which starts at zero.
  void add_across(int row, double second, double third, double firm, double goal) {
    unknown_[n++] = {row, 3, {0.0, second, third}, true, firm, goal};
  }

  // The latest z of an unknown.
  double size_of(int u) const { return scale_[u] * z_[u]; }

  int first_row(int u) const { return unknown_[u].row; }

  // y over all `size` rows from b, and from the y_0 with the entries of `start`.
  void solve(const double* G, int size, const double* b, const double* start, double* y) {
    double *z = z_, left[R], image_of[R];
    lu_.resize(n);
    for (int i = 0; i < size; ++i) y[i] = 0.0;
    for (int u = 0; u < n; ++u) {
      lead_[u] = unknown_[u].row + leading(unknown_[u]);
      scale_[u] = 1.0 / sqrt(fmax(G[lead_[u] * size + lead_[u]], negligible));
      if (!unknown_[u].across) add_along(u, start[lead_[u]], y);
    }
    for (int u = 0; u < n; ++u) {
      const double* row = G + lead_[u] * size;
      double* factor = lu_.A + u * lu_.stride;
      double target = b[lead_[u]];
      if (const Unknown& own = unknown_[u]; own.across) {
        const double *second = G + (own.row + 1) * size, *third = second + size;
        for (int j = 0; j < size; ++j)
          image_of[j] = own.part[1] * second[j] + own.part[2] * third[j];
        row = image_of;
        target = own.part[1] * b[own.row + 1] + own.part[2] * b[own.row + 2] + own.goal;
      }
      left[u] = scale_[u] * (target - sum_of_products(row, y, size));
      for (int v = n; v < lu_.stride; ++v) factor[v] = 0.0;
      for (int v = 0; v < n; ++v) {
        const Unknown& other = unknown_[v];
        double image = 0.0;
        for (int k = 0; k < other.width; ++k) image += row[other.row + k] * other.part[k];
        K_[u * n + v] = factor[v] = scale_[u] * image * scale_[v];
      }
      K_[u * n + u] += scale_[u] * unknown_[u].firm * scale_[u];
      factor[u] = K_[u * n + u] + Tolerance::raise;
      z[u] = 0.0;
    }
    if (n == 0 || !lu_.factorise()) return;
    for (int round = 0; round <= Tolerance::refinements; ++round) {
      double change[R];
      for (int u = 0; u < n; ++u) change[u] = left[u] - sum_of_products(K_ + u * n, z, n);
      lu_.substitute(change);
      for (int u = 0; u < n; ++u) z[u] += change[u];
    }
    for (int u = 0; u < n; ++u) add_along(u, scale_[u] * z[u], y);
  }

 private:
  struct Unknown {
    int row, width;
    double part[3];
    bool across;
    double firm, goal;
  };

  static double sum_of_products(const double* a, const double* b, int n) {
    double sum = 0.0;
    for (int i = 0; i < n; ++i) sum += a[i] * b[i];
    return sum;
  }

  static int leading(const Unknown& u) { return u.part[0] != 0.0 ? 0 : u.part[1] != 0.0 ? 1 : 2; }

  void add_along(int u, double size, double* y) const {
    const Unknown& own = unknown_[u];
    for (int k = 0; k < own.width; ++k) y[own.row + k] += size * own.part[k];
  }

  Unknown unknown_[R];
  int lead_[R];
  double scale_[R], K_[R * R], z_[R];
  DenseLu<capacity> lu_;
};

}  // namespace fan
