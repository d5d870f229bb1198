// Contact points of one trajectory at a state: the near points, a point from its features alone,
// their velocities, and a time before which no others touch.
#pragma once

#include "fantoccini/collision/touch.hpp"
#include "fantoccini/contact/points.hpp"

FAN_LOOPS_BEGIN

namespace fan {

template <class Model>
class ContactPointsAt {
  using Points = ContactPoints<Model, double>;
  using Links = PlacedLinks<Model, double>;
  using Twist = typename Links::Twist;

 public:
  static constexpr int C = Points::C;
  using Point = typename Points::Point;
  using Tolerance = typename Points::Tolerance;

  // The points of the last search and the one appended to them; their rows, once computed.
  int n() const { return points_.n[0]; }
  const Point& point(int i) const { return points_.point[0][i]; }
  const Triple<double>* row(int i) const { return points_.row[i]; }
  const Triple<double>& rate_K(int i) const { return points_.rate_K[i]; }
  bool too_many() const { return points_.too_many[0]; }

  // Poses the links at a configuration and velocity.
  void pose(
      const ContactArrays& in, const double* q_D, const double* v_D, const double* q_K,
      const double* v_K, const double* p) {
    points_.pose(in, q_D, v_D, q_K, v_K, p);
  }

  // Finds the points with a gap below `margin` at the current poses.
  void search(const ContactArrays& in, double margin) {
    points_.n[0] = 0;
    points_.too_many[0] = false;  // a trial state of an integrator may have had too many
    for (int g = 0, k = 0; g < in.n_groups; ++g) {
      const int end = in.groups[3 * g + 2];
      if (links().separation(in, g) >= margin) k = end;
      for (; k < end; ++k) points_.search_pair(in, k, margin, 0);
    }
    points_.n_max = points_.n[0];
  }

  // Likewise those of one pair.
  void search_one_pair(const ContactArrays& in, int pair, double margin) {
    points_.n[0] = 0;
    points_.search_pair(in, pair, margin, 0);
  }

  // Index of the point with a feature of a pair, and with a region if it is lasting, or -1. If no
  // touching point has it, the point is computed from these alone and appended; `holds`: whether it
  // lies within its features.
  int find_feature(const ContactArrays& in, int pair, int feature, int region, bool* holds) {
    *holds = true;
    for (int i = 0; i < n(); ++i)
      if (matches(point(i), pair, feature, region) && touches_there(i)) return i;
    const int a = in.pairs[2 * pair], b = in.pairs[2 * pair + 1];
    points_.place_pair(in, pair);
    Touch touch;
    if (n() == C) return -1;
    const Solid &x = links().placed[a], &y = b < Points::B ? links().placed[b] : in.solids[b];
    if (!follow_touch(x, y, feature, region, &touch, holds)) return -1;
    Points::put(pair, touch, points_.point[0][n()]);
    return n();
  }

  // Whether a point has a feature of a pair, and a region if it is lasting.
  template <class Any>
  static bool matches(const Any& point, int pair, int feature, int region) {
    return point.pair == pair && point.feature == feature &&
           (point.region == region || (point.region < lasting_regions && region < lasting_regions));
  }

  // Whether point i itself touches, rather than one of other features.
  bool touches_there(int i) const { return point(i).region != BEYOND; }

  // Computes the rows of point i.
  void make_rows(const ContactArrays& in, int i) {
    points_.clear(i);
    points_.fill(in, 0, i);
    Points::clear_row(points_.row[i]);  // callers read all entries
    points_.need_row(in, i);
  }

  // The velocity of the first solid against the second at point i.
  void velocity(const ContactArrays& in, int i, double* u) const {
    const Point& at = point(i);
    for (int c = 0; c < 3; ++c) u[c] = 0.0;
    for (int side = 0; side < 2; ++side) {
      const int link = in.solids[in.pairs[2 * at.pair + side]].link;
      if (link < 0) continue;
      const Twist& t = links().twist[link];
      double by_turning[3];
      cross(t.angular, at.at, by_turning);
      for (int c = 0; c < 3; ++c) u[c] += (side ? -1.0 : 1.0) * (t.linear[c] + by_turning[c]);
    }
  }

  // An upper bound of the rate [1/s] at which the directions at a point of a pair change, for
  // solids that pass over one another at a speed.
  double rate_of_turning(const ContactArrays& in, int pair, double speed) const {
    double rate = 0.0, least = unbounded;
    for (int side = 0; side < 2; ++side) {
      const Solid& solid = in.solids[in.pairs[2 * pair + side]];
      if (solid.kind != HALF_SPACE) least = fmin(least, Links::smallest_size(solid));
      if (solid.link < 0) continue;
      const double* turning = links().twist[solid.link].angular;
      rate += sqrt(dot3(turning, turning));
    }
    return rate + speed / least;
  }

  // A time within which no solid passes through another, at the current velocities of the links.
  double safe_time(const ContactArrays& in) const {
    double least = unbounded;
    for (int g = 0, k = 0; g < in.n_groups; ++g) {
      const int a = in.groups[3 * g], b = in.groups[3 * g + 1], end = in.groups[3 * g + 2];
      const int first = k;
      k = end;
      if (b < 0 && in.solids[-1 - b].kind == HALF_SPACE) continue;
      double size = unbounded;
      for (int i = first; i < end; ++i)
        size = fmin(
            size, Links::smallest_size(in.solids[in.pairs[2 * i]]) +
                      Links::smallest_size(in.solids[in.pairs[2 * i + 1]]));
      const double speed = links().speed[a] + (b < 0 ? 0.0 : links().speed[b]);
      const double way = fmax(links().separation(in, g), 0.0) + Tolerance::share_of_size * size;
      if (speed * least > way) least = way / speed;
    }
    return least;
  }

 private:
  const Links& links() const { return points_.placed_links(); }

  Points points_;
};

}  // namespace fan

FAN_LOOPS_END
