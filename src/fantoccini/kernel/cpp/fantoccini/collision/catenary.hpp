// The curve of a slack string: points along a catenary of the string's length.
//
//   x(s) = a asinh(s / a),   z(s) = sqrt(a^2 + s^2) - a,   a = w / (2 u),   sinh(u) / u = r
//
// with s the arc length from the lowest point, w the ends' horizontal distance, v their difference
// in height, L the length and r = sqrt(L^2 - v^2) / w; the same as in fantoccini.base.catenary.
#pragma once

#include <cmath>

namespace fan {

constexpr int n_chords = 12;  // straight segments of the approximation

// ln(sinh(u) / u), and its derivative.
inline double log_sinhc(double u) {
  if (u < 0.05) return u * u * (1.0 / 6.0 - u * u * (1.0 / 180.0 - u * u / 2835.0));
  return u + std::log1p(-std::exp(-2.0 * u)) - std::log(2.0 * u);
}

inline double log_sinhc_slope(double u) {
  if (u < 0.05) return u * (1.0 / 3.0 - u * u * (1.0 / 45.0 - 2.0 * u * u / 945.0));
  return 1.0 / std::tanh(u) - 1.0 / u;
}

// n_chords + 1 points (3,) of a string from start to end, equally spaced in its length, except one
// that is moved to the lowest point. The length must exceed the distance of start and end.
inline void catenary(const double* start, const double* end, double length, double* points) {
  const double along[] = {end[0] - start[0], end[1] - start[1], end[2] - start[2]};
  const double flat = std::sqrt(along[0] * along[0] + along[1] * along[1]);
  // A narrower curve counts as two vertical legs.
  const double width = flat > 1e-9 * length ? flat : 1e-9 * length;
  const double span = std::sqrt(flat * flat + along[2] * along[2]);
  const double log_r = 0.5 * std::log1p((length - span) * (length + span) / (width * width));
  double u = std::fmax(std::sqrt(6.0 * log_r), log_r + std::log1p(log_r) + 1.0);
  for (int i = 0; i < 60; ++i) {
    const double step = (log_sinhc(u) - log_r) / log_sinhc_slope(u);
    u -= step;
    if (std::abs(step) <= 1e-14 * u) break;
  }
  const double a = width / (2.0 * u), middle = along[2] / std::tanh(u);
  const double first = 0.5 * (middle - length), x0 = std::asinh(first / a);
  const double z0 = std::sqrt(a * a + first * first);
  // The point nearest to the lowest one is moved to it.
  const int lowest = int(std::lround(-first / length * n_chords));
  for (int k = 0; k <= n_chords; ++k) {
    double s = first + length * k / n_chords;
    if (k == lowest && k > 0 && k < n_chords) s = 0.0;
    const double x = flat > 0.0 ? a * (std::asinh(s / a) - x0) / flat : 0.0;
    points[3 * k] = start[0] + along[0] * x;
    points[3 * k + 1] = start[1] + along[1] * x;
    points[3 * k + 2] = start[2] + std::sqrt(a * a + s * s) - z0;
  }
  for (int c = 0; c < 3; ++c) points[3 * n_chords + c] = end[c];
}

}  // namespace fan
