// Vectors in space, and twists: velocity, then angular velocity.
#pragma once

#include "fantoccini/math/real.hpp"

namespace fan {

template <class Real>
FAN_FN Real dot3(const Real* a, const Real* b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// out may be a or b.
template <class Real>
FAN_FN void cross(const Real* a, const Real* b, Real* out) {
  const Real x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2];
  out[2] = a[0] * b[1] - a[1] * b[0];
  out[0] = x;
  out[1] = y;
}

FAN_FN double length3(const double* a) { return sqrt(dot3(a, a)); }

FAN_FN void difference3(const double* a, const double* b, double* out) {
  for (int k = 0; k < 3; ++k) out[k] = a[k] - b[k];
}

FAN_FN void copy3(const double* a, double* out) {
  for (int k = 0; k < 3; ++k) out[k] = a[k];
}

// a + t b
FAN_FN void along3(const double* a, double t, const double* b, double* out) {
  for (int k = 0; k < 3; ++k) out[k] = a[k] + t * b[k];
}

// Makes a unit vector; whether it was longer than `least`. Others stay as they are.
FAN_FN bool unit3(double* a, double least) {
  const double length = length3(a);
  if (!(length > least)) return false;
  for (int k = 0; k < 3; ++k) a[k] /= length;
  return true;
}

// x in the axes R.
FAN_FN void into_axes(const double* R, const double* x, double* out) {
  for (int j = 0; j < 3; ++j) out[j] = dot3(R + 3 * j, x);
}

// A vector in the axes R, in the world.
FAN_FN void out_of_axes(const double* R, const double* x, double* out) {
  for (int c = 0; c < 3; ++c) out[c] = R[c] * x[0] + R[3 + c] * x[1] + R[6 + c] * x[2];
}

// The unit vector of an axis, or its opposite.
FAN_FN void axis3(int k, double sign, double* out) {
  for (int c = 0; c < 3; ++c) out[c] = c == k ? sign : 0.0;
}

FAN_FN double dot6(const double* a, const double* b) { return dot3(a, b) + dot3(a + 3, b + 3); }

// [a, b] of twists, the rate of b when it is carried along by a.
FAN_FN void bracket(const double* a, const double* b, double* out) {
  double more[3];
  cross(a + 3, b, out);
  cross(a, b + 3, more);
  cross(a + 3, b + 3, out + 3);
  for (int c = 0; c < 3; ++c) out[c] += more[c];
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
