// Corrections of a configuration, repeated until only rounding is left.
#pragma once

#include "contract.hpp"
#include "real.hpp"

namespace fan {

// What is left of the rows' heights, relative to their scale.
struct CorrectionTolerances {
  static constexpr double exact = 1e-15;       // a rounding or so: nothing is left to do
  static constexpr double acceptable = 1e-12;  // where rounding lets it get no better
  static constexpr double progress = 0.5;      // share left by a round that still converges
  static constexpr int max_rounds = 12;
};

// Repeats `move` on q until `left` says that nothing is. Rounding is reached when a round no longer
// halves what is left; where rows are nearly dependent it may even add to it: that round is taken
// back. A move that cannot be made is one too many where rounding was reached before it.
template <int n_q, class Left, class Move>
Status correct(double* q, Left left, Move move) {
  using Tolerance = CorrectionTolerances;
  double kept[room(n_q)], before = unbounded;
  for (int i = 0; i < n_q; ++i) kept[i] = q[i];
  for (int round = 0; round < Tolerance::max_rounds; ++round) {
    const double worst = left();
    if (worst < Tolerance::exact) return RUNNING;
    if (!(worst < Tolerance::progress * before)) {
      for (int i = 0; i < n_q && !(worst < before); ++i) q[i] = kept[i];
      return before < Tolerance::acceptable ? RUNNING : PROJECTION_FAILED;
    }
    before = worst;
    for (int i = 0; i < n_q; ++i) kept[i] = q[i];
    const Status moved = move();
    if (moved != RUNNING) return before < Tolerance::acceptable ? RUNNING : moved;
  }
  return PROJECTION_FAILED;
}

}  // namespace fan
