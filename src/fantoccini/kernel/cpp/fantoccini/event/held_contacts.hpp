// Contacts of an event-driven run. Between two events every point that touches keeps its mode:
//
//   sticking: u = 0;   sliding: u_n = 0, x_T = mu x_n d with d against u_T;   resting: x = 0
//
// so that the forces x follow from linear equations over the held strings and points
// (held_rows.hpp). Redundant points are held as well: of all x the one nearest to the forces at the
// last event is taken, which are those of least norm if these are admissible; if it is not
// admissible, any other with the same motion. The modes end at the instant at which there is none;
// the forces of that instant are those of the law itself.
#pragma once

#include "fantoccini/contact/push.hpp"
#include "fantoccini/event/held_nothing.hpp"
#include "fantoccini/event/held_rows.hpp"
#include "fantoccini/model/correct.hpp"
#include "fantoccini/runs/snapshot.hpp"
#include "fantoccini/solvers/cone.hpp"

namespace fan {

template <class Model, bool touches>
class HeldContacts {
 public:
  using Points = FollowedPoints<Model>;
  using Rows = HeldRows<Model>;
  static constexpr int C = Points::C, N = Points::N, NQ = Points::NQ, M = Points::M, R = Rows::R;
  using Tolerance = HeldContactTolerances;
  using Contact = typename Points::Contact;

  Points points;
  Rows rows;

  double friction = 0.0;       // W
  ConeProblem<R> cone;         // for callers that choose forces or impulses
  bool redistributed = false;  // whether the latest evaluation redistributed redundant forces
  bool ends = false;           // whether the law's forces there, `lawful`, part or move held points

  bool active() const { return points.in && points.n > 0; }

  // Whether any point is followed, after a search near a state.
  template <class F>
  bool look_near(const F& f, const double* q_D, const double* v_D) {
    if (!points.in) return false;
    points.search(f, q_D, v_D);
    return active();
  }

  // The guard of the deepest overlap, or of point slot - 1 (guards.hpp).
  template <class F>
  double guard_of(const F& f, int slot) const {
    if (!points.in) return -1.0;
    if (slot == 0) return points.overlap;
    return slot - 1 < points.n ? guard(f, slot - 1) : -1.0;
  }

  bool holds() const {
    for (int c = 0; c < points.n; ++c)
      if (points.at[c].mode == STICKING || points.at[c].mode == SLIDING) return true;
    return false;
  }

  // The forces with the modes frozen. Adds -W x to w and the power of driven solids to `power`;
  // tension gets those of f.rows, which must be gathered.
  template <class F>
  void push(
      const F& f, const double* q_D, const double* v_D, double* w, double* tension, double* power) {
    ends = false;
    points.differ(f, q_D, v_D);
    rows.assemble(points, f);
    double reference[array_size(R)] = {};
    for (int a = 0; a < rows.n_single; ++a) reference[a] = points.tension[f.rows.row[a]];
    for (int c = 0; c < points.n; ++c)
      for (int d = 0; d < 3; ++d)
        reference[rows.n_single + 3 * c + d] = dot3(points.frame[c] + 3 * d, points.at[c].force);
    double known[array_size(R)], free_hddot[array_size(R)];
    find_slipping(f, known, free_hddot);
    rows.find_forces(points, f, free_hddot, reference);
    for (int a = 0; a < rows.n_single; ++a) rows.y[a] += known[a];
    friction = 0.0;
    for (int a = 0; a < rows.n_single; ++a) {
      tension[f.rows.row[a]] = rows.y[a];
      *power += rows.y[a] * f.rows.hdot_K[a];
    }
    for (int i = 0; i < 3 * points.n; ++i) {
      points.x[i] = rows.y[rows.n_single + i];
      *power += points.x[i] * points.rate_K[i];
      // Within steps, sticking points move only by errors, and redundant forces may have any size.
      if (i % 3 && points.at[i / 3].mode == SLIDING) friction += points.x[i] * points.hdot[i];
    }
    rows.take(rows.y, w);
    for (int i = 0; i < rows.n; ++i) {
      double sum = rows.hddot[i];
      for (int j = 0; j < rows.n; ++j) sum -= rows.G[i * rows.n + j] * rows.y[j];
      after_[i] = sum;
    }
    for (int i = 0; i < 3 * points.n; ++i) points.after[i] = after_[rows.n_single + i];
  }

  // hddot of the gathered row a with all forces.
  double after_of_row(int a) const { return after_[a]; }

  // Guard of point c: positive if it no longer keeps its mode at the latest evaluation.
  template <class F>
  double guard(const F& f, int c) const {
    const Contact& own = points.at[c];
    if (own.mode == PARTED) return -1.0;
    if (!points.exists[c]) return 1.0;
    const int i = 3 * c;
    if (own.mode == RESTING) {
      const double parts =
          fabs(points.after[i]) / f.hddot_scale() - Tolerance::parting_acceleration;
      const double shift = fabs(points.gap[c]) - own.over - Tolerance::max_rest_distance;
      return parts > shift ? parts : shift;
    }
    const double forces = excess(f, c, points.x + 3 * c);
    if (own.mode == STICKING || points.in->friction[own.pair] == 0.0) return forces;
    const double speed = points.along(c);
    const double stops =
        own.moving ? Tolerance::stopped - speed : -speed - own.back - Tolerance::stopped;
    const double jams = Tolerance::least_influence - rows.influence(points, c);
    const double worst = forces > stops ? forces : stops;
    return worst > jams ? worst : jams;
  }

  // Violation of its bounds by the force of point c, relative to the weight.
  template <class F>
  double excess(const F& f, int c, const double* own) const {
    const double lifts = -own[0] / f.weight() - Tolerance::negligible_force;
    if (points.at[c].mode != STICKING) return lifts;
    const double size = sqrt(own[1] * own[1] + own[2] * own[2]);
    const double slips = (size - points.in->friction[points.at[c].pair] * own[0]) / f.weight() -
                         Tolerance::negligible_force;
    return lifts > slips ? lifts : slips;
  }

  template <class F>
  bool breaks(const F& f, int c) const {
    return excess(f, c, points.x + 3 * c) > 0.0;
  }

  // Violation of the law by the latest forces and accelerations, relative to the weight and to
  // Flow::hddot_scale. Where modes end, points without force may part, and those at their cones
  // slide.
  template <class F>
  double residual(const F& f) const {
    double most = 0.0;
    for (int c = 0; c < points.n; ++c) {
      if (points.at[c].mode != STICKING && points.at[c].mode != SLIDING) continue;
      const double *own = written(c), *then = (ends ? points.after_lawful : points.after) + 3 * c;
      most = fmax(most, excess(f, c, own));
      const bool parts = ends && own[0] / f.weight() <= Tolerance::negligible_force;
      most = fmax(most, (parts ? fmax(then[0], 0.0) : fabs(then[0])) / f.hddot_scale());
      if (points.at[c].mode == STICKING && !parts)
        most = fmax(most, slips(f, c, own, then) / f.hddot_scale());
    }
    return most;
  }

  // Acceleration of sticking point c across its normal that violates the law: all of it, except
  // that of a point whose modes end, at its cone, that its friction brakes.
  template <class F>
  double slips(const F& f, int c, const double* own, const double* then) const {
    const double all = sqrt(then[1] * then[1] + then[2] * then[2]);
    const double size = sqrt(own[1] * own[1] + own[2] * own[2]);
    const double most = points.in->friction[points.at[c].pair] * own[0];
    if (!ends || most - size > Tolerance::negligible_force * f.weight() || !(size > 0.0))
      return all;
    const double along = (then[1] * own[1] + then[2] * own[2]) / size;
    return along < 0.0 ? all : fabs(then[1] * own[2] - then[2] * own[1]) / size;
  }

  // The recorded force of point c, in its frame.
  const double* written(int c) const { return (ends ? points.lawful : points.x) + 3 * c; }

  // Likewise the tension or force of a held row.
  double written_tension(int row, double latest) const {
    return ends ? lawful_tension_[row] : latest;
  }

  // Whether friction is about to jam any point: forces grow without bound.
  template <class F>
  bool jamming(const F& f) const {
    for (int c = 0; c < points.n; ++c) {
      if (points.at[c].mode != SLIDING || !points.exists[c]) continue;
      if (rows.influence(points, c) < Tolerance::jamming_influence) return true;
      if (fabs(points.x[3 * c]) > Tolerance::jamming_force * f.weight()) return true;
    }
    return false;
  }

  // Whether point c has just lost its force, or parted, at the latest evaluation.
  template <class F>
  bool is_loose(const F& f, int c) const {
    if (points.at[c].mode == PARTED) return !points.at[c].fresh;
    return (points.at[c].mode == STICKING || points.at[c].mode == SLIDING) &&
           points.x[3 * c] / f.weight() <= Tolerance::negligible_force;
  }

  // Whether sticking point c has just reached its cone.
  template <class F>
  bool is_strained(const F& f, int c) const {
    const double* own = points.x + 3 * c;
    const double size = sqrt(own[1] * own[1] + own[2] * own[2]);
    return points.at[c].mode == STICKING &&
           size - points.in->friction[points.at[c].pair] * own[0] >=
               -Tolerance::negligible_force * f.weight();
  }

  // The points that push, as a record contains them.
  template <class Push>
  int pushing(Push* out) const {
    int count = 0;
    for (int c = 0; c < points.n; ++c) {
      if (points.at[c].mode != STICKING && points.at[c].mode != SLIDING) continue;
      Push& to = out[count++];
      to.pair = points.at[c].pair;
      to.feature = points.at[c].feature;
      to.gap = points.gap[c];
      double u[3] = {-points.hdot[3 * c], -points.hdot[3 * c + 1], -points.hdot[3 * c + 2]};
      points.in_world(c, written(c), to.impulse);
      points.in_world(c, u, to.velocity);
      for (int k = 0; k < 3; ++k) {
        to.at[k] = points.point[c][k];
        to.normal[k] = points.frame[c][k];
      }
    }
    return count;
  }

  // Brings held rows to h = 0 and hdot = 0 at the time `t` in the metric of M_DD; f's evaluation
  // must be that of (t, state).
  template <class F>
  Status project(F& f, double t, double* state) {
    double rate[F::NY], h[array_size(R)];
    rows.list_unknowns(points, f, false, false);
    const int single = rows.n_single;
    for (int a = 0; a < single; ++a) h[a] = f.eval.height(f.rows.row[a]);
    for (int c = 0; c < points.n; ++c) h[single + 3 * c] = -points.gap[c];
    const auto left = [&] {
      double worst = 0.0;
      for (int u = 0; u < rows.directed.n; ++u) {
        const int i = rows.directed.first_row(u);
        const double off = fabs(h[i]) / (i < single ? f.row_scale(f.rows.row[i]) : 1.0);
        if (!(off <= worst) && worst == worst) worst = off;
      }
      return worst;
    };
    const double none[array_size(R)] = {};
    const Status status = correct<NQ>(state, left, [&] {
      double w[array_size(N)] = {}, move[array_size(N)], all[array_size(M)];
      rows.directed.solve(rows.G, rows.n, h, none, rows.y);
      rows.take(rows.y, w);
      f.eval.solve_factor(w, move);
      retract<typename Model::Dynamic>(state, move, state);
      f.heights(state, all);
      for (int a = 0; a < single; ++a) h[a] = all[f.rows.row[a]];
      points.measure_gaps(f, state, h + single);
      return RUNNING;
    });
    if (status != RUNNING) return status;
    f.evaluate(t, state, rate);
    bring_to_rest(f, state + NQ);
    return RUNNING;
  }

  // hdot = 0 on the held rows, likewise; with `beginning` also across the normals of points that
  // begin to slide.
  template <class F>
  void bring_to_rest(F& f, double* v_D, bool beginning = false) {
    const double none[array_size(R)] = {};
    double w[array_size(N)] = {}, move[array_size(N)];
    rows.list_unknowns(points, f, true, false, beginning);
    rows.directed.solve(rows.G, rows.n, rows.hdot, none, rows.y);
    rows.take(rows.y, w);
    f.eval.solve_factor(w, move);
    for (int k = 0; k < N; ++k) v_D[k] += move[k];
  }

  // Seeks other forces with the same motion if those of redundant points are not admissible, so
  // that a mode ends only if no forces keep it. The latest evaluation must be f's.
  template <class F>
  void redistribute(F& f) {
    redistributed = ends = false;
    bool needed = false;
    for (int c = 0; c < points.n; ++c) {
      const bool is_held = points.at[c].mode == STICKING || points.at[c].mode == SLIDING;
      needed = needed || (is_held && points.exists[c] && breaks(f, c));
    }
    for (int a = 0; a < rows.n_single; ++a) {
      const int r = f.rows.row[a];
      needed = needed || (f.row_state[r] == HELD && !f.rows.two_sided[a] &&
                          (rows.y[a] < 0.0 || rows.y[a] > f.winches.largest(r)));
    }
    if (!needed) return;
    double known[array_size(R)], free_hddot[array_size(R)];
    find_slipping(f, known, free_hddot);
    int of[array_size(R)], n_own = 0, n_points = 0;
    bool slides[array_size(C)];
    double along[2 * array_size(C)];
    for (int a = 0; a < rows.n_single; ++a)
      if (f.row_state[f.rows.row[a]] == HELD) of[n_own++] = a;
    const int n_rows = n_own;
    for (int c = 0; c < points.n; ++c) {
      if (points.at[c].mode != STICKING && points.at[c].mode != SLIDING) continue;
      slides[n_points] = points.at[c].mode == SLIDING;
      along[2 * n_points] = rows.direction[c][0];
      along[2 * n_points + 1] = rows.direction[c][1];
      cone.mu[n_points++] = points.in->friction[points.at[c].pair];
      for (int d = 0; d < 3; ++d) of[n_own++] = rows.n_single + 3 * c + d;
    }
    cone.resize(n_rows, n_points);
    cone.slides = slides;
    cone.along = along;
    for (int i = 0; i < n_own; ++i) {
      for (int j = 0; j < n_own; ++j) cone.G[i * cone.stride + j] = rows.G[of[i] * rows.n + of[j]];
      cone.b[i] = free_hddot[of[i]];
      cone.x[i] = rows.y[of[i]];
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
      const int own = of[i] - rows.n_single;
      if (own < 0) (ends ? lawful_tension_ : f.tension)[f.rows.row[of[i]]] = cone.x[i];
      else (ends ? points.lawful : points.x)[own] = cone.x[i];
      if (own >= 0) points.after_lawful[own] = -cone.s[i];
    }
    redistributed = !ends;
  }

  // Tensions of the strings whose winches slip, `known`, and hddot with these alone, `hddot`.
  template <class F>
  void find_slipping(const F& f, double* known, double* hddot) const {
    for (int i = 0; i < rows.n; ++i) {
      known[i] = 0.0;
      hddot[i] = rows.hddot[i];
    }
    for (int a = 0; a < rows.n_single; ++a) {
      const int r = f.rows.row[a];
      if (f.row_state[r] != SLIPPING && f.row_state[r] != PINNED) continue;
      known[a] = f.winches.largest(r);
      for (int i = 0; i < rows.n; ++i) hddot[i] -= rows.G[i * rows.n + a] * known[a];
    }
  }

  void remember(Snapshot& memory) {
    memory.keep(points.n, points.at, points.tension, points.too_many);
  }

 private:
  double lawful_tension_[array_size(M)], after_[array_size(R)];
};

}  // namespace fan
