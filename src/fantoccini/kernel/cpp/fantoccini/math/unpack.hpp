// Conversion between numbers of several lanes and one array per lane: transposes blocks of
// registers (Eklundh, IEEE Trans. Comput. C-21, 1972).
#pragma once

#include <cstring>

#include "fantoccini/math/lane_of.hpp"
#include "fantoccini/math/wide.hpp"

namespace fan {

#if defined(__GNUC__) && !defined(__clang__) && FAN_WIDTH > 1
// Exchanges lanes l + s of `a` with lanes l of `b`, for all l without the bit s.
template <int s>
FAN_ALWAYS_INLINE void exchange(Wide* a, Wide* b) {
  typedef long long Places __attribute__((vector_size(8 * FAN_WIDTH)));
  Places low, high;
  FAN_UNROLL for (int l = 0; l < FAN_WIDTH; ++l) {
    low[l] = l & s ? FAN_WIDTH + l - s : l;
    high[l] = l & s ? FAN_WIDTH + l : l + s;
  }
  const auto x = a->v, y = b->v;
  a->v = __builtin_shuffle(x, y, low);
  b->v = __builtin_shuffle(x, y, high);
}

template <int s>
FAN_ALWAYS_INLINE void exchange_all(Wide* x) {
  if constexpr (s < FAN_WIDTH) {
    FAN_UNROLL for (int i = 0; i < FAN_WIDTH; ++i) if (!(i & s)) exchange<s>(x + i, x + i + s);
    exchange_all<2 * s>(x);
  }
}

// Writes the first n_lanes lanes of n numbers to one array per lane.
inline void unpack(const Wide* from, int n, double* const* to, int n_lanes) {
  int j = 0;
  for (; j + FAN_WIDTH <= n; j += FAN_WIDTH) {
    Wide x[FAN_WIDTH];
    FAN_UNROLL for (int i = 0; i < FAN_WIDTH; ++i) x[i] = from[j + i];
    exchange_all<1>(x);
    FAN_UNROLL for (int l = 0; l < FAN_WIDTH; ++l) if (l < n_lanes)
        std::memcpy(to[l] + j, x + l, sizeof(Wide));
  }
  for (; j < n; ++j)
    for (int l = 0; l < n_lanes; ++l) to[l][j] = lane_of(from[j], l);
}

// Transposes n numbers of one array per lane: lane l of number j of array i goes to lane i of
// number j of array l, for the first n_lanes arrays.
inline void turn(const Wide* const* from, int n, Wide* const* to, int n_lanes) {
  for (int j = 0; j < n; ++j) {
    Wide x[FAN_WIDTH];
    FAN_UNROLL for (int i = 0; i < FAN_WIDTH; ++i) x[i] = from[i][j];
    exchange_all<1>(x);
    FAN_UNROLL for (int l = 0; l < FAN_WIDTH; ++l) if (l < n_lanes) to[l][j] = x[l];
  }
}

// Reads n numbers of one array for each lane.
inline void pack(const double* const* from, int n, Wide* to) {
  int j = 0;
  for (; j + FAN_WIDTH <= n; j += FAN_WIDTH) {
    FAN_UNROLL for (int l = 0; l < FAN_WIDTH; ++l)
        std::memcpy(to + j + l, from[l] + j, sizeof(Wide));
    exchange_all<1>(to + j);
  }
  for (; j < n; ++j)
    for (int l = 0; l < FAN_WIDTH; ++l) lane_of(to[j], l) = from[l][j];
}
#else
inline void unpack(const Wide* from, int n, double* const* to, int n_lanes) {
  for (int j = 0; j < n; ++j)
    for (int l = 0; l < n_lanes; ++l) to[l][j] = lane_of(from[j], l);
}

inline void turn(const Wide* const* from, int n, Wide* const* to, int n_lanes) {
  for (int j = 0; j < n; ++j)
    for (int l = 0; l < n_lanes; ++l)
      for (int i = 0; i < Traits<Wide>::width; ++i) lane_of(to[l][j], i) = lane_of(from[i][j], l);
}

inline void pack(const double* const* from, int n, Wide* to) {
  for (int j = 0; j < n; ++j)
    for (int l = 0; l < Traits<Wide>::width; ++l) lane_of(to[j], l) = from[l][j];
}
#endif

}  // namespace fan
