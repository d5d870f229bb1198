// Slip and rewinding of a string's winch, and the restitution of catches.
//
// A winch with a largest tension slips: the string's length is L + slip with slip >= 0, and
//
//   0 <= tension < max:  the slip is rewound;   tension = max:  its rate is larger than that
//
// It is rewound at rewind_speed, with constant deceleration to rest at no slip, or not at all:
//
//   rate of slip = -min(rewind_speed, sqrt(2 Tolerance::brake slip))
#pragma once

#include "fantoccini/contract.hpp"
#include "fantoccini/math/real.hpp"

namespace fan {

struct WinchTolerances {
  static constexpr double brake = Constants::winch_deceleration;  // m/s^2
  // m: a smaller slip counts as 0.
  static constexpr double negligible_slip = 1e-20;
  // m: a smaller slip is not rewound, which would take less than sqrt(2 slip / brake) = 2 us:
  // rounding would start the winch.
  static constexpr double max_resting_slip = 2e-12;
  // m: largest negative slip, or difference from its string's gap, with redundant strings that
  // contradict one another.
  static constexpr double max_length_error = 1e-10;
  // Braking begins at a slip larger by this fraction, so that the end of a stretch lies in the next
  // one.
  static constexpr double braking_margin = 1e-9;
  static constexpr double clock = 1e-15;  // resolution of times, relative to them or to 1 s
};

// Slip while it is rewound [m, m/s, m/s^2].
struct Wound {
  double slip, rate, acc;
};

// Three numbers per string (WinchLayout), which Python sets.
template <int S>
struct Winches {
  using Tolerance = WinchTolerances;

  double max_tension[array_size(S)];   // N; unbounded for none
  double rewind_speed[array_size(S)];  // m/s; 0 for none
  double restitution[array_size(S)];   // of catches, 0 to 1
  bool some_slip = false;              // whether any string has a largest tension

  void set(const double* table) {
    some_slip = false;
    for (int i = 0; i < S; ++i) {
      const double* numbers = table + WinchLayout::width * i;
      max_tension[i] = numbers[WinchLayout::max_tension];
      rewind_speed[i] = numbers[WinchLayout::rewind_speed];
      restitution[i] = numbers[WinchLayout::restitution];
      some_slip = some_slip || slips(i);
    }
  }

  bool slips(int row) const { return row < S && max_tension[row] < unbounded; }

  // N: the largest tension or force of a row.
  double largest(int row) const { return row < S ? max_tension[row] : unbounded; }

  // The rate at which a slip is rewound.
  double winding(int i, double slip) const {
    if (!(slip > 0.0)) return 0.0;
    const double braked = sqrt(2.0 * Tolerance::brake * slip);
    return braked < rewind_speed[i] ? -braked : -rewind_speed[i];
  }

  // The same over a fixed step, in which at most the whole slip is rewound.
  template <class Real>
  FAN_FN Real winding(int i, const Real& slip, double dt) const {
    using std::sqrt;
    if (!(rewind_speed[i] > 0.0)) return Real(0.0);
    const Real braked = sqrt(Real(2.0 * Tolerance::brake) * slip);
    return -minimum(Real(slip * (1.0 / dt)), minimum(braked, Real(rewind_speed[i])));
  }

  // The slip a time after it was `slip`, for times up to `stretch`.
  Wound wound(int i, double slip, double time) const {
    const double speed = rewind_speed[i];
    if (!(slip > Tolerance::max_resting_slip && speed > 0.0)) return {slip, 0.0, 0.0};
    if (slip > braking(i)) return {slip - speed * time, -speed, 0.0};
    const double rest = sqrt(2.0 * slip / Tolerance::brake) - time;
    return {0.5 * Tolerance::brake * rest * rest, -Tolerance::brake * rest, Tolerance::brake};
  }

  // s: time of constant acceleration: until the winch brakes, or until it stops; 0 if it rests.
  double stretch(int i, double slip) const {
    const double speed = rewind_speed[i];
    if (!(slip > Tolerance::max_resting_slip && speed > 0.0)) return 0.0;
    return slip > braking(i) ? (slip - 0.5 * speed * speed / Tolerance::brake) / speed
                             : sqrt(2.0 * slip / Tolerance::brake);
  }

  // A slip at `time`: that at the end of its stretch if the rest of the stretch is below the
  // resolution of times; 0 if it is negligible.
  double resolved(int i, double slip, double time) const {
    if (!(slip > Tolerance::negligible_slip))
      return slip < 0.0 && slip >= -Tolerance::max_length_error ? slip : 0.0;
    const double rest = stretch(i, slip);
    const double resolution = Tolerance::clock * (fabs(time) > 1.0 ? fabs(time) : 1.0);
    if (rest == 0.0 || rest > resolution) return slip;
    return slip > braking(i) ? 0.5 * rewind_speed[i] * rewind_speed[i] / Tolerance::brake : 0.0;
  }

 private:
  // m: the slip at which braking begins.
  double braking(int i) const {
    return 0.5 * rewind_speed[i] * rewind_speed[i] / Tolerance::brake *
           (1.0 + Tolerance::braking_margin);
  }
};

}  // namespace fan
