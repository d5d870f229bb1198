// The C interface of a puppet's clearance library, as fantoccini.kernel.runtime loads it. The
// translation unit that includes this defines `fan::Model` over `fan::Wide` first.
#pragma once

#include <new>
#include <vector>

#include "fantoccini/collision/clearance.hpp"
#include "fantoccini/interface/export.hpp"

// Clearances (n,) of configurations (n, n_qD), (n, n_qK): lower bounds of all distances while
// joints move by up to slide, turn (n, n_links), wound and loose (n, n_strings), which are zero if
// null; and the index of the nearest pair. Returns 0, or 1 if there is not enough memory.
FAN_EXPORT int fan_clearance(
    long long n, const double* q_D, const double* q_K, const double* p, const double* slide,
    const double* turn, const double* wound, const double* loose, const fan::ClearanceArrays* in,
    double* clearance, double* lower, long long* pair) {
  using fan::Model;
  using fan::Wide;
  constexpr int width = fan::Traits<Wide>::width;
  try {
    std::vector<fan::Placed<Wide>> placed(in->n_moving);
    fan::Clearance<Model, Wide> at;
    for (int i = 0; i < Model::n_p; ++i) at.p[i] = Wide(p[i]);
    for (long long first = 0; first < n; first += width) {
      fan::load_lanes(q_D, Model::n_qD, first, n, at.q_D);
      fan::load_lanes(q_K, Model::n_qK, first, n, at.q_K);
      if (slide) {
        fan::load_lanes(slide, Model::n_links, first, n, at.moves.slide);
        fan::load_lanes(turn, Model::n_links, first, n, at.moves.turn);
        fan::load_lanes(wound, Model::n_strings, first, n, at.moves.wound);
        fan::load_lanes(loose, Model::n_strings, first, n, at.moves.loose);
      }
      Wide counts(0.0);
      for (int l = 0; l < width && first + l < n; ++l) fan::lane_of(counts, l) = 1.0;
      at.measure(
          *in, placed.data(), counts > Wide(0.5), fan::ClearanceTolerances::max_distance, slide);
      for (int l = 0; l < width && first + l < n; ++l) {
        clearance[first + l] = fan::lane_of(at.least, l);
        lower[first + l] = fan::lane_of(at.lower, l);
        pair[first + l] = (long long)(fan::lane_of(at.pair, l));
      }
    }
  } catch (const std::bad_alloc&) {
    return 1;
  }
  return 0;
}
