// Which points of a step take part at first, what their normals are asked for, and the impulses to
// begin with: what pushed in the step before, by what it was.
#pragma once

#include "fantoccini/contact/patches.hpp"

FAN_LOOPS_BEGIN

namespace fan {

template <class Model, class Real>
class ContactAims : public ContactPatches<Model, Real> {
  using Problem = ContactProblem<Model, Real>;

 public:
  using Problem::C, Problem::width;
  using typename Problem::Mask, typename Problem::Tolerance;
  using Push = ContactPush;

  int n[width] = {};      // points that push
  Push push[width][room(C)];

 protected:
  using Problem::points_, Problem::in_, Problem::near_, Problem::chosen_, Problem::wait_;
  using Problem::x_, Problem::hdot_, Problem::before_, Problem::asked_, Problem::dt_;
  using Problem::is_before_known_, Problem::is_carried_, Problem::rebound_, Problem::parting_;
  using Problem::bounces_;

  // Whether all points pushed in the step before, or others of their pairs did, or they stay away at
  // the velocities of the start, and none can bounce: what takes part then is left to watch(). Of one
  // trajectory.
  FAN_FN bool all_pushed() const {
    bool all = true;
    for (int i = 0; i < points_.n[0]; ++i) {
      const double hdot = lane_of(hdot_[3 * i], 0), way = -parting_[0][i];
      const bool stays_away = hdot < Tolerance::share_of_way * way;
      const bool may_bounce = steps_[0][i] == 0 && hdot > 0.0 &&
                              in_->restitution[points_.point[0][i].pair] > 0.0;
      all = all && (is_carried_[0][i] || stays_away) && !may_bounce;
    }
    return all;
  }

  // The speed at which a point is asked to part beyond stopping: minus the gap over the step.
  FAN_FN void ask(int l, int i, double whole, double recovery_speed) {
    const double h = -points_.point[l][i].gap;
    const double back = h / (h > 0.0 && whole > dt_ ? whole : dt_);
    const double parting = back < recovery_speed ? back : recovery_speed;
    parting_[l][i] = lane_of(asked_[i], l) = parting;
    rebound_[l][i] = 0.0;
  }

  // Whether a point takes part, and its rebound.
  FAN_FN void aim(int l, int i) {
    if (!is_before_known_) {
      chosen_[l] += near_[l][i];
      return;
    }
    const double hdot = lane_of(hdot_[3 * i], l), parting = parting_[l][i];
    const double before = lane_of(before_[3 * i], l);
    const double rebound = in_->restitution[points_.point[l][i].pair] * hdot;
    const bool new_one = steps_[l][i] == 0 && before + parting > 0.0;
    const bool bounces = new_one && rebound > parting && rebound > before - hdot;
    if (bounces) rebound_[l][i] = lane_of(asked_[i], l) = rebound;
    bounces_[l] = bounces_[l] || bounces;
    // Where other points of the pair carried it before, they are tried first; see watch().
    const bool waits = is_carried_[l][i] && !bounces;
    near_[l][i] = near_[l][i] || (!waits && before + lane_of(asked_[i], l) > 0.0);
    chosen_[l] += near_[l][i];
  }

  // Tells the points of a lane, in order, which of them pushed in the step before.
  FAN_FN void recognise(int l) {
    int j = 0;
    const auto is_of = [&](int k, int pair) { return k >= 0 && k < n[l] && push[l][k].pair == pair; };
    for (int i = 0; i < points_.n[l]; ++i) {
      auto& p = points_.point[l][i];
      while (j < n[l] && earlier(push[l][j], p)) ++j;
      p.before = is_of(j, p.pair) && push[l][j].feature == p.feature ? j : -1;
      p.carried = is_of(j, p.pair) || is_of(j - 1, p.pair);
      p.slid = false;
      for (int k = j; is_of(k, p.pair); ++k) p.slid = p.slid || slides(push[l][k]);
      for (int k = j - 1; is_of(k, p.pair); --k) p.slid = p.slid || slides(push[l][k]);
    }
  }

  FAN_FN static bool slides(const Push& push) {
    const double *v = push.velocity, along = dot3(v, push.normal);
    return dot3(v, v) - along * along > Tolerance::sliding_speed * Tolerance::sliding_speed;
  }

  // What pushed in the step before takes part, with its impulses as the first guess.
  FAN_FN void recall(int l) {
    for (int i = 0; i < points_.n[l]; ++i) {
      const auto& p = points_.point[l][i];
      const bool pushed = near_[l][i] = points_.has(l, i) && p.before >= 0;
      is_carried_[l][i] = points_.has(l, i) && p.carried;
      rebound_[l][i] = 0.0;
      steps_[l][i] = wait_[l][i] = 0;
      if (!pushed) continue;
      const Push& own = push[l][p.before];
      steps_[l][i] = own.steps;
      wait_[l][i] = own.wait > 0 ? own.wait - 1 : 0;
      for (int d = 0; d < 3; ++d)
        lane_of(x_[3 * i + d], l) = dot3(p.frame + 3 * d, own.impulse);
    }
  }

  template <class Other>
  FAN_FN static bool earlier(const Push& a, const Other& b) {
    return a.pair < b.pair || (a.pair == b.pair && a.feature < b.feature);
  }

  int steps_[width][room(C)];      // for which a point has pushed
};

}  // namespace fan

FAN_LOOPS_END
