// Corrections of a configuration, repeated until only rounding remains.
#pragma once

#include "fantoccini/contract.hpp"
#include "fantoccini/math/real.hpp"

namespace fan {

// Thresholds for the largest error of the rows' heights, relative to their scale.
struct CorrectionTolerances {
  static constexpr double exact = 1e-15;       // done: a few roundings
  static constexpr double acceptable = 1e-12;  // done, if an iteration makes no progress
  static constexpr double progress = 0.5;      // largest reduction factor of a converging iteration
  static constexpr int max_rounds = 12;
};

// Repeats `move` on q until the error `left` is rounding: when an iteration no longer halves it. An
// iteration that increases it, as with nearly dependent rows, is undone in q only. A move that
// fails is ignored if the error before it was acceptable.
template <int n_q, class Left, class Move>
Status correct(double* q, Left left, Move move) {
  using Tolerance = CorrectionTolerances;
  double kept[array_size(n_q)], before = unbounded;
  for (int i = 0; i < n_q; ++i) kept[i] = q[i];
  for (int round = 0;; ++round) {
    const double worst = left();
    if (worst < Tolerance::exact) return RUNNING;
    if (!(worst < Tolerance::progress * before)) {
      for (int i = 0; i < n_q && !(worst < before); ++i) q[i] = kept[i];
      return before < Tolerance::acceptable ? RUNNING : PROJECTION_FAILED;
    }
    if (round == Tolerance::max_rounds)
      return worst < Tolerance::acceptable ? RUNNING : PROJECTION_FAILED;
    before = worst;
    for (int i = 0; i < n_q; ++i) kept[i] = q[i];
    const Status moved = move();
    if (moved != RUNNING) return before < Tolerance::acceptable ? RUNNING : moved;
  }
}

}  // namespace fan
