// The normal and two tangents of a contact point, as screws about the world's origin.
#pragma once

#include "fantoccini/math/triple.hpp"

FAN_LOOPS_BEGIN

namespace fan {

// Components of the three directions along each axis, and about it.
struct PointDirections {
  Quad of[3], about[3];

  PointDirections() = default;
  // For the velocity at a point.
  FAN_FN PointDirections(const double* e, const double* at) {
    FAN_UNROLL for (int c = 0; c < 3; ++c) of[c] = Quad{e[c], e[3 + c], e[6 + c], 0.0};
    FAN_UNROLL for (int c = 0; c < 3; ++c) about[c] =
        at[(c + 1) % 3] * of[(c + 2) % 3] - at[(c + 2) % 3] * of[(c + 1) % 3];
  }
  // For an angular velocity.
  FAN_FN PointDirections(const double* e, double size) {
    FAN_UNROLL for (int c = 0; c < 3; ++c) {
      of[c] = Quad{};
      about[c] = size * Quad{e[c], e[3 + c], e[6 + c], 0.0};
    }
  }

  // Components of a linear and an angular velocity.
  FAN_FN Quad speed(const double* v, const double* w) const {
    return (of[0] * v[0] + of[1] * v[1] + of[2] * v[2]) +
           (about[0] * w[0] + about[1] * w[1] + about[2] * w[2]);
  }
};

}  // namespace fan

FAN_LOOPS_END
