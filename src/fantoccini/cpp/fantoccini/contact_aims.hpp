// What the contact points of a time step are to do: which pushed in the step before, and the speeds
// that their normal impulses must take away.
#pragma once

#include "contact_lanes.hpp"

FAN_LOOPS_BEGIN

namespace fan {

template <class Model, class Real>
class ContactAims : public ContactLanes<Model, Real> {
  using Problem = ContactProblem<Model, Real>;

 public:
  using Problem::C, Problem::width;
  using Push = ContactPush;

  int n[width] = {};      // points that push
  Push push[width][room(C)];

 protected:
  using typename Problem::Mask, typename Problem::Tolerance;
  using Problem::points_, Problem::in_, Problem::near_, Problem::chosen_, Problem::x_, Problem::b_;
  using Problem::before_, Problem::rebound_, Problem::parting_, Problem::bounces_;

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
      near_[l][i] = points_.has(l, i) && p.before >= 0;
      is_carried_[l][i] = points_.has(l, i) && p.carried;
      steps_[l][i] = near_[l][i] ? push[l][p.before].steps : 0;
      rebound_[l][i] = 0.0;
      for (int d = 0; d < 3 && near_[l][i]; ++d)
        lane_of(x_[3 * i + d], l) = dot3(p.frame + 3 * d, push[l][p.before].impulse);
    }
  }

  template <class Other>
  FAN_FN static bool earlier(const Push& a, const Other& b) {
    return a.pair < b.pair || (a.pair == b.pair && a.feature < b.feature);
  }

  // What the normal impulse of a point must take away: the speed at which it closes without
  // impulses, and the gap over the step, or the rebound.
  FAN_FN void aim(int l, int i, double dt, double whole, double recovery_speed) {
    const double h = -points_.point[l][i].gap, before = lane_of(before_[3 * i], l);
    const double hdot = lane_of(hdot_[3 * i], l);
    const double back = h / (h > 0.0 && whole > dt ? whole : dt);
    const double parting = back < recovery_speed ? back : recovery_speed;
    const double rebound = in_->restitution[points_.point[l][i].pair] * hdot;
    const bool new_one = steps_[l][i] == 0 && before + parting > 0.0;
    const bool bounces = new_one && rebound > parting && rebound > before - hdot;
    rebound_[l][i] = bounces ? rebound : 0.0;
    parting_[l][i] = parting;
    bounces_[l] = bounces_[l] || bounces;
    lane_of(b_[3 * i], l) = before + (bounces ? rebound : parting);
    // Where other points of the pair carried it before, they are tried first; see watch().
    const bool waits = is_carried_[l][i] && !bounces;
    near_[l][i] = near_[l][i] || (!waits && lane_of(b_[3 * i], l) > 0.0);
    chosen_[l] += near_[l][i];
  }

  // The same of the points i of all lanes. A point does not wait if the present velocity closes it,
  // for trying again costs all lanes; unless those that carried slid, which leaves open how they
  // share it.
  FAN_FN void aim_lanes(int i, double dt, double whole, double recovery_speed) {
    Real h = Real(0.0), restitution = h, is_new = h, carried = h, slid = h, there = h;
    for (int l = 0; l < width; ++l) {
      if (!points_.has(l, i)) continue;
      const auto& point = points_.point[l][i];
      lane_of(there, l) = 1.0;
      lane_of(h, l) = -point.gap;
      lane_of(restitution, l) = in_->restitution[point.pair];
      lane_of(is_new, l) = steps_[l][i] == 0 ? 1.0 : 0.0;
      lane_of(carried, l) = is_carried_[l][i] ? 1.0 : 0.0;
      lane_of(slid, l) = point.slid ? 1.0 : 0.0;
    }
    const Mask here = there > Real(0.5);
    const Real &before = before_[3 * i], &hdot = hdot_[3 * i];
    const Real back = h / select(h > Real(0.0), Real(whole > dt ? whole : dt), Real(dt));
    const Real parting = minimum(back, Real(recovery_speed)), rebound = restitution * hdot;
    const Mask bounces = here && is_new > Real(0.5) && before + parting > Real(0.0) &&
                         rebound > parting && rebound > before - hdot;
    const Real b = before + select(bounces, rebound, parting);
    const Mask soon = hdot + parting > Real(0.0) && slid < Real(0.5);
    const Mask waits = carried > Real(0.5) && !bounces && !soon;
    const Mask joins = here && !waits && b > Real(0.0);
    b_[3 * i] = select(here, b, b_[3 * i]);
    for (int l = 0; l < width; ++l) {
      if (!lane_of(here, l)) continue;
      rebound_[l][i] = lane_of(bounces, l) ? lane_of(rebound, l) : 0.0;
      parting_[l][i] = lane_of(parting, l);
      bounces_[l] = bounces_[l] || lane_of(bounces, l);
      near_[l][i] = near_[l][i] || lane_of(joins, l);
      chosen_[l] += near_[l][i];
    }
  }

  int steps_[width][room(C)];      // for which a point has pushed
  bool is_carried_[width][room(C)];  // whether a point of the same pair pushed in the step before
  Real hdot_[room(3 * C)];         // of their rows, at the start of the step
};

}  // namespace fan

FAN_LOOPS_END
