// Real as a vector of doubles: one trajectory per lane.
//
// A thin type over the compiler's vectors. std::experimental::simd has the same operations, but g++
// does not inline them in functions as long as the generated ones, which is three times slower.
#pragma once

#include <cmath>

#include "fantoccini/math/real.hpp"
#include "fantoccini/math/vectors.hpp"

#define FAN_LANE_OP __attribute__((always_inline)) friend inline

namespace fan {

template <class T, int width>
struct VectorOf {
  typedef T type __attribute__((vector_size(sizeof(T) * width)));
};

// One truth value per lane: all bits of the lane are ones or zeros.
template <int width>
struct LaneMask {
  using Bits = typename VectorOf<long long, width>::type;
  Bits bits;

  bool operator[](int lane) const { return bits[lane] != 0; }
  void set(int lane, bool value) { bits[lane] = value ? -1 : 0; }

  FAN_LANE_OP LaneMask operator&&(const LaneMask& a, const LaneMask& b) {
    return {a.bits & b.bits};
  }
  FAN_LANE_OP LaneMask operator||(const LaneMask& a, const LaneMask& b) {
    return {a.bits | b.bits};
  }
  FAN_LANE_OP LaneMask operator!(const LaneMask& a) { return {~a.bits}; }
  FAN_LANE_OP LaneMask operator==(const LaneMask& a, const LaneMask& b) {
    return {a.bits == b.bits};
  }
  FAN_LANE_OP LaneMask operator!=(const LaneMask& a, const LaneMask& b) {
    return {a.bits ^ b.bits};
  }
};

#if defined(__AVX512F__)
// One truth value per lane, as one bit: the masks of AVX-512.
template <>
struct LaneMask<8> {
  unsigned char bits;

  bool operator[](int lane) const { return bits >> lane & 1; }
  void set(int lane, bool value) {
    bits = static_cast<unsigned char>((bits & ~(1 << lane)) | (value << lane));
  }

  FAN_LANE_OP LaneMask operator&&(LaneMask a, LaneMask b) { return made(a.bits & b.bits); }
  FAN_LANE_OP LaneMask operator||(LaneMask a, LaneMask b) { return made(a.bits | b.bits); }
  FAN_LANE_OP LaneMask operator!(LaneMask a) { return made(~a.bits); }
  FAN_LANE_OP LaneMask operator==(LaneMask a, LaneMask b) { return made(~(a.bits ^ b.bits)); }
  FAN_LANE_OP LaneMask operator!=(LaneMask a, LaneMask b) { return made(a.bits ^ b.bits); }

 private:
  static LaneMask made(int bits) { return {static_cast<unsigned char>(bits)}; }
};
#endif

// A comparison of lanes; HOW is its code in AVX-512.
#if defined(__AVX512F__)
#define FAN_LANE_COMPARISON(OP, HOW)                             \
  FAN_LANE_OP Mask operator OP(const Lanes& a, const Lanes& b) { \
    if constexpr (width == 8) return {compared<HOW>(a.v, b.v)};  \
    else return {a.v OP b.v};                                    \
  }
#else
#define FAN_LANE_COMPARISON(OP, HOW) \
  FAN_LANE_OP Mask operator OP(const Lanes& a, const Lanes& b) { return {a.v OP b.v}; }
#endif

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
  FAN_LANE_OP Lanes& operator+=(Lanes& a, const Lanes& b) {
    a.v += b.v;
    return a;
  }
  FAN_LANE_OP Lanes& operator-=(Lanes& a, const Lanes& b) {
    a.v -= b.v;
    return a;
  }
  FAN_LANE_OP Lanes& operator*=(Lanes& a, const Lanes& b) {
    a.v *= b.v;
    return a;
  }
  FAN_LANE_OP Lanes& operator/=(Lanes& a, const Lanes& b) {
    a.v /= b.v;
    return a;
  }

  FAN_LANE_COMPARISON(==, 0x00)
  FAN_LANE_COMPARISON(<, 0x11)
  FAN_LANE_COMPARISON(>, 0x1e)
  FAN_LANE_COMPARISON(!=, 0x04)
  FAN_LANE_COMPARISON(<=, 0x12)
  FAN_LANE_COMPARISON(>=, 0x1d)

  // Hidden friends, so that step code on doubles still uses the C library's functions.
  FAN_LANE_OP Lanes abs(const Lanes& a) {
    using Bits = typename VectorOf<long long, width>::type;
    return of((Vector)((Bits)a.v & 0x7fffffffffffffffLL));
  }
  FAN_LANE_OP Lanes fabs(const Lanes& a) { return abs(a); }
  FAN_LANE_OP Lanes sqrt(const Lanes& a) {
#if defined(__AVX512F__)
    if constexpr (width == 8) return of(vector_root(a.v));
#endif
#if defined(__AVX__)
    if constexpr (width == 4) return of(vector_root(a.v));
#endif
    Lanes out;
    for (int l = 0; l < width; ++l) out.v[l] = ::sqrt(a.v[l]);
    return out;
  }

  // Functions of the C library, lane by lane, which elementary.hpp does not have.
#define FAN_LANE_CALL(NAME)                                     \
  __attribute__((noinline)) friend Lanes NAME(const Lanes& a) { \
    Lanes out;                                                  \
    for (int l = 0; l < width; ++l) out.v[l] = ::NAME(a.v[l]);  \
    return out;                                                 \
  }
  FAN_LANE_CALL(sin)
  FAN_LANE_CALL(cos)
  FAN_LANE_CALL(floor)
#undef FAN_LANE_CALL
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
#if defined(__AVX512F__)
  if constexpr (width == 8) return Lanes<width>::of(chosen(mask.bits, yes.v, no.v));
  else
#endif
    return Lanes<width>::of(mask.bits ? yes.v : no.v);
}

// The functions of the same names in elementary.hpp, for lanes.
template <int width>
__attribute__((always_inline)) inline Lanes<width> one_if(const LaneMask<width>& condition) {
  return select(condition, Lanes<width>(1.0), Lanes<width>(0.0));
}
template <int width, class Number>
__attribute__((always_inline)) inline Lanes<width> zero_unless(
    const LaneMask<width>& condition, const Number& x) {
  return select(condition, Lanes<width>(x), Lanes<width>(0.0));
}

// a if a > b (or a < b), else b: one operation instead of two dependent ones.
template <int width>
__attribute__((always_inline)) inline Lanes<width> maximum(
    const Lanes<width>& a, const Lanes<width>& b) {
#if defined(__AVX512F__)
  if constexpr (width == 8) return Lanes<width>::of(vector_maximum(a.v, b.v));
#endif
#if defined(__AVX__)
  if constexpr (width == 4) return Lanes<width>::of(vector_maximum(a.v, b.v));
#endif
  return Lanes<width>::of(a.v > b.v ? a.v : b.v);
}

template <int width>
__attribute__((always_inline)) inline Lanes<width> minimum(
    const Lanes<width>& a, const Lanes<width>& b) {
#if defined(__AVX512F__)
  if constexpr (width == 8) return Lanes<width>::of(vector_minimum(a.v, b.v));
#endif
#if defined(__AVX__)
  if constexpr (width == 4) return Lanes<width>::of(vector_minimum(a.v, b.v));
#endif
  return Lanes<width>::of(a.v < b.v ? a.v : b.v);
}

// One index for every lane.
template <int width>
struct LanePlaces {
  typename VectorOf<int, width>::type v;

  int& operator[](int lane) { return reinterpret_cast<int*>(&v)[lane]; }
  int operator[](int lane) const { return v[lane]; }

  FAN_LANE_OP LanePlaces operator+(const LanePlaces& a, const LanePlaces& b) { return {a.v + b.v}; }
  FAN_LANE_OP LanePlaces operator*(const LanePlaces& a, int by) { return {a.v * by}; }
};

// The numbers at these indices of `from`; 0 in lanes outside the mask, whose indices must be valid,
// too.
template <int width>
__attribute__((always_inline)) inline Lanes<width> gathered(
    const double* from, const LanePlaces<width>& at, const LaneMask<width>& mask) {
#if defined(__AVX512F__)
  if constexpr (width == 8) return Lanes<width>::of(numbers_at(from, at.v, mask.bits));
#endif
  Lanes<width> out;
  for (int l = 0; l < width; ++l) out.v[l] = from[at.v[l]];
  return select(mask, out, Lanes<width>(0.0));
}

// 1 / sqrt(x), x > 0 (NaN at 0 with AVX-512). A root and a quotient of eight doubles take as long
// as sixty products; AVX-512 has an estimate to 2^-14, which two iterations make equally exact.
template <int width>
__attribute__((always_inline)) inline Lanes<width> inverse_root(const Lanes<width>& x) {
#if defined(__AVX512F__)
  if constexpr (width == 8) {
    const EightDoubles one = 1.0 - EightDoubles{}, v = x.v;
    EightDoubles y = rough_inverse_root(v);
    const EightDoubles rough = less_product(v * y, y, one);
    y += (y * rough) * (0.5 + 0.375 * rough);
    // The remaining error is below the rounding of x y, whose low part is therefore kept.
    const EightDoubles high = v * y, low = product_less(v, y, high);
    const EightDoubles lacks = less_product(high, y, one) - low * y;
    return Lanes<width>::of(y + (0.5 * y) * lacks);
  }
#endif
  return 1.0 / sqrt(x);
}

#if defined(__AVX512F__)
inline bool any(LaneMask<8> mask) { return mask.bits != 0; }
#endif

template <int width>
__attribute__((always_inline)) inline bool any(const LaneMask<width>& mask) {
#if defined(__AVX__)
  if constexpr (width == 4) return any_bit(mask.bits);
#endif
  bool any_lane = false;
  for (int l = 0; l < width; ++l) any_lane |= mask[l];
  return any_lane;
}

}  // namespace fan

#undef FAN_LANE_COMPARISON
#undef FAN_LANE_OP
