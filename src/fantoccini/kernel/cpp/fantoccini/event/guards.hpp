// Guards: functions whose zeros a step must not pass. A guard is positive when the row's state no
// longer holds. It is the height h of a slack row; minus the tension of a held row, or its excess
// over the winch's largest; the hddot or overlap of a redundant row; the missing speed of a
// slipping row. The rows are followed by the watched drives, whose guard is positive where they
// lose a step or run away, then the deepest overlap of solids, and the contact points
// (held_contacts.hpp).
//
// An event's time is the root of the worst guard evaluated by integrating to it, not read off the
// dense output. After a release the row's guard re-arms once it has opened by more than rounding,
// or immediately if it rebounds; until then it fires only if the row is violated by more than
// rounding and moves further.
#pragma once

#include "fantoccini/event/flow.hpp"
#include "fantoccini/runs/snapshot.hpp"

namespace fan {

struct GuardTolerances {
  // -h, relative to the row's scale, above which a released row has opened and is armed again: a
  // few rounding errors.
  static constexpr double open_gap = 2e-15;
  // h, likewise, above which a row that is not armed is caught. Also the tolerance of heights
  // inside a step, and of held rows if any winch can slip.
  static constexpr double caught_height = 1e-13;
  // m/s or rad/s: a row that is not armed closes only if faster; a slipping string is armed once it
  // slips faster than its winch winds by this.
  static constexpr double min_speed = 1e-9;
  // Negligible tension, relative to the weight.
  static constexpr double negligible_tension = 1e-12;
  // Largest guard at a located event: of a slack row, h over the row's scale; of a taut row, mostly
  // tension over weight (see Flow::lack); of a drive, periods, m or rad.
  static constexpr double catch_root = 1e-15, release_root = 1e-13, drive_root = 1e-12;
  static constexpr int max_root_iterations = 100;
  static constexpr int max_earlier_roots = 8;  // number of searches for an earlier crossing
  // Resolution of the clock, relative to the time or 1 s: four rounding errors.
  static constexpr double clock = 4.0 * 2.3e-16;
};

template <class Model>
struct Guards {
  using F = Flow<Model>;
  using Tolerance = GuardTolerances;
  static constexpr int NQ = F::NQ, S = F::S, M = F::M, ALL = F::GUARDS;

  F& flow;
  bool armed[array_size(M)];
  // At the start of the step.
  double height0[array_size(M)], rate0[array_size(M)], guard0[array_size(ALL)];

  explicit Guards(F& f) : flow(f) {
    for (int r = 0; r < M; ++r) armed[r] = true;
  }

  void remember(Snapshot& memory) { memory.keep(armed, height0, rate0, guard0); }

  // The shortest time the clock resolves.
  double resolution() const { return Tolerance::clock * (fabs(flow.t) > 1.0 ? fabs(flow.t) : 1.0); }

  // Whether a row is closed at the flow's latest evaluation.
  bool closed(int r, double closeness) const {
    return flow.eval.height(r) >= -closeness * flow.row_scale(r);
  }

  // Whether a slack row closes at (t, y), the flow's latest evaluation.
  bool touches(int r, double closeness) const {
    const double over = flow.eval.height(r) / flow.row_scale(r);
    const bool at_once = armed[r] || (flow.winches.some_slip && over > FlowTolerances::closed_gap);
    return over >= -closeness &&
           flow.rate_of(r, flow.y + NQ) > (at_once ? 0.0 : Tolerance::min_speed);
  }

  // Stores the reference values of the next step's guards.
  void remember() {
    for (int r = 0; r < M; ++r) {
      height0[r] = flow.eval.height(r);
      rate0[r] = flow.rate_of(r, flow.y + NQ);
    }
    for (int r = 0; r < ALL; ++r) guard0[r] = guard(r);
  }

  // A row's guard from the latest evaluation: positive when its state no longer holds. In units
  // that make rows comparable: lengths over the row's scale, tensions over the weight.
  double guard(int r) const {
    if (r >= F::ALL) return flow.contacts.guard_of(flow, r - F::ALL);
    if (r >= M) return flow.motors.excess(r - M);
    if (r < S && Model::wire[r]) return -1.0;
    if (flow.row_state[r] == SLIPPING) {
      const double wound_in =
          (-flow.slip_now[r] - WinchTolerances::max_length_error) / flow.row_scale(r) -
          Tolerance::caught_height;
      const double slow = flow.violation(r) - (armed[r] ? 0.0 : Tolerance::min_speed);
      return slow > wound_in ? slow : wound_in;
    }
    // A row may begin the step slightly beyond its bound: only the excess counts.
    const double over = (flow.eval.height(r) - already(r)) / flow.row_scale(r);
    if (flow.taut(r)) {
      const double violation = flow.violation(r) - Tolerance::negligible_tension;
      // A redundant row moves with the held ones, except for the error of their near dependence.
      const double overlap =
          flow.row_state[r] == HELD ? violation : over - FlowTolerances::closed_gap;
      return violation > overlap ? violation : overlap;
    }
    return over - (armed[r] ? 0.0 : Tolerance::caught_height);
  }

  // Violation of a row's bound at the start of the step, counted up to closed_gap, or four times
  // that where redundant strings on winches may prevent its correction.
  double already(int r) const {
    const double most =
        (flow.winches.some_slip ? 4.0 : 1.0) * FlowTolerances::closed_gap * flow.row_scale(r);
    return height0[r] > most ? most : (height0[r] > 0.0 ? height0[r] : 0.0);
  }

  // Largest value of a row's guard at the row's event.
  double met(int r) const {
    if (r == F::ALL) return Tolerance::catch_root;
    if (r >= F::ALL) return Tolerance::release_root;
    if (r >= M) return Tolerance::drive_root;
    return flow.taut(r) ? Tolerance::release_root : Tolerance::catch_root;
  }

  // Whether the chosen active set contradicts the state at the latest evaluation: a held row is off
  // its bound, or a string slips too slowly. False if no winch can slip and another set would not
  // help.
  bool contradicted() const {
    if (!flow.winches.some_slip) return false;
    for (int r = 0; r < M; ++r) {
      if (flow.row_state[r] == HELD &&
          fabs(flow.eval.height(r)) > Tolerance::caught_height * flow.row_scale(r))
        return true;
      if (flow.row_state[r] != SLIPPING) continue;
      const bool beyond = flow.slip_now[r] < -WinchTolerances::max_length_error;
      if (flow.violation(r) > (beyond ? 0.0 : Tolerance::min_speed)) return true;
    }
    return false;
  }

  // The largest guard at the latest evaluation.
  double worst() const {
    double out = -1.0;
    for (int r = 0; r < ALL; ++r) {
      const double g = guard(r);
      if (g > out || g != g) out = g != g ? 1.0 : g;
    }
    return out;
  }

  // The worst guard after a step of length s; leaves the flow there, projected or not.
  double guard_at(double s) {
    flow.stages(s);
    flow.finish(s);
    flow.contacts.redistribute(flow);
    return worst();
  }

  // A time in (0, s] at which a guard is positive, or 0. The step has just been tried and evaluated
  // at its end, and is again when this returns 0.
  double suspicious(double s) { return worst() > 0.0 ? s : inside(s); }

  // Crossings that return within the step, suspected at the stages or, for heights, at the maximum
  // of the cubic through the ends. Each is confirmed by integrating there, the earliest first.
  double inside(double s) {
    double candidate[array_size(ALL)];
    int n = 0;
    for (int r = 0; r < ALL; ++r) {
      const double at = suspect(r, s);
      if (at > 0.0) candidate[n++] = at;
    }
    const bool probed = n > 0;
    while (n > 0) {
      int first = 0;
      for (int i = 1; i < n; ++i)
        if (candidate[i] < candidate[first]) first = i;
      if (guard_at(candidate[first]) > 0.0) return candidate[first];
      candidate[first] = candidate[--n];
    }
    if (probed) guard_at(s);
    return 0.0;
  }

  // Time within the last step at which row r may have crossed and returned; 0 if there is none.
  double suspect(int r, double s) const {
    if (r < S && Model::wire[r]) return 0.0;
    const bool slack = r < M && !flow.taut(r);
    double worst = Tolerance::drive_root;
    if (r == F::ALL) worst = Tolerance::caught_height;
    else if (slack) worst = already(r) + Tolerance::caught_height * flow.row_scale(r);
    else if (r < M) worst = Tolerance::negligible_tension + Tolerance::min_speed;
    double at = 0.0;
    for (int i = 1; i < dop853::stages; ++i) {
      const double over = flow.stage_violation[i][r];
      if (over > worst && dop853::C[i] < 1.0) {
        worst = over;
        at = dop853::C[i] * s;
      }
    }
    if (at > 0.0 || !slack) return at;
    return peak_time(
        height0[r], rate0[r], flow.eval.height(r), flow.rate_of(r, flow.end + NQ), s,
        Tolerance::caught_height * flow.row_scale(r));
  }

  // Time of the maximum of the cubic through (0, h0, d0), (s, h1, d1), if it is above zero, or
  // below it by at most a tenth of its rise above the ends.
  static double peak_time(double h0, double d0, double h1, double d1, double s, double tolerance) {
    // h(x) = h0 + s d0 x + b x^2 + a x^3 with x = time / s.
    const double a = 2 * (h0 - h1) + s * (d0 + d1), b = 3 * (h1 - h0) - s * (2 * d0 + d1);
    const double c = s * d0, root = b * b - 3 * a * c;
    if (!(root > 0.0)) return 0.0;
    // Of the two stationary points the maximum is the one with b + 3 a x < 0.
    const double q = sqrt(root);
    const double x = b > 0.0 ? (a != 0.0 ? (-b - q) / (3 * a) : 2.0) : c / (q - b);
    if (!(x > 0.0 && x < 1.0)) return 0.0;
    const double top = h0 + x * (c + x * (b + x * a));
    const double rise = top - (h0 > h1 ? h0 : h1);
    return top > -(0.1 * rise + tolerance) ? x * s : 0.0;
  }

  // The first time at which a guard turns positive, given that one is at s. Leaves the flow there.
  double locate(double s) {
    double hi = s;
    for (int again = 0; again < Tolerance::max_earlier_roots; ++again) {
      hi = root(hi);
      const double earlier = inside(hi);
      if (earlier == 0.0) break;
      hi = earlier;
    }
    return hi;
  }

  // The first time up to `hi` at which a guard is positive, but only by rounding, given that one is
  // positive at `hi`, where the flow is. Row by row, until none has an earlier root. Leaves the
  // flow there.
  double root(double hi) {
    for (int round = 0; round <= ALL; ++round) {
      const double before = hi;
      for (int r = 0; r < ALL; ++r) {
        if (guard(r) <= met(r)) continue;
        hi = root_of(r, hi);
      }
      if (!(hi < before)) break;
    }
    return hi;
  }

  // The root of row r's guard in (0, hi], from its positive side. Newton's method for heights,
  // whose rates are known, the Illinois method for the others, in a bracket that is bisected where
  // they are slow.
  double root_of(int r, double hi) {
    const bool height = (r < M && !flow.taut(r)) || r == F::ALL;
    double lo = 0.0, g_lo = guard0[r] < 0.0 ? guard0[r] : -1e-18, g_hi = guard(r);
    double width = hi;
    int side = 1;
    // Finer than the clock: the state is integrated over s, whatever t + s rounds to.
    const double finest = Tolerance::clock * hi;
    for (int i = 0; i < Tolerance::max_root_iterations && hi - lo > finest; ++i) {
      if (side == 1 && g_hi <= met(r)) break;
      double mid = lo - g_lo * (hi - lo) / (g_hi - g_lo);
      if (height && side == 1) {
        const double rate = r == F::ALL ? flow.contacts.points.closing
                                        : flow.rate_of(r, flow.end + NQ) / flow.row_scale(r);
        if (rate > 0.0) mid = hi - (g_hi - 0.5 * Tolerance::catch_root) / rate;
      }
      if (i % 3 == 2) {
        if (hi - lo > 0.5 * width || i > Tolerance::max_root_iterations / 3) mid = 0.5 * (lo + hi);
        width = hi - lo;
      }
      const double nudge = 0.5 * finest;
      if (!(mid > lo + nudge)) mid = lo + nudge;
      if (mid > hi - nudge) mid = hi - nudge;
      guard_at(mid);
      const double g = guard(r);
      if (g > 0.0) {
        hi = mid;
        g_hi = g;
        if (side == 1 && i > 0) g_lo *= 0.5;
        side = 1;
      } else {
        lo = mid;
        g_lo = g;
        if (side == -1) g_hi *= 0.5;
        side = -1;
      }
    }
    if (side == -1) guard_at(hi);
    return hi;
  }
};

}  // namespace fan
