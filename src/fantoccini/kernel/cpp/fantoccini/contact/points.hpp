// Contact points of a step: where solids touch or may touch before its end, and their rows of A_D,
//
//   u = e . (v_A + w_A x P - v_B - w_B x P),   e the normal and two tangents at the point P
//
// with (v, w) a link's twist about the world's origin, the sum of the screws of the velocities that
// move it. Rows have the sign of h, like those of strings: hdot = -u, so that h = -gap <= 0 where
// solids do not overlap, and a force x >= 0 pushes A along +e and B along -e. For one trajectory,
// rows are written on demand; hdot comes from the links' twists.
#pragma once

#include "fantoccini/collision/near_pairs.hpp"
#include "fantoccini/collision/placed_links.hpp"
#include "fantoccini/contact/directions.hpp"
#include "fantoccini/contact/moved_by.hpp"

FAN_LOOPS_BEGIN

namespace fan {

struct ContactPointTolerances {
  // m: gap below which a pair is considered at any speed.
  static constexpr double margin = 1e-3;
  // Likewise, relative to the largest distance that the two solids approach in a step at the speeds
  // at its start.
  static constexpr double travel = 2.0;
  // Largest travel in one step, relative to the sum of two solids' smallest radii or half edges.
  static constexpr double share_of_size = 0.5;
  // m/s: speed at which a solid passes another; above rounding.
  static constexpr double passing_speed = 1e-12;
};

template <class Model, class Real>
class ContactPoints {
  using Links = PlacedLinks<Model, Real>;
  using Twist = typename Links::Twist;

 public:
  static constexpr int C = Model::n_contacts, N = Links::N, NK = Links::NK;
  static constexpr int L = Links::L, B = Links::B, width = Links::width;
  using Tolerance = ContactPointTolerances;
  using Mask = typename Traits<Real>::Mask;

  struct Point {
    int pair, feature, region;  // of ContactArrays; point of the pair; of Touch
    double gap, at[3];          // m
    double frame[9];            // normal, tangent, tangent
    int before;          // its index among the points that pushed in the previous step; -1 for none
    bool carried, slid;  // whether any point of its pair pushed, and, in lanes, slid
  };

  int n[width], n_max;  // number of points of each lane, and the largest
  Point point[width][array_size(C)];
  Triple<Real> row[array_size(C)][array_size(N)];  // of A_D: every point's normal and tangents
  Triple<Real> rate_K[array_size(C)];              // A_K v_K of these rows
  MovedBy<N> moved[array_size(C)];                 // where a point's rows may differ from zero
  bool too_many[width] = {};  // whether a lane has had more points than the capacity

  // Loads the solids; their poses are unknown.
  FAN_FN void begin(const ContactArrays& in) {
    links_.begin(in);
    slack_ = links_.slack();
    for (int l = 0; l < width; ++l) near_[l].forget();
  }

  // The least gap of every pair at a configuration of lane 0; entries of pairs farther apart than
  // the margin are unchanged.
  void measure(
      const ContactArrays& in, const Real* q_D, const Real* q_K, const Real* p, double margin,
      double* gaps) {
    const Real v_D[array_size(N)] = {}, v_K[array_size(NK)] = {};
    pose(in, q_D, v_D, q_K, v_K, p);
    for (int k = 0; k < in.n_pairs; ++k) {
      n[0] = 0;
      search_pair(in, k, margin, 0);
      for (int i = 0; i < n[0]; ++i)
        if (i == 0 || point[0][i].gap < gaps[k]) gaps[k] = point[0][i].gap;
    }
  }

  // Poses the links of lane 0 at a configuration and velocity.
  void pose(
      const ContactArrays& in, const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K,
      const Real* p) {
    links_.locate(q_D, q_K, p);
    begin(in);
    links_.load(0, v_D, v_K);
    links_.move();
    links_.place();
  }

  // Finds the points at (q_D, q_K) over a step dt, in the lanes that are not idle. recall(lane)
  // then marks the points that pushed in the previous step.
  template <class Recall>
  FAN_FN void find(
      const ContactArrays& in, const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K,
      const Real* p, double dt, const Mask& idle, const Recall& recall) {
    links_.locate(q_D, q_K, p);
    n_max = 0;
    passing_within_ = 0.0;
    for (int l = 0; l < width; ++l) {
      n[l] = 0;
      if (lane_of(idle, l)) continue;
      links_.load(l, v_D, v_K);
      links_.move();
      links_.place();
      for (int i = 0; i < L; ++i) lane_of(speed_at_start_[i], l) = links_.speed[i];
      search_near_pairs(in, dt, l);
      recall(l);
      if (n[l] > n_max) n_max = n[l];
    }
    for (int i = 0; i < n_max; ++i) clear(i);
    for (int l = 0; l < width; ++l) {
      for (int i = 0; i < n[l]; ++i) fill(in, l, i);
    }
  }

  // Finds the points of the given pairs, whatever their gaps. For one trajectory.
  FAN_FN void find_of_pairs(
      const ContactArrays& in, const int* pairs, int n_pairs, const Real* q_D, const Real* v_D,
      const Real* q_K, const Real* v_K, const Real* p) {
    links_.locate(q_D, q_K, p);
    links_.load(0, v_D, v_K);
    links_.move();
    links_.place();
    n[0] = 0;
    for (int j = 0; j < n_pairs; ++j) search_pair(in, pairs[j], unbounded, 0);
    n_max = n[0];
    for (int i = 0; i < n_max; ++i) {
      clear(i);
      fill(in, 0, i);
    }
  }

  // As PlacedLinks::outruns(), by the margins of find().
  FAN_FN Mask outruns(const Real* dv_D, double dt) const {
    return links_.outruns(dv_D, dt, speed_at_start_, Tolerance::margin, Tolerance::travel);
  }

  // The list of near pairs.
  FAN_FN auto& near() { return near_[0]; }

  // Adds the points that the velocities v_D would pass in a step dt from the state of find(), in
  // some lanes. Returns whether there are any.
  FAN_FN bool find_more(
      const ContactArrays& in, const Real* v_D, const Real* v_K, double dt, const Mask& lanes) {
    const int n_max_before = n_max;
    int n_before[width];
    passing_within_ = dt;
    for (int l = 0; l < width; ++l) {
      n_before[l] = n[l];
      if (!lane_of(lanes, l)) continue;
      links_.load(l, v_D, v_K);
      links_.move();
      links_.place();
      search_all_pairs(in, dt, l);
      if (n[l] > n_max) n_max = n[l];
    }
    for (int i = n_max_before; i < n_max; ++i) clear(i);
    bool more = false;
    for (int l = 0; l < width; ++l) {
      if (n[l] == n_before[l]) continue;
      more = true;
      for (int i = n_before[l]; i < n[l]; ++i) fill(in, l, i);
    }
    return more;
  }

  // Whether there is a point i in a lane.
  FAN_FN bool has(int l, int i) const { return i < n[l]; }

  // hdot of points at velocities v_D.
  class Rates {
   public:
    FAN_FN Rates(const ContactPoints& of, const Real* v_D) : of_(of), v_D_(v_D) {
      for (bool& known : is_known_) known = false;
    }

    FAN_FN Triple<Real> operator()(int i) {
      Triple<Real> out = change(i);
      out.add(Real(1.0), of_.rate_K[i]);
      return out;
    }

    // Without driven motion: change of hdot by a change of velocity.
    FAN_FN Triple<Real> change(int i) {
      Triple<Real> out;
      out.clear();
      for (int side = 0; side < 2; ++side) {
        const int link = of_.link_[i][side];
        if (link < 0) continue;
        if (!is_known_[link]) of_.turn(link, v_D_, twist_[link]);
        is_known_[link] = true;
        const auto& by = twist_[link];
        out.add(side ? 1.0 : -1.0, {of_.form_[i].speed(by.linear, by.angular)});
      }
      return out;
    }

   private:
    const ContactPoints& of_;
    const Real* v_D_;
    Twist twist_[array_size(Links::L)];  // of the links used so far
    bool is_known_[array_size(Links::L)];
  };

  // hdot of point i at the velocities of find().
  FAN_FN Triple<Real> rate(int i, const Real* v_D) const {
    Triple<Real> out;
    out.clear();
    for (int side = 0; side < 2; ++side) {
      const int link = link_[i][side];
      if (link >= 0)
        out.add(
            side ? 1.0 : -1.0,
            {form_[i].speed(links_.twist[link].linear, links_.twist[link].angular)});
    }
    return out;
  }

  // The links of a point's solids; -1 for the world. For one trajectory.
  FAN_FN const int* links(int i) const { return link_[i]; }

  // Writes point i's row unless it exists.
  FAN_FN void need_row(const ContactArrays& in, int i) {
    if (is_written_[i]) return;
    is_written_[i] = true;
    write(in, 0, point[0][i].pair, form_[i], moved[i], row[i]);
  }

  // The rows of three directions at a point of a pair, and of rotations about them, in units of
  // `size` [m]. For one trajectory.
  FAN_FN void write_rows(
      const ContactArrays& in, int pair, const double* at, const double* frame,
      const MovedBy<N>& by, Triple<Real>* out) const {
    write(in, 0, pair, PointDirections(frame, at), by, out);
  }

  FAN_FN void write_turns(
      const ContactArrays& in, int pair, const double* frame, double size, const MovedBy<N>& by,
      Triple<Real>* out) const {
    write(in, 0, pair, PointDirections(frame, size), by, out);
  }

  // Adds the points of pair k to those of lane l.
  FAN_FN void search_pair(const ContactArrays& in, int k, double margin, int l) {
    place_pair(in, k);
    search_placed_pair(in, k, margin, l);
  }

  // Places the solids of both links of a pair.
  FAN_FN void place_pair(const ContactArrays& in, int k) {
    for (int side = 0; side < 2; ++side) {
      const int link = in.solids[in.pairs[2 * k + side]].link;
      if (link >= 0 && !links_.is_placed[link]) links_.place_link(in, link);
    }
  }

  // Most points of a pair have the same normal: `last` is the previous point.
  FAN_FN static void put(int pair, const Touch& from, Point& to, const Point* last = nullptr) {
    to.pair = pair;
    to.feature = from.feature;
    to.region = from.region;
    to.gap = from.gap;
    for (int c = 0; c < 3; ++c) {
      to.at[c] = from.point[c];
      to.frame[c] = from.normal[c];
    }
    if (last && same(last->frame, to.frame))
      FAN_UNROLL for (int c = 3; c < 9; ++c) to.frame[c] = last->frame[c];
    else add_tangents(to.frame);
  }

  // Discards point i's rows.
  FAN_FN void clear(int i) {
    moved[i].clear();
    rate_K[i].clear();
    is_written_[i] = false;
  }

  FAN_FN static void clear_row(Triple<Real>* out) {
    for (int k = 0; k < N; ++k) out[k].clear();
  }

  // Fills in lane l's point i: its links, and the velocities that move it.
  FAN_FN void fill(const ContactArrays& in, int l, int i) {
    const Point& from = point[l][i];
    const PointDirections& form = form_[i] = PointDirections(from.frame, from.at);
    for (int side = 0; side < 2; ++side) {
      const int link = link_[i][side] = in.solids[in.pairs[2 * from.pair + side]].link;
      if (link < 0) continue;
      const int *begin = Model::moved_D_begin + link, *entry = Model::moved_D_entry;
      moved[i].add(link, entry + begin[0], entry + begin[1]);
      for (int j = Model::moved_K_begin[link]; j < Model::moved_K_begin[link + 1]; ++j) {
        const double* s = links_.screw_K + 6 * Model::moved_K_entry[j];
        const double speed = links_.v_K[Model::moved_K_entry[j]];
        rate_K[i].add_in(l, side ? speed : -speed, form.speed(s, s + 3));
      }
    }
  }

  FAN_FN const Links& placed_links() const { return links_; }

 private:
  // Finds the points of lane l among the pairs that are near, or among all.
  FAN_FN void search_near_pairs(const ContactArrays& in, double dt, int l) {
    auto& near = near_[l];
    double margin[array_size(L)];
    for (int i = 0; i < L; ++i)
      margin[i] = 0.5 * Tolerance::margin + Tolerance::travel * dt * links_.speed[i];
    if (!near.holds(links_.poses, links_.ball_of, margin, slack_)) {
      if (!near.is_due()) return search_all_pairs(in, dt, l);
      links_.list_near(in, near, slack_);
      if (!near.holds(links_.poses, links_.ball_of, margin, slack_))
        return search_all_pairs(in, dt, l);
    }
    for (int j = 0; j < near.n; ++j) {
      const int k = near.pair[j], a = in.solids[in.pairs[2 * k]].link;
      const int other = in.pairs[2 * k + 1], b = other < B ? in.solids[other].link : -1;
      if (!links_.is_placed[a]) links_.place_link(in, a);
      if (b >= 0 && !links_.is_placed[b]) links_.place_link(in, b);
      const double speed = links_.speed[a] + (b < 0 ? 0.0 : links_.speed[b]);
      search_placed_pair(in, k, Tolerance::margin + Tolerance::travel * dt * speed, l);
    }
  }

  // Finds the points of lane l.
  FAN_FN void search_all_pairs(const ContactArrays& in, double dt, int l) {
    for (int g = 0, k = 0; g < in.n_groups; ++g) {
      const int a = in.groups[3 * g], b = in.groups[3 * g + 1], end = in.groups[3 * g + 2];
      const double speed = links_.speed[a] + (b < 0 ? 0.0 : links_.speed[b]);
      const double margin = Tolerance::margin + Tolerance::travel * dt * speed;
      const bool distant = b < 0 ? links_.is_far(links_.ball_of[a], in.solids[-1 - b], margin)
                                 : links_.is_far(links_.ball_of[a], links_.ball_of[b], margin);
      if (distant) {
        k = end;
        continue;
      }
      if (!links_.is_placed[a]) links_.place_link(in, a);
      if (b >= 0 && !links_.is_placed[b]) links_.place_link(in, b);
      for (; k < end; ++k) search_placed_pair(in, k, margin, l);
    }
  }

  // Adds the points of pair k, whose links' solids are placed, to those of lane l.
  FAN_FN void search_placed_pair(const ContactArrays& in, int k, double margin, int l) {
    Touch near_touch[max_touches];
    const int n_near = links_.touch(in, k, margin, near_touch);
    for (int i = 0; i < n_near; ++i) {
      if (passing_within_ > 0.0 && !joins(in, k, near_touch[i], l)) continue;
      if (n[l] == C) {
        too_many[l] = true;
        return;
      }
      put(k, near_touch[i], point[l][n[l]], n[l] > 0 ? &point[l][n[l] - 1] : nullptr);
      ++n[l];
    }
  }

  FAN_FN static bool same(const double* a, const double* b) {
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
  }

  // Whether a point of pair k is not among lane l's, and would be passed.
  FAN_FN bool joins(const ContactArrays& in, int k, const Touch& touch, int l) const {
    for (int i = 0; i < n[l]; ++i)
      if (point[l][i].pair == k && point[l][i].feature == touch.feature) return false;
    double closing = 0.0;
    for (int side = 0; side < 2; ++side) {
      const int link = in.solids[in.pairs[2 * k + side]].link;
      if (link < 0) continue;
      const Twist& t = links_.twist[link];
      double v[3];
      cross(t.angular, touch.point, v);
      for (int c = 0; c < 3; ++c) v[c] += t.linear[c];
      closing += (side ? 1.0 : -1.0) * dot3(v, touch.normal);
    }
    return closing - touch.gap / passing_within_ > Tolerance::passing_speed;
  }

  // The twist of a link.
  FAN_FN void turn(int link, const double* v_D, Twist& out) const {
    Quad linear{}, angular{};
    for (int j = Model::moved_D_begin[link]; j < Model::moved_D_begin[link + 1]; ++j) {
      const int k = Model::moved_D_entry[j];
      linear += v_D[k] * quad(links_.screw_D + 6 * k);
      angular += v_D[k] * quad(links_.screw_D + 6 * k + 3);
    }
    quad(out.linear) = linear;
    quad(out.angular) = angular;
  }

  // Adds the rows of a pair in lane l to `out`. For one trajectory, if its two links share no
  // velocity, only entries that move it are written, and the others need not be 0 before.
  FAN_FN void write(
      const ContactArrays& in, int l, int pair, const PointDirections& form, const MovedBy<N>& by,
      Triple<Real>* out) const {
    const bool fresh = by.apart;
    if (!fresh) clear_row(out);
    for (int side = 0; side < 2; ++side) {
      const int link = in.solids[in.pairs[2 * pair + side]].link;
      if (link < 0) continue;
      for (int j = Model::moved_D_begin[link]; j < Model::moved_D_begin[link + 1]; ++j) {
        const int k = Model::moved_D_entry[j];
        const double* s = links_.screw_D + 6 * k;
        if (fresh) out[k].clear();
        out[k].add_in(l, side ? 1.0 : -1.0, form.speed(s, s + 3));
      }
    }
  }

  Links links_;
  NearPairs<L, 4 * L> near_[width];
  double slack_ = 0.0;                  // m: of the lists of near pairs
  Real speed_at_start_[array_size(L)];  // m/s: from which the margins of find() follow
  double passing_within_ = 0.0;  // s: the step, while only points that would be passed are added
  // Of one trajectory.
  PointDirections form_[array_size(C)];
  int link_[array_size(C)][2];
  bool is_written_[array_size(C)];
};

}  // namespace fan

FAN_LOOPS_END
