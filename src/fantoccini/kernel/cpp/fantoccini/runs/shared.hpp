// Arrays of every trajectory, or one that all share.
#pragma once

#include "fantoccini/contract.hpp"

namespace fan {

// The numbers of trajectory i; null if there are none.
inline const double* of(const Shared& shared, long long i) {
  return shared.first ? shared.first + i * shared.stride : nullptr;
}

}  // namespace fan
