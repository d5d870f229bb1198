// Elementary functions for any Real: sine and cosine, arctangent, inverse root. They make no calls
// (except for angles beyond max_reduced_angle), so that all lanes are computed at once. Errors are
// below 1 unit in the last place up to 1e4 rad, below 1.5 up to max_reduced_angle, and below 2 for
// the arctangent and the inverse root.
//
// Range reduction, approximations and their coefficients are those of Sun's fdlibm (K. C. Ng).
#pragma once

#include <cmath>

#include "fantoccini/math/real.hpp"

namespace fan {

// 1 if a condition holds, else 0; and x if a condition holds, else 0.
FAN_FN double one_if(bool condition) { return condition ? 1.0 : 0.0; }
template <class Real>
FAN_FN Real zero_unless(bool condition, const Real& x) {
  return condition ? x : Real(0.0);
}

constexpr double max_reduced_angle = 1e6;  // rad: beyond, the C library computes sine and cosine

// x rounded to a whole number, for |x| < 2^51.
template <class Real>
FAN_FN Real whole(const Real& x) {
  constexpr double shift = 6755399441055744.0;  // 1.5 * 2^52
  const Real shifted = x + Real(shift);
  return shifted - Real(shift);
}

// sin and cos of r + rest, |r| <= pi/4; rest is the low part of the angle, below the rounding of r.
template <class Real>
FAN_FN void near_sine_cosine(const Real& r, const Real& rest, Real* sine, Real* cosine) {
  const Real z = r * r;
  const Real odd =
      -1.66666666666666324348e-01 +
      z * (8.33333333332248946124e-03 +
           z * (-1.98412698298579493134e-04 +
                z * (2.75573137070700676789e-06 +
                     z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10))));
  const Real even =
      4.16666666666666019037e-02 +
      z * (-1.38888888888741095749e-03 +
           z * (2.48015872894767294178e-05 +
                z * (-2.75573143513906633035e-07 +
                     z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))));
  const Real half = 0.5 * z, most = 1.0 - half;
  *sine = r + (rest * most + r * (z * odd));
  *cosine = most + (((1.0 - most) - half) + (z * (z * even) - r * rest));
}

// sin x and cos x.
template <class Real>
FAN_FN void sine_cosine(const Real& x, Real* sine, Real* cosine) {
  using std::abs;
  using std::cos;
  using std::sin;
  // x = n pi/2 + r + rest, with pi/2 in parts of 33 bits, whose products with n are exact.
  const Real n = whole(x * 6.36619772367581382433e-01);
  const Real first = x - n * 1.57079632673412561417e+00;
  const Real second = n * 6.07710050630396597660e-11;
  const Real r = first - second;
  const Real rest = ((first - r) - second) - n * 2.02226624879595063154e-21;
  Real s, c;
  near_sine_cosine(r, rest, &s, &c);
  const Real quadrant = n - 4.0 * whole(n * 0.25 - 0.375);
  const auto swaps = quadrant == Real(1.0) || quadrant == Real(3.0);
  const Real s_abs = select(swaps, c, s), c_abs = select(swaps, s, c);
  *sine = select(quadrant > Real(1.5), -s_abs, s_abs);
  *cosine = select(quadrant == Real(1.0) || quadrant == Real(2.0), -c_abs, c_abs);
  const auto large = !(abs(x) < Real(max_reduced_angle));
  if (!any(large)) return;
  *sine = select(large, sin(x), *sine);
  *cosine = select(large, cos(x), *cosine);
}

// The angle in [-pi/2, pi/2] whose tangent is x.
template <class Real>
FAN_FN Real arctangent(const Real& x) {
  using std::abs;
  // Above tan(3 pi/8) relative to pi/2, above tan(pi/8) relative to pi/4.
  const Real size = abs(x);
  const auto steep = size > Real(2.414213562373095), slant = size > Real(0.41421356237309503);
  const Real above = select(steep, Real(-1.0), select(slant, size - Real(1.0), size));
  const Real below = select(steep, size, select(slant, size + Real(1.0), Real(1.0)));
  const Real high = select(
      steep, Real(1.57079632679489655800e+00),
      select(slant, Real(7.85398163397448278999e-01), Real(0.0)));
  const Real low = select(
      steep, Real(6.12323399573676603587e-17),
      select(slant, Real(3.06161699786838301793e-17), Real(0.0)));
  const Real t = above / below, z = t * t, w = z * z;
  const Real even =
      z * (3.33333333333329318027e-01 +
           w * (1.42857142725034663711e-01 +
                w * (9.09088713343650656196e-02 +
                     w * (6.66107313738753120669e-02 +
                          w * (4.97687799461593236017e-02 + w * 1.62858201153657823623e-02)))));
  const Real odd =
      w * (-1.99999999998764832476e-01 +
           w * (-1.11111104054623557880e-01 +
                w * (-7.69187620504482999495e-02 +
                     w * (-5.83357013379057348645e-02 + w * -3.65315727442169155270e-02))));
  const Real out = high - ((t * (even + odd) - low) - t);
  return select(x < Real(0.0), -out, out);
}

// 1 / sqrt(x), x > 0.
FAN_FN double inverse_root(double x) { return 1.0 / sqrt(x); }

}  // namespace fan
