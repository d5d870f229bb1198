// Accumulations of catches (Zeno): a rod on two strings inside its radius of gyration is caught by
// one and the other in turn, at intervals that shrink geometrically. When four intervals in a row
// have shrunk and what is left of gap and speed is below tolerance, all participants are brought
// taut at once.
#pragma once

#include "contact.hpp"

namespace fan {

template <int M>
struct Accumulation {
  static constexpr int kept = 6;
  static constexpr double gap = 1e-7;    // relative to the row's scale
  static constexpr double speed = 1e-6;  // m/s or rad/s

  double times[kept];
  int row[kept];
  int n = 0;
  bool member[room(M)];

  // Books the catch about to happen; true when the last catches accumulate here and now.
  template <class Flow>
  bool watch(const Flow& f, const bool* closed, const bool* before) {
    int caught = -1;
    for (int r = 0; r < M; ++r)
      if (closed[r] && !before[r]) caught = r;
    if (n == kept) {
      for (int i = 1; i < kept; ++i) {
        times[i - 1] = times[i];
        row[i - 1] = row[i];
      }
      --n;
    }
    times[n] = f.t;
    row[n] = caught;
    ++n;
    if (n < kept) return false;
    for (int i = 2; i < kept; ++i)
      if (!(times[i] - times[i - 1] < 0.98 * (times[i - 1] - times[i - 2]))) return false;
    for (int r = 0; r < M; ++r) member[r] = closed[r];
    for (int i = 0; i < kept; ++i) member[row[i]] = true;
    for (int r = 0; r < M; ++r) {
      if (!member[r]) continue;
      if (!(f.eval.height(r) > -gap * f.row_scale(r))) return false;
      if (!(fabs(f.rate_of(r, f.y + Flow::NQ)) < speed)) return false;
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
