// Calls of generated functions over whole arrays, for fantoccini.kernel.runtime. The
// translation unit that includes this defines `fan::Model` first, and maps functions after it.
#pragma once

#include "fantoccini/contract.hpp"
#include "fantoccini/interface/export.hpp"

// Calls a model function n times: argument i of call k begins at arg[i] + k * arg_stride[i]. Only
// pointers of empty arguments and results may be null.
#define FAN_MAP(NAME, N_ARG, N_RES)                                                           \
  FAN_EXPORT int fan_map_##NAME(                                                              \
      long long n, const double* const* arg, const long long* arg_stride, double* const* res, \
      const long long* res_stride) {                                                          \
    const double* a[N_ARG];                                                                   \
    double* r[N_RES];                                                                         \
    for (long long k = 0; k < n; ++k) {                                                       \
      for (int i = 0; i < N_ARG; ++i) a[i] = arg[i] + k * arg_stride[i];                      \
      for (int i = 0; i < N_RES; ++i) r[i] = res[i] + k * res_stride[i];                      \
      fan::Model::NAME(a, r);                                                                 \
    }                                                                                         \
    return 0;                                                                                 \
  }
