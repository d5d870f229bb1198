// Pairs of solids that may touch soon, kept from step to step: all others stay farther apart than
// any margin until a link has moved by its part of the slack.
//
// A point of a link's ball (centre c, radius b) moves by at most |c - c'| + b |R - R'|, with the
// Frobenius norm, from the pose at which the list was made. Together with the link's part of the
// margin of a step, this may reach half of the slack.
#pragma once

#include "fantoccini/math/real.hpp"
#include "fantoccini/math/space.hpp"

namespace fan {

struct NearPairsTolerances {
  // Slack, relative to the mean radius of the links' balls.
  static constexpr double slack = 0.3;
  // Shortest life of a useful list [steps], and steps without a list after a shorter one.
  static constexpr int min_life = 3, wait = 8;
};

template <int n_links, int capacity>
class NearPairs {
 public:
  using Tolerance = NearPairsTolerances;

  int n = 0;
  int pair[array_size(capacity)];

  // Discards the list.
  FAN_FN void forget() {
    known_ = false;
    life_ = Tolerance::min_life;
    wait_ = 0;
  }

  // Whether the list is still valid for links at these poses (12 numbers each), with balls about
  // `centre` and these margins; the radius is 0 for links that do not count.
  template <class Balls>
  FAN_FN bool holds(const double* poses, const Balls& ball, const double* margin, double slack) {
    bool all = known_;
    for (int i = 0; i < n_links && all; ++i) {
      if (ball[i].radius == 0.0) continue;
      const double left = 0.5 * slack - margin[i], *R = poses + 12 * i, *old = R_[i];
      double turned = 0.0, moved = 0.0;
      FAN_UNROLL for (int k = 0; k < 9; ++k) turned += (R[k] - old[k]) * (R[k] - old[k]);
      FAN_UNROLL for (int c = 0; c < 3; ++c) moved +=
          (ball[i].at[c] - at_[i][c]) * (ball[i].at[c] - at_[i][c]);
      // (a + b)^2 <= 2 (a^2 + b^2)
      const double square = 2.0 * (moved + ball[i].radius * ball[i].radius * turned);
      all = left > 0.0 && square < left * left;
    }
    if (all) ++life_;
    return all;
  }

  // Whether there is a list, and the poses with which holds() compares.
  FAN_FN bool is_known() const { return known_; }
  FAN_FN const double* turned(int link) const { return R_[link]; }
  FAN_FN const double* centre(int link) const { return at_[link]; }

  // Counts one more step for which the list was valid.
  FAN_FN void count_step() { ++life_; }

  // Whether to make a list now.
  FAN_FN bool is_due() {
    if (known_ && life_ < Tolerance::min_life) wait_ = Tolerance::wait;
    known_ = false;
    return wait_ == 0 || --wait_ == 0;
  }

  // Begins an empty list at these poses.
  template <class Balls>
  FAN_FN void begin(const double* poses, const Balls& ball) {
    for (int i = 0; i < n_links; ++i) {
      if (ball[i].radius == 0.0) continue;
      for (int k = 0; k < 9; ++k) R_[i][k] = poses[12 * i + k];
      for (int c = 0; c < 3; ++c) at_[i][c] = ball[i].at[c];
    }
    n = life_ = 0;
    known_ = true;
  }

  // Adds a pair, in order. A list that overflows is discarded.
  FAN_FN void add(int k) {
    if (n < capacity) {
      pair[n++] = k;
    } else {
      known_ = false;
      wait_ = Tolerance::wait;
    }
  }

 private:
  bool known_ = false;
  int life_ = 0, wait_ = 0;
  double R_[array_size(n_links)][9], at_[array_size(n_links)][3];
};

}  // namespace fan
