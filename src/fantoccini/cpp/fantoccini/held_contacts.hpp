// Contacts of an event-driven run. Between two events every point that touches keeps its mode:
//
//   sticking: u = 0;   sliding: u_n = 0, x_T = mu x_n d with d against u_T;   resting: x = 0
//
// so that the forces x follow from linear equations over the held strings and points,
//
//   hddot - G x = 0 along the directions that are held,   G = W^T W,   W = F^-T A_D^T,
//
// in the signs of contact_points.hpp (hdot = -u). Redundant points are held as well: of all x the
// one nearest to the forces at the last event is taken, which are those of least norm where these
// are legal.
//
// gamma, the part of hddot without accelerations, is the derivative of the points' velocities
// along the motion with velocities frozen, by central differences of order 4 over the narrow phase.
#pragma once

#include "cone.hpp"
#include "contact_points.hpp"
#include "contact_push.hpp"
#include "correct.hpp"
#include "snapshot.hpp"

namespace fan {

enum ContactMode { PARTED, RESTING, STICKING, SLIDING };

struct HeldContactTolerances {
  // Part of a turn, or of a solid's size, over which differences are taken: errors of 1e-13.
  static constexpr double turn = 1e-3;
  static constexpr double slowest = 1.0;  // 1/s: rates below count as this
  // Gap within which points are looked at [m].
  static constexpr double margin = 1e-3;
  // m: overlap above which a point that has just parted touches again, and distance at which one
  // without force no longer rests.
  static constexpr double caught = 1e-13, strayed = 1e-11;
  // m: rounding of a gap.
  static constexpr double rounding = 1e-15;
  // m: gap above which a parted point is an open one.
  static constexpr double open_gap = 1e-14;
  // m/s: a parted point that opens faster is open soon.
  static constexpr double leaving_speed = 1e-8;
  // m/s: a point slides no longer where u falls to this along its direction.
  static constexpr double stopped = 1e-10;
  // Least normal influence of a sliding point's force, relative to that without friction: below,
  // friction jams (Painleve).
  static constexpr double least_influence = 1e-6;
  // Raise of the diagonal, relative to it, and refinements that take its effect away again.
  static constexpr double raise = 1e-8;
  static constexpr int refinements = 4;
  // |hddot| of a resting point, relative to Flow::hddot_scale; a force that is none, to the weight.
  static constexpr double parting_acceleration = 1e-8, negligible_force = 1e-12;
};

template <class Model>
class HeldContacts {
 public:
  static constexpr int C = Model::n_contacts, N = Model::n_vD, M = Model::n_rows;
  static constexpr int R = M + 3 * C;  // rows: strings and limits, then three of every point
  static constexpr int NQ = Model::n_qD, NQK = Model::n_qK, NK = Model::n_vK;
  using Tolerance = HeldContactTolerances;
  using Points = ContactPoints<Model, double>;

  struct Contact {
    int pair, feature;
    ContactMode mode;
    bool moving;       // slides faster than Tolerance::stopped
    bool told;         // its sliding is among the events
    bool fresh;        // touches since this instant
    bool leaves;       // springs back from it
    double along[3];   // of friction on the first solid where it slides, in the world
    double force[3];   // at the last event, in the world
    double over;       // m: overlap that a parted point has from the start
    double back;       // m/s: how fast one that begins to slide still goes the other way
    double since;      // s: when it began to slide
  };

  const ContactArrays* in = nullptr;
  int n = 0;
  Contact at[room(C)];
  bool too_many = false;

  // Of the latest evaluation.
  double gap[room(C)];
  double hdot[room(3 * C)], x[room(3 * C)], after[room(3 * C)];  // after: hddot with all forces
  double overlap = -unbounded, closing = 0.0;  // of the point that is deepest, and how fast
  double safe = unbounded;                     // s: until solids might pass through one another
  double friction = 0.0;                       // W

  ConeProblem<R> cone;  // for whoever chooses forces or impulses
  bool redistributed = false;  // whether redundant forces were found anew at the latest evaluation

  bool active() const { return in && n > 0; }

  bool holds() const {
    for (int c = 0; c < n; ++c)
      if (at[c].mode == STICKING || at[c].mode == SLIDING) return true;
    return false;
  }

  // Evaluates all points near at a state; f's evaluation, but for accelerations, must be that of it.
  template <class F>
  void look(const F& f, const double* q_D, const double* v_D) {
    points_.pose(*in, q_D, v_D, f.q_K, f.v_K, f.p);
    points_.look_within(*in, Tolerance::margin);
    too_many = points_.too_many[0];
    safe = points_.safe_time(*in);
    overlap = -Tolerance::margin;
    closing = 0.0;
    for (int c = 0; c < n; ++c) found_[c] = false;
    for (int i = 0; i < points_.n[0]; ++i) {
      const auto& from = points_.point[0][i];
      const int c = place(from.pair, from.feature);
      double over = -from.gap;
      if (c >= 0) {
        found_[c] = true;
        gap[c] = from.gap;
        for (int d = 0; d < 3; ++d) point_[c][d] = from.at[d];
        for (int d = 0; d < 9; ++d) frame_[c][d] = from.frame[d];
        points_.make_rows(*in, i);
        for (int d = 0; d < 3; ++d) {
          for (int k = 0; k < N; ++k) row_[3 * c + d][k] = points_.row[3 * i + d][k];
          rate_K_[3 * c + d] = points_.rate_K[3 * i + d];
          double sum = rate_K_[3 * c + d];
          for (int k = 0; k < N; ++k) sum += row_[3 * c + d][k] * v_D[k];
          hdot[3 * c + d] = sum;
        }
        if (at[c].mode != PARTED) continue;
        over -= at[c].over + (at[c].leaves ? Tolerance::rounding : Tolerance::caught);
      }
      if (over > overlap) {
        overlap = over;
        double u[3];
        points_.velocity(*in, i, u);
        closing = -dot3(u, from.frame);
      }
    }
  }

  // The forces with the modes frozen. Adds -W x to w and the power of driven solids to `power`;
  // tension gets those of f.rows, which must be gathered.
  template <class F>
  void push(const F& f, const double* q_D, const double* v_D, double* w, double* tension, double* power) {
    differ(f, q_D, v_D);
    assemble(f);
    double reference[room(R)] = {};
    for (int a = 0; a < n_single_; ++a) reference[a] = tension_[f.rows.row[a]];
    for (int c = 0; c < n; ++c)
      for (int d = 0; d < 3; ++d) reference[n_single_ + 3 * c + d] = dot3(frame_[c] + 3 * d, at[c].force);
    list_unknowns(f, true, true);
    solve(hddot_, reference, y_);
    friction = 0.0;
    for (int a = 0; a < n_single_; ++a) {
      tension[f.rows.row[a]] = y_[a];
      *power += y_[a] * f.rows.hdot_K[a];
    }
    for (int i = 0; i < 3 * n; ++i) {
      x[i] = y_[n_single_ + i];
      *power += x[i] * rate_K_[i];
      if (i % 3) friction += x[i] * hdot[i];
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
    const double forces = excess(f, c);
    if (own.mode == STICKING || in->friction[own.pair] == 0.0) return forces;
    const double speed = along(c);
    const double stops = own.moving ? Tolerance::stopped - speed : -speed - own.back - Tolerance::stopped;
    const double jams = Tolerance::least_influence - influence(c);
    const double worst = forces > stops ? forces : stops;
    return worst > jams ? worst : jams;
  }

  // By how much point c's force is illegal, relative to the weight.
  template <class F>
  double excess(const F& f, int c) const {
    const double* own = x + 3 * c;
    const double lifts = -own[0] / f.weight() - Tolerance::negligible_force;
    if (at[c].mode != STICKING) return lifts;
    const double size = sqrt(own[1] * own[1] + own[2] * own[2]);
    const double slips =
        (size - in->friction[at[c].pair] * own[0]) / f.weight() - Tolerance::negligible_force;
    return lifts > slips ? lifts : slips;
  }

  template <class F>
  bool breaks(const F& f, int c) const {
    return excess(f, c) > 0.0;
  }

  // The normal influence of sliding point c's force, relative to that without friction.
  double influence(int c) const {
    const int i = n_single_ + 3 * c;
    const double* d = direction_[c];
    const double mu = in->friction[at[c].pair];
    return 1.0 + mu * (G_[i * n_ + i + 1] * d[0] + G_[i * n_ + i + 2] * d[1]) / G_[i * n_ + i];
  }

  // What parted points become once they are open, and the directions that sliding ones keep over
  // zero in the next step. The latest evaluation must be that of the present state.
  void anchor() {
    int kept = 0;
    for (int c = 0; c < n; ++c) {
      if (at[c].mode == PARTED && (!found_[c] || gap[c] > Tolerance::open_gap)) continue;
      if (at[c].mode == SLIDING && found_[c] && along(c) > 2.0 * Tolerance::stopped) {
        at[c].moving = true;
        direction(c, at[c].along);
      }
      at[c].fresh = false;
      copy(c, kept++);
    }
    n = kept;
  }

  // Adds all points with a gap of at most `most` at the latest evaluation, as parted ones.
  template <class F>
  void take_closed(const F& f, const double* q_D, const double* v_D, double most) {
    bool more = false;
    for (int i = 0; i < points_.n[0] && n < C; ++i) {
      const auto& from = points_.point[0][i];
      if (from.gap > most || place(from.pair, from.feature) >= 0) continue;
      bool told = false;
      for (int c = 0; c < n; ++c) told = told || (meet(at[c].pair, from.pair) && at[c].told);
      at[n++] = {from.pair, from.feature, PARTED, false, told, true, false, {0.0, 0.0, 0.0},
                 {0.0, 0.0, 0.0}, from.gap < 0.0 ? -from.gap : 0.0, 0.0, f.t};
      more = true;
    }
    if (more) {
      sort();
      look(f, q_D, v_D);
    }
  }

  // Points without force may keep the distance that they have after an event.
  void accept_overlaps() {
    for (int c = 0; c < n; ++c) {
      at[c].over = at[c].mode == RESTING ? fabs(gap[c]) : fmax(-gap[c], 0.0);
      at[c].back = at[c].mode == SLIDING ? fmax(-along(c), 0.0) : 0.0;
      at[c].leaves = hdot[3 * c] < -Tolerance::leaving_speed;
    }
  }

  // Looks for other forces with the same motion where those of redundant points are not legal; so
  // that a mode ends only where no forces keep it. The latest evaluation must be f's.
  template <class F>
  void redistribute(F& f) {
    redistributed = false;
    bool needed = false;
    for (int c = 0; c < n; ++c)
      needed = needed || ((at[c].mode == STICKING || at[c].mode == SLIDING) && found_[c] && breaks(f, c));
    for (int a = 0; a < n_single_; ++a) {
      const int r = f.rows.row[a];
      needed = needed || (f.row_state[r] == HELD && !f.rows.two_sided[a] && y_[a] < 0.0);
    }
    if (!needed) return;
    int of[room(R)], n_own = 0, n_points = 0;
    bool slides[room(C)];
    double along[2 * room(C)];
    for (int a = 0; a < n_single_; ++a)
      if (f.row_state[f.rows.row[a]] == HELD) of[n_own++] = a;
    cone.n_single = n_own;
    for (int c = 0; c < n; ++c) {
      if (at[c].mode != STICKING && at[c].mode != SLIDING) continue;
      slides[n_points] = at[c].mode == SLIDING;
      along[2 * n_points] = direction_[c][0];
      along[2 * n_points + 1] = direction_[c][1];
      cone.mu[n_points++] = in->friction[at[c].pair];
      for (int d = 0; d < 3; ++d) of[n_own++] = n_single_ + 3 * c + d;
    }
    cone.n_contacts = n_points;
    cone.slides = slides;
    cone.along = along;
    for (int i = 0; i < n_own; ++i) {
      for (int j = 0; j < n_own; ++j) cone.G[i * n_own + j] = G_[of[i] * n_ + of[j]];
      cone.b[i] = hddot_[of[i]];
      cone.x[i] = y_[of[i]];
      cone.lower[i] = i < cone.n_single && f.rows.two_sided[of[i]] ? -unbounded : 0.0;
      cone.upper[i] = unbounded;
    }
    const bool solved = cone.solve();
    cone.slides = nullptr;
    if (!solved) return;
    const double most = Tolerance::parting_acceleration * f.hddot_scale();
    for (int i = 0; i < n_own; ++i) {
      const bool tangent = i >= cone.n_single && (i - cone.n_single) % 3 > 0;
      if (tangent && slides[(i - cone.n_single) / 3]) continue;
      if (fabs(cone.s[i]) > most) return;
    }
    for (int i = 0; i < n_own; ++i) {
      if (i < cone.n_single) f.tension[f.rows.row[of[i]]] = cone.x[i];
      else x[of[i] - n_single_] = cone.x[i];
    }
    redistributed = true;
  }

  // Whether two pairs are of the same two solids.
  bool meet(int pair, int other) const { return pair == other; }

  bool is_found(int c) const { return found_[c]; }

  // The velocity along point c's friction, positive where it slides on.
  double along(int c) const {
    double sum = 0.0;
    for (int d = 1; d < 3; ++d) sum += hdot[3 * c + d] * dot3(frame_[c] + 3 * d, at[c].along);
    return sum;
  }

  double sliding_speed(int c) const {
    return sqrt(hdot[3 * c + 1] * hdot[3 * c + 1] + hdot[3 * c + 2] * hdot[3 * c + 2]);
  }

  // The direction of hdot_T at point c, in the world.
  void direction(int c, double* out) const {
    const double size = sliding_speed(c);
    for (int k = 0; k < 3; ++k)
      out[k] = (hdot[3 * c + 1] * frame_[c][3 + k] + hdot[3 * c + 2] * frame_[c][6 + k]) / size;
  }

  // A force in point c's frame, in the world.
  void in_world(int c, const double* force, double* out) const {
    for (int k = 0; k < 3; ++k)
      out[k] = force[0] * frame_[c][k] + force[1] * frame_[c][3 + k] + force[2] * frame_[c][6 + k];
  }

  // Remembers the latest forces as those of an event.
  template <class F>
  void keep_forces(const F& f) {
    for (int c = 0; c < n; ++c) in_world(c, x + 3 * c, at[c].force);
    for (int r = 0; r < M; ++r) tension_[r] = f.tension[r];
  }

  void forget_forces() {
    for (int c = 0; c < n; ++c)
      for (int k = 0; k < 3; ++k) at[c].force[k] = 0.0;
    for (int r = 0; r < M; ++r) tension_[r] = 0.0;
  }

  // Forces of points and rows, as keep_forces leaves them.
  struct Forces {
    double point[room(C)][3], row[room(M)];
  };

  Forces forces() const {
    Forces out;
    for (int c = 0; c < n; ++c)
      for (int k = 0; k < 3; ++k) out.point[c][k] = at[c].force[k];
    for (int r = 0; r < M; ++r) out.row[r] = tension_[r];
    return out;
  }

  void set_forces(const Forces& from) {
    for (int c = 0; c < n; ++c)
      for (int k = 0; k < 3; ++k) at[c].force[k] = from.point[c][k];
    for (int r = 0; r < M; ++r) tension_[r] = from.row[r];
  }

  // Whether point c has just lost its force, or parted, at the latest evaluation.
  template <class F>
  bool is_loose(const F& f, int c) const {
    if (at[c].mode == PARTED) return !at[c].fresh;
    return (at[c].mode == STICKING || at[c].mode == SLIDING) && x[3 * c] / f.weight() <= Tolerance::negligible_force;
  }

  // Whether sticking point c has just reached its cone.
  template <class F>
  bool is_strained(const F& f, int c) const {
    const double* own = x + 3 * c;
    const double size = sqrt(own[1] * own[1] + own[2] * own[2]);
    return at[c].mode == STICKING &&
           size - in->friction[at[c].pair] * own[0] >= -Tolerance::negligible_force * f.weight();
  }

  // |hdot| of the fastest normal of points that are held.
  double fastest_normal() const {
    double most = 0.0;
    for (int c = 0; c < n; ++c)
      if (at[c].mode == STICKING || at[c].mode == SLIDING) most = fmax(most, fabs(hdot[3 * c]));
    return most;
  }

  void set_reference(int row, double tension) { tension_[row] = tension; }

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
      in_world(c, x + 3 * c, to.impulse);
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
      for (int u = 0; u < m_; ++u) {
        const int i = unknown_[u].row;
        const double off = fabs(h[i]) / (i < single ? f.row_scale(f.rows.row[i]) : 1.0);
        if (!(off <= worst) && worst == worst) worst = off;
      }
      return worst;
    };
    const double none[room(R)] = {};
    const Status status = correct<NQ>(state, left, [&] {
      double w[room(N)] = {}, move[room(N)], all[room(M)];
      solve(h, none, y_);
      take(y_, w);
      f.eval.back(w, move);
      retract<typename Model::Dynamic>(state, move, state);
      f.heights(state, all);
      for (int a = 0; a < single; ++a) h[a] = all[f.rows.row[a]];
      measure_gaps(f, state, h + single);
      return RUNNING;
    });
    if (status != RUNNING) return status;
    f.evaluate(t, state, rate);
    bring_to_rest(f, state + NQ);
    return RUNNING;
  }

  // hdot = 0 on the held rows, likewise.
  template <class F>
  void bring_to_rest(F& f, double* v_D) {
    const double none[room(R)] = {};
    double w[room(N)] = {}, move[room(N)];
    list_unknowns(f, true, false);
    solve(hdot_, none, y_);
    take(y_, w);
    f.eval.back(w, move);
    for (int k = 0; k < N; ++k) v_D[k] += move[k];
  }

  // Rows of the whole problem: those that f has gathered, then three of every point.
  template <class F>
  void assemble(const F& f) {
    n_single_ = f.rows.n;
    n_ = n_single_ + 3 * n;
    constexpr int stride = Complementarity<double, M>::N;
    for (int a = 0; a < n_single_; ++a) {
      column_[a] = f.rows.column[a];
      hdot_[a] = f.rows.hdot[a];
      hddot_[a] = f.rows.hddot[a];
      for (int b = 0; b < n_single_; ++b) G_[a * n_ + b] = f.rows.problem.G[a * stride + b];
    }
    for (int i = 0; i < 3 * n; ++i) {
      const int own = n_single_ + i;
      Call<Model, double>::forth(f.eval.L, row_[i], W_[i]);
      column_[own] = W_[i];
      hdot_[own] = hdot[i];
      double free_rate = 0.0;
      for (int k = 0; k < N; ++k) free_rate += W_[i][k] * f.eval.w0[k];
      hddot_[own] = gamma_[i] + free_rate;
      for (int b = 0; b <= own; ++b) {
        double sum = 0.0;
        for (int k = 0; k < N; ++k) sum += W_[i][k] * column_[b][k];
        G_[own * n_ + b] = G_[b * n_ + own] = sum;
      }
    }
  }

  // Of the assembled rows.
  int size() const { return n_; }
  int first_of(int c) const { return n_single_ + 3 * c; }
  const double* influences() const { return G_; }
  double hdot_of(int i) const { return hdot_[i]; }
  double hddot_of(int i) const { return hddot_[i]; }
  double driven_rate(int i) const { return rate_K_[i - n_single_]; }
  const double* frame(int c) const { return frame_[c]; }

  // w <- w - W y over all assembled rows.
  void take(const double* y, double* w) const {
    for (int i = 0; i < n_; ++i) {
      if (y[i] == 0.0) continue;
      for (int k = 0; k < N; ++k) w[k] -= column_[i][k] * y[i];
    }
  }

  // gamma: derivatives of hdot along the motion without accelerations of the puppet, where
  // the driven coordinates have theirs.
  template <class F>
  void differ(const F& f, const double* q_D, const double* v_D) {
    double rate = Tolerance::slowest;
    for (int c = 0; c < n; ++c) rate = fmax(rate, points_.rate_of_turning(*in, at[c].pair, speed(c)));
    const double step = Tolerance::turn / rate;
    constexpr int ways[] = {-2, -1, 1, 2};
    constexpr double weights[] = {1.0, -8.0, 8.0, -1.0};
    double u[4][room(C)][3], normal_rate[4][room(C)];
    bool all[room(C)];
    for (int c = 0; c < n; ++c) all[c] = true;
    for (int k = 0; k < 4; ++k) {
      const double tau = ways[k] * step;
      double there[room(NQ)], there_K[room(NQK)], move[room(N)], move_K[room(NK)], v_K[room(NK)];
      for (int j = 0; j < N; ++j) move[j] = tau * v_D[j];
      for (int j = 0; j < NK; ++j) {
        move_K[j] = tau * f.v_K[j];
        v_K[j] = f.v_K[j] + tau * f.acc_K[j];
      }
      retract<typename Model::Dynamic>(q_D, move, there);
      retract<typename Model::Driven>(f.q_K, move_K, there_K);
      near_.pose(*in, there, v_D, there_K, v_K, f.p);
      for (int c = 0, pair = -1; c < n; ++c) {
        if (at[c].pair != pair) {
          pair = at[c].pair;
          near_.look_at_pair(*in, pair, 2.0 * Tolerance::margin + 2.0 * fabs(tau) * speed(c));
        }
        int i = 0;
        while (i < near_.n[0] && near_.point[0][i].feature != at[c].feature) ++i;
        if (i == near_.n[0]) {
          all[c] = false;
          continue;
        }
        near_.velocity(*in, i, u[k][c]);
        normal_rate[k][c] = dot3(u[k][c], near_.point[0][i].frame);
      }
    }
    for (int c = 0; c < n; ++c)
      for (int d = 0; d < 3; ++d) {
        double sum = 0.0;
        for (int k = 0; k < 4 && all[c]; ++k)
          sum += weights[k] * (d ? dot3(u[k][c], frame_[c] + 3 * d) : normal_rate[k][c]);
        gamma_[3 * c + d] = -sum / (12.0 * step);
      }
  }

  void remember(Snapshot& memory) { memory.keep(n, at, tension_, too_many); }

 private:
  // A direction in which forces act, over the rows from `row` on.
  struct Unknown {
    int row, width;
    double part[3];
  };

  int place(int pair, int feature) const {
    for (int c = 0; c < n; ++c)
      if (at[c].pair == pair && at[c].feature == feature) return c;
    return -1;
  }

  void sort() {
    for (int c = 1; c < n; ++c)
      for (int b = c; b > 0 && (at[b].pair < at[b - 1].pair ||
                                (at[b].pair == at[b - 1].pair && at[b].feature < at[b - 1].feature));
           --b) {
        const Contact held = at[b];
        at[b] = at[b - 1];
        at[b - 1] = held;
      }
  }

  // Point c's entries of the latest evaluation to those of an earlier one.
  void copy(int c, int to) {
    if (c == to) return;
    at[to] = at[c];
    found_[to] = found_[c];
    gap[to] = gap[c];
    for (int k = 0; k < 3; ++k) point_[to][k] = point_[c][k];
    for (int k = 0; k < 9; ++k) frame_[to][k] = frame_[c][k];
    for (int d = 0; d < 3; ++d) {
      hdot[3 * to + d] = hdot[3 * c + d];
      x[3 * to + d] = x[3 * c + d];
      after[3 * to + d] = after[3 * c + d];
      rate_K_[3 * to + d] = rate_K_[3 * c + d];
      for (int k = 0; k < N; ++k) row_[3 * to + d][k] = row_[3 * c + d][k];
    }
  }

  double speed(int c) const {
    return fabs(hdot[3 * c]) + fabs(hdot[3 * c + 1]) + fabs(hdot[3 * c + 2]);
  }

  // The gaps of the points at a configuration, negated, at out[3 c]; 0 for those that are lost.
  template <class F>
  void measure_gaps(const F& f, const double* q_D, double* out) {
    const double v_D[room(N)] = {}, v_K[room(NK)] = {};
    near_.pose(*in, q_D, v_D, f.q_K, v_K, f.p);
    for (int c = 0, pair = -1; c < n; ++c) {
      if (at[c].pair != pair) near_.look_at_pair(*in, pair = at[c].pair, Tolerance::margin);
      out[3 * c] = 0.0;
      for (int i = 0; i < near_.n[0]; ++i)
        if (near_.point[0][i].feature == at[c].feature) out[3 * c] = -near_.point[0][i].gap;
    }
  }

  // The directions that are held: of strings all that are taut; of points the normals and, if
  // `tangents`, those of sticking ones. With `friction` the forces of sliding ones have theirs.
  template <class F>
  void list_unknowns(const F& f, bool tangents, bool friction) {
    m_ = 0;
    for (int a = 0; a < n_single_; ++a)
      if (f.row_state[f.rows.row[a]] == HELD) unknown_[m_++] = {a, 1, {1.0, 0.0, 0.0}};
    for (int c = 0; c < n; ++c) {
      const int i = n_single_ + 3 * c;
      const ContactMode mode = at[c].mode;
      if (mode == SLIDING && friction) find_direction(c);
      if (mode == SLIDING || mode == STICKING) {
        const double mu = mode == SLIDING && friction ? in->friction[at[c].pair] : 0.0;
        unknown_[m_++] = {i, 3, {1.0, mu * direction_[c][0], mu * direction_[c][1]}};
      }
      if (mode != STICKING || !tangents) continue;
      unknown_[m_++] = {i, 3, {0.0, 1.0, 0.0}};
      unknown_[m_++] = {i, 3, {0.0, 0.0, 1.0}};
    }
  }

  // The direction of friction at sliding point c in its tangents: that of hdot_T, or the one kept
  // where it is at rest or turns back.
  void find_direction(int c) {
    double* d = direction_[c];
    const bool own = at[c].moving && along(c) > Tolerance::stopped;
    for (int k = 0; k < 2; ++k)
      d[k] = own ? hdot[3 * c + 1 + k] : dot3(frame_[c] + 3 * (k + 1), at[c].along);
    const double size = sqrt(d[0] * d[0] + d[1] * d[1]);
    for (int k = 0; k < 2; ++k) d[k] = size > 0.0 ? d[k] / size : 0.0;
  }

  // y over all rows, along the unknowns, with (right - G y) = 0 in the first rows of their
  // directions; the nearest to the reference.
  void solve(const double* right, const double* reference, double* y) {
    double z[room(R)], scale[room(R)], left[room(R)], start[room(R)];
    for (int i = 0; i < n_; ++i) y[i] = 0.0;
    for (int u = 0; u < m_; ++u) {
      const Unknown& own = unknown_[u];
      const int lead = own.row + leading(own);
      scale[u] = 1.0 / sqrt(fmax(G_[lead * n_ + lead], negligible));
      start[u] = reference[lead];
      for (int k = 0; k < own.width; ++k) y[own.row + k] += own.part[k] * start[u];
    }
    for (int u = 0; u < m_; ++u) {
      const int i = unknown_[u].row + leading(unknown_[u]);
      double sum = right[i];
      for (int j = 0; j < n_; ++j) sum -= G_[i * n_ + j] * y[j];
      left[u] = scale[u] * sum;
      for (int v = 0; v < m_; ++v) {
        const Unknown& other = unknown_[v];
        double image = 0.0;
        for (int k = 0; k < other.width; ++k) image += G_[i * n_ + other.row + k] * other.part[k];
        K_[u * m_ + v] = lu_.A[u * m_ + v] = scale[u] * image * scale[v];
      }
      lu_.A[u * m_ + u] += Tolerance::raise;
      z[u] = 0.0;
    }
    lu_.n = m_;
    if (m_ == 0 || !lu_.factorise()) return;
    for (int round = 0; round <= Tolerance::refinements; ++round) {
      double change[room(R)];
      for (int u = 0; u < m_; ++u) change[u] = left[u] - product(K_ + u * m_, z, m_);
      lu_.substitute(change);
      for (int u = 0; u < m_; ++u) z[u] += change[u];
    }
    for (int u = 0; u < m_; ++u) {
      const Unknown& own = unknown_[u];
      for (int k = 0; k < own.width; ++k) y[own.row + k] += own.part[k] * scale[u] * z[u];
    }
  }

  static int leading(const Unknown& u) { return u.part[0] != 0.0 ? 0 : u.part[1] != 0.0 ? 1 : 2; }

  Points points_, near_;  // of the latest evaluation; at displaced configurations
  bool found_[room(C)];
  double point_[room(C)][3], frame_[room(C)][9], direction_[room(C)][2] = {};
  double row_[room(3 * C)][room(N)], rate_K_[room(3 * C)], gamma_[room(3 * C)];
  double tension_[room(M)] = {};  // at the last event
  int n_single_ = 0, n_ = 0, m_ = 0;
  const double* column_[room(R)];
  double W_[room(3 * C)][room(N)], G_[room(R * R)], K_[room(R * R)];
  double hdot_[room(R)], hddot_[room(R)], y_[room(R)], after_[room(R)];
  Unknown unknown_[room(R)];
  DenseLu<R> lu_;
};

}  // namespace fan
