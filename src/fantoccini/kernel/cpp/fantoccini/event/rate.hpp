// Detects events so frequent that time nearly stands still: rows that chatter. A cascade of
// catches, which ends, has fewer.
#pragma once

#include "fantoccini/math/real.hpp"

namespace fan {

struct EventRateTolerances {
  // s: if the mean interval since the count began is longer, the count starts again. Rows that
  // chatter have shorter ones.
  static constexpr double max_interval = 1e-6;
  // Events in one count: more than in any cascade.
  static constexpr long long max_events = 10000;
  // Weight of an instant with contact, which takes this many times as long.
  static constexpr int of_contact = 10;
};

template <int M>
struct EventRate {
  long long of_row[array_size(M)] = {};  // events since the count began

  // Counts an event of a row, -1 for none, at t, as `weight` events.
  void note(double t, int row, int weight = 1) {
    if (n_ == 0 || t - begun_ > EventRateTolerances::max_interval * double(n_)) begin(t);
    n_ += weight;
    if (row >= 0) ++of_row[row];
  }

  bool crowded() const { return n_ > EventRateTolerances::max_events; }

  // By row, its events relative to those of the row with the most, 0 to 1.
  void shares(double* out) const {
    long long most = 1;
    for (int r = 0; r < M; ++r) most = of_row[r] > most ? of_row[r] : most;
    for (int r = 0; r < M; ++r) out[r] = double(of_row[r]) / double(most);
  }

 private:
  void begin(double t) {
    begun_ = t;
    n_ = 0;
    for (int r = 0; r < M; ++r) of_row[r] = 0;
  }

  double begun_ = 0.0;
  long long n_ = 0;
};

}  // namespace fan
