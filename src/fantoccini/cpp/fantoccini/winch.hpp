// What a string's winch does beyond its commands, and how it is caught.
//
// A winch with a largest tension slips: the string's length is L + slip with slip >= 0, and
//
//   0 <= tension < max:  the slip is wound back;   tension = max:  it grows faster than that
//
// It is wound back at rewind_speed and braked evenly to rest at no slip, or not at all:
//
//   rate of slip = -min(rewind_speed, sqrt(2 kBrake slip))
#pragma once

#include "contract.hpp"

namespace fan {

constexpr double kUnlimited = 1e300;  // a largest tension that is none
constexpr double kBrake = 1.0;        // m/s^2
constexpr double kNoSlip = 1e-20;     // m
// m: what a winch could wind back in 2 us it does not. With the rounding s of a slip it would wind
// at sqrt(2 kBrake s).
constexpr double kTrace = 2e-12;
// m: by how much a winch may have slipped the wrong way, or be off its string's length, where
// redundant strings contradict one another.
constexpr double kGive = 1e-10;

// Slip while it is wound back [m, m/s, m/s^2].
struct Wound {
  double slip, rate, acc;
};

// Three numbers a string, by Python.
template <int S>
struct Winches {
  double max_tension[room(S)];   // N; kUnlimited for none
  double rewind_speed[room(S)];  // m/s; 0 for none
  double restitution[room(S)];   // of catches, 0 to 1
  bool some_slip = false;        // whether any has a largest tension

  void set(const double* table) {
    some_slip = false;
    for (int i = 0; i < S; ++i) {
      const double* own = table + WinchLayout::width * i;
      max_tension[i] = own[WinchLayout::max_tension];
      rewind_speed[i] = own[WinchLayout::rewind_speed];
      restitution[i] = own[WinchLayout::restitution];
      some_slip = some_slip || slips(i);
    }
  }

  bool slips(int row) const { return row < S && max_tension[row] < kUnlimited; }

  // The rate at which a slip is wound back.
  double winding(int i, double slip) const {
    if (!(slip > 0.0)) return 0.0;
    const double braked = sqrt(2.0 * kBrake * slip);
    return braked < rewind_speed[i] ? -braked : -rewind_speed[i];
  }

  // The slip `time` after it was `slip`, within the stretch that `stretch` gives.
  Wound wound(int i, double slip, double time) const {
    const double speed = rewind_speed[i];
    if (!(slip > kTrace && speed > 0.0)) return {slip, 0.0, 0.0};
    if (slip > braking(i)) return {slip - speed * time, -speed, 0.0};
    const double left = sqrt(2.0 * slip / kBrake) - time;
    return {0.5 * kBrake * left * left, -kBrake * left, kBrake};
  }

  // How long the winch goes on as it does: until it brakes, or until it stops; 0 where it rests.
  double stretch(int i, double slip) const {
    const double speed = rewind_speed[i];
    if (!(slip > kTrace && speed > 0.0)) return 0.0;
    return slip > braking(i) ? (slip - 0.5 * speed * speed / kBrake) / speed
                             : sqrt(2.0 * slip / kBrake);
  }

  // A slip without what the clock at `time` does not resolve of its stretch.
  double resolved(int i, double slip, double time) const {
    if (!(slip > kNoSlip)) return slip < 0.0 && slip >= -kGive ? slip : 0.0;
    const double left = stretch(i, slip), finest = 1e-15 * (fabs(time) > 1.0 ? fabs(time) : 1.0);
    if (left == 0.0 || left > finest) return slip;
    return slip > braking(i) ? 0.5 * rewind_speed[i] * rewind_speed[i] / kBrake : 0.0;
  }

 private:
  // The slip at which braking begins; a trace more, so that a stretch ends in the next one.
  double braking(int i) const {
    return 0.5 * rewind_speed[i] * rewind_speed[i] / kBrake * (1.0 + 1e-9);
  }
};

}  // namespace fan
