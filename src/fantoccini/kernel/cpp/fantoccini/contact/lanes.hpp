// Contacts of one time step for a bundle of lanes, with the interface of step.hpp. Lanes that only
// stand on the ground are solved here, all at once (ground_lanes.hpp). Other lanes are `apart`:
// they make their steps one by one (timestepping/single_lanes.hpp).
#pragma once

#include "fantoccini/contact/ground_lanes.hpp"
#include "fantoccini/contact/near_lanes.hpp"
#include "fantoccini/contact/step.hpp"

namespace fan {

template <class Model, class Real>
class ContactLanes {
 public:
  static constexpr int N = Model::n_vD, M = Model::n_rows, C = Model::n_contacts;
  static constexpr int width = Traits<Real>::width;
  using Mask = typename Traits<Real>::Mask;
  using Push = ContactPush;

  Real violation, work, impact, friction;  // penetration depth [m]; energies of the step [J]
  Real residual = Real(0.0);               // of the contact law, after the last step
  bool looks_ahead = true;                 // as ContactStep::looks_ahead
  Mask apart = Real(0.0) > Real(1.0);      // lanes that are not solved here

  // Starts without any contact.
  FAN_FN void begin(const ContactArrays& in) {
    near_.begin(in);
    ground_.begin(in);
    for (int l = 0; l < width; ++l) {
      n_[l] = 0;
      too_many_[l] = false;
    }
  }

  bool too_many(int lane) const { return too_many_[lane]; }

  template <class Memory>
  FAN_FN void remember(Memory& memory) {
    list_pushes();
    memory.keep_of_lanes(n_);
    memory.keep_of_lanes(push_);
    memory.keep_of_lanes(too_many_);
  }

  // As ContactStep::take_as_resting(), for the lanes that are not apart.
  FAN_FN void take_as_resting() {
    list_pushes();
    for (int l = 0; l < width; ++l) n_[l] = keep_resting(push_[l], n_[l]);
  }

  FAN_FN void find(
      const ContactArrays& in, const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K,
      const Real* p, double dt, double full_step, double recovery_speed, const Mask& idle) {
    work = impact = friction = residual = Real(0.0);
    near_.place_at(in, q_D, v_D, q_K, v_K, p, dt);
    auto& feet = ground_.feet;
    fresh_ = !feet.kept;
    for (int l = 0; l < width; ++l)
      if (!lane_of(feet.kept, l) && !lane_of(idle, l)) feet.take(in, l, push_[l], n_[l]);
    const Mask alone = near_.find_on(in, dt, feet.kept && !idle, feet);
    ground_.start(near_, alone, dt, full_step, recovery_speed);
    if (looks_ahead && ground_.rolls()) {
      near_.look_ahead(q_D, v_D, q_K, v_K, p, dt);
      ground_.require_in_middle(in, near_);
    }
    violation = ground_.depth;
    apart = Real(0.0) > Real(1.0);
    set_apart(!idle && !ground_.lanes);
  }

  // Sets apart lanes in which impulses have accelerated links beyond the margins of find(). Returns
  // whether there are any.
  FAN_FN bool look_again(const Real* acc, double dt) {
    const Mask fast = ground_.lanes && near_.outruns(acc, dt);
    set_apart(fast);
    return any(fast);
  }

  // Whether contact points take part in every lane except those in `idle`.
  FAN_FN bool take_part(const Mask& idle) const { return !any(!(ground_.stands || idle)); }

  // Adds the points that would penetrate at the velocity v. Returns whether there are any.
  FAN_FN bool watch(const Real* v) {
    Mask failed = Real(0.0) > Real(1.0);
    const bool more = ground_.watch(near_, v, failed);
    set_apart(failed);
    return more;
  }

  // As ContactStep::settle(), for the lanes on the ground.
  FAN_FN void settle(
      const Evaluation<Model, Real>& eval, RowSystem<Model, Real>& rows, const Mask* near,
      Real* guess, double cap, Mask& settled) {
    if (!any(ground_.stands)) return;
    set_apart(ground_.settle(near_, eval, rows, near, guess, cap));
    const Mask& here = ground_.stands;
    auto& problem = rows.problem;
    settled = settled || here;
    for (int a = 0; a < rows.n; ++a) {
      const int r = rows.row[a];
      problem.x[a] = select(here, ground_.impulse(r), problem.x[a]);
      problem.s[a] = select(here, ground_.s(r), problem.s[a]);
      problem.high[a] = problem.high[a] && !here;
    }
  }

  // w <- w - W x over the points.
  FAN_FN void add(Real* w) const { ground_.add(w); }

  // How much the impulses reduce hdot of the gathered row a.
  FAN_FN Real rate_by_impulses(const RowSystem<Model, Real>& rows, int a) const {
    return ground_.rate_by_impulses(rows, a);
  }

  // Energies of the step, and the points that push at its end. Returns 1 in lanes with an impact,
  // else 0.
  FAN_FN Real account() {
    residual = select(ground_.stands, ground_.residual, Real(0.0));
    const Mask struck = ground_.keep(impact);
    for (int l = 0; l < width; ++l)
      if (!lane_of(apart, l)) n_[l] = 0;
    return select(struck, Real(1.0), Real(0.0));
  }

  // Calls f with the lane and the pair of every point that pushes.
  template <class F>
  void each_push(const F& f) const {
    for (int l = 0; l < width; ++l) {
      if (lane_of(ground_.feet.kept, l))
        ground_.feet.each_push(l, [&](const auto& foot, int) { f(l, foot.pair); });
      else
        for (int i = 0; i < n_[l]; ++i) f(l, push_[l][i].pair);
    }
  }

  // Hands the contacts of a lane that is apart to its own ContactStep; take() brings them back.
  FAN_FN void hand_over(int l, ContactStep<Model, double>& to) {
    to.take(push_[l], n_[l], near_.near(l));
  }
  FAN_FN void take(int l, ContactStep<Model, double>& from) {
    n_[l] = from.hand_over(push_[l], near_.near(l));
    too_many_[l] = from.too_many(0);
    lane_of(residual, l) = from.residual;
    near_.read_list(l);
  }

 private:
  // Sets these lanes apart.
  FAN_FN void set_apart(const Mask& lanes) {
    if (!any(lanes)) return;
    for (int l = 0; l < width; ++l)
      if (lane_of(lanes && !fresh_, l)) n_[l] = ground_.feet.hand_over(l, push_[l]);
    ground_.leave(lanes);
    apart = apart || lanes;
  }

  // Copies the pushing points of lanes on the ground into push_, where those of other lanes are.
  FAN_FN void list_pushes() {
    auto& feet = ground_.feet;
    for (int l = 0; l < width; ++l)
      if (lane_of(feet.kept, l)) n_[l] = feet.hand_over(l, push_[l]);
    feet.kept = Real(0.0) > Real(1.0);
  }

  NearLanes<Model, Real> near_;
  GroundLanes<Model, Real> ground_;
  Mask fresh_;  // lanes that the feet had not stored at the start of the step
  // The pushing points of each lane: how many, and the points.
  int n_[width];
  Push push_[width][array_size(C)];
  bool too_many_[width];
};

}  // namespace fan
