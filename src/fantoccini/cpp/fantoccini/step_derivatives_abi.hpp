// The C interface of derivatives of time steps, as fantoccini.runtime loads it. The translation unit
// that includes this defines `fan::Model` first.
#pragma once

#include <new>

#include "export.hpp"
#include "step_derivatives.hpp"

// The nodes [first, last) of the arrays; 1 where there was no memory, else 0.
FAN_EXPORT int fan_step_derivatives(
    const fan::StepDerivativeArrays* in, long long first, long long last) {
  auto* made = new (std::nothrow) fan::StepDerivatives<fan::Model>();
  if (!made) return 1;
  for (long long i = first; i < last; ++i) made->find(*in, i);
  delete made;
  return 0;
}
