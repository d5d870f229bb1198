// The C interface of a puppet's library of the variational integrator, as fantoccini.kernel.runtime
// loads it. The translation unit that includes this defines `fan::Model` first.
#pragma once

#include "fantoccini/variational/run.hpp"

namespace fan {
using AnyRun = VariationalRun<Model>;
}

#include "fantoccini/interface/run.hpp"
