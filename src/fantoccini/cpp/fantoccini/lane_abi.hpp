// The C interface of a puppet's library of lanes, as fantoccini.runtime loads it. The translation
// unit that includes this defines `fan::Model` over `fan::Wide` first.
#pragma once

#include "export.hpp"
#include "fixed_lanes.hpp"
#include "lane_batch.hpp"

FAN_POOL

// Works on a pool until nothing is left; 0, or 1 where there was no memory.
FAN_EXPORT int fan_batch_work(void* pool) {
  return fan::work_on<fan::LaneBatch<fan::FixedLanes<fan::Model, fan::Wide>>>(pool);
}
