// Definitions of the functions of touch.hpp. Include it first, in exactly one translation unit.
#pragma once

#define FAN_TOUCH_FN

#include "fantoccini/collision/touch.hpp"
