// The C interface of hanging poses nearest to targets, as fantoccini.kernel.runtime loads it. The
// translation unit that includes this defines `fan::Model` first.
#pragma once

#include <new>

#include "fantoccini/interface/export.hpp"
#include "fantoccini/search/reach.hpp"

// Returns 0, or 1 if there is not enough memory.
FAN_EXPORT int fan_reach(const fan::ReachArrays* in) {
  auto* made = new (std::nothrow) fan::Reach<fan::Model>();
  if (!made) return 1;
  made->find(*in);
  delete made;
  return 0;
}
