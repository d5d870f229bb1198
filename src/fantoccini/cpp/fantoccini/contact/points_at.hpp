// Contact points of one trajectory at a state: which are near, one of them by what it lies on, how they
// move, and how soon others may.
#pragma once

#include "fantoccini/collision/touch.hpp"
#include "fantoccini/contact/points.hpp"

FAN_LOOPS_BEGIN

namespace fan {

template <class Model>
class ContactPointsAt : public ContactPoints<Model, double> {
  using Base = ContactPoints<Model, double>;
  using Twist = typename PlacedLinks<Model, double>::Twist;

 public:
  using Base::C, Base::n, Base::most, Base::point, Base::row, Base::too_many;
  using typename Base::Point, typename Base::Tolerance;

  // The points with a gap below `margin` where lane 0 is posed.
  void look_within(const ContactArrays& in, double margin) {
    n[0] = 0;
    too_many[0] = false;  // a state that an integrator only tried may have had too many
    for (int g = 0, k = 0; g < in.n_groups; ++g) {
      const int end = in.groups[3 * g + 2];
      if (separation(in, g) >= margin) k = end;
      for (; k < end; ++k) look(in, k, margin, 0);
    }
    most = n[0];
  }

  // Those of one pair alone.
  void look_at_pair(const ContactArrays& in, int pair, double margin) {
    n[0] = 0;
    look(in, pair, margin, 0);
  }

  // Which of lane 0's points has a feature of a pair, and a region if that lasts, or -1. Where it is
  // none of those that touch, it is made by these alone, and put behind them; `holds`: it is still one.
  int find_feature(const ContactArrays& in, int pair, int feature, int region, bool* holds) {
    *holds = true;
    for (int i = 0; i < n[0]; ++i)
      if (is_one(point[0][i], pair, feature, region) && touches_there(i)) return i;
    const int a = in.pairs[2 * pair], b = in.pairs[2 * pair + 1];
    place_pair(in, pair);
    Touch found;
    if (n[0] == C) return -1;
    const Solid &x = placed_[a], &y = b < B ? placed_[b] : in.solids[b];
    if (!follow_touch(x, y, feature, region, &found, holds)) return -1;
    put(pair, found, point[0][n[0]]);
    return n[0];
  }

  // Whether a point has a feature of a pair, and a region if that lasts.
  template <class Any>
  static bool is_one(const Any& point, int pair, int feature, int region) {
    return point.pair == pair && point.feature == feature &&
           (point.region == region || (point.region < lasting_regions && region < lasting_regions));
  }

  // Whether it is lane 0's point i that touches, rather than one of other features.
  bool touches_there(int i) const { return point[0][i].region != BEYOND; }

  // Makes the rows of lane 0's point i.
  void make_rows(const ContactArrays& in, int i) {
    clear(i);
    fill(in, 0, i);
    clear_row(row[i]);  // whoever asks for them reads all entries
    Base::need_row(in, i);
  }

  // The velocity of the first solid against the second at lane 0's point i.
  void velocity(const ContactArrays& in, int i, double* u) const {
    const Point& at = point[0][i];
    for (int c = 0; c < 3; ++c) u[c] = 0.0;
    for (int side = 0; side < 2; ++side) {
      const int link = in.solids[in.pairs[2 * at.pair + side]].link;
      if (link < 0) continue;
      const Twist& t = twist_[link];
      double by_turning[3];
      cross(t.angular, at.at, by_turning);
      for (int c = 0; c < 3; ++c) u[c] += (side ? -1.0 : 1.0) * (t.linear[c] + by_turning[c]);
    }
  }

  // A bound on the rate [1/s] at which the directions at a point of a pair change, where its solids
  // pass over one another at a speed.
  double rate_of_turning(const ContactArrays& in, int pair, double speed) const {
    double rate = 0.0, least = unbounded;
    for (int side = 0; side < 2; ++side) {
      const Solid& solid = in.solids[in.pairs[2 * pair + side]];
      if (solid.kind != HALF_SPACE) least = fmin(least, smallest_size(solid));
      if (solid.link < 0) continue;
      const double* turning = twist_[solid.link].angular;
      rate += sqrt(dot3(turning, turning));
    }
    return rate + speed / least;
  }

  // A time in which no solid of lane 0 passes through another, at the velocities it is posed with.
  double safe_time(const ContactArrays& in) const {
    double least = unbounded;
    for (int g = 0, k = 0; g < in.n_groups; ++g) {
      const int a = in.groups[3 * g], b = in.groups[3 * g + 1], end = in.groups[3 * g + 2];
      const int first = k;
      k = end;
      if (b < 0 && in.solids[-1 - b].kind == HALF_SPACE) continue;
      double size = unbounded;
      for (int i = first; i < end; ++i)
        size = fmin(size, smallest_size(in.solids[in.pairs[2 * i]]) +
                              smallest_size(in.solids[in.pairs[2 * i + 1]]));
      const double speed = speed_[a] + (b < 0 ? 0.0 : speed_[b]);
      const double way = fmax(separation(in, g), 0.0) + Tolerance::share_of_size * size;
      if (speed * least > way) least = way / speed;
    }
    return least;
  }

 private:
  using Base::B, Base::clear, Base::clear_row, Base::fill, Base::look, Base::place_pair, Base::placed_;
  using Base::put, Base::separation, Base::smallest_size, Base::speed_, Base::twist_;
};

}  // namespace fan

FAN_LOOPS_END
