// What a compiled puppet shows to the outside.
#pragma once

#define FAN_EXPORT extern "C" __attribute__((visibility("default")))
