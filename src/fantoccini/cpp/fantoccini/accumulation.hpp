// Accumulations of catches (Zeno): strings that share a body are caught in turn, each catch
// loosening the others, at intervals that shrink geometrically. Once several catches in a row are
// slower than `speed`, what is left of gaps and speeds is below tolerance and all participants are
// brought taut at once. The impulses still to come act along the same rows as the projection does,
// so the state after it differs by about speed times the time still to come, some 1e-11.
#pragma once

#include "contact.hpp"

namespace fan {

template <int M>
struct Accumulation {
  static constexpr int kept = 6;           // catches in a row
  static constexpr double window = 1e-4;   // s in which they happen
  static constexpr double gap = 1e-9;      // relative to the row's scale
  static constexpr double speed = 1e-5;    // m/s or rad/s

  double times[kept];
  double fastest[kept];
  bool caught[kept][room(M)];
  bool member[room(M)];
  int n = 0;

  // Books the catch about to happen: `closed` rows of which `before` were taut already.
  template <class Flow>
  void watch(const Flow& f, const bool* closed, const bool* before) {
    const int at = n++ % kept;
    times[at] = f.t;
    fastest[at] = 0.0;
    for (int r = 0; r < M; ++r) {
      caught[at][r] = closed[r];
      const double rate = f.rate_of(r, f.y + Flow::NQ);
      if (closed[r] && !before[r] && rate > fastest[at]) fastest[at] = rate;
    }
  }

  // Whether the last catches accumulate here and now.
  template <class Flow>
  bool reached(const Flow& f) {
    if (n < kept || f.t - times[n % kept] > window) return false;
    for (int r = 0; r < M; ++r) member[r] = false;
    for (int i = 0; i < kept; ++i) {
      if (fastest[i] > speed) return false;
      for (int r = 0; r < M; ++r) member[r] = member[r] || caught[i][r];
    }
    for (int r = 0; r < M; ++r) {
      const bool far = f.eval.height(r) < -gap * f.row_scale(r);
      const bool fast = fabs(f.rate_of(r, f.y + Flow::NQ)) > 2.0 * speed;
      if (member[r] && (far || fast)) member[r] = false;
    }
    n = 0;
    return true;
  }

  // Brings all members taut at (t, y): positions and velocities projected, the loss booked.
  template <class Flow>
  Status settle(Flow& f, double& impact) {
    double rate[Flow::NY];
    const double before = f.total_energy();
    for (int r = 0; r < M; ++r) f.taut[r] = member[r];
    f.evaluate(f.t, f.y, rate);
    const Status status = f.project(f.t, f.y);
    if (status != RUNNING) return status;
    f.evaluate(f.t, f.y, rate);
    impact += before - f.total_energy();
    return RUNNING;
  }
};

}  // namespace fan
