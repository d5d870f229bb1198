// Marks the functions that a compiled puppet exports.
#pragma once

#define FAN_EXPORT extern "C" __attribute__((visibility("default")))
