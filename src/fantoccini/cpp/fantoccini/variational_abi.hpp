// The C interface of a puppet's library of the variational integrator, as fantoccini.runtime loads
// it. The translation unit that includes this defines `fan::Model` first.
#pragma once

#include "variational_run.hpp"

namespace fan {
using AnyRun = VariationalRun<Model>;
}

#include "run_abi.hpp"
