// The C interface of derivatives of time steps, as fantoccini.kernel.runtime loads it. The
// translation unit that includes this defines `fan::Model` first.
#pragma once

#include <new>

#include "fantoccini/derivatives/step_bundles.hpp"
#include "fantoccini/interface/export.hpp"

// The nodes [first, last) of the arrays. Returns 0, or 1 if there is not enough memory.
FAN_EXPORT int fan_step_derivatives(
    const fan::StepDerivativeArrays* in, long long first, long long last) {
  using Bundles = fan::StepBundles<fan::Model>;
  auto* made = new (std::nothrow) Bundles;
  if (!made) return 1;
  for (long long i = first; i < last; i += Bundles::width)
    made->find(*in, i, last - i < Bundles::width ? int(last - i) : Bundles::width);
  delete made;
  return 0;
}
