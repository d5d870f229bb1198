// Handles the instants of an event-driven run: applies impulses, chooses the active set again, and
// writes the events and the state after them (writer.hpp).
#pragma once

#include "fantoccini/event/accumulation.hpp"
#include "fantoccini/event/guards.hpp"
#include "fantoccini/event/writer.hpp"

namespace fan {

struct EventTolerances {
  // Largest -h of a row that counts as closed at the start of a run, relative to its scale. It
  // allows for the errors of files and solvers. The held rows are then brought to h = 0.
  static constexpr double start_gap = Constants::start_gap;
  // A row has just lost its tension if that fell to zero less than this time ago [s].
  static constexpr double same_instant = 1e-10;
  // Steps shorter than this [s] count as standstill; the run ends after max_standstill_steps of
  // them in succession.
  static constexpr double standstill = 1e-12;
  static constexpr int max_standstill_steps = 200;
  // If a step shorter than this [s] fails, the run ends; longer ones are shortened and tried again.
  static constexpr double min_failing_step = 1e-10;
  // Step control (Hairer): order of the error, safety factor, least and largest factor of a step.
  static constexpr double order = 8.0, safety = 0.9, min_factor = 0.2, max_factor = 8.0;
  static constexpr double overflow_factor = 0.1;  // factor for a step whose error is not finite
  // Shares of the time left to the target: a step of at least `whole` is stretched to all of it;
  // one of more than `two_steps` is shortened to that share, so that the last step is not tiny.
  static constexpr double whole = 1 - 1e-12, two_steps = 0.5;
  // Change of an acceleration or a force that counts as a jump at a break, relative to 1 + |before|
  // + |after|.
  static constexpr double jump = 1e-9;
  static constexpr int max_saves_per_step = 64;  // capacity of the record
  // Gap [m] below which contact points touch: during a run, and at its start.
  static constexpr double touching = 1e-12, touching_at_start = 1e-6;
};

template <class Model>
struct EventInstants {
  using Writer = EventWriter<Model>;
  using F = typename Writer::F;
  using Situation = typename Writer::Situation;
  using Tolerance = EventTolerances;
  static constexpr int N = F::N, NQ = F::NQ, S = F::S, M = F::M, NY = F::NY, C = F::C;

  F& flow;
  Guards<Model>& guards;
  ClosedRows<Model> closed_rows;
  typename Writer::Instants contact_instants;
  Writer writer{flow, closed_rows, contact_instants};
  Accumulation accumulation;
  double attribution[array_size(M)] = {};  // each row's share in the cause of the status, 0 to 1
  double until = unbounded;  // the end of the run [s]; events after it are not reported
  double tension_lost_at[array_size(M)];  // s: last time at which each row lost its tension

  EventInstants(F& flow, Guards<Model>& guards) : flow(flow), guards(guards) {}
  EventInstants(const EventInstants&) = delete;

  // Computes the evaluation, k[0] and the accelerations at (t, y) again.
  void refresh() { flow.evaluate(flow.t, flow.y, flow.k[0]); }

  void set_active_set(const Hold* mode) {
    for (int r = 0; r < M; ++r) flow.row_state[r] = mode[r];
  }

  void attribute_to_rows(const double* rows) {
    for (int r = 0; r < M; ++r) attribution[r] = rows[r];
  }

  // Whether solids touch, or contact points are tracked, at (t, y), where the flow was last
  // evaluated.
  bool in_contact(double max_gap = Tolerance::touching) const {
    if constexpr (F::touches) {
      const auto& points = flow.contacts.points;
      return points.in && (points.n > 0 || points.overlap >= -max_gap);
    }
    return false;
  }

  // Handles an event at (t, y): applies the impulses of catches, then chooses the next active set.
  Status instant(Record<Model>& out) {
    if (in_contact()) return contact_instant(out, Tolerance::touching);
    Situation s;
    bool caught = false;
    for (int r = 0; r < M; ++r) {
      s.before[r] = flow.row_state[r];
      const bool held = s.before[r] == HELD || s.before[r] == PINNED;
      const double relative_tension = flow.tension[r] / flow.weight();
      if (held && relative_tension < GuardTolerances::negligible_tension)
        tension_lost_at[r] = flow.t;
      // A redundant row that has just lost its tension must not be exchanged with another again
      // and again.
      s.loose[r] = s.before[r] == SLACK ? !guards.armed[r]
                                        : flow.t - tension_lost_at[r] <= Tolerance::same_instant;
      s.strained[r] = is_strained(r);
      const bool touches = s.before[r] == SLACK && guards.touches(r, FlowTolerances::closed_gap);
      s.caught[r] = touches;
      s.closed[r] = s.before[r] != SLACK || guards.closed(r, FlowTolerances::closed_gap);
      caught = caught || touches;
    }
    if (caught) {
      accumulation.watch(flow.t);
      if (!flow.opt.save_steps) writer.emit(out);
      const Status status = closed_rows.strike(flow, s.closed);
      if (status != RUNNING) return fail(status);
      writer.impact += closed_rows.lost;
      for (int r = 0; r < M; ++r) {
        s.caught[r] = s.caught[r] || (s.before[r] == SLACK && closed_rows.impulse[r] > 0.0);
        s.loose[r] = s.loose[r] && !s.caught[r];
        if (s.caught[r]) writer.note(out, CATCH, r, closed_rows.impulse[r], closed_rows.speed[r]);
      }
    }
    return settle_active_set(s, out);
  }

  // At a break of the inputs the tensions may jump: chooses the active set again, and writes a
  // second row if the inputs' accelerations or the forces jump.
  Status breakpoint(Record<Model>& out) {
    double acc_K[array_size(Model::n_vK)], u_D[array_size(N)];
    for (int j = 0; j < Model::n_vK; ++j) acc_K[j] = flow.acc_K[j];
    for (int k = 0; k < N; ++k) u_D[k] = flow.u_D[k];
    flow.drive.start_at(flow.t);
    refresh();
    bool jumps = false;
    for (int j = 0; j < Model::n_vK; ++j) jumps = jumps || differ(acc_K[j], flow.acc_K[j]);
    for (int k = 0; k < N; ++k) jumps = jumps || differ(u_D[k], flow.u_D[k]);
    if (jumps) writer.note(out, BREAKPOINT, -1, 0.0, 0.0);
    const long long rows = out.n_samples;
    bool touched = false;
    for (int r = 0; r < M; ++r)
      touched =
          touched || (flow.row_state[r] == SLACK && guards.touches(r, FlowTolerances::closed_gap));
    const Status status = touched ? instant(out) : settle_active_set(current_situation(), out);
    if (jumps && out.n_samples == rows) writer.emit(out);
    return status;
  }

  // Chooses again which of the redundant rows are held: the present ones are nearly dependent.
  Status another_basis(Record<Model>& out) { return settle_active_set(current_situation(), out); }

  // Handles an instant with contacts: the impulses of strings, limits and solids are solved
  // together, then all modes are chosen. Points touch if they are at most `max_gap` apart; at the
  // start of a run (`starts`) the touch is not new.
  Status contact_instant(Record<Model>& out, double max_gap, bool starts = false) {
    if constexpr (!F::touches) return RUNNING;
    else {
      auto& contacts = flow.contacts;
      // This call is counted even if it writes no event, so that an endless series ends the run.
      writer.event_rate.note(flow.t, -1, EventRateTolerances::of_contact);
      contacts.points.take_closed(flow, flow.y, flow.y + NQ, max_gap);
      if (contacts.points.too_many) return TOO_MANY_CONTACTS;
      Situation s = current_situation();
      bool loose[array_size(C)], strained[array_size(C)], struck[array_size(C)],
          touched[array_size(C)], strikes[array_size(M)];
      bool any_struck = false,
           any_hit = false;  // any catch or impact; any that exchanges an impulse
      for (int r = 0; r < M; ++r) {
        const double relative_tension = flow.tension[r] / flow.weight();
        if (s.before[r] == HELD && relative_tension < GuardTolerances::negligible_tension)
          tension_lost_at[r] = flow.t;
        if (s.before[r] != SLACK)
          s.loose[r] = flow.t - tension_lost_at[r] <= Tolerance::same_instant;
        s.strained[r] = is_strained(r);
        s.caught[r] = s.before[r] == SLACK && guards.touches(r, FlowTolerances::closed_gap);
        s.closed[r] = s.before[r] != SLACK || guards.closed(r, FlowTolerances::closed_gap);
        strikes[r] = s.closed[r] && !flow.winches.slips(r);
        any_struck = any_struck || s.caught[r];
        any_hit = any_hit || (s.caught[r] && strikes[r]);
      }
      for (int c = 0; c < contacts.points.n; ++c) {
        loose[c] = contacts.is_loose(flow, c);
        strained[c] = contacts.is_strained(flow, c);
        touched[c] = contacts.points.at[c].mode != PARTED;
      }
      contact_instants.gather(flow, strikes);
      for (int c = 0; c < contacts.points.n; ++c) {
        struck[c] = contact_instants.is_struck(flow, c);
        any_struck = any_struck || struck[c];
        any_hit = any_hit || struck[c];
      }
      if (any_struck) {
        accumulation.watch(flow.t);
        if (starts || !flow.opt.save_steps) writer.emit(out);
        contact_instants.begin_impact(flow);
        if (any_hit) {
          const Status status = contact_instants.strike(flow);
          if (status != RUNNING) return status;
          writer.impact += contact_instants.lost;
        }
        for (int r = 0; r < M; ++r) {
          s.caught[r] = s.caught[r] || (s.before[r] == SLACK && contact_instants.impulse[r] > 0.0);
          s.loose[r] = s.loose[r] && !s.caught[r];
          if (s.caught[r])
            writer.note(out, CATCH, r, contact_instants.impulse[r], contact_instants.speed[r]);
        }
        for (int c = 0; c < contacts.points.n; ++c) {
          loose[c] = loose[c] && !struck[c] && !(contact_instants.point_impulse[c] > 0.0);
          strained[c] = false;
        }
        writer.write_touches(struck, out);
        refresh();
      }
      flow.grip();
      if (any_hit || flow.winches.some_slip) contact_instants.gather(flow, s.closed);
      Hold next[array_size(M)];
      const Status chosen =
          contact_instants.choose(flow, s.loose, s.strained, loose, strained, next);
      if (chosen != RUNNING) return chosen;
      set_active_set(next);
      const double energy = flow.total_energy() - net_work(),
                   stopped = contacts.points.fastest_normal();
      refresh();
      const Status projected = flow.project(flow.t, flow.y);
      if (projected != RUNNING) return projected;
      refresh();
      contacts.bring_to_rest(flow, flow.y + NQ, true);
      refresh();
      // Energy changed by correcting the start does not count as a loss of the run.
      if (!starts) writer.impact += energy - (flow.total_energy() - net_work());
      for (int r = 0; r < M; ++r)
        if (next[r] == SLIPPING) guards.armed[r] = flow.violation(r) < -GuardTolerances::min_speed;
      share_forces();
      contacts.points.accept_overlaps();
      bool changed = any_struck;
      for (int r = 0; r < M; ++r) {
        if (!starts) writer.write_changes(s, r, out);
        changed = changed || next[r] != s.before[r];
        if (next[r] == SLACK && s.holds(r)) guards.armed[r] = closed_rows.leaves(flow, r);
      }
      changed = starts || writer.write_modes(touched, struck, out) || changed;
      if (stopped > GuardTolerances::min_speed && accumulation.shrinking()) {
        out.event(fmin(accumulation.limit(), until), ACCUMULATION, -1, 0.0, stopped);
        ++writer.n_events;
        accumulation.forget();
      }
      update_directions(out);
      guards.remember();
      if (changed) writer.emit(out);
      return contacts.points.too_many ? TOO_MANY_CONTACTS : RUNNING;
    }
  }

  // Updates the directions of sliding points, and writes an event for each pair that has begun to
  // slide.
  void update_directions(Record<Model>& out) {
    if constexpr (F::touches) {
      auto& contacts = flow.contacts;
      if (!contacts.active()) return;
      if (contacts.redistributed) contacts.points.keep_forces(flow);
      contacts.redistributed = false;
      auto& points = contacts.points;
      points.update_directions();
      for (int c = 0; c < points.n; ++c) {
        auto& own = points.at[c];
        if (own.reported || own.mode != SLIDING || !own.moving ||
            points.in->friction[own.pair] == 0.0)
          continue;
        bool first = true;
        for (int b = 0; b < points.n; ++b)
          first = first && !(points.at[b].reported && points.meet(points.at[b].pair, own.pair));
        own.reported = true;
        if (first)
          writer.write_contact_event(out, own.since, SLIDE, own.pair, 0.0, points.sliding_speed(c));
      }
    }
  }

 private:
  // Whether string r has just reached its winch's largest tension.
  bool is_strained(int r) const {
    return (flow.row_state[r] == HELD || flow.row_state[r] == PINNED) && flow.winches.slips(r) &&
           flow.tension[r] >=
               flow.winches.max_tension[r] - GuardTolerances::negligible_tension * flow.weight();
  }

  // The situation of the rows if there is no event.
  Situation current_situation() const {
    Situation s;
    for (int r = 0; r < M; ++r) {
      s.before[r] = flow.row_state[r];
      s.closed[r] = flow.taut(r);
      s.caught[r] = s.strained[r] = false;
      s.loose[r] = !flow.taut(r) && !guards.armed[r];
    }
    return s;
  }

  Status fail(Status status) {
    attribute_to_rows(closed_rows.attribution);
    return status;
  }

  static bool differ(double a, double b) {
    return fabs(a - b) > Tolerance::jump * (1.0 + fabs(a) + fabs(b));
  }

  Status settle_active_set(const Situation& s, Record<Model>& out) {
    if (in_contact()) return contact_instant(out, Tolerance::touching);
    Hold next[array_size(M)];
    const double energy = flow.total_energy() - net_work();
    double stopped = 0.0;
    Status hold_status = RUNNING;
    for (const Attempt& attempt : Attempts::list) {
      if (attempt.ahead > 0.0 && !flow.winches.some_slip) continue;
      // This is repeated, because rows that the hold brings to rest take part in the next choice. A
      // hold that fails leaves velocities and energies unchanged, but it has moved closed rows from
      // up to max_length_error to h = 0, which helps any further attempt.
      for (int round = 0; round <= M; ++round) {
        hold_status = closed_rows.choose(
            flow, s.loose, s.strained, next, FlowTolerances::closed_gap, attempt);
        if (hold_status != RUNNING) {
          if (flow.winches.some_slip) break;
          else return fail(hold_status);
        }
        set_active_set(next);
        refresh();
        hold_status = closed_rows.hold(flow, attempt);
        if (closed_rows.stopped > stopped) stopped = closed_rows.stopped;
        if (hold_status != RUNNING || !closed_rows.brought) break;
      }
      if (hold_status == RUNNING) refresh();
      if (hold_status == RUNNING && !guards.contradicted()) break;
    }
    if (hold_status != RUNNING) return fail(hold_status);
    refresh();
    writer.impact += energy - (flow.total_energy() - net_work());
    bool changed = false;
    for (int r = 0; r < M; ++r) {
      writer.write_changes(s, r, out);
      changed = changed || next[r] != s.before[r] || s.caught[r];
      if (next[r] == SLIPPING) guards.armed[r] = flow.violation(r) < -GuardTolerances::min_speed;
      // A string that rebounds will soon be slack; one that has only lost its tension may stay at
      // its bound.
      if (next[r] == SLACK && s.holds(r)) guards.armed[r] = closed_rows.leaves(flow, r);
    }
    if (stopped > GuardTolerances::min_speed && accumulation.shrinking()) {
      writer.note(out, ACCUMULATION, -1, 0.0, stopped);
      accumulation.forget();
    }
    guards.remember();
    if (changed) writer.emit(out);
    return RUNNING;
  }

  // Distributes redundant contact forces: those of least norm if they are admissible, else those
  // chosen before.
  void share_forces() {
    auto& contacts = flow.contacts;
    const auto chosen = contacts.points.forces();
    contacts.points.forget_forces();
    refresh();
    bool legal = true;
    for (int g = 0; g < F::GUARDS && legal; ++g)
      if (g != F::ALL && (g < M || g > F::ALL)) legal = !(guards.guard(g) > 0.0);
    if (!legal) {
      contacts.points.set_forces(chosen);
      refresh();
      contacts.redistribute(flow);
    }
    contacts.points.keep_forces(flow);
    contacts.redistributed = false;
  }

  // Net work of inputs and winches so far.
  double net_work() const { return flow.y[F::WORK] - flow.y[F::SLIP_LOSS]; }
};

}  // namespace fan
