// Accumulations of catches (Zeno): strings that share a body are caught in turn, each catch
// loosening the others, at intervals that shrink geometrically. The sequence ends where a loosened
// row is slower than max_rest_speed (attempts.hpp) and is held. This class recognises such a
// sequence.
#pragma once

namespace fan {

struct Accumulation {
  static constexpr int n_catches = 6;  // catches: five intervals, four of which follow another
  static constexpr double max_ratio = 0.98;  // of successive intervals that shrink

  double times[n_catches] = {};
  int n = 0;

  // Adds the time of a catch.
  void watch(double t) {
    if (n == n_catches) {
      for (int i = 1; i < n_catches; ++i) times[i - 1] = times[i];
      --n;
    }
    times[n++] = t;
  }

  // Whether each of the last four intervals between catches is shorter than the one before it.
  bool shrinking() const {
    if (n < n_catches) return false;
    for (int i = 2; i < n_catches; ++i)
      if (!(times[i] - times[i - 1] < max_ratio * (times[i - 1] - times[i - 2]))) return false;
    return true;
  }

  // Limit of the catch times if the intervals keep shrinking as the last two did.
  double limit() const {
    const double last = times[n - 1] - times[n - 2], before = times[n - 2] - times[n - 3];
    return times[n - 1] + last * last / (before - last);
  }

  void forget() { n = 0; }
};

}  // namespace fan
