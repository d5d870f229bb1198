// Guards: what a step must not pass. A slack row's guard is its height h, a taut row's its lacking
// tension; a guard is positive when the row's mode no longer holds.
//
// An event's time is the root of the worst guard evaluated by integrating to it, not read off an
// interpolant. After a release the row's guard re-arms once it has opened by more than rounding;
// until then it fires only if the row is violated by more than rounding and moves further.
#pragma once

#include "flow.hpp"

namespace fan {

constexpr double kOpen = 2e-15;         // |h| that counts as open, relative to the row's scale
constexpr double kNoTension = 1e-12;    // tension that counts as none, relative to the cap / 1e5
constexpr double kHeightRoot = 1e-15;   // how well a catch is met, relative to the row's scale
constexpr double kTensionRoot = 1e-13;  // how well a release is met, relative to the cap / 1e5
constexpr int kRootIterations = 100;

template <class Model>
struct Guards {
  using F = Flow<Model>;
  static constexpr int NQ = F::NQ, S = F::S, M = F::M;

  F& flow;
  bool armed[room(M)];
  double height0[room(M)], rate0[room(M)], guard0 = -1.0;  // at the start of the step

  explicit Guards(F& f) : flow(f) {
    for (int r = 0; r < M; ++r) armed[r] = true;
  }

  // The shortest time the clock resolves.
  double resolution() const { return 4.0 * 2.3e-16 * (fabs(flow.t) > 1.0 ? fabs(flow.t) : 1.0); }

  double no_tension() const { return kNoTension * flow.opt.tension_cap * 1e-5; }

  // What the next step's guards compare with.
  void remember() {
    for (int r = 0; r < M; ++r) {
      height0[r] = flow.eval.height(r);
      rate0[r] = flow.rate_of(r, flow.y + NQ);
    }
    guard0 = worst(flow.y + NQ).guard;
  }

  // A row's guard from the latest evaluation: positive when its mode no longer holds. In units
  // that make rows comparable: lengths over the row's scale, tensions over the cap.
  double guard(int r, const double* at_v) const {
    if (r < S && Model::wire[r]) return -1.0;
    if (flow.taut[r]) return (-flow.tension[r] - no_tension()) / flow.opt.tension_cap * 1e5;
    const double open = flow.eval.height(r) / flow.row_scale(r);
    if (armed[r]) return open;
    // Rounding may leave a row a trace beyond its bound; it is caught only if it moves further.
    return flow.rate_of(r, at_v) > 0.0 ? open - kOpen : -kOpen;
  }

  struct Worst {
    double guard;
    int row;
  };

  // The row whose guard is largest at the latest evaluation.
  Worst worst(const double* at_v) const {
    Worst out = {-1.0, 0};
    for (int r = 0; r < M; ++r) {
      const double g = guard(r, at_v);
      if (g > out.guard || g != g) out = {g != g ? 1.0 : g, r};
    }
    return out;
  }

  // The worst guard after a step of length s; the flow is left there.
  double guard_at(double s) {
    flow.stages(s);
    flow.evaluate(flow.t + s, flow.end, flow.k[dop853::stages]);
    return worst(flow.end + NQ).guard;
  }

  // A time in (0, s] at which a guard is positive, or 0. The step has just been tried and
  // evaluated at its end, and is again when this returns 0.
  double suspicious(double s) { return worst(flow.end + NQ).guard > 0.0 ? s : inside(s); }

  // Crossings that return within the step: heights by the cubic through the ends, tensions at the
  // stages, each confirmed by integrating there, the earliest first.
  double inside(double s) {
    double candidate[room(M)];
    int n = 0;
    for (int r = 0; r < M; ++r) {
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
    if (flow.taut[r]) {
      for (int i = 1; i < dop853::stages; ++i)
        if (-flow.stage_tension[i][r] > no_tension() && dop853::C[i] < 1.0)
          return dop853::C[i] * s;
      return 0.0;
    }
    if (!armed[r]) return 0.0;
    return peak_time(
        height0[r], rate0[r], flow.eval.height(r), flow.rate_of(r, flow.end + NQ), s,
        kOpen * flow.row_scale(r));
  }

  // Where the cubic through (0, h0, d0), (s, h1, d1) peaks above or close to zero; 0 if nowhere.
  static double peak_time(double h0, double d0, double h1, double d1, double s, double tolerance) {
    if (!(d0 > 0.0 && d1 < 0.0)) return 0.0;
    double lo = 0.0, hi = 1.0;
    for (int i = 0; i < 40; ++i) {
      const double x = 0.5 * (lo + hi);
      const double slope = (6 * x * x - 6 * x) * (h0 - h1) + s * (3 * x * x - 4 * x + 1) * d0 +
                           s * (3 * x * x - 2 * x) * d1;
      (slope > 0.0 ? lo : hi) = x;
    }
    const double x = lo, y = 1 - x;
    const double top = h0 * (1 + 2 * x) * y * y + h1 * x * x * (3 - 2 * x) + s * d0 * x * y * y -
                       s * d1 * x * x * y;
    const double rise = top - (h0 > h1 ? h0 : h1);
    return top > -(0.1 * rise + tolerance) ? x * s : 0.0;
  }

  // The first time at which a guard turns positive, given that one is at s. The flow is left at it.
  double locate(double s) {
    double hi = s;
    for (int again = 0; again < 8; ++again) {
      hi = root(hi);
      const double earlier = inside(hi);
      if (earlier == 0.0) break;
      hi = earlier;
    }
    return hi;
  }

  // The root of the worst guard below `hi`, where a guard is positive; returns a time at which it
  // still is, by no more than rounding. Newton's method for heights, whose rates are known, and
  // Illinois' for tensions, inside a bracket that bisection shrinks where they do not.
  double root(double hi) {
    double lo = 0.0, g_hi = guard_at(hi), g_lo = guard0 < 0.0 ? guard0 : -1e-16;
    double width = hi;
    int side = 0;
    for (int i = 0; i < kRootIterations; ++i) {
      const Worst at_hi = worst(flow.end + NQ);
      const bool height = !flow.taut[at_hi.row];
      if (hi - lo <= resolution() || (side >= 0 && g_hi <= (height ? kHeightRoot : kTensionRoot)))
        break;
      double mid = lo - g_lo * (hi - lo) / (g_hi - g_lo);
      if (height && side >= 0) {
        const double rate = flow.rate_of(at_hi.row, flow.end + NQ) / flow.row_scale(at_hi.row);
        if (rate > 0.0) mid = hi - (g_hi - 0.5 * kHeightRoot) / rate;
      }
      const double nudge = 0.5 * resolution();
      if (i % 4 == 3 && hi - lo > 0.5 * width) mid = 0.5 * (lo + hi);
      if (i % 4 == 3) width = hi - lo;
      if (!(mid > lo + nudge)) mid = lo + nudge;
      if (mid > hi - nudge) mid = hi - nudge;
      const double g = guard_at(mid);
      if (g > 0.0) {
        hi = mid;
        g_hi = g;
        if (side == 1) g_lo *= 0.5;
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
