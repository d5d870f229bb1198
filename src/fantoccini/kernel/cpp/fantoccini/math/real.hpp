// The scalar type of the runtime and what step code may do with it.
//
// Step code is written once, for a type Real that is double or a bundle of doubles (lanes.hpp):
// no branch depends on a Real; choices go through Mask and select. FAN_FN qualifies every function,
// so that a CUDA build can mark them for the device.
#pragma once

#include <math.h>

#ifndef FAN_FN
#define FAN_FN inline
#endif

// Before a loop of few turns: g++ -O2 leaves loops of constant length as they are.
#if defined(__clang__)
#define FAN_UNROLL _Pragma("unroll")
#elif defined(__GNUC__)
#define FAN_UNROLL _Pragma("GCC unroll 8")
#else
#define FAN_UNROLL
#endif

// Of a loop whose turns do not depend on each other: g++ -O2 then needs no check of that to compute
// several at once.
#if defined(__clang__)
#define FAN_INDEPENDENT _Pragma("clang loop vectorize(assume_safety)")
#elif defined(__GNUC__)
#define FAN_INDEPENDENT _Pragma("GCC ivdep")
#else
#define FAN_INDEPENDENT
#endif

// Of functions and, after their arguments, of lambdas that are optimised with what calls them.
#if defined(__GNUC__)
#define FAN_INLINE __attribute__((always_inline))
#else
#define FAN_INLINE
#endif
#define FAN_ALWAYS_INLINE FAN_INLINE FAN_FN

// Of functions whose local arrays are to lie where those of functions called before them did: the
// numbers of a bundle of lanes are more than the nearest cache holds.
#if defined(__GNUC__)
#define FAN_OUT_OF_LINE __attribute__((noinline)) FAN_FN
#else
#define FAN_OUT_OF_LINE FAN_FN
#endif

// Around code in which loops along lists and small matrices take most of the time: -O3, which is
// for such loops, while -O2 is what long generated code compiles with in bearable time.
#if defined(__GNUC__) && !defined(__clang__)
#define FAN_LOOPS_BEGIN _Pragma("GCC push_options") _Pragma("GCC optimize(\"O3\")")
#define FAN_LOOPS_END _Pragma("GCC pop_options")
#else
#define FAN_LOOPS_BEGIN
#define FAN_LOOPS_END
#endif

namespace fan {

// Stands for infinity in bounds, times and tensions; numbers of this size count as overflow.
constexpr double unbounded = 1e300;
// Smaller right sides and squares count as 0: residuals are judged relative to their terms, and
// subnormal numbers have no relative accuracy.
constexpr double negligible = 1e-280;
// m, rad, per second: a configuration and velocity of this norm have lost all meaning.
constexpr double max_state_norm = 1e9;

template <class Real>
struct Traits;

template <>
struct Traits<double> {
  using Mask = bool;
  static constexpr int width = 1;
};

FAN_FN double select(bool mask, double yes, double no) { return mask ? yes : no; }
// a where a > b or a < b, else b: where one is no number, b.
FAN_FN double maximum(double a, double b) { return a > b ? a : b; }
FAN_FN double minimum(double a, double b) { return a < b ? a : b; }
FAN_FN bool any(bool mask) { return mask; }

inline bool is_finite(double x) { return fabs(x) < unbounded; }

// Length of an array of n numbers: C++ has no arrays of length 0.
constexpr int room(int n) { return n > 0 ? n : 1; }

}  // namespace fan
