// The C interface of a puppet's library of lanes, as fantoccini.runtime loads it. The translation
// unit that includes this defines `fan::Model` over `fan::Wide` first.
#pragma once

#include "export.hpp"
#include "fixed_lanes.hpp"
#include "lane_batch.hpp"
#include "lane_stepper.hpp"

FAN_BATCHES(fan::LaneBatch<fan::FixedLanes<fan::Model, fan::Wide>>)
FAN_STEPPERS(fan::LaneStepper<fan::Model, fan::Wide>)
