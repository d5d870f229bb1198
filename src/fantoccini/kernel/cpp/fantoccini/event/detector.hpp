// Detects inputs that no motion can follow, after every accepted step. Where two hands pull a taut
// string apart there is no rigid motion: tensions grow without bound while A_D M^-1 A_D^T becomes
// singular, and an integrator alone does not detect it.
#pragma once

#include "fantoccini/event/flow.hpp"

namespace fan {

struct DetectorTolerances {
  // Pivot of A_D M^-1 A_D^T relative to its diagonal, below which the rows are nearly dependent.
  static constexpr double singular_pivot = 1e-8;
  // The input is impossible if since then the largest tension grew by this factor from its minimum,
  static constexpr double tension_growth = 2.0;
  // and exceeds this multiple of the weight: redundant rigs may stay nearly singular without harm.
  static constexpr double min_tension = 1e3;
  // m: a shorter segment of a taut string has no certain direction.
  static constexpr double collapsed_segment = 1e-6;
};

template <class Model>
struct Detector {
  using F = Flow<Model>;
  using Tolerance = DetectorTolerances;
  static constexpr int S = F::S, M = F::M;

  double attribution[array_size(M)];  // by row, 0 to 1

  // The status at the flow's latest evaluation, which must be that of its present state.
  Status check(const F& f) {
    for (int j = 0; j < F::N; ++j)
      if (!is_finite(f.acc[j])) return broken(f);
    // Inputs that are NaN make heights NaN; such rows count as slack, and the motion stays finite.
    for (int j = 0; j < Model::n_qK; ++j)
      if (!is_finite(f.q_K[j])) return broken(f);
    for (int j = 0; j < Model::n_vK; ++j)
      if (!is_finite(f.v_K[j]) || !is_finite(f.acc_K[j])) return broken(f);
    for (int r = 0; r < M; ++r)
      if (!(fabs(f.tension[r]) <= f.opt.tension_cap)) return capped(f);
    for (int i = 0; i < S; ++i)
      if (string_length<Model, double>(i, f.y, f.q_K) <= LengthTolerances::min_length) {
        attribute_to_row(i);
        return LENGTH_NOT_POSITIVE;
      }
    const Status status = collapse(f);
    return status == RUNNING ? singularity(f) : status;
  }

 private:
  void attribute_to_row(int row) {
    for (int r = 0; r < M; ++r) attribution[r] = r == row ? 1.0 : 0.0;
  }

  Status broken(const F& f) {
    attribute_to_row(-1);
    for (int k = 0; k < Model::n_packed; ++k)
      if (!is_finite(f.eval.L[k])) return SINGULAR_MASS;
    return NOT_FINITE;
  }

  Status capped(const F& f) {
    for (int r = 0; r < M; ++r) {
      const double share = fabs(f.tension[r]) / f.opt.tension_cap;
      attribution[r] = share < 1.0 ? share : 1.0;  // also of a NaN tension
    }
    return TENSION_CAP;
  }

  // Checks whether two neighbouring points of a taut string coincide.
  Status collapse(const F& f) {
    bool wanted = false;
    for (int i = 0; i < S; ++i) wanted = wanted || (f.taut(i) && Model::string_points[i] > 2);
    if (!wanted) return RUNNING;
    double points[array_size(3 * Model::n_points)];
    Call<Model, double>::points(f.y, f.q_K, f.p, points);
    int at = 0;
    for (int i = 0; i < S; ++i) {
      for (int k = 1; k < Model::string_points[i]; ++k) {
        const double* a = points + 3 * (at + k - 1);
        double square = 0.0;
        for (int c = 0; c < 3; ++c) square += (a[3 + c] - a[c]) * (a[3 + c] - a[c]);
        const bool looked_at = f.taut(i) && Model::string_points[i] > 2;
        if (looked_at && square < Tolerance::collapsed_segment * Tolerance::collapsed_segment) {
          attribute_to_row(i);
          return COLLAPSED;
        }
      }
      at += Model::string_points[i];
    }
    return RUNNING;
  }

  Status singularity(const F& f) {
    constexpr int stride = Complementarity<double, M>::N;
    const auto& problem = f.rows.problem;
    int weakest = -1;
    double least = Tolerance::singular_pivot, top = 0.0;
    for (int a = 0; a < f.rows.n; ++a) {
      if (f.tension[f.rows.row[a]] > top) top = f.tension[f.rows.row[a]];
      if (!problem.active[a]) continue;
      const double ratio = problem.pivot(a) / problem.G[a * stride + a];
      if (ratio < least) {
        least = ratio;
        weakest = a;
      }
    }
    if (weakest < 0) {
      reference_ = -1.0;
      return RUNNING;
    }
    if (reference_ < 0.0 || top < reference_) reference_ = top;
    if (top < Tolerance::tension_growth * reference_) return RUNNING;
    if (top < Tolerance::min_tension * f.weight()) return RUNNING;
    // Direction in which A_D M^-1 A_D^T nearly vanishes.
    double y[array_size(M)], along = 0.0, most = 0.0;
    for (int a = 0; a < f.rows.n; ++a) y[a] = a == weakest ? 1.0 : 0.0;
    problem.substitute(y);
    for (int a = 0; a < f.rows.n; ++a)
      if (problem.active[a]) along += y[a] * f.tension[f.rows.row[a]];
    attribute_to_row(-1);
    for (int a = 0; a < f.rows.n; ++a) {
      if (!problem.active[a]) continue;
      // Tensions grow along y or against it; one-sided rows whose tension falls are not a cause.
      const int r = f.rows.row[a];
      const bool wire = r < S && Model::wire[r];
      const double share = wire ? fabs(y[a]) : (along < 0.0 ? -y[a] : y[a]);
      attribution[r] = share > 0.0 ? share : 0.0;
      if (attribution[r] > most) most = attribution[r];
    }
    for (int r = 0; r < M; ++r) attribution[r] /= most > 0.0 ? most : 1.0;
    return IMPOSSIBLE_INPUT;
  }

  double reference_ = -1.0;  // N: minimum of the largest tension since nearly singular
};

}  // namespace fan
