// Short loops as straight-line code; g++ -O2 does not unroll loops of constant length.
#pragma once

#include <type_traits>

#include "fantoccini/math/real.hpp"

namespace fan {

// Calls f(from), ..., f(to - 1) with each index as a type, so that it is a constant in f. A lambda
// should be FAN_INLINE, so that all calls are optimised together.
template <int from, int to, class F>
FAN_ALWAYS_INLINE void unrolled(const F& f) {
  if constexpr (from < to) {
    f(std::integral_constant<int, from>());
    unrolled<from + 1, to>(f);
  }
}

// Calls f(0), ..., f(n - 1), which must be independent: the compiler may compute several at once.
template <int n, class F>
FAN_ALWAYS_INLINE void each(const F& f) {
  constexpr int multiple = n / 8 * 8;
  FAN_INDEPENDENT
  for (int k = 0; k < multiple; ++k) f(k);
  unrolled<multiple, n>(f);
}

// Calls f(k, j) for k from 0 to n - 1 with the constant j = k % step, for `step` independent sums:
// each addition waits for the previous one of its sum.
template <int step, int n, class F>
FAN_ALWAYS_INLINE void unrolled_by(const F& f) {
  constexpr int multiple = n / step * step;
  for (int k = 0; k < multiple; k += step)
    unrolled<0, step>([&](auto j) FAN_INLINE { f(k + j, j); });
  unrolled<0, n - multiple>([&](auto j) FAN_INLINE { f(multiple + j, j); });
}

// The largest of f(0), ..., f(n - 1); -unbounded for n = 0.
template <int n, class F>
FAN_ALWAYS_INLINE auto largest_of(const F& f) {
  using Real = std::decay_t<decltype(f(0))>;
  Real largest[4] = {Real(-unbounded), Real(-unbounded), Real(-unbounded), Real(-unbounded)};
  unrolled_by<4, n>([&](int k, auto j) FAN_INLINE { largest[j] = maximum(f(k), largest[j]); });
  return maximum(maximum(largest[0], largest[1]), maximum(largest[2], largest[3]));
}

// The sum of n squares.
template <int n, class Real>
FAN_FN Real squares(const Real* x) {
  Real sum[4] = {Real(0.0), Real(0.0), Real(0.0), Real(0.0)};
  unrolled_by<4, n>([&](int k, auto j) FAN_INLINE { sum[j] += x[k] * x[k]; });
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

// The sum of n squares of weight x.
template <int n, class Real>
FAN_FN Real weighted_squares(const Real* x, const double* weight) {
  Real sum[4] = {Real(0.0), Real(0.0), Real(0.0), Real(0.0)};
  unrolled_by<4, n>([&](int k, auto j) FAN_INLINE {
    const Real part = x[k] * weight[k];
    sum[j] += part * part;
  });
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

}  // namespace fan
