// The event-driven run: adaptive steps of the frozen-mode flow, stopped where a tension falls
// through zero (release) or a slack row closes (catch).
//
// An event's time is the root of a guard evaluated by integrating to it, not read off an
// interpolant. After a release the row's catch guard re-arms once it has opened by more than
// rounding; until then it fires only if the row is violated by more than rounding.
#pragma once

#include "accumulation.hpp"
#include "contact.hpp"
#include "record.hpp"

namespace fan {

constexpr double kOpen = 2e-15;       // |h| that counts as open, relative to the row's scale
constexpr double kNoTension = 1e-12;  // tension that counts as none, relative to the cap / 1e5
constexpr double kHeightRoot = 1e-15;   // how well a catch is met, relative to the row's scale
constexpr double kTensionRoot = 1e-13;  // how well a release is met, relative to the cap / 1e5
constexpr int kRootIterations = 100;
constexpr int kSavesPerStep = 64;

template <class Model>
struct EventRun {
  using F = Flow<Model>;
  static constexpr int N = F::N, NQ = F::NQ, S = F::S, M = F::M, NY = F::NY;
  static constexpr int rows_per_step = kSavesPerStep + 4;
  static constexpr int events_per_step = 2 * M + 4;

  F flow;
  Contact<Model> contact;
  Accumulation<M> accumulation;
  double impact = 0.0;  // energy lost in catches so far
  bool armed[room(M)];
  double step_size = 0.0;
  long long n_steps = 0, n_events = 0, stuck = 0;
  const double* save_at = nullptr;
  long long n_save = 0, next_save = 0;

  Status start(Record<Model>& out) {
    flow.drive.start_at(flow.t);
    bool taut[room(M)], loose[room(M)];
    for (int r = 0; r < M; ++r) {
      armed[r] = true;
      loose[r] = false;
    }
    Status status = contact.choose(flow, loose, taut);
    if (status == RUNNING) {
      set_mode(taut);
      refresh();
      status = flow.project(flow.t, flow.y);
    }
    step_size = flow.opt.first_step;
    refresh();
    emit(out);
    skip_saved();
    return status;
  }

  // Takes up new inputs at the present time.
  void resume() {
    flow.drive.start_at(flow.t);
    refresh();
    remember();
  }

  Status run(double t_end, Record<Model>& out) {
    while (flow.t < t_end) {
      if (!out.room_for(rows_per_step, events_per_step)) return RUNNING;
      if (n_steps >= flow.opt.max_steps) return TOO_MANY_STEPS;
      if (n_events >= flow.opt.max_events || stuck > 200) return TOO_MANY_EVENTS;
      const double brk = flow.drive.next_break(flow.t, t_end);
      double target = brk < t_end ? brk : t_end;
      const double last = next_save + kSavesPerStep - 1 < n_save
                              ? save_at[next_save + kSavesPerStep - 1]
                              : target;
      if (last < target && last > flow.t) target = last;
      const Status status = step(target, out);
      if (status != RUNNING) return status;
      if (flow.t == brk) {
        const Status changed = breakpoint(out);
        if (changed != RUNNING) return changed;
      }
    }
    return DONE;
  }

 private:
  // The evaluation, k[0] and accelerations at (t, y).
  void refresh() { flow.evaluate(flow.t, flow.y, flow.k[0]); }

  void set_mode(const bool* taut) {
    for (int r = 0; r < M; ++r) flow.taut[r] = taut[r];
  }

  double resolution() const { return 4.0 * 2.3e-16 * (fabs(flow.t) > 1.0 ? fabs(flow.t) : 1.0); }

  double no_tension() const { return kNoTension * flow.opt.tension_cap * 1e-5; }

  Status step(double target, Record<Model>& out) {
    const double left = target - flow.t;
    double s = step_size < flow.opt.max_step ? step_size : flow.opt.max_step;
    if (left <= resolution()) {
      flow.t = target;
      return RUNNING;
    }
    double growth_cap = 8.0;
    for (;;) {
      bool reaches = false;
      if (s >= left * (1 - 1e-12)) {
        s = left;
        reaches = true;
      } else if (s > 0.5 * left) {
        s = 0.5 * left;  // no sliver before the target
      }
      if (s < resolution()) return STEP_TOO_SMALL;
      ++n_steps;
      if (n_steps >= flow.opt.max_steps) return TOO_MANY_STEPS;
      flow.stages(s);
      const double err = flow.error(s);
      if (!(err < 1e300)) {
        if (s < 1e-10) return NOT_FINITE;
        s *= 0.1;
        growth_cap = 1.0;
        continue;
      }
      double factor = err > 0.0 ? 0.9 * pow(err, -1.0 / 8.0) : growth_cap;
      if (err > 1.0) {
        s *= factor < 0.2 ? 0.2 : factor;
        growth_cap = 1.0;
        continue;
      }
      factor = factor < 0.2 ? 0.2 : (factor > growth_cap ? growth_cap : factor);
      if (!reaches || factor < 1.0) step_size = s * factor;
      else if (s * factor > step_size) step_size = s * factor;
      flow.evaluate(flow.t + s, flow.end, flow.k[dop853::stages]);
      const double found = suspicious(s);
      if (found <= 0.0) return accept(s, reaches ? target : flow.t + s, out);
      const double at = locate(found);
      const Status status = accept(at, at == left ? target : flow.t + at, out);
      return status == RUNNING ? instant(out) : status;
    }
  }

  // --- guards ---------------------------------------------------------------------------------

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

  Worst worst(const double* at_v) const {
    Worst out = {-1.0, 0};
    for (int r = 0; r < M; ++r) {
      const double g = guard(r, at_v);
      if (g > out.guard || g != g) out = {g != g ? 1.0 : g, r};
    }
    return out;
  }

  double guard_at(double s) {
    flow.stages(s);
    flow.evaluate(flow.t + s, flow.end, flow.k[dop853::stages]);
    return worst(flow.end + NQ).guard;
  }

  // A time in (0, s] at which a guard is positive, or 0. The step has just been tried and
  // evaluated at its end, and is again when this returns 0.
  double suspicious(double s) { return worst(flow.end + NQ).guard > 0.0 ? s : inside(s); }

  // Crossings that return within the step: heights by the cubic through the ends, tensions at the
  // stages, each confirmed by integrating there.
  double inside(double s) {
    double at = 0.0;
    for (int r = 0; r < M; ++r) {
      if (flow.taut[r]) {
        if (r < S && Model::wire[r]) continue;
        for (int i = 1; i < dop853::stages; ++i)
          if (-flow.stage_tension[i][r] > no_tension() && dop853::C[i] < 1.0 &&
              (at == 0.0 || dop853::C[i] * s < at))
            at = dop853::C[i] * s;
      } else if (armed[r]) {
        const double peak = peak_time(
            height0_[r], rate0_[r], flow.eval.height(r), flow.rate_of(r, flow.end + NQ), s,
            kOpen * flow.row_scale(r));
        if (peak > 0.0 && (at == 0.0 || peak < at)) at = peak;
      }
    }
    if (at == 0.0) return 0.0;
    if (guard_at(at) > 0.0) return at;
    guard_at(s);
    return 0.0;
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
    double lo = 0.0, g_hi = guard_at(hi), g_lo = guard0_ < 0.0 ? guard0_ : -1e-16;
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

  // --- acceptance and events ------------------------------------------------------------------

  Status accept(double s, double new_t, Record<Model>& out) {
    if (next_save < n_save && save_at[next_save] < new_t) {
      save_inside(s, new_t, out);
      flow.evaluate(new_t, flow.end, flow.k[dop853::stages]);
    }
    const Status status = flow.project(new_t, flow.end);
    if (status != RUNNING) return status;
    for (int j = 0; j < NY; ++j)
      if (!(fabs(flow.end[j]) < 1e300)) return NOT_FINITE;
    const double moved = new_t - flow.t;
    flow.t = new_t;
    for (int j = 0; j < NY; ++j) flow.y[j] = flow.end[j];
    refresh();
    stuck = moved > 1e-12 ? 0 : stuck + 1;
    for (int r = 0; r < M; ++r) {
      const double h = flow.eval.height(r);
      if (!flow.taut[r] && h < -kOpen * flow.row_scale(r)) armed[r] = true;
      if (!flow.taut[r] && h > 0.0) armed[r] = false;
      if (!(fabs(flow.tension[r]) <= flow.opt.tension_cap)) return TENSION_CAP;
    }
    for (int i = 0; i < S; ++i)
      if (Model::length_q[i] >= 0 && flow.q_K[Model::length_q[i]] <= 1e-9)
        return LENGTH_NOT_POSITIVE;
    remember();
    if (flow.opt.save_steps) emit(out);
    while (next_save < n_save && save_at[next_save] <= flow.t) {
      if (!flow.opt.save_steps) emit(out);
      ++next_save;
    }
    return RUNNING;
  }

  void save_inside(double s, double new_t, Record<Model>& out) {
    flow.prepare_dense(s);
    const double t0 = flow.t;
    double state[NY], rate[NY];
    for (; next_save < n_save && save_at[next_save] < new_t; ++next_save) {
      const double at = save_at[next_save];
      flow.dense((at - t0) / s, state);
      flow.evaluate(at, state, rate);
      if (flow.project(at, state) != RUNNING) continue;
      flow.evaluate(at, state, rate);
      write(at, state, out);
    }
  }

  void emit(Record<Model>& out) { write(flow.t, flow.y, out); }

  void write(double t, const double* y, Record<Model>& out) {
    // At a release the tension is zero up to rounding, of either sign.
    double tension[room(M)];
    for (int r = 0; r < M; ++r) {
      const bool both = r < S && Model::wire[r];
      tension[r] = both || flow.tension[r] > 0.0 ? flow.tension[r] : 0.0;
    }
    out.row(
        t, y, y + NQ, flow.acc, flow.q_K, flow.v_K, flow.acc_K, tension, flow.taut, flow.p,
        y[F::WORK], y[F::LOSS], impact);
  }

  void skip_saved() {
    while (next_save < n_save && save_at[next_save] <= flow.t) ++next_save;
    remember();
  }

  // What the next step's guards compare with.
  void remember() {
    for (int r = 0; r < M; ++r) {
      height0_[r] = flow.eval.height(r);
      rate0_[r] = flow.rate_of(r, flow.y + NQ);
    }
    guard0_ = worst(flow.y + NQ).guard;
  }

  // An event at (t, y): catches strike, then the next mode is chosen.
  Status instant(Record<Model>& out) {
    bool before[room(M)], closed[room(M)], loose[room(M)];
    bool caught = false;
    for (int r = 0; r < M; ++r) {
      before[r] = flow.taut[r];
      loose[r] = before[r] && guard(r, flow.y + NQ) > -kNoTension;
      const bool touches = flow.eval.height(r) >= -kTouch * flow.row_scale(r) &&
                           flow.rate_of(r, flow.y + NQ) > 0.0;
      closed[r] = before[r] || touches;
      caught = caught || (touches && !before[r]);
    }
    if (caught) {
      accumulation.watch(flow, closed, before);
      if (!flow.opt.save_steps) emit(out);
      Status status = contact.strike(flow, closed);
      if (status != RUNNING) return status;
      impact += contact.lost;
      for (int r = 0; r < M; ++r)
        if (closed[r] && !before[r]) {
          out.event(flow.t, CATCH, r, contact.impulse[r], contact.speed[r]);
          ++n_events;
        }
      if (accumulation.reached(flow)) {
        status = accumulation.settle(flow, impact);
        if (status != RUNNING) return status;
        out.event(flow.t, ACCUMULATION, -1, 0.0, 0.0);
        ++n_events;
      }
    }
    return settle_mode(before, closed, loose, out);
  }

  // At a break of the inputs the tensions may jump: choose the mode again.
  Status breakpoint(Record<Model>& out) {
    bool before[room(M)], closed[room(M)], loose[room(M)];
    for (int r = 0; r < M; ++r) {
      closed[r] = before[r] = flow.taut[r];
      loose[r] = false;
    }
    flow.drive.start_at(flow.t);
    return settle_mode(before, closed, loose, out);
  }

  Status settle_mode(
      const bool* before, const bool* closed, const bool* loose, Record<Model>& out) {
    bool next[room(M)];
    const Status status = contact.choose(flow, loose, next);
    if (status != RUNNING) return status;
    bool changed = false;
    for (int r = 0; r < M; ++r) {
      if (closed[r] && !next[r]) {
        if (before[r]) {
          out.event(flow.t, RELEASE, r, 0.0, 0.0);
          ++n_events;
        }
        armed[r] = false;
      }
      changed = changed || next[r] != before[r] || closed[r] != before[r];
    }
    set_mode(next);
    refresh();
    const double energy = flow.total_energy();
    const Status held = flow.project(flow.t, flow.y);
    if (held != RUNNING) return held;
    refresh();
    impact += energy - flow.total_energy();
    remember();
    if (changed) emit(out);
    return RUNNING;
  }

  double height0_[room(M)], rate0_[room(M)], guard0_ = -1.0;
};

}  // namespace fan
