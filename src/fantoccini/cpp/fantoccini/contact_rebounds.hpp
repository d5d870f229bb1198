// When contacts that spring back are struck within a step. Their group moves on as it did until the
// first of them touches, after t, and with the velocities of the law for the rest of the step:
//
//   q+ = q moved by t v + (dt - t) v+,   t = gap / (speed at which it closes at the start)
//
// t is 0 for what touches already.
// A group that is struck several times makes the step in parts, each until the next touch
// (timestepping.hpp). What else the law asks of the group holds after that way, too:
//
//   h + t hdot + (dt - t) hdot+ <= 0
#pragma once

#include "contact_aims.hpp"
#include "timestepping_tolerances.hpp"

FAN_LOOPS_BEGIN

namespace fan {

template <class Model, class Real>
class ContactRebounds : public ContactAims<Model, Real> {
  using Problem = ContactProblem<Model, Real>;
  using Aims = ContactAims<Model, Real>;

 public:
  using Problem::C, Problem::N, Problem::M, Problem::width;
  using typename Problem::Tolerance;

  // Where groups are struck several times, when the first of these touches is over, at least `least`
  // after the start [s]; 0 where there are none.
  FAN_FN double first_of_several(double least) const {
    double first = unbounded;
    for (int i = 0; i < points_.n[0] && bounces_[0]; ++i) {
      const double end = fmax(own_touch_time(i) * (1.0 + Tolerance::same_touch), least);
      if (!is_struck(i) || !(end < first)) continue;
      for (int j = 0; j < points_.n[0]; ++j)
        if (is_struck(j) && own_touch_time(j) > end && together(i, j)) first = end;
    }
    return first < dt_ ? first : 0.0;
  }

  // The same of what such a touch has made strike something else, found while the law is solved.
  FAN_FN double struck_again_at() const { return again_at_ < dt_ ? again_at_ : 0.0; }

  // Adds what pushed in earlier parts of the step to what pushes at its end.
  FAN_FN void join(const ContactPush* earlier, int n_earlier) {
    ContactPush* list = this->push[0];
    for (int k = 0; k < n_earlier; ++k) {
      int i = 0, &n = this->n[0];
      while (i < n && Aims::earlier(list[i], earlier[k])) ++i;
      if (i < n && !Aims::earlier(earlier[k], list[i])) {
        for (int c = 0; c < 3; ++c) list[i].impulse[c] += earlier[k].impulse[c];
      } else if (n < C) {
        for (int j = n++; j > i; --j) list[j] = list[j - 1];
        list[i] = earlier[k];
      }
    }
  }

  // Until when the group of links moved on as it did, in the last step [s]; 0 where nothing springs back.
  double touch_time(const int* links) const {
    double t = 0.0;
    for (int side = 0; side < 2 && is_some_; ++side) {
      const int tree = groups_.tree_of(links[side]);
      if (tree >= 0 && struck_at_[tree] != 0.0) t = struck_at_[tree];
    }
    return t;
  }

  // The same of a string or limit.
  FAN_FN double touch_time_of_row(int r) const {
    return is_some_ ? struck_at_[groups_.tree_of_row(r)] : 0.0;
  }

  // The position term of a row: `otherwise`, but of one that is caught in a step in which its group is
  // struck.
  FAN_FN double parting_of_row(int r, double h, double hdot, double otherwise) const {
    const double t = touch_time_of_row(r);
    const bool is_caught = h < 0.0 && hdot > TimeSteppingTolerances::catching_speed && h + dt_ * hdot > 0.0;
    if (t == 0.0 || !is_caught) return otherwise;
    const double back = (h + t * hdot) / rest_of_step(t);
    return back < recovery_speed_ ? back : recovery_speed_;
  }

  // The velocity that moves the configuration in the step from v to v_next.
  FAN_FN void mean_velocity(const Real* v, const Real* v_next, Real* out) const {
    for (int k = 0; k < N; ++k) {
      const double share = is_some_ ? struck_at_[groups_.tree_of_velocity(k)] / dt_ : 0.0;
      out[k] = v_next[k] + share * (v[k] - v_next[k]);
    }
  }

 protected:
  using Problem::points_, Problem::in_, Problem::near_, Problem::groups_, Problem::scale_;
  using Problem::x_, Problem::hdot_, Problem::before_, Problem::b_, Problem::asked_, Problem::dt_;
  using Problem::rebound_, Problem::parting_, Problem::bounces_;

  FAN_FN void begin_rebounds(double whole, double recovery_speed) {
    is_some_ = false;
    again_at_ = unbounded;
    whole_ = whole;
    recovery_speed_ = recovery_speed;
  }

  // Where something springs back, finds when and asks all points that may take part accordingly.
  FAN_FN void ask_after_touch() {
    if (!bounces_[0]) return;
    find_touch_times([&](int i) { return near_[0][i]; });
    for (int i = 0; i < points_.n[0]; ++i) group_[i] = near_[0][i] ? groups_.named(tree_[i]) : -1;
    for (int i = 0; i < points_.n[0]; ++i) {
      const double t = touch_time(points_.links(i));
      if (t == 0.0) continue;
      const double h = t * lane_of(hdot_[3 * i], 0) - points_.point[0][i].gap;
      const double back = h / (h > 0.0 ? (whole_ > dt_ ? whole_ : dt_) : rest_of_step(t));
      const double parting = back < recovery_speed_ ? back : recovery_speed_;
      const double rebound = scale_[0] * rebound_[0][i];
      parting_[0][i] = parting;
      lane_of(asked_[i], 0) = rebound_[0][i] > 0.0 && rebound > parting ? rebound : parting;
      lane_of(b_[3 * i], 0) = lane_of(before_[3 * i], 0) + lane_of(asked_[i], 0);
    }
  }

  // Notes where point i, which closes at this speed after the touch of its group, would spring back in
  // turn before the step ends.
  FAN_FN void note_struck_again(int i, double closing) {
    if (!bounces_[0] || !(in_->restitution[points_.point[0][i].pair] > 0.0) || !is_in_struck_group(i)) return;
    const double t = touch_time(points_.links(i)), least = Tolerance::least_part * dt_;
    const double there = points_.point[0][i].gap - t * lane_of(hdot_[3 * i], 0);
    const double end = fmax(t * (1.0 + Tolerance::same_touch), least);
    if (there > least * closing && end < again_at_) again_at_ = end;
  }

  // Finds when groups that what pushes connects are struck.
  FAN_FN void find_touch_times() {
    is_some_ = false;
    if (bounces_[0]) find_touch_times([&](int i) { return lane_of(x_[3 * i], 0) > 0.0; });
  }

  // The gap of a point that pushes where its force acts: at the touch where it springs back, else at
  // the end of the step. An overlap is that of the start.
  FAN_FN double gap_of_push(int i, double after) const {
    const double gap = points_.point[0][i].gap, t = touch_time(points_.links(i));
    if (!(gap > 0.0)) return gap;
    const double there = gap - t * lane_of(hdot_[3 * i], 0);
    return rebound_[0][i] > 0.0 ? there : there - (dt_ - t) * after;
  }

 private:
  FAN_FN bool is_in_struck_group(int i) const {
    bool is_struck = false;
    for (int side = 0; side < 2; ++side) {
      const int tree = groups_.tree_of(points_.links(i)[side]);
      is_struck = is_struck || (tree >= 0 && strikes_[tree]);
    }
    return is_struck;
  }

  // When a point that springs back touches, by its speed at the start [s].
  FAN_FN double own_touch_time(int i) const {
    const double gap = points_.point[0][i].gap;
    return gap > 0.0 ? gap / lane_of(hdot_[3 * i], 0) : 0.0;
  }

  FAN_FN bool is_struck(int i) const { return near_[0][i] && rebound_[0][i] > 0.0; }

  FAN_FN bool together(int i, int j) const { return group_[i] == group_[j]; }

  // What is left of the step after t, at least a small part of it.
  FAN_FN double rest_of_step(double t) const {
    const double rest = dt_ - t, least = Tolerance::least_rest * dt_;
    return rest > least ? rest : least;
  }

  template <class TakesPart>
  FAN_FN void find_touch_times(const TakesPart& takes_part) {
    groups_.begin();
    for (int i = 0; i < points_.n[0]; ++i)
      if (takes_part(i)) tree_[i] = groups_.joined(points_.links(i)[0], points_.links(i)[1]);
    double first[room(N)];  // of each group, by the tree that names it
    for (int k = 0; k < groups_.trees(); ++k) first[k] = dt_;
    is_some_ = false;
    bool strikes[room(N)] = {};
    for (int i = 0; i < points_.n[0]; ++i) {
      if (!takes_part(i) || !(rebound_[0][i] > 0.0)) continue;
      const int group = groups_.named(tree_[i]);
      const double t = own_touch_time(i);
      if (t < first[group]) first[group] = t;
      strikes[group] = is_some_ = true;
    }
    for (int k = 0; k < groups_.trees() && is_some_; ++k) {
      const int group = groups_.named(k);
      strikes_[k] = strikes[group];
      struck_at_[k] = strikes[group] ? first[group] : 0.0;
    }
  }

  bool is_some_ = false;
  int tree_[room(C)], group_[room(C)];  // of points that take part; of those at the start of the step
  double struck_at_[room(N)];  // s: by tree
  bool strikes_[room(N)] = {};  // whether something springs back, likewise
  double again_at_ = unbounded;
  double whole_ = 0.0, recovery_speed_ = 0.0;
};

}  // namespace fan

FAN_LOOPS_END
