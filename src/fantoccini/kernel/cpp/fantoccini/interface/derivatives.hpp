// The C interface of a puppet's derivatives. The translation unit that includes this defines
// `fan::Model` first.
#pragma once

#include <new>

#include "fantoccini/derivatives/flow_derivatives.hpp"
#include "fantoccini/interface/map_lanes.hpp"

// Changes along a smooth piece of a run; sets its status and step. Returns 0, or 1 if there is not
// enough memory.
FAN_EXPORT int fan_flow_derivatives(fan::FlowDerivativeArrays* arrays) {
  try {
    const auto flow = std::make_unique<fan::FlowDerivatives<fan::Model>>(*arrays);
    arrays->status = flow->advance();
    arrays->step = flow->step();
  } catch (const std::bad_alloc&) {
    return 1;
  }
  return 0;
}
