// Corrections of a configuration, repeated until only rounding is left.
#pragma once

#include "contract.hpp"
#include "real.hpp"

namespace fan {

constexpr double kCorrected = 1e-12;  // what may be left, relative to a row's scale

// Repeats `move` on q until `left` says that nothing is. Rounding is reached when a round no longer
// halves what is left; where rows are nearly dependent it may even add to it: that round is taken
// back. A move that cannot be made is one too many where rounding was reached before it.
template <int n_q, class Left, class Move>
Status correct(double* q, Left left, Move move) {
  double kept[room(n_q)], before = 1e300;
  for (int i = 0; i < n_q; ++i) kept[i] = q[i];
  for (int round = 0; round < 12; ++round) {
    const double worst = left();
    if (worst < 1e-15) return RUNNING;
    if (!(worst < 0.5 * before)) {
      for (int i = 0; i < n_q && !(worst < before); ++i) q[i] = kept[i];
      return before < kCorrected ? RUNNING : PROJECTION_FAILED;
    }
    before = worst;
    for (int i = 0; i < n_q; ++i) kept[i] = q[i];
    const Status moved = move();
    if (moved != RUNNING) return before < kCorrected ? RUNNING : moved;
  }
  return PROJECTION_FAILED;
}

}  // namespace fan
