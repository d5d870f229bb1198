// Three numbers of a contact point: for its normal and its two tangents. Three doubles are stored
// in a register of four, whose last entry is 0.
#pragma once

#include "fantoccini/math/dense_lu.hpp"

namespace fan {

template <class Real>
struct Triple {
  Real of[3];

  FAN_FN Real operator[](int d) const { return of[d]; }
  FAN_FN void clear() { of[0] = of[1] = of[2] = Real(0.0); }

  // this <- this + factor x.
  FAN_FN void add(const Real& factor, const Triple& x) {
    FAN_UNROLL for (int d = 0; d < 3; ++d) of[d] += factor * x.of[d];
  }

  // Writes the numbers of one lane.
  FAN_FN void put(int lane, QuadInPlace& out) const {
    out = Quad{of[0][lane], of[1][lane], of[2][lane], 0.0};
  }

  // this <- this + factor x in one lane.
  FAN_FN void add_in(int lane, double factor, const Quad& x) {
    FAN_UNROLL for (int d = 0; d < 3; ++d) of[d][lane] += factor * x[d];
  }

  // Operators for generated functions that are evaluated for three vectors at once.
  FAN_ALWAYS_INLINE friend Triple operator+(const Triple& a, const Triple& b) {
    return {{a.of[0] + b.of[0], a.of[1] + b.of[1], a.of[2] + b.of[2]}};
  }
  FAN_ALWAYS_INLINE friend Triple operator-(const Triple& a, const Triple& b) {
    return {{a.of[0] - b.of[0], a.of[1] - b.of[1], a.of[2] - b.of[2]}};
  }
  FAN_ALWAYS_INLINE friend Triple operator-(const Triple& a) {
    return {{-a.of[0], -a.of[1], -a.of[2]}};
  }
  FAN_ALWAYS_INLINE friend Triple operator+(const Triple& a, const Real& b) {
    return {{a.of[0] + b, a.of[1] + b, a.of[2] + b}};
  }
  FAN_ALWAYS_INLINE friend Triple operator*(const Real& a, const Triple& b) {
    return {{a * b.of[0], a * b.of[1], a * b.of[2]}};
  }
  FAN_ALWAYS_INLINE friend Triple operator*(const Triple& a, const Real& b) { return b * a; }
};

template <>
struct Triple<double> {
  Quad of;

  FAN_FN double operator[](int d) const { return of[d]; }
  FAN_FN void clear() { of = Quad{}; }
  FAN_FN void add(double factor, const Triple& x) { of += factor * x.of; }
  FAN_FN void put(int, QuadInPlace& out) const { out = of; }
  FAN_FN void add_in(int, double factor, const Quad& x) { of += factor * x; }
};

}  // namespace fan
