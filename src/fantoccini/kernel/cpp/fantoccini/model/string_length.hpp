// A string's length L, which is driven, wound by a drive, or a number, and the time at which a
// driven length becomes too short.
#pragma once

#include "fantoccini/model/segments.hpp"

namespace fan {

struct LengthTolerances {
  static constexpr double min_length = 1e-6;  // m: shortest length of a string
  static constexpr int max_halvings = 40;     // of a piece, for times to 1e-12 of its duration
};

template <class Model, class Real>
FAN_FN Real string_length(int i, const Real* q_D, const Real* q_K) {
  const int driven = Model::length_q[i], wound = Model::wound_q[i];
  if (driven >= 0) return q_K[driven];
  return wound >= 0 ? q_D[wound] : Real(Model::nominal_length[i]);
}

// The argument at which a polynomial first falls to `least`, from its control points (Bernstein
// form) between `from` and `from + width`; `none`, which must be larger, if it does not. A
// polynomial lies between its smallest and its largest control point; de Casteljau's construction
// computes those of both halves.
inline double falls_to(
    const double* points, double least, double from, double width, double none,
    int halvings = LengthTolerances::max_halvings) {
  if (points[0] <= least) return from;
  double lowest = points[0];
  for (int k = 1; k < n_powers; ++k) lowest = points[k] < lowest ? points[k] : lowest;
  if (lowest > least) return none;
  if (halvings == 0) return from;
  double left[n_powers], right[n_powers];
  for (int k = 0; k < n_powers; ++k) right[k] = points[k];
  for (int k = 0; k < n_powers; ++k) {
    left[k] = right[0];
    for (int i = 0; i + 1 < n_powers - k; ++i) right[i] = 0.5 * (right[i] + right[i + 1]);
  }
  const double half = 0.5 * width;
  const double found = falls_to(left, least, from, half, none, halvings - 1);
  return found < none ? found : falls_to(right, least, from + half, half, none, halvings - 1);
}

// The control points of sum_k c_k s^k for s from `from` to `from + width`.
inline void control_points(const double* c, double from, double width, double* points) {
  double shifted[n_powers];
  for (int k = 0; k < n_powers; ++k) shifted[k] = c[k];
  for (int k = 0; k < n_powers; ++k)
    for (int i = n_powers - 2; i >= k; --i) shifted[i] += from * shifted[i + 1];
  double power = 1.0, choose = 1.0;  // C(5, k)
  for (int k = 0; k < n_powers; ++k) {
    points[k] = shifted[k] * power / choose;
    power *= width;
    choose *= double(n_powers - 1 - k) / (k + 1);
  }
  for (int k = 1; k < n_powers; ++k)
    for (int i = n_powers - 1; i >= k; --i) points[i] += points[i - 1];
}

}  // namespace fan
