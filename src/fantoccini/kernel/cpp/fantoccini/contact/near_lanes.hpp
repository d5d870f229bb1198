// The links of a bundle of lanes: their motion, the balls around their solids, and the lists of
// near pairs, which are checked in all lanes at once.
#pragma once

#include "fantoccini/collision/plane_lanes.hpp"
#include "fantoccini/contact/points.hpp"

namespace fan {

template <class Model, class Real>
class NearLanes {
  using Links = PlacedLinks<Model, Real>;
  using Poses = decltype(Links::of_lanes);

 public:
  static constexpr int L = Links::L, N = Links::N, width = Links::width;
  using Mask = typename Traits<Real>::Mask;
  using Tolerance = ContactPointTolerances;
  using Near = NearPairs<Links::L, 4 * Links::L>;

  // Loads the solids; their poses are unknown.
  FAN_FN void begin(const ContactArrays& in) {
    links_.begin(in);
    slack_ = links_.slack();
    for (int l = 0; l < width; ++l) near_[l].forget();
    known_ = Real(0.0) > Real(1.0);
    is_listed_anew_ = true;
    n_listed_ = 0;
  }

  // Begins the search at (q_D, q_K): poses and velocities of the links.
  FAN_FN void place_at(
      const ContactArrays& in, const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K,
      const Real* p, double dt) {
    links_.locate(q_D, q_K, p);
    move_all(links_.of_lanes, v_D, v_K, twist_of_);
    place_all();
    good_ = known_ && hold(dt);
    for (int l = 0; l < width; ++l)
      if (!lane_of(good_, l) && near_[l].is_due()) list_anew(in, v_D, v_K, l);
    if (is_listed_anew_) good_ = known_ && hold(dt);
    if (any(good_) && is_listed_anew_) merge_lists(in);
  }

  // Finds the points of `ground` over a step dt in these lanes. Returns those without other
  // contacts.
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
            x, links_.of_lanes.poses + 12 * x.link, y, margin, near,
            [&](int feature, const Real* at, const Real& gap, const Mask& where) {
              ground.add(own, feature, at, gap, where);
            });
        continue;
      }
      for (int l = 0; l < width; ++l)
        if (lane_of(near, l) && touches_in(in, k, lane_of(margin, l), l)) alone.set(l, false);
    }
    for (int l = 0; l < width; ++l)
      if (lane_of(alone, l)) near_[l].count_step();
    return alone;
  }

  // Poses and twists in the middle of a step dt, at the velocities of its start.
  FAN_FN void look_ahead(
      const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K, const Real* p,
      double dt) {
    Real q[array_size(Model::n_qD)], q_in[array_size(Model::n_qK)];
    retract<typename Model::Dynamic>(q_D, v_D, 0.5 * dt, q);
    retract<typename Model::Driven>(q_K, v_K, 0.5 * dt, q_in);
    Call<Model, Real>::screws(q, q_in, p, middle_);
    move_all(middle_, v_D, v_K, twist_in_middle_);
  }
  FAN_FN const Real* pose_in_middle(int link) const { return middle_.poses + 12 * link; }
  FAN_FN const Real* twist_in_middle(int link) const { return twist_in_middle_ + 6 * link; }

  // Lists the near pairs of lane l.
  FAN_FN void list_anew(const ContactArrays& in, const Real* v_D, const Real* v_K, int l) {
    links_.load(l, v_D, v_K);
    links_.move();
    links_.place();
    links_.list_near(in, near_[l], slack_);
    read_list(l);
  }

  // The list of near pairs of lane l, which a step of that lane alone may replace.
  FAN_FN Near& near(int l) { return near_[l]; }

  // Reads the list of lane l, which may have been replaced.
  FAN_FN void read_list(int l) {
    known_.set(l, near_[l].is_known());
    is_listed_anew_ = true;
    for (int link = 0; link < L && near_[l].is_known(); ++link) {
      if (!links_.has_solids(link)) continue;
      for (int k = 0; k < 9; ++k) lane_of(old_[12 * link + k], l) = near_[l].turned(link)[k];
      for (int c = 0; c < 3; ++c) lane_of(old_[12 * link + 9 + c], l) = near_[l].centre(link)[c];
    }
  }

  // Lanes in which a link may move farther than its margin allows, if the step dt changes the
  // velocities by dv_D.
  FAN_FN Mask outruns(const Real* dv_D, double dt) const {
    return links_.outruns(dv_D, dt, speed_at_start_, Tolerance::margin, Tolerance::travel);
  }

  // A link's twist at the velocities at the start of the step; the screw of a velocity; the twist
  // at other velocities of a link that nothing drives.
  FAN_FN const Real* twist(int link) const { return twist_of_ + 6 * link; }
  FAN_FN const Real* screw(int k) const { return links_.of_lanes.screw_D + 6 * k; }
  FAN_FN void twist_at(int link, const Real* v_D, Real* out) const {
    for (int c = 0; c < 6; ++c) out[c] = Real(0.0);
    for (int j = Model::moved_D_begin[link]; j < Model::moved_D_begin[link + 1]; ++j) {
      const int k = Model::moved_D_entry[j];
      FAN_UNROLL for (int c = 0; c < 6; ++c) out[c] += links_.of_lanes.screw_D[6 * k + c] * v_D[k];
    }
  }

 private:
  // As PlacedLinks::move(), for poses and screws `at`.
  FAN_FN void move_all(const Poses& at, const Real* v_D, const Real* v_K, Real* twist_of) const {
    for (int i = 0; i < L; ++i) {
      const int up = Model::link_parent[i];
      Real* to = twist_of + 6 * i;
      for (int c = 0; c < 6; ++c) to[c] = up < 0 ? Real(0.0) : twist_of[6 * up + c];
      const auto add = [&](const int* begin, const int* entry, const Real* screw, const Real* v) {
        const int carried = up < 0 ? 0 : begin[up + 1] - begin[up];
        for (int j = begin[i] + carried; j < begin[i + 1]; ++j) {
          const Real *of = screw + 6 * entry[j], &speed = v[entry[j]];
          FAN_UNROLL for (int c = 0; c < 6; ++c) to[c] += of[c] * speed;
        }
      };
      add(Model::moved_D_begin, Model::moved_D_entry, at.screw_D, v_D);
      add(Model::moved_K_begin, Model::moved_K_entry, at.screw_K, v_K);
    }
  }

  // As PlacedLinks::place().
  FAN_FN void place_all() {
    using std::sqrt;
    for (int link = 0; link < L; ++link) {
      speed_at_start_[link] = Real(0.0);
      if (!links_.has_solids(link)) continue;
      const Real *R = links_.of_lanes.poses + 12 * link, *t = twist_of_ + 6 * link;
      const double* own = links_.around[link].at;
      Real *at = centre_ + 3 * link, v[3];
      FAN_UNROLL for (int c = 0; c < 3; ++c) at[c] =
          R[9 + c] + R[c] * own[0] + R[3 + c] * own[1] + R[6 + c] * own[2];
      cross(t + 3, at, v);
      FAN_UNROLL for (int c = 0; c < 3; ++c) v[c] += t[c];
      speed_at_start_[link] =
          sqrt(dot3(v, v)) + sqrt(dot3(t + 3, t + 3)) * links_.around[link].radius;
    }
  }

  // As NearPairs::holds(): the lanes whose lists are still valid.
  FAN_FN Mask hold(double dt) const {
    Mask all = Real(0.0) < Real(1.0);
    for (int link = 0; link < L; ++link) {
      if (!links_.has_solids(link)) continue;
      const Real left =
          (0.5 * slack_ - 0.5 * Tolerance::margin) - Tolerance::travel * dt * speed_at_start_[link];
      const Real *R = links_.of_lanes.poses + 12 * link, *old = old_ + 12 * link;
      Real turned = Real(0.0), moved_by = Real(0.0);
      FAN_UNROLL for (int k = 0; k < 9; ++k) turned += (R[k] - old[k]) * (R[k] - old[k]);
      FAN_UNROLL for (int c = 0; c < 3; ++c) {
        const Real by = centre_[3 * link + c] - old[9 + c];
        moved_by += by * by;
      }
      const double radius = links_.around[link].radius;
      const Real square = 2.0 * (moved_by + radius * radius * turned);
      all = all && left > Real(0.0) && square < left * left;
    }
    return all;
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
        if (lane_of(known_, l) && at[l] < near_[l].n && near_[l].pair[at[l]] < k)
          k = near_[l].pair[at[l]];
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

  // The lanes among these in which the balls of the solids of pair k are within the margin of each
  // other.
  FAN_FN Mask
  near_in(const ContactArrays& in, int k, double dt, const Mask& lanes, Real& margin) const {
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
      return lanes && height - links_.ball[first].radius < margin;
    }
    Real other[3], square = Real(0.0);
    place_middle(y, other);
    for (int c = 0; c < 3; ++c) square += (middle[c] - other[c]) * (middle[c] - other[c]);
    const double own = y.link >= 0 ? links_.ball[second].radius : bounding_radius(y);
    const Real reach = margin + (links_.ball[first].radius + own);
    return lanes && square < reach * reach;
  }

  // Whether pair k has points in lane l.
  FAN_FN bool touches_in(const ContactArrays& in, int k, double margin, int l) {
    const int first = in.pairs[2 * k], second = in.pairs[2 * k + 1];
    Touch near_touch[max_touches];
    place_in(in, first, l);
    if (in.solids[second].link >= 0) place_in(in, second, l);
    return links_.touch(in, k, margin, near_touch) > 0;
  }

  // The middle of a solid in the world.
  FAN_FN void place_middle(const Solid& x, Real* out) const {
    double own[3];
    for (int c = 0; c < 3; ++c) own[c] = 0.5 * (x.a[c] + x.b[c]);
    if (x.link >= 0) return carry_in_lanes(links_.of_lanes.poses + 12 * x.link, own, out);
    for (int c = 0; c < 3; ++c) out[c] = Real(own[c]);
  }

  // Places one solid of a link at its pose in lane l.
  FAN_FN void place_in(const ContactArrays& in, int solid, int l) {
    const Solid& x = in.solids[solid];
    double pose[12];
    for (int k = 0; k < 12; ++k) pose[k] = lane_of(links_.of_lanes.poses[12 * x.link + k], l);
    place_solid(x, pose, pose + 9, links_.placed[solid]);
    for (int c = 0; c < 3; ++c)
      links_.ball[solid].at[c] = 0.5 * (links_.placed[solid].a[c] + links_.placed[solid].b[c]);
  }

  Links links_;
  Poses middle_;  // in the middle of the step
  Real twist_in_middle_[array_size(6 * L)];
  Near near_[width];
  double slack_ = 0.0;                  // m: of the lists of near pairs
  Real speed_at_start_[array_size(L)];  // m/s: from which the margins follow
  Real twist_of_[array_size(6 * L)],
      centre_[array_size(3 * L)];  // of the links and the balls around them
  Real
      old_[array_size(12 * L)];  // rotations and centres at which the lists of near pairs were made
  Mask known_, good_;            // lanes that have a list, and a valid one in this step
  bool is_listed_anew_ = true;   // whether a list differs from that in listed_
  int n_listed_ = 0;
  Listed listed_[width * 4 * array_size(Model::n_links)];
};

}  // namespace fan
