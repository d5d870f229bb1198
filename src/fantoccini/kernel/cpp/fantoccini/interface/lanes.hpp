// The C interface of a puppet's library of lanes, as fantoccini.kernel.runtime loads it. The
// translation unit that includes this defines `fan::Model` over `fan::Wide` first.
#pragma once

#include "fantoccini/interface/export.hpp"
#include "fantoccini/runs/lane_batch.hpp"
#include "fantoccini/timestepping/lane_stepper.hpp"

FAN_BATCHES(fan::LaneBatch<fan::TimeSteppingTrajectory<fan::Model, fan::Wide>>)
FAN_STEPPERS(fan::LaneStepper<fan::Model, fan::Wide>)
