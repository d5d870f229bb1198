// Contact points of a step: where solids touch or may touch before its end, and the rows of A_D
// there.
//
//   u = e . (v_A + w_A x P - v_B - w_B x P),   e the normal and two tangents at the point P
//
// with (v, w) a link's twist about the world's origin, the sum of the screws of the velocities that
// move it. Rows have the sign of h, like those of strings: hdot = -u, so that h = -gap <= 0 where
// solids do not overlap, and a force x >= 0 pushes A along +e and B along -e.
#pragma once

#include "moved_by.hpp"
#include "near_pairs.hpp"
#include "placed_links.hpp"

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
class ContactPoints : public PlacedLinks<Model, Real> {
  using Links = PlacedLinks<Model, Real>;
  using Ball = typename Links::Ball;
  using Twist = typename Links::Twist;
  using RealTwist = typename Links::RealTwist;

 public:
  static constexpr int C = Model::n_contacts, N = Links::N, NK = Links::NK;
  static constexpr int width = Links::width;
  using Tolerance = ContactPointTolerances;
  using Mask = typename Traits<Real>::Mask;

  struct Point {
    int pair, feature, region;  // of ContactArrays; which of the pair's points; of Touch
    double gap, at[3];       // m
    double frame[9];         // normal, tangent, tangent
    int before;              // which of those that pushed in the step before; -1 for none
    bool carried, slid;      // whether any of its pair did, and moved across the normal
  };

  int n[width], most;        // points of each lane, and of the one that has most
  Point point[width][room(C)];
  bool too_many[width] = {};  // whether a lane has had more points than there is room for
  Triple<Real> row[room(C)][room(N)];  // of A_D: every point's normal and tangents
  Triple<Real> rate_K[room(C)];        // A_K v_K of these rows
  using Moved =
      std::conditional_t<(width > 1), MovedInLanes<N, Real>, MovedBy<N>>;
  Moved moved[room(C)];                // where a point's rows may differ from zero

  // Whether there is a point i in a lane. Bundles leave places free; see ContactPointsLanes.
  FAN_FN bool has(int l, int i) const {
    return i < n[l] && (width == 1 || point[l][i].pair >= 0);
  }

  // Takes the solids; nothing is known of where they are.
  FAN_FN void begin(const ContactArrays& in) {
    Links::begin(in);
    double sum = 0.0, n_links = 0.0;
    for (int i = 0; i < L; ++i) {
      if (!has_solids(i)) continue;
      sum += Links::around_[i].radius;
      n_links += 1.0;
    }
    slack_ = n_links > 0.0 ? NearPairsTolerances::slack * sum / n_links : 0.0;
    for (int l = 0; l < width; ++l) near_[l].forget();
  }

  // The least gap of every pair at a configuration of lane 0; pairs farther apart than the margin
  // keep what is in `gaps`.
  void measure(
      const ContactArrays& in, const Real* q_D, const Real* q_K, const Real* p, double margin,
      double* gaps) {
    Real v_D[room(N)] = {}, v_K[room(NK)] = {};
    Call<Model, Real>::screws(q_D, q_K, p, links_);
    begin(in);
    load(0, v_D, v_K);
    move();
    place();
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

  // Makes the rows of lane 0's point i.
  void make_rows(const ContactArrays& in, int i) {
    clear(i);
    clear_row(i);  // whoever asks for them reads all entries
    fill(in, 0, i);
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
      if (n[l] > 0 && width > 1) load(l, v_D, v_K);
      for (int i = 0; i < n[l]; ++i) fill(in, l, i);
    }
  }

  // The lanes in which some link may go farther than the margins of find() allow for, if the step
  // dt changes the velocities by dv_D. Each link may gain half of the fixed part over the step, as
  // the other one of a pair may, and its own part of what they travel.
  FAN_FN Mask outruns(const Real* dv_D, double dt) const {
    const double fixed = 0.5 * Tolerance::margin / dt;
    RealTwist twist[room(L)];
    add_real_twists(dv_D, twist);
    Mask out = Real(0.0) > Real(1.0);
    for (int i = 0; i < L; ++i) {
      if (reach_[i] == 0.0) continue;
      const Real *u = twist[i].linear, *w = twist[i].angular, *r = links_.poses + 12 * i + 9;
      const Real v[3] = {
          u[0] + w[1] * r[2] - w[2] * r[1], u[1] + w[2] * r[0] - w[0] * r[2],
          u[2] + w[0] * r[1] - w[1] * r[0]};
      const Real spare = fixed + (Tolerance::travel - 1.0) * speed_at_start_[i];
      // (a + b)^2 <= 2 (a^2 + b^2)
      const Real square = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) +
                          (w[0] * w[0] + w[1] * w[1] + w[2] * w[2]) * (reach_[i] * reach_[i]);
      out = out || 2.0 * square > spare * spare;
    }
    return out;
  }

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
      if (width > 1) load(l, v_D, v_K);
      for (int i = n_before[l]; i < n[l]; ++i) fill(in, l, i);
    }
    return more;
  }

 protected:
  using Links::add_real_twists, Links::tangents;
  using Links::L, Links::B, Links::load, Links::move, Links::place, Links::place_link;
  using Links::separation, Links::smallest_size, Links::is_far, Links::are_far;
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
      list_near(in, near);
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

  // Lists the pairs that are nearer than the slack.
  template <class Near>
  FAN_FN void list_near(const ContactArrays& in, Near& near) {
    near.begin(poses_, ball_of_);
    for (int g = 0, k = 0; g < in.n_groups; ++g) {
      const int a = in.groups[3 * g], b = in.groups[3 * g + 1], end = in.groups[3 * g + 2];
      const bool far = b < 0 ? is_far(ball_of_[a], in.solids[-1 - b], slack_)
                             : is_far(ball_of_[a], ball_of_[b], slack_);
      if (far) {
        k = end;
        continue;
      }
      if (!is_placed_[a]) place_link(in, a);
      if (b >= 0 && !is_placed_[b]) place_link(in, b);
      for (; k < end; ++k) {
        Touch found[max_touches];
        if (touch(in, k, slack_, found) > 0) near.add(k);
      }
    }
  }

  // The points of pair k, whose solids are placed, with a gap below a margin; returns how many.
  FAN_FN int touch(const ContactArrays& in, int k, double margin, Touch* found) {
    const int a = in.pairs[2 * k], b = in.pairs[2 * k + 1];
    const Solid &x = placed_[a], &y = b < B ? placed_[b] : in.solids[b];
    if (b < B ? is_far(ball_[a], ball_[b], margin) : is_far(ball_[a], y, margin)) return 0;
    if (are_far(x, y, margin)) return 0;
    return touches(x, y, margin, found);
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
    for (int side = 0; side < 2; ++side) {
      const int link = in.solids[in.pairs[2 * k + side]].link;
      if (link >= 0 && !is_placed_[link]) place_link(in, link);
    }
    look_at_placed(in, k, margin, l);
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
      Point& to = point[l][n[l]++];
      to.pair = k;
      to.feature = found[i].feature;
      to.region = found[i].region;
      to.gap = found[i].gap;
      for (int c = 0; c < 3; ++c) {
        to.at[c] = found[i].point[c];
        to.frame[c] = found[i].normal[c];
      }
      tangents(to.frame);
    }
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

  FAN_FN void clear(int i) {
    moved[i].clear();
    rate_K[i].clear();
    if (width > 1) clear_row(i);
  }

  FAN_FN void clear_row(int i) {
    for (int k = 0; k < N; ++k) row[i][k].clear();
  }

  // The rows of lane l's point i. Of one trajectory, only entries that move it are written where its
  // two links have none in common.
  FAN_FN void fill(const ContactArrays& in, int l, int i) {
    const Point& from = point[l][i];
    const double *e = from.frame, *at = from.at;
    int links[2];
    for (int side = 0; side < 2; ++side) {
      const int link = links[side] = in.solids[in.pairs[2 * from.pair + side]].link;
      const int *begin = Model::moved_D_begin + link, *entry = Model::moved_D_entry;
      if (link >= 0) moved[i].add_in(l, link, entry + begin[0], entry + begin[1]);
    }
    const bool fresh = width == 1 && moved[i].apart;
    if (width == 1 && !fresh) clear_row(i);
    // The three directions' parts along each axis, and their moments about the origin.
    Quad of[3], moment[3];
    FAN_UNROLL for (int c = 0; c < 3; ++c) of[c] = Quad{e[c], e[3 + c], e[6 + c], 0.0};
    FAN_UNROLL for (int c = 0; c < 3; ++c)
      moment[c] = at[(c + 1) % 3] * of[(c + 2) % 3] - at[(c + 2) % 3] * of[(c + 1) % 3];
    const auto speed = [&](const double* s) {  // of the point, by a screw
      return (of[0] * s[0] + of[1] * s[1] + of[2] * s[2]) +
             (moment[0] * s[3] + moment[1] * s[4] + moment[2] * s[5]);
    };
    for (int side = 0; side < 2; ++side) {
      const int link = links[side];
      if (link < 0) continue;
      const double sign = side ? 1.0 : -1.0;
      for (int j = Model::moved_D_begin[link]; j < Model::moved_D_begin[link + 1]; ++j) {
        const int k = Model::moved_D_entry[j];
        if (fresh) row[i][k].clear();
        row[i][k].add_in(l, sign, speed(screw_D_ + 6 * k));
      }
      for (int j = Model::moved_K_begin[link]; j < Model::moved_K_begin[link + 1]; ++j) {
        const int k = Model::moved_K_entry[j];
        rate_K[i].add_in(l, sign * v_K_[k], speed(screw_K_ + 6 * k));
      }
    }
  }

  NearPairs<L, 4 * L> near_[width];
  double slack_ = 0.0;              // m: of the lists of near pairs
  Real speed_at_start_[room(L)];    // m/s: by which the margins of find() were chosen
  double passing_within_ = 0.0;  // s: the step, while only points that would be passed are added
};

}  // namespace fan

FAN_LOOPS_END
