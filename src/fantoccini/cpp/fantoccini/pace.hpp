// Whether events stop time from passing: rows that chatter are told from a cascade, which ends.
#pragma once

#include "real.hpp"

namespace fan {

constexpr double kPace = 1e-6;        // s an event: a longer mean since the count began ends it
constexpr long long kCrowd = 10000;   // events in one count
constexpr long long kStandstill = 200;  // steps in a row without time passing

template <int M>
struct Pace {
  long long of_row[room(M)] = {};  // events since the count began

  // Books an event of a row, -1 for none, at t.
  void note(double t, int row) {
    if (n_ == 0 || t - begun_ > kPace * double(n_)) begin(t);
    ++n_;
    if (row >= 0) ++of_row[row];
  }

  bool crowded() const { return n_ > kCrowd; }

  // By row, its part in the events, 0 to 1.
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
