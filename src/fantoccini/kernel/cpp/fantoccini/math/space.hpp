// Products of vectors in space.
#pragma once

#include "fantoccini/math/real.hpp"

namespace fan {

template <class Real>
FAN_FN Real dot3(const Real* a, const Real* b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

template <class Real>
FAN_FN void cross(const Real* a, const Real* b, Real* out) {
  out[0] = a[1] * b[2] - a[2] * b[1];
  out[1] = a[2] * b[0] - a[0] * b[2];
  out[2] = a[0] * b[1] - a[1] * b[0];
}

// Two unit vectors perpendicular to a normal and to each other, from the axis farthest from it.
FAN_FN void add_tangents(double* frame) {
  int axis = 0;
  for (int c = 1; c < 3; ++c)
    if (fabs(frame[c]) < fabs(frame[axis])) axis = c;
  const double e[3] = {double(axis == 0), double(axis == 1), double(axis == 2)};
  cross(e, frame, frame + 3);
  const double size = sqrt(dot3(frame + 3, frame + 3));
  for (int c = 3; c < 6; ++c) frame[c] /= size;
  cross(frame, frame + 3, frame + 6);
}

}  // namespace fan
