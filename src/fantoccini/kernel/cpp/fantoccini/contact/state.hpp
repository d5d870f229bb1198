// The contact points of a time step: their positions, the ones that take part, the required rates
// of their normals, and the impulses, which start from those of the previous step.
#pragma once

#include "fantoccini/contact/points.hpp"
#include "fantoccini/contact/push.hpp"
#include "fantoccini/model/evaluation.hpp"

FAN_LOOPS_BEGIN

namespace fan {

template <class Model, class Real>
struct ContactState {
  static constexpr int C = Model::n_contacts, N = Model::n_vD, M = Model::n_rows;
  static constexpr int width = Traits<Real>::width;
  using Points = ContactPoints<Model, Real>;
  using Tolerance = ContactStepTolerances;
  using Push = ContactPush;

  Points points;
  const ContactArrays* in = nullptr;
  double dt = 0.0, whole = 0.0;     // s: of the step; of the run's steps
  double left = 0.0;                // s: rest of the step, at the velocities after it
  bool near[width][array_size(C)];  // whether a point takes part
  int chosen[width] = {};           // their number
  int steps[width][array_size(C)];  // number of steps for which a point has pushed
  bool is_carried[width]
                 [array_size(C)];    // whether a point of the same pair pushed in the previous step
  int wait[width][array_size(C)];    // steps for which a point's group is not tried as patches
  bool pulls[width][array_size(M)];  // whether a row that takes part may pull
  // For one trajectory: the points and rows that are solved as patches (patches.hpp), and their
  // residual.
  bool held[array_size(C)] = {}, row_held[array_size(M)] = {};
  double held_residual = 0.0;
  // m/s: e u_n- of new contacts, 0 of others; parting speed without it.
  double rebound[width][array_size(C)], parting[width][array_size(C)];
  bool withheld[width][array_size(C)];  // points that would rebound, but for holds_back
  bool holds_back = false;  // nothing rebounds: all such points only have to close their gaps
  bool bounces[width];      // whether any contact rebounds
  double scale[width];      // of the restitutions of the step
  Real x[array_size(3 * C)], s[array_size(3 * C)], b[array_size(3 * C)];
  // hdot after the step without impulses; at its start; b - before of the normals. is_before_known
  // is false until `before` or b is first needed.
  Real before[array_size(3 * C)], hdot[array_size(3 * C)], required[array_size(C)];
  bool is_before_known = true;
  Real drift[array_size(3 * C)] = {};  // b - before of tangents: see rolling.hpp

  // Whether point i takes part in the law that is solved point by point.
  FAN_FN bool takes_part(int l, int i) const { return near[l][i] && !held[i]; }

  // v+ - v without impulses.
  FAN_FN void unhindered(const Evaluation<Model, Real>& eval, Real* dv) const {
    Real w[array_size(N)];
    for (int k = 0; k < N; ++k) w[k] = dt * eval.w0[k];
    eval.solve_factor(w, dv);
  }

  // Computes `before` of all points.
  FAN_FN void compute_before(const Evaluation<Model, Real>& eval) {
    Real dv[array_size(N)];
    unhindered(eval, dv);
    typename Points::Rates free(points, dv);
    for (int i = 0; i < points.n_max; ++i) {
      const Triple<Real> by_forces = free.change(i);
      for (int d = 0; d < 3; ++d) before[3 * i + d] = hdot[3 * i + d] + by_forces[d];
    }
    is_before_known = true;
  }

  // Computes b of all points.
  FAN_FN void compute_required() {
    for (int i = 0; i < points.n_max; ++i) {
      b[3 * i] = before[3 * i] + required[i];
      for (int d = 1; d < 3; ++d) b[3 * i + d] = before[3 * i + d] + drift[3 * i + d];
    }
  }

  FAN_FN void need_before(const Evaluation<Model, Real>& eval) {
    if (is_before_known) return;
    compute_before(eval);
    compute_required();
  }

  // Whether all points pushed in the previous step, or others of their pairs did, or they stay away
  // at the velocities of the start, and none can rebound: ContactStep::watch() then finds the
  // points that take part. For one trajectory.
  FAN_FN bool all_pushed() const {
    bool all = true;
    for (int i = 0; i < points.n[0]; ++i) {
      const double closing = lane_of(hdot[3 * i], 0), way = -parting[0][i];
      const bool stays_away = closing < Tolerance::share_of_way * way;
      const bool may_bounce =
          steps[0][i] == 0 && closing > 0.0 && in->restitution[points.point[0][i].pair] > 0.0;
      all = all && (is_carried[0][i] || stays_away) && !may_bounce;
    }
    return all;
  }

  // Required parting speed of a point: minus its gap over the step or, for a new one, over the rest
  // of it.
  FAN_FN void require(int l, int i, double recovery_speed) {
    const double h = -points.point[l][i].gap;
    const double ahead = steps[l][i] == 0 ? left : dt;
    const double back = h / (h > 0.0 ? (whole > dt ? whole : dt) : ahead);
    parting[l][i] = lane_of(required[i], l) = back < recovery_speed ? back : recovery_speed;
    rebound[l][i] = 0.0;
    withheld[l][i] = false;
  }

  // m/s: e times the closing speed of a new point; 0 unless it exceeds the change by the forces of
  // a whole step.
  FAN_FN double rebound_of(int l, int i, double closing) const {
    const double by_forces = lane_of(before[3 * i], l) - lane_of(hdot[3 * i], l);
    const double back = in->restitution[points.point[l][i].pair] * closing;
    return back > by_forces * (whole > dt ? whole / dt : 1.0) ? back : 0.0;
  }

  // Decides whether a point takes part, and its rebound.
  FAN_FN void aim(int l, int i) {
    if (!is_before_known) {
      chosen[l] += near[l][i];
      return;
    }
    const double closing = lane_of(hdot[3 * i], l), free = lane_of(before[3 * i], l);
    const bool is_new = steps[l][i] == 0 && free + parting[l][i] > 0.0;
    const double back = is_new ? rebound_of(l, i, closing) : 0.0;
    withheld[l][i] = holds_back && back > 0.0 && back > parting[l][i];
    const bool springs = !holds_back && back > 0.0 && back > parting[l][i];
    if (springs) rebound[l][i] = lane_of(required[i], l) = back;
    bounces[l] = bounces[l] || springs;
    // Points of the pair that pushed before are tried first; see ContactStep::watch().
    const bool waits = is_carried[l][i] && !springs;
    near[l][i] = near[l][i] || (!waits && free + lane_of(required[i], l) > 0.0);
    chosen[l] += near[l][i];
  }

  // Sets the rebound velocities of lane l, scaled by the factor.
  FAN_FN void set_rebounds(int l) {
    for (int i = 0; i < points.n[l]; ++i) {
      if (rebound[l][i] == 0.0) continue;
      const double back = scale[l] * rebound[l][i], least = parting[l][i];
      lane_of(required[i], l) = back > least ? back : least;
      lane_of(b[3 * i], l) = lane_of(before[3 * i], l) + lane_of(required[i], l);
    }
  }

  // Marks the points of a lane, in order, that pushed in the previous step.
  FAN_FN void recognise(int l, const Push* pushes, int n_pushes) {
    int j = 0;
    const auto is_of = [&](int k, int pair) {
      return k >= 0 && k < n_pushes && pushes[k].pair == pair && !pushes[k].rebounds;
    };
    for (int i = 0; i < points.n[l]; ++i) {
      auto& p = points.point[l][i];
      while (j < n_pushes && is_before(pushes[j], p)) ++j;
      p.before = is_of(j, p.pair) && pushes[j].feature == p.feature ? j : -1;
      p.carried = is_of(j, p.pair) || is_of(j - 1, p.pair);
      p.slid = false;
      for (int k = j; is_of(k, p.pair); ++k) p.slid = p.slid || slides(pushes[k]);
      for (int k = j - 1; is_of(k, p.pair); --k) p.slid = p.slid || slides(pushes[k]);
    }
  }

  // Includes the points that pushed in the previous step, with their impulses as the first guess.
  FAN_FN void recall(int l, const Push* pushes) {
    for (int i = 0; i < points.n[l]; ++i) {
      const auto& p = points.point[l][i];
      const bool pushed = near[l][i] = points.has(l, i) && p.before >= 0;
      is_carried[l][i] = points.has(l, i) && p.carried;
      rebound[l][i] = 0.0;
      withheld[l][i] = false;
      steps[l][i] = wait[l][i] = 0;
      if (!pushed) continue;
      const Push& own = pushes[p.before];
      steps[l][i] = own.steps;
      wait[l][i] = own.wait > 0 ? own.wait - 1 : 0;
      for (int d = 0; d < 3; ++d) lane_of(x[3 * i + d], l) = dot3(p.frame + 3 * d, own.impulse);
    }
  }

  // hdot of row i after the step.
  FAN_FN double after(int l, int i) const {
    return -lane_of(s[i], l) - (i % 3 == 0 ? lane_of(required[i / 3], l) : 0.0);
  }

  // Whether the forces of one step alone give point i its closing speed at the start.
  FAN_FN bool rested(int l, int i) const {
    const double closing = lane_of(hdot[3 * i], l);
    const double by_forces = lane_of(before[3 * i], l) - closing;
    return closing <= (by_forces > Tolerance::passing_speed ? by_forces : Tolerance::passing_speed);
  }

  // Whether point i is part of an impact. A corner on which a resting body comes to stand is not.
  FAN_FN bool strikes(int l, int i) const {
    return (steps[l][i] < Tolerance::steps_of_impact && !rested(l, i)) || closes(l, i);
  }

  // Whether point i, if it pushes, ends the step with the speed that closes its gap.
  FAN_FN bool closes(int l, int i) const { return -parting[l][i] > Tolerance::closing_speed; }

 private:
  FAN_FN static bool slides(const Push& push) {
    const double *v = push.velocity, along = dot3(v, push.normal);
    return dot3(v, v) - along * along > Tolerance::sliding_speed * Tolerance::sliding_speed;
  }
};

}  // namespace fan

FAN_LOOPS_END
