// A string's own length L: driven, wound by a drive, or a number.
#pragma once

#include "real.hpp"

namespace fan {

template <class Model, class Real>
FAN_FN Real string_length(int i, const Real* q_D, const Real* q_K) {
  const int driven = Model::length_q[i], wound = Model::wound_q[i];
  if (driven >= 0) return q_K[driven];
  return wound >= 0 ? q_D[wound] : Real(Model::nominal_length[i]);
}

}  // namespace fan
