// All rows held at an instant of an event-driven run, strings and limits before three of every
// point, and the forces along them,
//
//   hddot - G y = 0 along the held directions,   G = W^T W,   W = F^-T A_D^T
//
// Friction of a sliding point has the direction of hdot_T, which turns at the rate mu x_n G /
// |hdot_T|, without bound as the point slows down. For a slow point it has the direction d that
// hdot_T will have a time tau later,
//
//   d || hdot_T + tau hddot_T(d),   u = |hdot_T|
//   1/tau = (1 + (u/speed)^2) u/ahead + 2 brake/u + least
//
// so that steps need not resolve the turning. The point moves at most `ahead` in that time. The
// directions of all slow points follow, with the forces, from Newton's method on their angles.
#pragma once

#include "fantoccini/event/followed_points.hpp"
#include "fantoccini/solvers/directed_rows.hpp"

namespace fan {

struct SlowSlidingTolerances {
  // m: travel of a slow point in tau; m/s: speed above which it is smaller.
  static constexpr double ahead = 1e-11, speed = 1e-5;
  // 1/s: lower bound of 1/tau.
  static constexpr double least = 1e4;
  // A point is slow if its friction would turn faster than 1/tau by this factor.
  static constexpr double faster = 2.0;
  // Largest turn of friction when a point becomes slow [rad].
  static constexpr double small_turn = 1e-3;
  // Negligible part of a point's own influence; turn below which the iteration has converged [rad];
  // largest number of iterations.
  static constexpr double negligible_influence = 1e-4, turned = 1e-8;
  static constexpr int turns = 10;
};

template <class Model>
class HeldRows {
 public:
  using Points = FollowedPoints<Model>;
  static constexpr int C = Points::C, N = Points::N, M = Points::M;
  static constexpr int R = M + 3 * C;  // strings and limits, then three of every point
  using Tolerance = HeldContactTolerances;
  using Slow = SlowSlidingTolerances;

  double direction[array_size(C)][2] = {};  // of friction, in the tangents
  int n_single = 0, n = 0;                  // strings and limits; all rows
  const double* column[array_size(R)];      // of W
  double G[array_size(R * R)], hdot[array_size(R)], hddot[array_size(R)];
  double y[array_size(R)];  // forces
  DirectedRows<R> directed;

  // Gathers the rows of f, then three of every point.
  template <class F>
  void assemble(const Points& points, const F& f) {
    n_single = f.rows.n;
    n = n_single + 3 * points.n;
    constexpr int stride = Complementarity<double, M>::N;
    for (int a = 0; a < n_single; ++a) {
      column[a] = f.rows.column[a];
      hdot[a] = f.rows.hdot[a];
      hddot[a] = f.rows.hddot[a];
      for (int b = 0; b < n_single; ++b) G[a * n + b] = f.rows.problem.G[a * stride + b];
    }
    for (int i = 0; i < 3 * points.n; ++i) {
      const int own = n_single + i;
      Call<Model, double>::solve_factor_transposed(f.eval.L, points.row[i], W_[i]);
      column[own] = W_[i];
      hdot[own] = points.hdot[i];
      double free_rate = 0.0;
      for (int k = 0; k < N; ++k) free_rate += W_[i][k] * f.eval.w0[k];
      hddot[own] = points.gamma[i] + free_rate;
      for (int b = 0; b <= own; ++b) {
        double sum = 0.0;
        for (int k = 0; k < N; ++k) sum += W_[i][k] * column[b][k];
        G[own * n + b] = G[b * n + own] = sum;
      }
    }
  }

  // The first row of point c.
  int first_of(int c) const { return n_single + 3 * c; }

  // w <- w - W y over all assembled rows.
  void take(const double* y, double* w) const {
    for (int i = 0; i < n; ++i) {
      if (y[i] == 0.0) continue;
      for (int k = 0; k < N; ++k) w[k] -= column[i][k] * y[i];
    }
  }

  // The normal influence of sliding point c's force, relative to that without friction.
  double influence(const Points& points, int c) const {
    const int i = first_of(c);
    const double* d = direction[c];
    const double mu = points.in->friction[points.at[c].pair];
    return 1.0 + mu * (G[i * n + i + 1] * d[0] + G[i * n + i + 2] * d[1]) / G[i * n + i];
  }

  // Chooses the slow points from the latest forces, until the next call. Returns whether any is or
  // was slow. A point becomes slow only if its friction hardly turns thereby.
  bool choose_slow(Points& points) {
    bool any = false;
    for (int c = 0; c < points.n; ++c) {
      auto& own = points.at[c];
      const bool ahead = looks_ahead(points, c);
      any = any || own.slow;
      own.slow = false;
      const double speed = points.sliding_speed(c), mu = points.in->friction[own.pair];
      if (own.mode != SLIDING || !points.exists[c] || mu == 0.0 || !(speed > Tolerance::stopped))
        continue;
      const double *d = direction[c], *A = points.after + 3 * c + 1;
      const double onward = d[0] * A[0] + d[1] * A[1], across = d[0] * A[1] - d[1] * A[0];
      own.brake = fmax(-onward, 0.0);
      const double rate = rate_ahead(points, c);
      const bool stiff =
          mu * points.x[3 * c] * own_influence(c, -d[1], d[0]) > Slow::faster * speed * rate;
      own.slow = stiff && (ahead || fabs(across) < Slow::small_turn * (speed * rate + onward));
      any = any || own.slow;
    }
    return any;
  }

  // The held directions: of strings all that are taut; of points the normals and, with `tangents`,
  // those of sticking ones, with `beginning` also of those that begin to slide. With `friction` the
  // forces of sliding points include their friction.
  template <class F>
  void list_unknowns(
      const Points& points, const F& f, bool tangents, bool friction, bool beginning = false) {
    directed.n = 0;
    for (int a = 0; a < n_single; ++a)
      if (f.row_state[f.rows.row[a]] == HELD) directed.add(a, 1, 1.0, 0.0, 0.0);
    for (int c = 0; c < points.n; ++c) {
      const int i = first_of(c);
      const ContactMode mode = points.at[c].mode;
      if (mode == SLIDING || mode == STICKING) {
        const double mu =
            mode == SLIDING && friction ? points.in->friction[points.at[c].pair] : 0.0;
        directed.add(i, 3, 1.0, mu * direction[c][0], mu * direction[c][1]);
      }
      const bool stands =
          mode == STICKING || (beginning && mode == SLIDING && !points.at[c].moving);
      if (!stands || !tangents) continue;
      directed.add(i, 3, 0.0, 1.0, 0.0);
      directed.add(i, 3, 0.0, 0.0, 1.0);
    }
  }

  // The forces y with the modes frozen, nearest to `reference`; `free_hddot` is hddot without them.
  template <class F>
  void find_forces(
      const Points& points, const F& f, const double* free_hddot, const double* reference) {
    bool turns = false;
    for (int c = 0; c < points.n; ++c) {
      if (points.at[c].mode != SLIDING) continue;
      const bool ahead = looks_ahead(points, c);
      turns = turns || ahead;
      find_direction(points, c, !ahead && points.along(c) > Tolerance::stopped);
    }
    list_unknowns(points, f, true, true);
    directed.solve(G, n, free_hddot, reference, y);
    if (!turns) return;
    Turn turn = CONTINUE;
    for (int k = 0; turn == CONTINUE && k < Slow::turns; ++k)
      turn = turn_slow(points, f, free_hddot, reference);
    if (turn == CONVERGED) return;
    // No such directions: those of the present velocities.
    for (int c = 0; c < points.n; ++c)
      if (points.at[c].mode == SLIDING)
        find_direction(points, c, points.along(c) > Tolerance::stopped);
    list_unknowns(points, f, true, true);
    directed.solve(G, n, free_hddot, reference, y);
  }

 private:
  enum Turn { CONVERGED, CONTINUE, FAILED };

  // Whether friction at point c has a later direction of hdot_T: it begins to slide, or is slow.
  bool looks_ahead(const Points& points, int c) const {
    if (points.at[c].mode != SLIDING || points.in->friction[points.at[c].pair] == 0.0) return false;
    return !points.at[c].moving || (points.at[c].slow && points.along(c) > Tolerance::stopped);
  }

  // 1/tau of point c.
  double rate_ahead(const Points& points, int c) const {
    const double speed = points.sliding_speed(c), fast = speed / Slow::speed;
    const double stops = points.at[c].moving ? 2.0 * points.at[c].brake / speed : 0.0;
    return (1.0 + fast * fast) * speed / Slow::ahead + stops + Slow::least;
  }

  // G of point c along a direction in its tangents.
  double own_influence(int c, double p, double q) const {
    const double* own = G + (first_of(c) + 1) * (n + 1);
    return p * (own[0] * p + 2.0 * own[1] * q) + q * own[n + 1] * q;
  }

  // The direction of friction at sliding point c: its `own`, that of hdot_T; or the one kept at
  // rest or while turning back, the start for that of a slow point.
  void find_direction(const Points& points, int c, bool own) {
    double* d = direction[c];
    for (int k = 0; k < 2; ++k)
      d[k] = own ? points.hdot[3 * c + 1 + k]
                 : dot3(points.frame[c] + 3 * (k + 1), points.at[c].along);
    make_unit(d);
  }

  static void make_unit(double* d) {
    const double size = sqrt(d[0] * d[0] + d[1] * d[1]);
    for (int k = 0; k < 2; ++k) d[k] = size > 0.0 ? d[k] / size : 0.0;
  }

  // One Newton step on the directions of slow points and all forces.
  template <class F>
  Turn turn_slow(
      const Points& points, const F& f, const double* free_hddot, const double* reference) {
    int slow[array_size(C)], n_slow = 0;
    double firm[array_size(C)], goal[array_size(C)];
    for (int c = 0; c < points.n; ++c) {
      if (!looks_ahead(points, c)) continue;
      const int i = first_of(c);
      const double *d = direction[c], rate = rate_ahead(points, c);
      const double push = points.in->friction[points.at[c].pair] * y[i];
      if (!(push > 0.0)) continue;  // it lifts
      double onward = 0.0;
      for (int k = 0; k < 2; ++k) {
        double then = points.hdot[3 * c + 1 + k] * rate + free_hddot[i + 1 + k];
        for (int j = 0; j < n; ++j) then -= G[(i + 1 + k) * n + j] * y[j];
        onward += d[k] * then;
      }
      const double none = Slow::negligible_influence * own_influence(c, -d[1], d[0]);
      if (onward < -none * push) return FAILED;  // it stops
      slow[n_slow] = c;
      firm[n_slow] = fmax(onward / push, none);
      goal[n_slow++] = rate * (d[0] * points.hdot[3 * c + 2] - d[1] * points.hdot[3 * c + 1]);
    }
    list_unknowns(points, f, true, true);
    const int first = directed.n;
    for (int s = 0; s < n_slow; ++s) {
      const double* d = direction[slow[s]];
      directed.add_across(first_of(slow[s]), -d[1], d[0], firm[s], goal[s]);
    }
    directed.solve(G, n, free_hddot, reference, y);
    double most = 0.0;
    for (int s = 0; s < n_slow; ++s) {
      const int c = slow[s];
      const double push = points.in->friction[points.at[c].pair] * y[first_of(c)];
      const double turn = directed.size_of(first + s);
      double* d = direction[c];
      if (!(push > 0.0)) return FAILED;
      most = fmax(most, fabs(turn / push));
      const double turned[2] = {push * d[0] - turn * d[1], push * d[1] + turn * d[0]};
      for (int k = 0; k < 2; ++k) d[k] = turned[k];
      make_unit(d);
    }
    return most > Slow::turned ? CONTINUE : CONVERGED;
  }

  double W_[array_size(3 * C)][array_size(N)];
};

}  // namespace fan
