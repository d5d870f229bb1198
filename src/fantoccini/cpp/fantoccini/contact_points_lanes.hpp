// Contact points of a bundle of lanes: the links' motion, the balls around their solids, the test
// whether lists of near pairs still hold, the points of boxes, capsules and spheres on half-spaces that
// stand, and the rows of A_D in all lanes at once. Other pairs whose balls are near are looked at lane
// by lane.
//
// Points have places that agree between lanes as far as they can: first those that pushed in the step
// before, in the order of their pairs, then the others, each pair with as many places as the lane
// that has most of its points. Columns are made of places: so few are, and those of one link each.
#pragma once

#include "contact_points.hpp"
#include "touch_plane_lanes.hpp"

namespace fan {

template <class Model, class Real>
class ContactPointsLanes : public ContactPoints<Model, Real> {
  using Points = ContactPoints<Model, Real>;

 public:
  using Points::C, Points::N, Points::width, Points::n, Points::most, Points::point, Points::row;
  using Points::rate_K, Points::moved;
  using typename Points::Mask, typename Points::Point, typename Points::Tolerance;

  // Takes the solids; nothing is known of where they are.
  FAN_FN void begin(const ContactArrays& in) {
    Points::begin(in);
    known_ = Real(0.0) > Real(1.0);
    is_listed_anew_ = true;
    n_listed_ = 0;
  }

  // Begins the search at (q_D, q_K): where the links are and how they move.
  FAN_FN void place_at(
      const ContactArrays& in, const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K,
      const Real* p, double dt) {
    Call<Model, Real>::screws(q_D, q_K, p, links_);
    move_all(v_D, v_K);
    place_all();
    good_ = known_ && hold(dt);
    if (any(good_) && is_listed_anew_) merge_lists(in);
  }

  // Finds the points of `ground` over a step dt in these lanes. Returns those in which that is all
  // there is.
  template <class Ground>
  FAN_FN Mask find_on(const ContactArrays& in, double dt, const Mask& lanes, Ground& ground) {
    Mask alone = lanes && good_;
    ground.clear();
    for (int j = 0; j < n_listed_; ++j) {
      const int k = listed_[j].pair;
      Real margin;
      const Mask near = near_in(in, k, dt, listed_[j].lanes && alone, margin);
      if (!any(near)) continue;
      const int own = in.pairs[2 * k];
      if (ground.takes(in, k)) {
        const Solid &x = in.solids[own], &y = in.solids[in.pairs[2 * k + 1]];
        touch_plane_lanes(
            x, links_.poses + 12 * x.link, y, margin, near,
            [&](int feature, const Real* at, const Real& gap, const Mask& where) {
              ground.add(own, feature, at, gap, where);
            });
        continue;
      }
      for (int l = 0; l < width; ++l)
        if (lane_of(near, l) && touches_in(in, k, lane_of(margin, l), l)) alone.set(l, false);
    }
    for (int l = 0; l < width; ++l)
      if (lane_of(alone, l)) near_[l].serve();
    return alone;
  }

  // The points of these lanes, as ContactPoints::find(), after place_at().
  template <class Recall>
  FAN_FN void find_in(
      const ContactArrays& in, const Real* v_D, const Real* v_K, double dt, const Mask& lanes,
      const Recall& recall) {
    most = 0;
    passing_within_ = 0.0;
    for (int l = 0; l < width; ++l) n[l] = 0;
    if (!any(lanes)) return;
    look_at_listed(in, dt, good_ && lanes);
    for (int l = 0; l < width; ++l) {
      if (!lane_of(lanes, l)) continue;
      if (lane_of(good_, l)) {
        near_[l].serve();
      } else {
        load(l, v_D, v_K);
        move();
        place();
        this->look_at_near(in, dt, l);
        learn(l);
      }
      recall(l);
    }
    arrange(in);
    for (int i = 0; i < most; ++i) {
      this->clear(i);
      fill_all(in, i, v_K);
    }
  }

  // A link's twist at the velocities of the step's start; the screw of a velocity; the twist of a link
  // that nothing drives at other velocities.
  FAN_FN const Real* twist(int link) const { return twist_of_ + 6 * link; }
  FAN_FN const Real* screw(int k) const { return links_.screw_D + 6 * k; }
  FAN_FN void twist_at(int link, const Real* v_D, Real* out) const {
    for (int c = 0; c < 6; ++c) out[c] = Real(0.0);
    for (int j = Model::moved_D_begin[link]; j < Model::moved_D_begin[link + 1]; ++j) {
      const int k = Model::moved_D_entry[j];
      FAN_UNROLL for (int c = 0; c < 6; ++c) out[c] += links_.screw_D[6 * k + c] * v_D[k];
    }
  }

 private:
  using Points::L, Points::NK, Points::links_, Points::near_, Points::reach_, Points::around_;
  using Points::speed_at_start_, Points::passing_within_, Points::slack_, Points::is_placed_;
  using Points::ball_, Points::lane_, Points::poses_, Points::has_solids, Points::load, Points::move, Points::place;

  // The places of points of one key: the pair, those that pushed before the others.
  struct Places {
    int key, n, first;
  };

  // Gives all points their places. Where there are too many, each lane has its own in that order.
  FAN_FN void arrange(const ContactArrays& in) {
    Places places[room(C)];
    int key[width][room(C)], n_places = 0, n_all = 0;
    bool fits = true;
    for (int l = 0; l < width; ++l)
      for (int i = 0, same[2] = {}; i < n[l]; ++i) {
        const int pair = point[l][i].pair, late = point[l][i].before < 0;
        if (i == 0 || pair != point[l][i - 1].pair) same[0] = same[1] = 0;
        const int own = key[l][i] = pair + late * int(in.n_pairs), count = ++same[late];
        int k = 0;
        while (k < n_places && places[k].key < own) ++k;
        if (k == n_places || places[k].key != own) {
          fits = fits && n_places < C;
          if (!fits) continue;
          for (int j = n_places++; j > k; --j) places[j] = places[j - 1];
          places[k] = {own, 0, 0};
        }
        if (places[k].n < count) places[k].n = count;
      }
    for (int k = 0; k < n_places; ++k) {
      places[k].first = n_all;
      n_all += places[k].n;
    }
    fits = fits && n_all <= C;
    for (int l = 0; l < width; ++l) {
      Point own[room(C)];
      const int n_own = n[l];
      for (int i = 0; i < n_own; ++i) own[i] = point[l][i];
      n[l] = 0;
      const auto put = [&](int i) { point[l][n[l]++] = own[i]; };
      for (int k = 0; k < n_places && fits; ++k) {
        const int end = places[k].first + places[k].n;
        for (int i = 0; i < n_own; ++i)
          if (key[l][i] == places[k].key) put(i);
        while (n[l] < end) point[l][n[l]++].pair = -1;
      }
      for (int late = 0; late < 2 && !fits; ++late)
        for (int i = 0; i < n_own; ++i)
          if ((key[l][i] >= in.n_pairs) == late) put(i);
      if (n[l] > most) most = n[l];
    }
  }

  // As PlacedLinks::move().
  FAN_FN void move_all(const Real* v_D, const Real* v_K) {
    for (int i = 0; i < L; ++i) {
      const int up = Model::link_parent[i];
      Real* to = twist_of_ + 6 * i;
      for (int c = 0; c < 6; ++c) to[c] = up < 0 ? Real(0.0) : twist_of_[6 * up + c];
      const auto add = [&](const int* begin, const int* entry, const Real* screw, const Real* v) {
        const int carried = up < 0 ? 0 : begin[up + 1] - begin[up];
        for (int j = begin[i] + carried; j < begin[i + 1]; ++j) {
          const Real *of = screw + 6 * entry[j], &speed = v[entry[j]];
          FAN_UNROLL for (int c = 0; c < 6; ++c) to[c] += of[c] * speed;
        }
      };
      add(Model::moved_D_begin, Model::moved_D_entry, links_.screw_D, v_D);
      add(Model::moved_K_begin, Model::moved_K_entry, links_.screw_K, v_K);
    }
  }

  // As PlacedLinks::place().
  FAN_FN void place_all() {
    using std::sqrt;
    for (int link = 0; link < L; ++link) {
      speed_at_start_[link] = Real(0.0);
      if (!has_solids(link)) continue;
      const Real *R = links_.poses + 12 * link, *t = twist_of_ + 6 * link;
      const double* own = around_[link].at;
      Real *at = centre_ + 3 * link, v[3];
      FAN_UNROLL for (int c = 0; c < 3; ++c)
        at[c] = R[9 + c] + R[c] * own[0] + R[3 + c] * own[1] + R[6 + c] * own[2];
      cross(t + 3, at, v);
      FAN_UNROLL for (int c = 0; c < 3; ++c) v[c] += t[c];
      speed_at_start_[link] = sqrt(dot3(v, v)) + sqrt(dot3(t + 3, t + 3)) * around_[link].radius;
    }
  }

  // As NearPairs::holds(): the lanes whose lists are still good.
  FAN_FN Mask hold(double dt) const {
    Mask all = Real(0.0) < Real(1.0);
    for (int link = 0; link < L; ++link) {
      if (!has_solids(link)) continue;
      const Real left = (0.5 * slack_ - 0.5 * Tolerance::margin) -
                        Tolerance::travel * dt * speed_at_start_[link];
      const Real *R = links_.poses + 12 * link, *old = old_ + 12 * link;
      Real turned = Real(0.0), moved_by = Real(0.0);
      FAN_UNROLL for (int k = 0; k < 9; ++k) turned += (R[k] - old[k]) * (R[k] - old[k]);
      FAN_UNROLL for (int c = 0; c < 3; ++c) {
        const Real by = centre_[3 * link + c] - old[9 + c];
        moved_by += by * by;
      }
      const double radius = around_[link].radius;
      const Real square = 2.0 * (moved_by + radius * radius * turned);
      all = all && left > Real(0.0) && square < left * left;
    }
    return all;
  }

  // Takes what lane l's list of near pairs knows.
  FAN_FN void learn(int l) {
    known_.set(l, near_[l].is_known());
    is_listed_anew_ = true;
    for (int link = 0; link < L && near_[l].is_known(); ++link) {
      if (!has_solids(link)) continue;
      for (int k = 0; k < 9; ++k) lane_of(old_[12 * link + k], l) = near_[l].turned(link)[k];
      for (int c = 0; c < 3; ++c) lane_of(old_[12 * link + 9 + c], l) = near_[l].centre(link)[c];
    }
  }

  // A pair in the lists of some lanes.
  struct Listed {
    int pair;
    Mask lanes;
  };

  // All pairs of the lists, in order.
  FAN_FN void merge_lists(const ContactArrays& in) {
    int at[width] = {};
    const int none = int(in.n_pairs);
    is_listed_anew_ = false;
    n_listed_ = 0;
    for (;;) {
      int k = none;
      for (int l = 0; l < width; ++l)
        if (lane_of(known_, l) && at[l] < near_[l].n && near_[l].pair[at[l]] < k) k = near_[l].pair[at[l]];
      if (k == none) return;
      Listed& to = listed_[n_listed_++];
      to.pair = k;
      to.lanes = Real(0.0) > Real(1.0);
      for (int l = 0; l < width; ++l)
        if (lane_of(known_, l) && at[l] < near_[l].n && near_[l].pair[at[l]] == k) {
          to.lanes.set(l, true);
          ++at[l];
        }
    }
  }

  // Finds the points of these lanes among the pairs of their lists, pair by pair.
  FAN_FN void look_at_listed(const ContactArrays& in, double dt, const Mask& lanes) {
    for (int j = 0; j < n_listed_; ++j) {
      const Mask own = listed_[j].lanes && lanes;
      if (any(own)) look_at_pair_in(in, listed_[j].pair, dt, own);
    }
  }

  // The lanes, of those given, in which the solids of pair k are within the margin of each other as
  // far as their balls tell.
  FAN_FN Mask near_in(const ContactArrays& in, int k, double dt, const Mask& lanes, Real& margin) const {
    if (!any(lanes)) return lanes;
    const int first = in.pairs[2 * k], second = in.pairs[2 * k + 1];
    const Solid &x = in.solids[first], &y = in.solids[second];
    Real speed = speed_at_start_[x.link], middle[3];
    if (y.link >= 0) speed += speed_at_start_[y.link];
    margin = Tolerance::margin + (Tolerance::travel * dt) * speed;
    place_middle(x, middle);
    if (y.kind == HALF_SPACE) {
      Real height = Real(0.0);
      for (int c = 0; c < 3; ++c) height += (middle[c] - y.a[c]) * y.b[c];
      return lanes && height - ball_[first].radius < margin;
    }
    Real other[3], square = Real(0.0);
    place_middle(y, other);
    for (int c = 0; c < 3; ++c) square += (middle[c] - other[c]) * (middle[c] - other[c]);
    const double own = y.link >= 0 ? ball_[second].radius : bounding_radius(y);
    const Real reach = margin + (ball_[first].radius + own);
    return lanes && square < reach * reach;
  }

  // Whether pair k has points in lane l.
  FAN_FN bool touches_in(const ContactArrays& in, int k, double margin, int l) {
    const int first = in.pairs[2 * k], second = in.pairs[2 * k + 1];
    Touch found[max_touches];
    place_in(in, first, l);
    if (in.solids[second].link >= 0) place_in(in, second, l);
    return this->touch(in, k, margin, found) > 0;
  }

  // Finds the points of pair k in these lanes.
  FAN_FN void look_at_pair_in(const ContactArrays& in, int k, double dt, const Mask& lanes) {
    const int first = in.pairs[2 * k], second = in.pairs[2 * k + 1];
    const Solid &x = in.solids[first], &y = in.solids[second];
    const Real* pose = links_.poses + 12 * x.link;
    Real margin;
    const Mask near = near_in(in, k, dt, lanes, margin);
    if (!any(near)) return;
    if (y.kind == HALF_SPACE && has_points_in_lanes(x)) {
      double frame[9];
      for (int c = 0; c < 3; ++c) frame[c] = y.b[c];
      add_tangents(frame);
      touch_plane_lanes(
          x, pose, y, margin, near,
          [&](int feature, const Real* at, const Real& gap, const Mask& where) {
            for (int l = 0; l < width; ++l)
              if (lane_of(where, l)) add_point(k, feature, at, gap, frame, l);
          });
      return;
    }
    for (int l = 0; l < width; ++l) {
      if (!lane_of(near, l)) continue;
      place_in(in, first, l);
      if (y.link >= 0) place_in(in, second, l);
      this->look_at_placed(in, k, lane_of(margin, l), l);
    }
  }

  // The middle of a solid in the world.
  FAN_FN void place_middle(const Solid& x, Real* out) const {
    double own[3];
    for (int c = 0; c < 3; ++c) own[c] = 0.5 * (x.a[c] + x.b[c]);
    if (x.link >= 0) return carry_in_lanes(links_.poses + 12 * x.link, own, out);
    for (int c = 0; c < 3; ++c) out[c] = Real(own[c]);
  }

  // Places one solid of a link as it is in lane l.
  FAN_FN void place_in(const ContactArrays& in, int solid, int l) {
    const Solid& x = in.solids[solid];
    double pose[12];
    for (int k = 0; k < 12; ++k) pose[k] = lane_of(links_.poses[12 * x.link + k], l);
    Points::placed(x, pose, pose + 9, this->placed_[solid]);
    for (int c = 0; c < 3; ++c)
      ball_[solid].at[c] = 0.5 * (this->placed_[solid].a[c] + this->placed_[solid].b[c]);
  }

  // Adds a point of pair k to those of lane l.
  FAN_FN void add_point(
      int k, int feature, const Real* at, const Real& gap, const double* frame, int l) {
    if (n[l] == C) {
      this->too_many[l] = true;
      return;
    }
    Point& to = point[l][n[l]++];
    to.pair = k;
    to.feature = feature;
    to.region = 0;
    to.gap = lane_of(gap, l);
    for (int c = 0; c < 3; ++c) to.at[c] = lane_of(at[c], l);
    for (int c = 0; c < 9; ++c) to.frame[c] = frame[c];
  }

  // The rows of point i of all lanes: first what moves the first bodies, then the second ones.
  FAN_FN void fill_all(const ContactArrays& in, int i, const Real* v_K) {
    Real at[3], frame[9], sign[2][2 * width];
    for (int k = 0; k < 3; ++k) at[k] = Real(0.0);
    for (int k = 0; k < 9; ++k) frame[k] = Real(0.0);
    auto& links = moved[i];
    bool is_side[2][2 * width];
    for (int l = 0; l < width; ++l) {
      if (!this->has(l, i)) continue;
      const auto& from = point[l][i];
      for (int k = 0; k < 3; ++k) lane_of(at[k], l) = from.at[k];
      for (int k = 0; k < 9; ++k) lane_of(frame[k], l) = from.frame[k];
      for (int side = 0; side < 2; ++side) {
        const int link = in.solids[in.pairs[2 * from.pair + side]].link;
        if (link < 0) continue;
        const int known = links.n_links, *begin = Model::moved_D_begin + link;
        const int *entry = Model::moved_D_entry;
        const int j = links.add_in(l, link, entry + begin[0], entry + begin[1]);
        for (int s = 0; s < 2 && j == known; ++s) {
          sign[s][j] = Real(0.0);
          is_side[s][j] = false;
        }
        lane_of(sign[side][j], l) = side ? 1.0 : -1.0;
        is_side[side][j] = true;
      }
    }
    for (int side = 0; side < 2; ++side)
      for (int j = 0; j < links.n_links; ++j)
        if (is_side[side][j]) add_link(i, links.which[j], sign[side][j], at, frame, v_K);
  }

  FAN_FN void add_link(
      int i, int link, const Real& sign, const Real* at, const Real* frame, const Real* v_K) {
    // The three directions, and their moments about the origin.
    Real of[9], moment[9];
    for (int k = 0; k < 9; ++k) of[k] = sign * frame[k];
    for (int d = 0; d < 9; d += 3) cross(at, of + d, moment + d);
    const auto speed = [&](const Real* s, int d) {  // of the point, by a screw
      return dot3(of + 3 * d, s) + dot3(moment + 3 * d, s + 3);
    };
    for (int j = Model::moved_D_begin[link]; j < Model::moved_D_begin[link + 1]; ++j) {
      const int k = Model::moved_D_entry[j];
      FAN_UNROLL for (int d = 0; d < 3; ++d) row[i][k].of[d] += speed(links_.screw_D + 6 * k, d);
    }
    for (int j = Model::moved_K_begin[link]; j < Model::moved_K_begin[link + 1]; ++j) {
      const int k = Model::moved_K_entry[j];
      FAN_UNROLL for (int d = 0; d < 3; ++d)
        rate_K[i].of[d] += v_K[k] * speed(links_.screw_K + 6 * k, d);
    }
  }

  Real twist_of_[room(6 * L)], centre_[room(3 * L)];  // of the links and the balls around them
  Real old_[room(12 * L)];  // turns and centres at which the lists of near pairs were made
  Mask known_, good_;       // lanes that have a list, and one that holds in this step
  bool is_listed_anew_ = true;  // whether a list is another one than in listed_
  int n_listed_ = 0;
  Listed listed_[width * 4 * room(Model::n_links)];
};

}  // namespace fan
