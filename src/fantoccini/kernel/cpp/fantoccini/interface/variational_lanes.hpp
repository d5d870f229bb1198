// The C interface of a puppet's library of variational lanes, as fantoccini.kernel.runtime loads
// it. The translation unit that includes this defines `fan::Model` over `fan::Wide` first.
#pragma once

#include "fantoccini/interface/export.hpp"
#include "fantoccini/runs/lane_batch.hpp"
#include "fantoccini/variational/trajectory.hpp"

FAN_BATCHES(fan::LaneBatch<fan::VariationalTrajectory<fan::Model, fan::Wide>>)
