// The scalar type of the runtime, and its operations in step code.
//
// Step code is written once, for a type Real that is double or a vector of doubles (lanes.hpp): no
// branch depends on a Real; choices use Mask and select. FAN_FN qualifies every function, so that a
// CUDA build can mark them for the device.
#pragma once

#include <math.h>

#ifndef FAN_FN
#define FAN_FN inline
#endif

// Before a short loop: g++ -O2 does not unroll loops of constant length.
#if defined(__clang__)
#define FAN_UNROLL _Pragma("unroll")
#elif defined(__GNUC__)
#define FAN_UNROLL _Pragma("GCC unroll 8")
#else
#define FAN_UNROLL
#endif

// Before a loop whose iterations are independent: g++ -O2 then vectorises it without a check.
#if defined(__clang__)
#define FAN_INDEPENDENT _Pragma("clang loop vectorize(assume_safety)")
#elif defined(__GNUC__)
#define FAN_INDEPENDENT _Pragma("GCC ivdep")
#else
#define FAN_INDEPENDENT
#endif

// Qualifies functions, and lambdas after their arguments, that are always inlined.
#if defined(__GNUC__)
#define FAN_INLINE __attribute__((always_inline))
#else
#define FAN_INLINE
#endif
#define FAN_ALWAYS_INLINE FAN_INLINE FAN_FN

// Qualifies functions that are never inlined, so that their local arrays share memory with those of
// earlier calls: the numbers of all lanes exceed the first-level cache.
#if defined(__GNUC__)
#define FAN_OUT_OF_LINE __attribute__((noinline)) FAN_FN
#else
#define FAN_OUT_OF_LINE FAN_FN
#endif

// Around code that spends most time in loops over lists and small matrices: -O3, which would take
// too long for generated code.
#if defined(__GNUC__) && !defined(__clang__)
#define FAN_LOOPS_BEGIN _Pragma("GCC push_options") _Pragma("GCC optimize(\"O3\")")
#define FAN_LOOPS_END _Pragma("GCC pop_options")
#else
#define FAN_LOOPS_BEGIN
#define FAN_LOOPS_END
#endif

namespace fan {

// Represents infinity in bounds, times and tensions; numbers of this size count as overflow.
constexpr double unbounded = 1e300;
// Smaller right-hand sides and squares count as 0: residuals are relative to their terms, and
// subnormal numbers have no relative accuracy.
constexpr double negligible = 1e-280;
// m, rad, per second: a configuration and velocity of this norm are invalid.
constexpr double max_state_norm = 1e9;

template <class Real>
struct Traits;

template <>
struct Traits<double> {
  using Mask = bool;
  static constexpr int width = 1;
};

FAN_FN double select(bool mask, double yes, double no) { return mask ? yes : no; }
// a if a > b (or a < b), else b; b if one of them is NaN.
FAN_FN double maximum(double a, double b) { return a > b ? a : b; }
FAN_FN double minimum(double a, double b) { return a < b ? a : b; }
FAN_FN bool any(bool mask) { return mask; }

inline bool is_finite(double x) { return fabs(x) < unbounded; }

// Length of an array of n numbers: C++ has no arrays of length 0.
constexpr int array_size(int n) { return n > 0 ? n : 1; }

}  // namespace fan
