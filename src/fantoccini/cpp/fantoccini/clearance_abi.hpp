// The C interface of a puppet's library of clearances, as fantoccini.runtime loads it. The
// translation unit that includes this defines `fan::Model` over `fan::Wide` first.
#pragma once

#include <new>
#include <vector>

#include "clearance.hpp"
#include "export.hpp"

// The clearance of n configurations (n, n_qD), (n, n_qK) and the number of the pair that has it;
// 0, or 1 where there was no memory.
FAN_EXPORT int fan_clearance(
    long long n, const double* q_D, const double* q_K, const double* p,
    const fan::ClearanceArrays* in, double* clearance, long long* pair) {
  using fan::Model;
  using fan::Wide;
  constexpr int width = fan::Traits<Wide>::width;
  try {
    std::vector<fan::Placed<Wide>> placed(in->n_moving);
    fan::Clearance<Model, Wide> at;
    for (int i = 0; i < Model::n_p; ++i) at.p[i] = Wide(p[i]);
    for (long long first = 0; first < n; first += width) {
      // Places beyond the last configuration repeat it.
      for (int l = 0; l < width; ++l) {
        const long long who = first + l < n ? first + l : n - 1;
        for (int i = 0; i < Model::n_qD; ++i)
          fan::lane_of(at.q_D[i], l) = q_D[who * Model::n_qD + i];
        for (int i = 0; i < Model::n_qK; ++i)
          fan::lane_of(at.q_K[i], l) = q_K[who * Model::n_qK + i];
      }
      Wide counts(0.0);
      for (int l = 0; l < width && first + l < n; ++l) fan::lane_of(counts, l) = 1.0;
      at.measure(*in, placed.data(), counts > Wide(0.5));
      for (int l = 0; l < width && first + l < n; ++l) {
        clearance[first + l] = fan::lane_of(at.least, l);
        pair[first + l] = (long long)(fan::lane_of(at.which, l));
      }
    }
  } catch (const std::bad_alloc&) {
    return 1;
  }
  return 0;
}
