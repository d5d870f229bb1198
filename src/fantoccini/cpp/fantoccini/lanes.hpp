// Real as a bundle of doubles: one trajectory per lane.
//
// A thin type over the compiler's vectors. std::experimental::simd has the same operations as
// functions, which g++ stops inlining in functions as long as the generated ones: three times
// slower. Its sine and its like are used where it exists.
#pragma once

#include <cmath>

#if defined(__GNUC__) && !defined(__clang__) && __GNUC__ >= 11 && __has_include(<experimental/simd>)
#define FAN_STD_SIMD
#include <experimental/simd>
#endif

#include "real.hpp"

#define FAN_LANE_OP __attribute__((always_inline)) friend inline

namespace fan {

template <class T, int width>
struct VectorOf {
  typedef T type __attribute__((vector_size(sizeof(T) * width)));
};

template <int width>
struct LaneMask {
  using Bits = typename VectorOf<long long, width>::type;
  Bits bits;  // all ones or all zeros in a lane

  bool operator[](int lane) const { return bits[lane] != 0; }

  FAN_LANE_OP LaneMask operator&&(const LaneMask& a, const LaneMask& b) { return {a.bits & b.bits}; }
  FAN_LANE_OP LaneMask operator||(const LaneMask& a, const LaneMask& b) { return {a.bits | b.bits}; }
  FAN_LANE_OP LaneMask operator!(const LaneMask& a) { return {~a.bits}; }
  FAN_LANE_OP LaneMask operator==(const LaneMask& a, const LaneMask& b) { return {a.bits == b.bits}; }
  FAN_LANE_OP LaneMask operator!=(const LaneMask& a, const LaneMask& b) { return {a.bits ^ b.bits}; }
};

template <int width_>
struct Lanes {
  static constexpr int width = width_;
  using Vector = typename VectorOf<double, width>::type;
  using Mask = LaneMask<width>;
  Vector v;

  Lanes() = default;
  __attribute__((always_inline)) Lanes(double x) : v(x - Vector{}) {}
  __attribute__((always_inline)) static Lanes of(const Vector& v) {
    Lanes out;
    out.v = v;
    return out;
  }

  double& operator[](int lane) { return reinterpret_cast<double*>(&v)[lane]; }
  double operator[](int lane) const { return v[lane]; }

  FAN_LANE_OP Lanes operator+(const Lanes& a, const Lanes& b) { return of(a.v + b.v); }
  FAN_LANE_OP Lanes operator-(const Lanes& a, const Lanes& b) { return of(a.v - b.v); }
  FAN_LANE_OP Lanes operator*(const Lanes& a, const Lanes& b) { return of(a.v * b.v); }
  FAN_LANE_OP Lanes operator/(const Lanes& a, const Lanes& b) { return of(a.v / b.v); }
  FAN_LANE_OP Lanes operator-(const Lanes& a) { return of(-a.v); }
  FAN_LANE_OP Lanes& operator+=(Lanes& a, const Lanes& b) { a.v += b.v; return a; }
  FAN_LANE_OP Lanes& operator-=(Lanes& a, const Lanes& b) { a.v -= b.v; return a; }
  FAN_LANE_OP Lanes& operator*=(Lanes& a, const Lanes& b) { a.v *= b.v; return a; }
  FAN_LANE_OP Lanes& operator/=(Lanes& a, const Lanes& b) { a.v /= b.v; return a; }

  FAN_LANE_OP Mask operator<(const Lanes& a, const Lanes& b) { return {a.v < b.v}; }
  FAN_LANE_OP Mask operator>(const Lanes& a, const Lanes& b) { return {a.v > b.v}; }
  FAN_LANE_OP Mask operator!=(const Lanes& a, const Lanes& b) { return {a.v != b.v}; }
  FAN_LANE_OP Mask operator<=(const Lanes& a, const Lanes& b) { return {a.v <= b.v}; }
  FAN_LANE_OP Mask operator>=(const Lanes& a, const Lanes& b) { return {a.v >= b.v}; }

  // Hidden friends, so that step code on doubles goes on finding the C library's.
  FAN_LANE_OP Lanes abs(const Lanes& a) { return of(a.v < 0.0 ? -a.v : a.v); }
  FAN_LANE_OP Lanes fabs(const Lanes& a) { return abs(a); }
  FAN_LANE_OP Lanes sqrt(const Lanes& a) {
    Lanes out;
    for (int l = 0; l < width; ++l) out.v[l] = ::sqrt(a.v[l]);
    return out;
  }

#ifdef FAN_STD_SIMD
  using Std = std::experimental::fixed_size_simd<double, width>;
  template <class F>
  static Lanes each(const F& f, const Lanes& a) {
    return taken(f(Std(reinterpret_cast<const double*>(&a.v), std::experimental::element_aligned)));
  }
  template <class F>
  static Lanes each(const F& f, const Lanes& a, const Lanes& b) {
    return taken(f(Std(reinterpret_cast<const double*>(&a.v), std::experimental::element_aligned),
                   Std(reinterpret_cast<const double*>(&b.v), std::experimental::element_aligned)));
  }
  static Lanes taken(const Std& x) {
    Lanes out;
    x.copy_to(reinterpret_cast<double*>(&out.v), std::experimental::element_aligned);
    return out;
  }
#else
  template <class F>
  static Lanes each(const F& f, const Lanes& a) {
    Lanes out;
    for (int l = 0; l < width; ++l) out.v[l] = f(a.v[l]);
    return out;
  }
  template <class F>
  static Lanes each(const F& f, const Lanes& a, const Lanes& b) {
    Lanes out;
    for (int l = 0; l < width; ++l) out.v[l] = f(a.v[l], b.v[l]);
    return out;
  }
#endif

#define FAN_LANE_CALL(NAME)                                                    \
  __attribute__((noinline)) friend Lanes NAME(const Lanes& a) {               \
    return each([](const auto& x) { using std::NAME; return NAME(x); }, a);   \
  }
  FAN_LANE_CALL(sin)
  FAN_LANE_CALL(cos)
  FAN_LANE_CALL(tan)
  FAN_LANE_CALL(asin)
  FAN_LANE_CALL(acos)
  FAN_LANE_CALL(atan)
  FAN_LANE_CALL(exp)
  FAN_LANE_CALL(log)
#undef FAN_LANE_CALL
  __attribute__((noinline)) friend Lanes atan2(const Lanes& a, const Lanes& b) {
    return each([](const auto& y, const auto& x) { using std::atan2; return atan2(y, x); }, a, b);
  }
  __attribute__((noinline)) friend Lanes pow(const Lanes& a, const Lanes& b) {
    return each([](const auto& x, const auto& y) { using std::pow; return pow(x, y); }, a, b);
  }
  FAN_LANE_OP Lanes fmin(const Lanes& a, const Lanes& b) { return of(b.v < a.v ? b.v : a.v); }
  FAN_LANE_OP Lanes fmax(const Lanes& a, const Lanes& b) { return of(b.v > a.v ? b.v : a.v); }
};

template <int width_>
struct Traits<Lanes<width_>> {
  using Mask = LaneMask<width_>;
  static constexpr int width = width_;
};

template <int width>
__attribute__((always_inline)) inline Lanes<width> select(
    const LaneMask<width>& mask, const Lanes<width>& yes, const Lanes<width>& no) {
  return Lanes<width>::of(mask.bits ? yes.v : no.v);
}

template <int width>
inline bool any(const LaneMask<width>& mask) {
  long long some = 0;
  for (int l = 0; l < width; ++l) some |= mask.bits[l];
  return some != 0;
}

}  // namespace fan

#undef FAN_LANE_OP
