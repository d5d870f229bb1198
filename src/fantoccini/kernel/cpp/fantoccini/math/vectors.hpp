// Operations on vectors of doubles that only AVX and AVX-512 have.
//
// With g++ they are the builtins behind <immintrin.h>, which takes most of a second to read in
// every file; clang's builtins change, so that it uses the header.
#pragma once

#if defined(__AVX__)

#if defined(__clang__)
#include <immintrin.h>
#define FAN_BUILTIN(OURS, THEIRS) THEIRS
#else
#define FAN_BUILTIN(OURS, THEIRS) OURS
#endif

#define FAN_VECTOR_FN __attribute__((always_inline)) inline

namespace fan {

typedef double FourDoubles __attribute__((vector_size(32)));
typedef long long FourBits __attribute__((vector_size(32)));

FAN_VECTOR_FN FourDoubles vector_root(FourDoubles x) {
  return FAN_BUILTIN(__builtin_ia32_sqrtpd256(x), _mm256_sqrt_pd(x));
}

// a if a > b (or a < b), else b.
FAN_VECTOR_FN FourDoubles vector_maximum(FourDoubles a, FourDoubles b) {
  return FAN_BUILTIN(__builtin_ia32_maxpd256(a, b), _mm256_max_pd(a, b));
}
FAN_VECTOR_FN FourDoubles vector_minimum(FourDoubles a, FourDoubles b) {
  return FAN_BUILTIN(__builtin_ia32_minpd256(a, b), _mm256_min_pd(a, b));
}

FAN_VECTOR_FN bool any_bit(FourBits x) {
  return !FAN_BUILTIN(__builtin_ia32_ptestz256(x, x), _mm256_testz_si256((__m256i)x, (__m256i)x));
}

#if defined(__AVX512F__)

typedef double EightDoubles __attribute__((vector_size(64)));

// The builtins' arguments for all lanes, and for the current rounding mode.
#define FAN_WHOLE (unsigned char)-1, 4

// The result of the comparison `how`, one of Intel's codes such as _CMP_LT_OQ; a bit for each lane.
template <int how>
FAN_VECTOR_FN unsigned char compared(EightDoubles a, EightDoubles b) {
  return FAN_BUILTIN(
      __builtin_ia32_cmppd512_mask(a, b, how, FAN_WHOLE), _mm512_cmp_pd_mask(a, b, how));
}

FAN_VECTOR_FN EightDoubles chosen(unsigned char bits, EightDoubles yes, EightDoubles no) {
  return FAN_BUILTIN(
      __builtin_ia32_blendmpd_512_mask(no, yes, bits), _mm512_mask_blend_pd(bits, no, yes));
}

FAN_VECTOR_FN EightDoubles vector_root(EightDoubles x) {
  return FAN_BUILTIN(__builtin_ia32_sqrtpd512_mask(x, x, FAN_WHOLE), _mm512_sqrt_pd(x));
}

FAN_VECTOR_FN EightDoubles vector_maximum(EightDoubles a, EightDoubles b) {
  return FAN_BUILTIN(__builtin_ia32_maxpd512_mask(a, b, a, FAN_WHOLE), _mm512_max_pd(a, b));
}
FAN_VECTOR_FN EightDoubles vector_minimum(EightDoubles a, EightDoubles b) {
  return FAN_BUILTIN(__builtin_ia32_minpd512_mask(a, b, a, FAN_WHOLE), _mm512_min_pd(a, b));
}

// 1 / sqrt(x) to 2^-14.
FAN_VECTOR_FN EightDoubles rough_inverse_root(EightDoubles x) {
  return FAN_BUILTIN(
      __builtin_ia32_rsqrt14pd512_mask(x, x, (unsigned char)-1), _mm512_rsqrt14_pd(x));
}

typedef int EightPlaces __attribute__((vector_size(32)));

// The numbers at these indices of `from` in the lanes of a mask, 0 in the others.
FAN_VECTOR_FN EightDoubles numbers_at(const double* from, EightPlaces at, unsigned char bits) {
  return FAN_BUILTIN(
      __builtin_ia32_gathersiv8df(EightDoubles{}, from, at, bits, 8),
      _mm512_mask_i32gather_pd(EightDoubles{}, bits, (__m256i)at, from, 8));
}

// a b - c, rounded once.
FAN_VECTOR_FN EightDoubles product_less(EightDoubles a, EightDoubles b, EightDoubles c) {
  return FAN_BUILTIN(__builtin_ia32_vfmsubpd512_mask(a, b, c, FAN_WHOLE), _mm512_fmsub_pd(a, b, c));
}

// c - a b, rounded once.
FAN_VECTOR_FN EightDoubles less_product(EightDoubles a, EightDoubles b, EightDoubles c) {
  return FAN_BUILTIN(
      __builtin_ia32_vfnmaddpd512_mask(a, b, c, FAN_WHOLE), _mm512_fnmadd_pd(a, b, c));
}

#undef FAN_WHOLE
#endif

}  // namespace fan

#undef FAN_BUILTIN
#undef FAN_VECTOR_FN
#endif
