// Guards: what a step must not pass. A slack row's guard is its height h, a held row's its lacking
// tension (or what it has beyond its winch's largest), a redundant row's how far it strays from the
// held ones, a slipping row's its lacking speed; a guard is positive when the row's state no longer
// holds. After the rows come the drives that are watched, whose guard is positive where they lose a
// step or run away.
//
// An event's time is the root of the worst guard evaluated by integrating to it, not read off an
// interpolant. After a release the row's guard re-arms once it has opened by more than rounding, or
// at once where it springs back; until then it fires only if the row is violated by more than
// rounding and moves further.
#pragma once

#include "flow.hpp"
#include "snapshot.hpp"

namespace fan {

struct GuardTolerances {
  // h, relative to the row's scale: below minus this a released row has opened and is armed again,
  static constexpr double open_gap = 2e-15;
  // and above this one that is not armed is caught.
  static constexpr double caught_height = 1e-13;
  // m/s or rad/s: slower rows that are not armed do not close; a string slips from this speed on.
  static constexpr double min_speed = 1e-9;
  // Tension that counts as none, relative to the weight.
  static constexpr double negligible_tension = 1e-12;
  // How closely events are located: a catch by h over the row's scale, a release by the tension over
  // the weight, a drive's event in periods, m or rad.
  static constexpr double catch_root = 1e-15, release_root = 1e-13, drive_root = 1e-12;
  static constexpr int max_root_iterations = 100;
  static constexpr int max_earlier_roots = 8;  // crossings looked for before the one located
  // Relative resolution of the clock: four roundings.
  static constexpr double clock = 4.0 * 2.3e-16;
};

template <class Model>
struct Guards {
  using F = Flow<Model>;
  using Tolerance = GuardTolerances;
  static constexpr int NQ = F::NQ, S = F::S, M = F::M, ALL = F::ALL;

  F& flow;
  bool armed[room(M)];
  // At the start of the step.
  double height0[room(M)], rate0[room(M)], guard0[room(ALL)];
  // The integrator's errors in a released row's h, relative to its scale, where they are not small
  // against its first opening: the row is armed, and caught unarmed, beyond them.
  double noise = 0.0;
  // How far states that are looked at may be off the held rows, likewise: an integrator made outside
  // is looked at on its dense output, before it is projected.
  double afield = 0.0;

  explicit Guards(F& f) : flow(f) {
    for (int r = 0; r < M; ++r) armed[r] = true;
  }

  void remember(Snapshot& memory) {
    memory.keep(armed, height0, rate0, guard0, noise, afield);
  }

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
    return over >= -closeness && flow.rate_of(r, flow.y + NQ) > (at_once ? 0.0 : Tolerance::min_speed);
  }

  // What the next step's guards compare with.
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
    if (r >= M) return flow.motors.excess(r - M);
    if (r < S && Model::wire[r]) return -1.0;
    if (flow.row_state[r] == SLIPPING) {
      const double wound_in = (-flow.slip_now[r] - WinchTolerances::max_length_error) / flow.row_scale(r) -
                              Tolerance::caught_height;
      const double slow = flow.lack(r) - (armed[r] ? 0.0 : Tolerance::min_speed);
      return slow > wound_in ? slow : wound_in;
    }
    // A row may stand a trace beyond its bound: what counts is going further.
    const double over = (flow.eval.height(r) - already(r)) / flow.row_scale(r);
    if (flow.taut(r)) {
      const double lack = flow.lack(r) - Tolerance::negligible_tension;
      // A redundant row follows from the held ones, unless it hardly differs from them.
      const double strays = flow.row_state[r] == HELD ? lack : over - FlowTolerances::closed_gap - afield;
      return lack > strays ? lack : strays;
    }
    return over - (armed[r] ? 0.0 : Tolerance::caught_height + noise);
  }

  // How far a row stood beyond its bound when the step began. Rows that redundant strings on
  // winches keep from being put right may stand farther.
  double already(int r) const {
    const double most = (flow.winches.some_slip ? 4.0 : 1.0) * FlowTolerances::closed_gap * flow.row_scale(r);
    return height0[r] > most ? most : (height0[r] > 0.0 ? height0[r] : 0.0);
  }

  // How far beyond its root a row's guard may be where the row's event is.
  double met(int r) const {
    if (r >= M) return Tolerance::drive_root;
    return flow.taut(r) ? Tolerance::release_root : Tolerance::catch_root;
  }

  // Whether the active set just chosen contradicts the state at the latest evaluation, where
  // winches may give way instead: a held row is off its bound, or a string that slips does so too
  // slowly.
  bool contradicted() const {
    if (!flow.winches.some_slip) return false;
    for (int r = 0; r < M; ++r) {
      if (flow.row_state[r] == HELD && 
          fabs(flow.eval.height(r)) > Tolerance::caught_height * flow.row_scale(r))
        return true;
      if (flow.row_state[r] != SLIPPING) continue;
      const bool beyond = flow.slip_now[r] < -WinchTolerances::max_length_error;
      if (flow.lack(r) > (beyond ? 0.0 : Tolerance::min_speed)) return true;
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

  // The worst guard after a step of length s; the flow is left there.
  double guard_at(double s) {
    flow.stages(s);
    flow.finish(s);
    return worst();
  }

  // A time in (0, s] at which a guard is positive, or 0. The step has just been tried and
  // evaluated at its end, and is again when this returns 0.
  double suspicious(double s) { return worst() > 0.0 ? s : inside(s); }

  // Crossings that return within the step: heights by the cubic through the ends, tensions at the
  // stages, each confirmed by integrating there, the earliest first.
  double inside(double s) {
    double candidate[room(ALL)];
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

  // Where within the step just evaluated row r may have crossed and returned; 0 if nowhere.
  double suspect(int r, double s) const {
    if (r < S && Model::wire[r]) return 0.0;
    const bool slack = r < M && !flow.taut(r);
    double worst = Tolerance::drive_root;
    if (slack) worst = already(r) + Tolerance::caught_height * flow.row_scale(r);
    else if (r < M) worst = Tolerance::negligible_tension + Tolerance::min_speed;
    double at = 0.0;
    for (int i = 1; i < dop853::stages; ++i) {
      const double over = flow.stage_lack[i][r];
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

  // Where the cubic through (0, h0, d0), (s, h1, d1) has a maximum above or close to zero.
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

  // The first time at which a guard turns positive, given that one is at s. The flow is left at it.
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

  // The first time below `hi`, where guards are positive, at which one still is, by no more than
  // rounding: row by row, until none has its root earlier. The flow is left there.
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
  // whose rates are known, Illinois' for tensions, inside a bracket that bisection shrinks where
  // they do not.
  double root_of(int r, double hi) {
    const bool height = r < M && !flow.taut(r);
    double lo = 0.0, g_lo = guard0[r] < 0.0 ? guard0[r] : -1e-18, g_hi = guard(r);
    double width = hi;
    int side = 1;
    // Finer than the clock: the state is integrated over s, whatever t + s rounds to.
    const double finest = Tolerance::clock * hi;
    for (int i = 0; i < Tolerance::max_root_iterations && hi - lo > finest; ++i) {
      if (side == 1 && g_hi <= met(r)) break;
      double mid = lo - g_lo * (hi - lo) / (g_hi - g_lo);
      if (height && side == 1) {
        const double rate = flow.rate_of(r, flow.end + NQ) / flow.row_scale(r);
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
