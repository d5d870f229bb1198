// Output of an event-driven run: the state, and the events of rows and of solids that meet.
#pragma once

#include "fantoccini/event/closed_rows.hpp"
#include "fantoccini/event/contact_instants.hpp"
#include "fantoccini/event/rate.hpp"
#include "fantoccini/runs/record.hpp"

namespace fan {

template <class Model>
struct EventWriter {
  using F = Flow<Model>;
  static constexpr int NQ = F::NQ, S = F::S, M = F::M, C = F::C;

  using Instants = std::conditional_t<F::touches, ContactInstants<Model>, NoContacts>;

  F& flow;
  ClosedRows<Model>& closed_rows;
  const Instants& contact_instants;
  EventRate<M> event_rate;
  double impact = 0.0;  // energy lost in catches so far
  long long n_events = 0;

  EventWriter(F& flow, ClosedRows<Model>& closed_rows, const Instants& contact_instants)
      : flow(flow), closed_rows(closed_rows), contact_instants(contact_instants) {}

  // The rows at an event: their state before it; whether they are closed, have just been caught,
  // have just lost their tension (or are not armed), and have just reached their winch's largest.
  struct Situation {
    Hold before[array_size(M)];
    bool closed[array_size(M)], caught[array_size(M)], loose[array_size(M)],
        strained[array_size(M)];

    // Whether row r holds after the catches and before the choice of the next active set.
    bool holds(int r) const { return before[r] != SLACK || caught[r]; }
  };

  // Writes the present state.
  void emit(Record<Model>& out) { write(flow.t, flow.y, out); }

  // Writes a state, the flow's latest evaluation.
  void write(double t, const double* y, Record<Model>& out) {
    double tension[array_size(M)];
    double slip[array_size(S)];  // without the error of up to max_length_error (model/winch.hpp)
    bool taut[array_size(M)];
    for (int i = 0; i < S; ++i) slip[i] = flow.slip_now[i] > 0.0 ? flow.slip_now[i] : 0.0;
    if (followed())
      for (int r = 0; r < M; ++r) tension[r] = flow.contacts.written_tension(r, flow.tension[r]);
    else closed_rows.tensions(flow, tension);
    for (int r = 0; r < M; ++r) {
      // At a release the tension is zero up to rounding, of either sign.
      const bool both = r < S && Model::wire[r];
      if (!both && !(tension[r] > 0.0)) tension[r] = 0.0;
      taut[r] = flow.taut(r);
    }
    double friction = 0.0;
    if constexpr (F::touches) friction = y[F::FRICTION];
    const double energy_terms[] = {y[F::WORK], y[F::LOSS], impact, y[F::SLIP_LOSS], friction};
    out.row(
        t, y, y + NQ, flow.acc, flow.q_K, flow.v_K, flow.acc_K, tension, taut, flow.p, energy_terms,
        slip);
    if constexpr (F::touches) {
      ContactPush push[array_size(C)];
      const int n = followed() ? flow.contacts.pushing(push) : 0;
      out.touching(push, n, 1.0, n > 0 ? flow.contacts.residual(flow) : 0.0);
    }
  }

  // Whether contact points are followed.
  bool followed() const { return flow.contacts.active(); }

  void note(Record<Model>& out, EventCode kind, int row, double impulse, double speed) {
    out.event(flow.t, kind, row, impulse, speed);
    event_rate.note(flow.t, row);
    ++n_events;
  }

  void write_contact_event(
      Record<Model>& out, double t, EventCode kind, int pair, double impulse, double speed) {
    out.event(t, kind, M + F::D + flow.contacts.points.in->meetings[pair], impulse, speed);
    event_rate.note(flow.t, -1);
    ++n_events;
  }

  // Whether point c is the first of its two solids among the points.
  bool is_first(int c) const {
    const auto& points = flow.contacts.points;
    for (int b = 0; b < c; ++b)
      if (points.meet(points.at[b].pair, points.at[c].pair)) return false;
    return true;
  }

  // Writes the impacts of the points that struck, one event for every two solids.
  void write_touches(const bool* struck, Record<Model>& out) {
    auto& points = flow.contacts.points;
    for (int c = 0; c < points.n; ++c) {
      if (!is_first(c)) continue;
      double impulse = 0.0, speed = 0.0;
      bool any_struck = false;
      for (int b = c; b < points.n; ++b) {
        if (!points.meet(points.at[b].pair, points.at[c].pair)) continue;
        impulse += contact_instants.point_impulse[b];
        const double own = contact_instants.point_speed[b];
        if (struck[b] && own > speed) speed = own;
        any_struck = any_struck || struck[b];
      }
      if (any_struck) write_contact_event(out, flow.t, TOUCH, points.at[c].pair, impulse, speed);
    }
  }

  // Writes the events of solids that touched without an impact, parted, or came to stick. Returns
  // whether there are any.
  bool write_modes(const bool* touched, const bool* struck, Record<Model>& out) {
    auto& points = flow.contacts.points;
    bool changed = false;
    for (int c = 0; c < points.n; ++c) {
      if (!is_first(c)) continue;
      bool before = false, now = false, hit = false, reported = false, slides = false;
      for (int b = c; b < points.n; ++b) {
        auto& own = points.at[b];
        if (!points.meet(own.pair, points.at[c].pair)) continue;
        before = before || touched[b];
        now = now || own.mode != PARTED;
        hit = hit || struck[b];
        reported = reported || own.reported;
        slides = slides || own.mode == SLIDING;
        // A point that has come to rest and slides on begins to slide again.
        if (!own.moving) own.reported = false;
      }
      const int pair = points.at[c].pair;
      if (!before && now && !hit) write_contact_event(out, flow.t, TOUCH, pair, 0.0, 0.0);
      if ((before || hit) && !now) write_contact_event(out, flow.t, LIFT, pair, 0.0, 0.0);
      if (now && reported && !slides) write_contact_event(out, flow.t, STICK, pair, 0.0, 0.0);
      changed = changed || before != now || hit || reported;
    }
    return changed;
  }

  // Writes the events of row r, which went from s.before to its present state. The catch of an
  // impact has been written.
  void write_changes(const Situation& s, int r, Record<Model>& out) {
    const Hold before = s.before[r], next = flow.row_state[r];
    if (next == SLACK) {
      if (s.holds(r)) note(out, RELEASE, r, 0.0, 0.0);
      return;
    }
    if (!s.holds(r)) note(out, CATCH, r, 0.0, 0.0);
    if (next == SLIPPING && before != SLIPPING) note(out, SLIP, r, 0.0, flow.slip_rate[r]);
    if (next != SLIPPING && before == SLIPPING) note(out, GRIP, r, 0.0, 0.0);
  }
};

}  // namespace fan
