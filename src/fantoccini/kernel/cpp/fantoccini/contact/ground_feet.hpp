// Points of a bundle of lanes on one standing half-space: the corners of boxes and the ends of
// capsules, stored by solid and feature in all lanes at once, with their memory from step to step.
#pragma once

#include "fantoccini/collision/plane_lanes.hpp"
#include "fantoccini/contact/push.hpp"
#include "fantoccini/contract.hpp"
#include "fantoccini/math/lane_of.hpp"
#include "fantoccini/math/space.hpp"

namespace fan {

template <class Model, class Real>
class GroundFeet {
 public:
  static constexpr int B = array_size(Model::n_solids), width = Traits<Real>::width;
  static constexpr int features = 8;  // corners of a box; a capsule has two
  using Mask = typename Traits<Real>::Mask;
  using Push = ContactPush;

  struct Point {
    // Lanes in which the point exists in this step, takes part, and pushed in the previous step.
    Mask here, joins, pushes;
    // Lanes in which it would have to pull in the last solution, and in which it was therefore
    // dropped.
    Mask would_pull, dropped;
    Real at[3], gap;
    Real required;  // m/s: parting speed required after the step
    Real drift[3];  // m/s: rates required of a rolling ellipsoid, in addition (rolling.hpp)
    // As in ContactPush: of the last completed step, and of this one.
    Mask rested;
    Real steps, impulse[3];
    Mask rests;
    Real next_impulse[3];
  };

  // A solid that may stand on the ground, alone or with others of its link.
  struct Foot {
    int pair = -1, link;  // pair -1: it may not stand
    double friction, restitution;
    bool is_round;                // an ellipsoid, which may roll
    int n = 0, listed[features];  // features that exist in some lane
    Mask carried;                 // lanes in which it pushed in the previous step
    Point point[features];
  };

  Mask kept;  // lanes whose points of the previous step are stored here

  // Finds the solids that may stand on the first half-space, before any contact.
  FAN_FN void begin(const ContactArrays& in) {
    const Mask none = Real(0.0) > Real(1.0);
    kept = none;
    n = n_known_ = 0;
    int plane = -1;
    for (int i = 0; i < B; ++i) foot[i].pair = -1;
    for (int k = 0; k < in.n_pairs; ++k) {
      const int own = in.pairs[2 * k], other = in.pairs[2 * k + 1];
      const Solid &x = in.solids[own], &y = in.solids[other];
      if (y.kind != HALF_SPACE || y.link >= 0 || !has_points_in_lanes(x)) continue;
      if (plane < 0) {
        plane = other;
        for (int c = 0; c < 3; ++c) frame[c] = y.b[c];
        add_tangents(frame);
      }
      const int *moves = Model::moved_D_begin + x.link, *drives = Model::moved_K_begin + x.link;
      if (other != plane || moves[0] == moves[1] || drives[0] != drives[1]) continue;
      Foot& to = foot[own];
      to.pair = k;
      to.link = x.link;
      to.friction = in.friction[k];
      to.restitution = in.restitution[k];
      to.is_round = is_ellipsoid(x);
      for (Point& p : to.point)
        p.here = p.joins = p.pushes = p.would_pull = p.dropped = p.rested = none;
    }
  }

  // Whether the points of pair k are stored here.
  FAN_FN bool takes(const ContactArrays& in, int k) const {
    return foot[in.pairs[2 * k]].pair == k;
  }

  // Loads the points that pushed in lane l in the previous step. Returns whether all are stored
  // here.
  FAN_FN bool take(const ContactArrays& in, int l, const Push* push, int n_push) {
    kept.set(l, false);
    for (int i = 0; i < n_push; ++i)
      if (!takes(in, push[i].pair)) return false;
    for (int j = 0; j < n_known_; ++j)
      for (Point& p : foot[known_[j]].point) p.pushes.set(l, false);
    for (int i = 0; i < n_push; ++i) {
      const int own = in.pairs[2 * push[i].pair];
      list_foot(own);
      Point& to = foot[own].point[push[i].feature];
      to.pushes.set(l, true);
      to.rested.set(l, push[i].rested);
      lane_of(to.steps, l) = push[i].steps;
      lane_of(to.gap, l) = push[i].gap;
      lane_of(to.required, l) = dot3(push[i].velocity, push[i].normal);
      for (int c = 0; c < 3; ++c) {
        lane_of(to.at[c], l) = push[i].at[c];
        lane_of(to.impulse[c], l) = push[i].impulse[c];
      }
    }
    kept.set(l, true);
    return true;
  }

  // Writes the points that pushed in lane l, in order of pairs. Returns their number.
  FAN_FN int hand_over(int l, Push* push) const {
    int n_push = 0;
    each_push(l, [&](const Foot& from, int feature) {
      const Point& p = from.point[feature];
      int place = n_push++;
      for (; place > 0 && push[place - 1].pair > from.pair; --place) push[place] = push[place - 1];
      Push& out = push[place];
      out.pair = from.pair;
      out.feature = feature;
      out.steps = int(lane_of(p.steps, l));
      out.wait = 0;
      out.rested = lane_of(p.rested, l);
      out.rebounds = false;
      out.gap = lane_of(p.gap, l);
      for (int c = 0; c < 3; ++c) {
        out.at[c] = lane_of(p.at[c], l);
        out.normal[c] = frame[c];
        out.impulse[c] = lane_of(p.impulse[c], l);
        out.velocity[c] = lane_of(p.required, l) * frame[c];
      }
    });
    return n_push;
  }

  // Calls f with the foot and the feature of every point that pushed in lane l.
  template <class F>
  FAN_FN void each_push(int l, const F& f) const {
    for (int j = 0; j < n_known_; ++j)
      for (int k = 0; k < features; ++k)
        if (lane_of(foot[known_[j]].point[k].pushes, l)) f(foot[known_[j]], k);
  }

  // Begins a step without points.
  FAN_FN void clear() {
    const Mask none = Real(0.0) > Real(1.0);
    n = 0;
    for (int j = 0; j < n_known_; ++j) {
      Foot& own = foot[known_[j]];
      own.n = 0;
      own.carried = none;
      for (Point& p : own.point) {
        p.here = p.joins = p.would_pull = p.dropped = none;
        own.carried = own.carried || p.pushes;
      }
    }
  }

  // Adds a point in these lanes; the features of a solid in ascending order.
  FAN_FN void add(int solid, int feature, const Real* at, const Real& gap, const Mask& lanes) {
    Foot& own = foot[solid];
    if (list_foot(solid)) {
      own.n = 0;
      own.carried = Real(0.0) > Real(1.0);
    }
    if (own.n == 0) with_points[n++] = solid;
    Point& to = own.point[feature];
    own.listed[own.n++] = feature;
    to.here = lanes;
    to.gap = gap;
    for (int c = 0; c < 3; ++c) {
      to.at[c] = at[c];
      to.drift[c] = Real(0.0);
    }
  }

  // Stores the points that take part and push in these lanes; all others count as not pushing.
  FAN_FN void keep(const Mask& lanes) {
    int n_known = 0;
    kept = lanes;
    for (int j = 0; j < n_known_; ++j) {
      Foot& own = foot[known_[j]];
      Mask pushes = Real(0.0) > Real(1.0);
      for (Point& p : own.point) {
        p.steps = select(p.pushes, p.steps, Real(0.0));
        p.pushes = p.joins && lanes;
        p.rested = p.rests;
        p.steps +=
            select(p.steps <= Real(ContactStepTolerances::steps_of_impact), Real(1.0), Real(0.0));
        p.steps = select(closes(p), Real(1.0), p.steps);
        for (int c = 0; c < 3; ++c) p.impulse[c] = p.next_impulse[c];
        pushes = pushes || p.pushes;
      }
      if (any(pushes)) known_[n_known++] = known_[j];
    }
    n_known_ = n_known;
  }

  // Lanes in which a point that pushes ends the step with the speed that closes its gap.
  FAN_FN static Mask closes(const Point& p) {
    return -p.required > Real(ContactStepTolerances::closing_speed);
  }

  Foot foot[B];
  double frame[9];            // the ground's normal, and two tangents
  int n = 0, with_points[B];  // feet with points in some lane

 private:
  // Lists a foot that may have pushed. Returns whether it was not listed.
  FAN_FN bool list_foot(int solid) {
    for (int j = 0; j < n_known_; ++j)
      if (known_[j] == solid) return false;
    known_[n_known_++] = solid;
    const Mask none = Real(0.0) > Real(1.0);
    for (Point& p : foot[solid].point)
      p.here = p.joins = p.pushes = p.would_pull = p.dropped = none;
    return true;
  }

  int n_known_ = 0, known_[B];  // feet that pushed in the last step or have points
};

}  // namespace fan
