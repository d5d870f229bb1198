// The functions of touch.hpp as a unit of their own. Include it in one translation unit.
#pragma once

#define FAN_TOUCH_FN

#include "touch.hpp"
