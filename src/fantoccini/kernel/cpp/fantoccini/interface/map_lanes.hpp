// Calls over whole arrays of generated functions that are computed in lanes: at several states at
// once.
#pragma once

#include <memory>

#include "fantoccini/interface/map.hpp"
#include "fantoccini/math/lane_of.hpp"
#include "fantoccini/math/wide.hpp"

namespace fan {

// The calls of FAN_MAP, in lanes; the widths of arguments and results are their lengths.
template <int n_arg, int n_res>
void map_in_lanes(
    int (*function)(const Wide**, Wide**), const int* arg_width, const int* res_width, long long n,
    const double* const* arg, const long long* arg_stride, double* const* res,
    const long long* res_stride) {
  int total = 0;
  for (int i = 0; i < n_arg; ++i) total += arg_width[i];
  for (int i = 0; i < n_res; ++i) total += res_width[i];
  const std::unique_ptr<Wide[]> held(new Wide[total + 1]);
  const Wide* a[n_arg];
  Wide *r[n_res], *next = held.get();
  for (int i = 0; i < n_arg; ++i) a[i] = next, next += arg_width[i];
  for (int i = 0; i < n_res; ++i) r[i] = next, next += res_width[i];
  constexpr int width = Traits<Wide>::width;
  for (long long first = 0; first < n; first += width) {
    Wide* to = held.get();
    for (int i = 0; i < n_arg; ++i)
      for (int j = 0; j < arg_width[i]; ++j, ++to)
        for (int l = 0; l < width; ++l) {
          const long long k = first + l < n ? first + l : n - 1;
          lane_of(*to, l) = arg[i][k * arg_stride[i] + j];
        }
    function(a, r);
    for (int i = 0; i < n_res; ++i)
      for (int l = 0; l < width && first + l < n; ++l)
        for (int j = 0; j < res_width[i]; ++j)
          res[i][(first + l) * res_stride[i] + j] = lane_of(r[i][j], l);
  }
}

}  // namespace fan

#define FAN_LIST(...) {__VA_ARGS__}

// FAN_MAP in lanes; returns 1 if there is not enough memory. ARGS and RESULTS are lists of widths
// in parentheses.
#define FAN_MAP_IN_LANES(NAME, ARGS, RESULTS)                                                 \
  FAN_EXPORT int fan_map_##NAME(                                                              \
      long long n, const double* const* arg, const long long* arg_stride, double* const* res, \
      const long long* res_stride) {                                                          \
    static constexpr int args[] = FAN_LIST ARGS, results[] = FAN_LIST RESULTS;                \
    try {                                                                                     \
      fan::map_in_lanes<sizeof(args) / sizeof(int), sizeof(results) / sizeof(int)>(           \
          fan::Model::NAME, args, results, n, arg, arg_stride, res, res_stride);              \
    } catch (const std::bad_alloc&) {                                                         \
      return 1;                                                                               \
    }                                                                                         \
    return 0;                                                                                 \
  }
