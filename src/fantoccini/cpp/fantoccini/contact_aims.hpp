// Which points of a step take part at first, what their normals are asked for, and the impulses to
// begin with: what pushed in the step before, by what it was.
#pragma once

#include "contact_patches.hpp"

FAN_LOOPS_BEGIN

namespace fan {

template <class Model, class Real>
using ContactSolver = std::conditional_t<
    (Traits<Real>::width > 1), ContactLanes<Model, Real>, ContactPatches<Model, Real>>;

template <class Model, class Real>
class ContactAims : public ContactSolver<Model, Real> {
  using Problem = ContactProblem<Model, Real>;

 public:
  using Problem::C, Problem::width;
  using typename Problem::Tolerance;
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
    bool all = width == 1;
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

  // Finds the points of a lane that pushed in the step before, with their impulses as the first
  // guess; they take part.
  FAN_FN void recall(int l) {
    for (int i = 0, j = 0, first = 0; i < points_.n[l]; ++i) {
      const auto& p = points_.point[l][i];
      while (first < n[l] && push[l][first].pair < p.pair) ++first;
      while (j < n[l] && earlier(push[l][j], p)) ++j;
      const bool pushed = j < n[l] && push[l][j].pair == p.pair && push[l][j].feature == p.feature;
      steps_[l][i] = pushed ? push[l][j].steps : 0;
      wait_[l][i] = pushed && push[l][j].wait > 0 ? push[l][j].wait - 1 : 0;
      near_[l][i] = pushed;
      is_carried_[l][i] = first < n[l] && push[l][first].pair == p.pair;
      if (!pushed) continue;
      for (int d = 0; d < 3; ++d)
        lane_of(x_[3 * i + d], l) = dot3(p.frame + 3 * d, push[l][j].impulse);
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
