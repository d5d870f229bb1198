// What a string's winch does beyond its commands, and how it is caught.
//
// A winch with a largest tension slips: the string's length is L + slip with slip >= 0, and
//
//   0 <= tension < max:  slip changes at the winding rate;   tension = max:  it grows faster
//
// The winding rate is 0, or -rewind_speed while there is slip to be wound back.
#pragma once

#include "real.hpp"

namespace fan {

constexpr double kUnlimited = 1e300;  // a largest tension that is none

// Three numbers a string, by Python.
template <int S>
struct Winches {
  double max_tension[room(S)];   // N; kUnlimited for none
  double rewind_speed[room(S)];  // m/s; 0 for none
  double restitution[room(S)];   // of catches, 0 to 1

  void set(const double* table) {
    for (int i = 0; i < S; ++i) {
      max_tension[i] = table[3 * i];
      rewind_speed[i] = table[3 * i + 1];
      restitution[i] = table[3 * i + 2];
    }
  }

  bool slips(int row) const { return row < S && max_tension[row] < kUnlimited; }

  // The rate at which a winch that does not slip changes the slip.
  double winding(int i, double slip) const { return slip > 0.0 ? -rewind_speed[i] : 0.0; }
};

}  // namespace fan
