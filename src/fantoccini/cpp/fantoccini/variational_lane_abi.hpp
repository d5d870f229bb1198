// The C interface of a puppet's library of variational lanes, as fantoccini.runtime loads it. The
// translation unit that includes this defines `fan::Model` over `fan::Wide` first.
#pragma once

#include "export.hpp"
#include "lane_batch.hpp"
#include "led_variation.hpp"

FAN_POOL

// Works on a pool until nothing is left; 0, or 1 where there was no memory.
FAN_EXPORT int fan_batch_work(void* pool) {
  return fan::work_on<fan::LaneBatch<fan::LedVariation<fan::Model, fan::Wide>>>(pool);
}
