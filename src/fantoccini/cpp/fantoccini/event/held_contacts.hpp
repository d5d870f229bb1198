// Contacts of an event-driven run. Between two events every point that touches keeps its mode:
//
//   sticking: u = 0;   sliding: u_n = 0, x_T = mu x_n d with d against u_T;   resting: x = 0
//
// so that the forces x follow from linear equations over the held strings and points (held_rows.hpp).
// Redundant points are held as well: of all x the one nearest to the forces at the last event is
// taken, which are those of least norm where these are legal; where it is not legal, any other that
// gives the same motion. At the instant at which none does any longer the modes end; the forces of
// that instant are those of the law itself.
#pragma once

#include "fantoccini/contact/push.hpp"
#include "fantoccini/event/held_nothing.hpp"
#include "fantoccini/event/held_rows.hpp"
#include "fantoccini/model/correct.hpp"
#include "fantoccini/runs/snapshot.hpp"
#include "fantoccini/solvers/cone.hpp"

namespace fan {

template <class Model, bool touches>
class HeldContacts : public HeldRows<Model> {
  using Base = HeldRows<Model>;

 public:
  static constexpr int C = Base::C, N = Base::N, NQ = Base::NQ, M = Base::M, R = Base::R;
  using Tolerance = HeldContactTolerances;
  using Contact = typename Base::Contact;
  using Base::at, Base::n, Base::in, Base::gap, Base::hdot, Base::x, Base::after, Base::overlap;
  using Base::along, Base::differ, Base::friction, Base::in_world, Base::too_many;
  using Base::lawful, Base::after_lawful, Base::assemble, Base::take, Base::influence;

  ConeProblem<R> cone;  // for whoever chooses forces or impulses
  bool redistributed = false;  // whether redundant forces were found anew at the latest evaluation
  bool ends = false;           // whether the law's forces there, `lawful`, part or move what is held

  bool active() const { return in && n > 0; }

  // Whether any point is followed, once those near a state are looked at.
  template <class F>
  bool look_near(const F& f, const double* q_D, const double* v_D) {
    if (!in) return false;
    this->look(f, q_D, v_D);
    return active();
  }

  // The guard of the deepest overlap, or of point slot - 1 (guards.hpp).
  template <class F>
  double guard_of(const F& f, int slot) const {
    if (!in) return -1.0;
    if (slot == 0) return overlap;
    return slot - 1 < n ? guard(f, slot - 1) : -1.0;
  }

  bool holds() const {
    for (int c = 0; c < n; ++c)
      if (at[c].mode == STICKING || at[c].mode == SLIDING) return true;
    return false;
  }

  // The forces with the modes frozen. Adds -W x to w and the power of driven solids to `power`;
  // tension gets those of f.rows, which must be gathered.
  template <class F>
  void push(
      const F& f, const double* q_D, const double* v_D, double* w, double* tension, double* power) {
    ends = false;
    differ(f, q_D, v_D);
    assemble(f);
    double reference[room(R)] = {};
    for (int a = 0; a < n_single_; ++a) reference[a] = tension_[f.rows.row[a]];
    for (int c = 0; c < n; ++c)
      for (int d = 0; d < 3; ++d)
        reference[n_single_ + 3 * c + d] = dot3(frame_[c] + 3 * d, at[c].force);
    double known[room(R)], asked[room(R)];
    let_slip(f, known, asked);
    this->find_forces(f, asked, reference);
    for (int a = 0; a < n_single_; ++a) y_[a] += known[a];
    friction = 0.0;
    for (int a = 0; a < n_single_; ++a) {
      tension[f.rows.row[a]] = y_[a];
      *power += y_[a] * f.rows.hdot_K[a];
    }
    for (int i = 0; i < 3 * n; ++i) {
      x[i] = y_[n_single_ + i];
      *power += x[i] * rate_K_[i];
      // Sticking points move within steps by errors alone, and redundant forces are of any size there.
      if (i % 3 && at[i / 3].mode == SLIDING) friction += x[i] * hdot[i];
    }
    take(y_, w);
    for (int i = 0; i < n_; ++i) {
      double sum = hddot_[i];
      for (int j = 0; j < n_; ++j) sum -= G_[i * n_ + j] * y_[j];
      after_[i] = sum;
    }
    for (int i = 0; i < 3 * n; ++i) after[i] = after_[n_single_ + i];
  }

  // hddot of the gathered row a with all forces.
  double after_of_row(int a) const { return after_[a]; }

  // Positive where point c no longer keeps its mode at the latest evaluation.
  template <class F>
  double guard(const F& f, int c) const {
    const Contact& own = at[c];
    if (own.mode == PARTED) return -1.0;
    if (!found_[c]) return 1.0;
    const int i = 3 * c;
    if (own.mode == RESTING) {
      const double parts = fabs(after[i]) / f.hddot_scale() - Tolerance::parting_acceleration;
      const double strays = fabs(gap[c]) - own.over - Tolerance::strayed;
      return parts > strays ? parts : strays;
    }
    const double forces = excess(f, c, x + 3 * c);
    if (own.mode == STICKING || in->friction[own.pair] == 0.0) return forces;
    const double speed = along(c);
    const double stops = own.moving ? Tolerance::stopped - speed : -speed - own.back - Tolerance::stopped;
    const double jams = Tolerance::least_influence - influence(c);
    const double worst = forces > stops ? forces : stops;
    return worst > jams ? worst : jams;
  }

  // By how much a force of point c is illegal, relative to the weight.
  template <class F>
  double excess(const F& f, int c, const double* own) const {
    const double lifts = -own[0] / f.weight() - Tolerance::negligible_force;
    if (at[c].mode != STICKING) return lifts;
    const double size = sqrt(own[1] * own[1] + own[2] * own[2]);
    const double slips =
        (size - in->friction[at[c].pair] * own[0]) / f.weight() - Tolerance::negligible_force;
    return lifts > slips ? lifts : slips;
  }

  template <class F>
  bool breaks(const F& f, int c) const {
    return excess(f, c, x + 3 * c) > 0.0;
  }

  // By how much the latest forces and accelerations break the law, relative to the weight and to
  // Flow::hddot_scale. Where modes end, points without force may part, and those at their cones slide.
  template <class F>
  double residual(const F& f) const {
    double most = 0.0;
    for (int c = 0; c < n; ++c) {
      if (at[c].mode != STICKING && at[c].mode != SLIDING) continue;
      const double *own = written(c), *then = (ends ? after_lawful : after) + 3 * c;
      most = fmax(most, excess(f, c, own));
      const bool parts = ends && own[0] / f.weight() <= Tolerance::negligible_force;
      most = fmax(most, (parts ? fmax(then[0], 0.0) : fabs(then[0])) / f.hddot_scale());
      if (at[c].mode == STICKING && !parts) most = fmax(most, slips(f, c, own, then) / f.hddot_scale());
    }
    return most;
  }

  // The part of the acceleration of sticking point c across its normal that the law has not: all of
  // it, but of a point whose modes end, at its cone, that which its friction brakes.
  template <class F>
  double slips(const F& f, int c, const double* own, const double* then) const {
    const double all = sqrt(then[1] * then[1] + then[2] * then[2]);
    const double size = sqrt(own[1] * own[1] + own[2] * own[2]);
    const double most = in->friction[at[c].pair] * own[0];
    if (!ends || most - size > Tolerance::negligible_force * f.weight() || !(size > 0.0)) return all;
    const double along = (then[1] * own[1] + then[2] * own[2]) / size;
    return along < 0.0 ? all : fabs(then[1] * own[2] - then[2] * own[1]) / size;
  }

  // The force of point c that is written, in its frame.
  const double* written(int c) const { return (ends ? lawful : x) + 3 * c; }

  // Likewise the tension or force of a held row.
  double written_tension(int row, double latest) const { return ends ? lawful_tension_[row] : latest; }

  // Whether friction is about to jam one or more points: forces grow without bound.
  template <class F>
  bool jamming(const F& f) const {
    for (int c = 0; c < n; ++c) {
      if (at[c].mode != SLIDING || !found_[c]) continue;
      if (influence(c) < Tolerance::jamming_influence) return true;
      if (fabs(x[3 * c]) > Tolerance::jamming_force * f.weight()) return true;
    }
    return false;
  }

  // Whether point c has just lost its force, or parted, at the latest evaluation.
  template <class F>
  bool is_loose(const F& f, int c) const {
    if (at[c].mode == PARTED) return !at[c].fresh;
    return (at[c].mode == STICKING || at[c].mode == SLIDING) &&
           x[3 * c] / f.weight() <= Tolerance::negligible_force;
  }

  // Whether sticking point c has just reached its cone.
  template <class F>
  bool is_strained(const F& f, int c) const {
    const double* own = x + 3 * c;
    const double size = sqrt(own[1] * own[1] + own[2] * own[2]);
    return at[c].mode == STICKING &&
           size - in->friction[at[c].pair] * own[0] >= -Tolerance::negligible_force * f.weight();
  }

  // The points that push, as a record writes them.
  template <class Push>
  int pushing(Push* out) const {
    int count = 0;
    for (int c = 0; c < n; ++c) {
      if (at[c].mode != STICKING && at[c].mode != SLIDING) continue;
      Push& to = out[count++];
      to.pair = at[c].pair;
      to.feature = at[c].feature;
      to.gap = gap[c];
      double u[3] = {-hdot[3 * c], -hdot[3 * c + 1], -hdot[3 * c + 2]};
      in_world(c, written(c), to.impulse);
      in_world(c, u, to.velocity);
      for (int k = 0; k < 3; ++k) {
        to.at[k] = point_[c][k];
        to.normal[k] = frame_[c][k];
      }
    }
    return count;
  }

  // Brings held rows to h = 0 and hdot = 0 at the time `t` in the metric of M_DD; f's evaluation
  // must be that of (t, state).
  template <class F>
  Status project(F& f, double t, double* state) {
    double rate[F::NY], h[room(R)];
    list_unknowns(f, false, false);
    const int single = n_single_;
    for (int a = 0; a < single; ++a) h[a] = f.eval.height(f.rows.row[a]);
    for (int c = 0; c < n; ++c) h[single + 3 * c] = -gap[c];
    const auto left = [&] {
      double worst = 0.0;
      for (int u = 0; u < directed_.n; ++u) {
        const int i = directed_.first_row(u);
        const double off = fabs(h[i]) / (i < single ? f.row_scale(f.rows.row[i]) : 1.0);
        if (!(off <= worst) && worst == worst) worst = off;
      }
      return worst;
    };
    const double none[room(R)] = {};
    const Status status = correct<NQ>(state, left, [&] {
      double w[room(N)] = {}, move[room(N)], all[room(M)];
      directed_.solve(G_, n_, h, none, y_);
      take(y_, w);
      f.eval.back(w, move);
      retract<typename Model::Dynamic>(state, move, state);
      f.heights(state, all);
      for (int a = 0; a < single; ++a) h[a] = all[f.rows.row[a]];
      this->measure_gaps(f, state, h + single);
      return RUNNING;
    });
    if (status != RUNNING) return status;
    f.evaluate(t, state, rate);
    bring_to_rest(f, state + NQ);
    return RUNNING;
  }

  // hdot = 0 on the held rows, likewise; with `beginning` also across normals where points begin to slide.
  template <class F>
  void bring_to_rest(F& f, double* v_D, bool beginning = false) {
    const double none[room(R)] = {};
    double w[room(N)] = {}, move[room(N)];
    list_unknowns(f, true, false, beginning);
    directed_.solve(G_, n_, hdot_, none, y_);
    take(y_, w);
    f.eval.back(w, move);
    for (int k = 0; k < N; ++k) v_D[k] += move[k];
  }

  // Looks for other forces with the same motion where those of redundant points are not legal; so
  // that a mode ends only where no forces keep it. The latest evaluation must be f's.
  template <class F>
  void redistribute(F& f) {
    redistributed = ends = false;
    bool needed = false;
    for (int c = 0; c < n; ++c)
      needed = needed || ((at[c].mode == STICKING || at[c].mode == SLIDING) && found_[c] && breaks(f, c));
    for (int a = 0; a < n_single_; ++a) {
      const int r = f.rows.row[a];
      needed = needed || (f.row_state[r] == HELD && !f.rows.two_sided[a] &&
                          (y_[a] < 0.0 || y_[a] > f.winches.largest(r)));
    }
    if (!needed) return;
    double known[room(R)], asked[room(R)];
    let_slip(f, known, asked);
    int of[room(R)], n_own = 0, n_points = 0;
    bool slides[room(C)];
    double along[2 * room(C)];
    for (int a = 0; a < n_single_; ++a)
      if (f.row_state[f.rows.row[a]] == HELD) of[n_own++] = a;
    const int n_rows = n_own;
    for (int c = 0; c < n; ++c) {
      if (at[c].mode != STICKING && at[c].mode != SLIDING) continue;
      slides[n_points] = at[c].mode == SLIDING;
      along[2 * n_points] = direction_[c][0];
      along[2 * n_points + 1] = direction_[c][1];
      cone.mu[n_points++] = in->friction[at[c].pair];
      for (int d = 0; d < 3; ++d) of[n_own++] = n_single_ + 3 * c + d;
    }
    cone.resize(n_rows, n_points);
    cone.slides = slides;
    cone.along = along;
    for (int i = 0; i < n_own; ++i) {
      for (int j = 0; j < n_own; ++j) cone.G[i * cone.stride + j] = G_[of[i] * n_ + of[j]];
      cone.b[i] = asked[of[i]];
      cone.x[i] = y_[of[i]];
      cone.lower[i] = i < cone.n_single && f.rows.two_sided[of[i]] ? -unbounded : 0.0;
      cone.upper[i] = i < cone.n_single ? f.winches.largest(f.rows.row[of[i]]) : unbounded;
    }
    const bool solved = cone.solve();
    cone.slides = nullptr;
    if (!solved) return;
    const double most = Tolerance::parting_acceleration * f.hddot_scale();
    for (int i = 0; i < n_own; ++i) {
      const bool tangent = i >= cone.n_single && (i - cone.n_single) % 3 > 0;
      if (tangent && slides[(i - cone.n_single) / 3]) continue;
      ends = ends || fabs(cone.s[i]) > most;
    }
    for (int r = 0; r < M && ends; ++r) lawful_tension_[r] = f.tension[r];
    for (int i = 0; i < n_own; ++i) {
      const int own = of[i] - n_single_;
      if (own < 0) (ends ? lawful_tension_ : f.tension)[f.rows.row[of[i]]] = cone.x[i];
      else (ends ? lawful : x)[own] = cone.x[i];
      if (own >= 0) after_lawful[own] = -cone.s[i];
    }
    redistributed = !ends;
  }

  // The tensions of the strings whose winches slip, `known`, and hddot with no others, `hddot`.
  template <class F>
  void let_slip(const F& f, double* known, double* hddot) const {
    for (int i = 0; i < n_; ++i) {
      known[i] = 0.0;
      hddot[i] = hddot_[i];
    }
    for (int a = 0; a < n_single_; ++a) {
      const int r = f.rows.row[a];
      if (f.row_state[r] != SLIPPING && f.row_state[r] != PINNED) continue;
      known[a] = f.winches.largest(r);
      for (int i = 0; i < n_; ++i) hddot[i] -= G_[i * n_ + a] * known[a];
    }
  }

  void remember(Snapshot& memory) { memory.keep(n, at, tension_, too_many); }

 private:
  using Base::tension_, Base::found_, Base::point_, Base::frame_, Base::rate_K_, Base::list_unknowns;
  using Base::direction_, Base::n_single_, Base::n_, Base::G_, Base::hdot_, Base::hddot_, Base::y_;
  using Base::directed_;

  double lawful_tension_[room(M)], after_[room(R)];
};

}  // namespace fan
