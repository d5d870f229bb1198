// Real with the widest vectors of the processor and the compiler, or one double.
#pragma once

#include <cmath>

#ifndef FAN_WIDTH
#if defined(__GNUC__)
#if defined(__AVX512F__)
#define FAN_WIDTH 8
#elif defined(__AVX__)
#define FAN_WIDTH 4
#elif defined(__SSE2__) || defined(__aarch64__)
#define FAN_WIDTH 2
#else
#define FAN_WIDTH 1
#endif
#else
#define FAN_WIDTH 1
#endif
#endif

#include "fantoccini/math/elementary.hpp"

#if FAN_WIDTH > 1
#include "fantoccini/math/lanes.hpp"
#endif

namespace fan {

#if FAN_WIDTH > 1
using Wide = Lanes<FAN_WIDTH>;
#else
using Wide = double;
#endif

}  // namespace fan
