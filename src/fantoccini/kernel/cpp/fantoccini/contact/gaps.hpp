// The gaps of all pairs at configurations, for Python.
#pragma once

#include <new>

#include "fantoccini/contact/points.hpp"

FAN_LOOPS_BEGIN

namespace fan {

// The C interface of ContactPoints::measure; returns 1 if memory is exhausted, else 0.
template <class Model>
int measure_gaps(
    const ContactArrays& in, long long n, const double* q_D, const double* q_K, const double* p,
    double margin, double* gaps) {
  if constexpr (Model::n_contacts > 0) {
    auto* points = new (std::nothrow) ContactPoints<Model, double>();
    if (!points) return 1;
    for (long long i = 0; i < n; ++i)
      points->measure(
          in, q_D + i * Model::n_qD, q_K + i * Model::n_qK, p, margin, gaps + i * in.n_pairs);
    delete points;
  }
  return 0;
}

}  // namespace fan

FAN_LOOPS_END
