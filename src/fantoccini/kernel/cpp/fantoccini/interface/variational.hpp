// The C interface of a puppet's library of the variational integrator, as fantoccini.kernel.runtime
// loads it. The translation unit that includes this defines `fan::Model` first.
#pragma once

#include "fantoccini/runs/grid_run.hpp"
#include "fantoccini/variational/trajectory.hpp"

namespace fan {
using AnyRun = GridRun<VariationalTrajectory<Model, double>>;
}

#include "fantoccini/interface/run.hpp"
