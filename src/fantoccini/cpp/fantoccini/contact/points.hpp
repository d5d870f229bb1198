// Contact points of a step: where solids touch or may touch before its end, and the rows of A_D
// there (rows.hpp).
#pragma once

#include "fantoccini/collision/near_pairs.hpp"
#include "fantoccini/contact/rows.hpp"

FAN_LOOPS_BEGIN

namespace fan {

struct ContactPointTolerances {
  // m: gap up to which a pair is looked at, whatever its speed.
  static constexpr double margin = 1e-3;
  // The same, in what the two solids travel towards each other in a step at most, at the speeds of
  // its start.
  static constexpr double travel = 2.0;
  // Share of the sum of two solids' smallest radii or half edges that they travel in one go.
  static constexpr double share_of_size = 0.5;
  // m/s at which a solid would pass another: above rounding.
  static constexpr double passing_speed = 1e-12;
};

template <class Model, class Real>
class ContactPoints : public ContactRows<Model, Real> {
  using Links = PlacedLinks<Model, Real>;
  using Rows = ContactRows<Model, Real>;
  using Ball = typename Links::Ball;
  using Twist = typename Links::Twist;
  using RealTwist = typename Links::RealTwist;

 public:
  static constexpr int C = Model::n_contacts, N = Links::N, NK = Links::NK;
  static constexpr int width = Links::width;
  using Tolerance = ContactPointTolerances;
  using Mask = typename Traits<Real>::Mask;

  using typename Rows::Point;
  using Rows::n, Rows::most, Rows::point, Rows::row, Rows::rate_K, Rows::moved;
  bool too_many[width] = {};  // whether a lane has had more points than there is room for

  // Takes the solids; nothing is known of where they are.
  FAN_FN void begin(const ContactArrays& in) {
    Links::begin(in);
    slack_ = Links::slack();
    for (int l = 0; l < width; ++l) near_[l].forget();
  }

  // The least gap of every pair at a configuration of lane 0; pairs farther apart than the margin
  // keep what is in `gaps`.
  void measure(
      const ContactArrays& in, const Real* q_D, const Real* q_K, const Real* p, double margin,
      double* gaps) {
    const Real v_D[room(N)] = {}, v_K[room(NK)] = {};
    pose(in, q_D, v_D, q_K, v_K, p);
    for (int k = 0; k < in.n_pairs; ++k) {
      n[0] = 0;
      look(in, k, margin, 0);
      for (int i = 0; i < n[0]; ++i)
        if (i == 0 || point[0][i].gap < gaps[k]) gaps[k] = point[0][i].gap;
    }
  }

  // Poses the links of lane 0 at a configuration and velocity.
  void pose(
      const ContactArrays& in, const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K,
      const Real* p) {
    Call<Model, Real>::screws(q_D, q_K, p, links_);
    begin(in);
    load(0, v_D, v_K);
    move();
    place();
  }

  // The points at (q_D, q_K) over a step dt, in the lanes that are not idle. recall(lane) then
  // tells points what pushed in the step before.
  template <class Recall>
  FAN_FN void find(
      const ContactArrays& in, const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K,
      const Real* p, double dt, const Mask& idle, const Recall& recall) {
    Call<Model, Real>::screws(q_D, q_K, p, links_);
    most = 0;
    passing_within_ = 0.0;
    for (int l = 0; l < width; ++l) {
      n[l] = 0;
      if (lane_of(idle, l)) continue;
      load(l, v_D, v_K);
      move();
      place();
      for (int i = 0; i < L; ++i) lane_of(speed_at_start_[i], l) = speed_[i];
      look_at_near(in, dt, l);
      recall(l);
      if (n[l] > most) most = n[l];
    }
    for (int i = 0; i < most; ++i) clear(i);
    for (int l = 0; l < width; ++l) {
      for (int i = 0; i < n[l]; ++i) fill(in, l, i);
    }
  }

  // As PlacedLinks::outruns(), by the margins of find().
  FAN_FN Mask outruns(const Real* dv_D, double dt) const {
    return Links::outruns(dv_D, dt, speed_at_start_, Tolerance::margin, Tolerance::travel);
  }

  // The list of near pairs.
  FAN_FN auto& near() { return near_[0]; }

  // Adds the points that the velocities v_D would pass in a step dt from what find() was given, in
  // some lanes. Returns whether there are any.
  FAN_FN bool find_more(
      const ContactArrays& in, const Real* v_D, const Real* v_K, double dt, const Mask& lanes) {
    const int most_before = most;
    int n_before[width];
    passing_within_ = dt;
    for (int l = 0; l < width; ++l) {
      n_before[l] = n[l];
      if (!lane_of(lanes, l)) continue;
      load(l, v_D, v_K);
      move();
      place();
      look_at_all(in, dt, l);
      if (n[l] > most) most = n[l];
    }
    for (int i = most_before; i < most; ++i) clear(i);
    bool more = false;
    for (int l = 0; l < width; ++l) {
      if (n[l] == n_before[l]) continue;
      more = true;
      for (int i = n_before[l]; i < n[l]; ++i) fill(in, l, i);
    }
    return more;
  }

 protected:
  using Rows::clear, Rows::clear_row, Rows::fill;
  using Links::add_real_twists;
  using Links::L, Links::B, Links::load, Links::move, Links::place, Links::place_link;
  using Links::separation, Links::smallest_size, Links::is_far, Links::are_far, Links::touch, Links::list_near;
  using Links::links_, Links::poses_, Links::screw_D_, Links::screw_K_, Links::v_K_, Links::twist_, Links::speed_;
  using Links::reach_, Links::has_solids, Links::placed_, Links::ball_, Links::ball_of_, Links::is_placed_;

  // Finds the points of lane l among the pairs that are near, or among all.
  FAN_FN void look_at_near(const ContactArrays& in, double dt, int l) {
    auto& near = near_[l];
    double margin[room(L)];
    for (int i = 0; i < L; ++i)
      margin[i] = 0.5 * Tolerance::margin + Tolerance::travel * dt * speed_[i];
    if (!near.holds(poses_, ball_of_, margin, slack_)) {
      if (!near.is_due()) return look_at_all(in, dt, l);
      list_near(in, near, slack_);
      if (!near.holds(poses_, ball_of_, margin, slack_)) return look_at_all(in, dt, l);
    }
    for (int j = 0; j < near.n; ++j) {
      const int k = near.pair[j], a = in.solids[in.pairs[2 * k]].link;
      const int other = in.pairs[2 * k + 1], b = other < B ? in.solids[other].link : -1;
      if (!is_placed_[a]) place_link(in, a);
      if (b >= 0 && !is_placed_[b]) place_link(in, b);
      const double speed = speed_[a] + (b < 0 ? 0.0 : speed_[b]);
      look_at_placed(in, k, Tolerance::margin + Tolerance::travel * dt * speed, l);
    }
  }

  // Finds the points of lane l.
  FAN_FN void look_at_all(const ContactArrays& in, double dt, int l) {
    for (int g = 0, k = 0; g < in.n_groups; ++g) {
      const int a = in.groups[3 * g], b = in.groups[3 * g + 1], end = in.groups[3 * g + 2];
      const double speed = speed_[a] + (b < 0 ? 0.0 : speed_[b]);
      const double margin = Tolerance::margin + Tolerance::travel * dt * speed;
      const bool far = b < 0 ? is_far(ball_of_[a], in.solids[-1 - b], margin)
                             : is_far(ball_of_[a], ball_of_[b], margin);
      if (far) {
        k = end;
        continue;
      }
      if (!is_placed_[a]) place_link(in, a);
      if (b >= 0 && !is_placed_[b]) place_link(in, b);
      for (; k < end; ++k) look_at_placed(in, k, margin, l);
    }
  }

  // Adds the points of pair k to those of lane l.
  FAN_FN void look(const ContactArrays& in, int k, double margin, int l) {
    place_pair(in, k);
    look_at_placed(in, k, margin, l);
  }

  FAN_FN void place_pair(const ContactArrays& in, int k) {
    for (int side = 0; side < 2; ++side) {
      const int link = in.solids[in.pairs[2 * k + side]].link;
      if (link >= 0 && !is_placed_[link]) place_link(in, link);
    }
  }

  // The same where the solids of both links are placed.
  FAN_FN void look_at_placed(const ContactArrays& in, int k, double margin, int l) {
    Touch found[max_touches];
    const int n_found = touch(in, k, margin, found);
    for (int i = 0; i < n_found; ++i) {
      if (passing_within_ > 0.0 && !joins(in, k, found[i], l)) continue;
      if (n[l] == C) {
        too_many[l] = true;
        return;
      }
      put(k, found[i], point[l][n[l]], n[l] > 0 ? &point[l][n[l] - 1] : nullptr);
      ++n[l];
    }
  }

  // Points of a pair mostly have one normal: `last` is the point before.
  FAN_FN static void put(int pair, const Touch& from, Point& to, const Point* last = nullptr) {
    to.pair = pair;
    to.feature = from.feature;
    to.region = from.region;
    to.gap = from.gap;
    for (int c = 0; c < 3; ++c) {
      to.at[c] = from.point[c];
      to.frame[c] = from.normal[c];
    }
    if (last && same(last->frame, to.frame)) FAN_UNROLL for (int c = 3; c < 9; ++c) to.frame[c] = last->frame[c];
    else add_tangents(to.frame);
  }

  FAN_FN static bool same(const double* a, const double* b) {
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
  }

  // Whether a point of pair k is none of lane l's, and would be passed.
  FAN_FN bool joins(const ContactArrays& in, int k, const Touch& touch, int l) const {
    for (int i = 0; i < n[l]; ++i)
      if (point[l][i].pair == k && point[l][i].feature == touch.feature) return false;
    double closing = 0.0;
    for (int side = 0; side < 2; ++side) {
      const int link = in.solids[in.pairs[2 * k + side]].link;
      if (link < 0) continue;
      const Twist& t = twist_[link];
      double v[3];
      cross(t.angular, touch.point, v);
      for (int c = 0; c < 3; ++c) v[c] += t.linear[c];
      closing += (side ? 1.0 : -1.0) * dot3(v, touch.normal);
    }
    return closing - touch.gap / passing_within_ > Tolerance::passing_speed;
  }

  NearPairs<L, 4 * L> near_[width];
  double slack_ = 0.0;              // m: of the lists of near pairs
  Real speed_at_start_[room(L)];    // m/s: by which the margins of find() were chosen
  double passing_within_ = 0.0;  // s: the step, while only points that would be passed are added
};

}  // namespace fan

FAN_LOOPS_END
