// The C interface of gradients of rollouts, as fantoccini.kernel.runtime loads it. The translation
// unit that includes this defines `fan::Model` first.
#pragma once

#include <new>

#include "fantoccini/derivatives/rollout_gradient.hpp"
#include "fantoccini/interface/export.hpp"

FAN_EXPORT void* fan_gradient_new() {
  return new (std::nothrow) fan::RolloutGradient<fan::Model>();
}

FAN_EXPORT void fan_gradient_free(void* made) {
  delete static_cast<fan::RolloutGradient<fan::Model>*>(made);
}

FAN_EXPORT void fan_gradient_roll(void* made, fan::GradientArrays* in) {
  static_cast<fan::RolloutGradient<fan::Model>*>(made)->roll(*in);
}

FAN_EXPORT void fan_gradient_sweep(void* made, const fan::GradientArrays* in) {
  static_cast<fan::RolloutGradient<fan::Model>*>(made)->sweep(*in);
}
