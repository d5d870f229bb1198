// The rows of all that is held at an instant of an event-driven run, strings and limits before
// three of every point, and the forces along them,
//
//   hddot - G y = 0 along the directions that are held,   G = W^T W,   W = F^-T A_D^T
//
// Friction of a sliding point has the direction of hdot_T, which turns at mu x_n G / |hdot_T|:
// without bound where the point is slow. There it has the direction d that hdot_T will have a time
// tau later,
//
//   d || hdot_T + tau hddot_T(d),   u = |hdot_T|
//   1/tau = (1 + (u/speed)^2) u/ahead + 2 brake/u + least
//
// so that steps need not resolve the turning. The point goes no farther than `ahead` in that time.
// The directions of all slow points follow from Newton's method on their angles, with the forces.
#pragma once

#include "fantoccini/event/followed_points.hpp"
#include "fantoccini/solvers/directed_rows.hpp"

namespace fan {

struct SlowSlidingTolerances {
  // m: way of a slow point in tau; m/s: speed above which it is less.
  static constexpr double ahead = 1e-11, speed = 1e-5;
  // 1/s: least of 1/tau.
  static constexpr double least = 1e4;
  // A point is slow where its friction would turn so many times faster than 1/tau.
  static constexpr double faster = 2.0;
  // Turn with which it becomes so [rad].
  static constexpr double small_turn = 1e-3;
  // Part of a point's own influence that counts as none; turn in an iteration after which none is
  // left [rad]; most iterations.
  static constexpr double negligible_influence = 1e-4, turned = 1e-8;
  static constexpr int turns = 10;
};

template <class Model>
class HeldRows : public FollowedPoints<Model> {
  using Base = FollowedPoints<Model>;

 public:
  static constexpr int C = Base::C, N = Base::N, M = Base::M;
  static constexpr int R = M + 3 * C;  // rows: strings and limits, then three of every point
  using Tolerance = HeldContactTolerances;
  using Slow = SlowSlidingTolerances;
  using Base::at, Base::n, Base::in, Base::hdot, Base::along, Base::sliding_speed;

  // Gathers the rows: those that f has, then three of every point.
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

  // The normal influence of sliding point c's force, relative to that without friction.
  double influence(int c) const {
    const int i = first_of(c);
    const double* d = direction_[c];
    const double mu = in->friction[at[c].pair];
    return 1.0 + mu * (G_[i * n_ + i + 1] * d[0] + G_[i * n_ + i + 2] * d[1]) / G_[i * n_ + i];
  }

  // Chooses which points are slow from the latest forces, until the next call; whether any is or
  // was. One that was not becomes so where friction hardly turns thereby.
  bool choose_slow() {
    bool any = false;
    for (int c = 0; c < n; ++c) {
      auto& own = at[c];
      const bool ahead = looks_ahead(c);
      any = any || own.slow;
      own.slow = false;
      const double speed = sliding_speed(c), mu = in->friction[own.pair];
      if (own.mode != SLIDING || !found_[c] || mu == 0.0 || !(speed > Tolerance::stopped)) continue;
      const double *d = direction_[c], *A = after + 3 * c + 1;
      const double onward = d[0] * A[0] + d[1] * A[1], across = d[0] * A[1] - d[1] * A[0];
      own.brake = fmax(-onward, 0.0);
      const double rate = rate_ahead(c);
      const bool stiff = mu * x[3 * c] * own_influence(c, -d[1], d[0]) > Slow::faster * speed * rate;
      own.slow = stiff && (ahead || fabs(across) < Slow::small_turn * (speed * rate + onward));
      any = any || own.slow;
    }
    return any;
  }

  // Lets no point be slow; whether any was.
  bool forget_slow() {
    bool any = false;
    for (int c = 0; c < n; ++c) {
      any = any || at[c].slow;
      at[c].slow = false;
    }
    return any;
  }

 protected:
  using Base::after, Base::x, Base::found_, Base::frame_, Base::row_, Base::rate_K_, Base::gamma_;

  // The directions that are held: of strings all that are taut; of points the normals and, if
  // `tangents`, those of sticking ones, with `beginning` also of those that begin to slide. With
  // `friction` the forces of sliding ones have theirs.
  template <class F>
  void list_unknowns(const F& f, bool tangents, bool friction, bool beginning = false) {
    directed_.n = 0;
    for (int a = 0; a < n_single_; ++a)
      if (f.row_state[f.rows.row[a]] == HELD) directed_.add(a, 1, 1.0, 0.0, 0.0);
    for (int c = 0; c < n; ++c) {
      const int i = first_of(c);
      const ContactMode mode = at[c].mode;
      if (mode == SLIDING || mode == STICKING) {
        const double mu = mode == SLIDING && friction ? in->friction[at[c].pair] : 0.0;
        directed_.add(i, 3, 1.0, mu * direction_[c][0], mu * direction_[c][1]);
      }
      const bool stands = mode == STICKING || (beginning && mode == SLIDING && !at[c].moving);
      if (!stands || !tangents) continue;
      directed_.add(i, 3, 0.0, 1.0, 0.0);
      directed_.add(i, 3, 0.0, 0.0, 1.0);
    }
  }

  // The forces y_ with the modes frozen, nearest to `reference`, and hddot `asked` without them.
  template <class F>
  void find_forces(const F& f, const double* asked, const double* reference) {
    bool turns = false;
    for (int c = 0; c < n; ++c) {
      if (at[c].mode != SLIDING) continue;
      const bool ahead = looks_ahead(c);
      turns = turns || ahead;
      find_direction(c, !ahead && along(c) > Tolerance::stopped);
    }
    list_unknowns(f, true, true);
    directed_.solve(G_, n_, asked, reference, y_);
    if (!turns) return;
    Turn turn = FURTHER;
    for (int k = 0; turn == FURTHER && k < Slow::turns; ++k) turn = turn_slow(f, asked, reference);
    if (turn == THERE) return;
    // No such directions: those of the present velocities.
    for (int c = 0; c < n; ++c)
      if (at[c].mode == SLIDING) find_direction(c, along(c) > Tolerance::stopped);
    list_unknowns(f, true, true);
    directed_.solve(G_, n_, asked, reference, y_);
  }

  double direction_[room(C)][2] = {};  // of friction, in the tangents
  int n_single_ = 0, n_ = 0;
  const double* column_[room(R)];
  double W_[room(3 * C)][room(N)], G_[room(R * R)];
  double hdot_[room(R)], hddot_[room(R)], y_[room(R)];
  DirectedRows<R> directed_;

 private:
  enum Turn { THERE, FURTHER, NOT_THERE };

  // Whether friction at point c has the direction of hdot_T later: it begins to slide, or is slow.
  bool looks_ahead(int c) const {
    if (at[c].mode != SLIDING || in->friction[at[c].pair] == 0.0) return false;
    return !at[c].moving || (at[c].slow && along(c) > Tolerance::stopped);
  }

  // 1/tau of point c.
  double rate_ahead(int c) const {
    const double speed = sliding_speed(c), fast = speed / Slow::speed;
    const double stops = at[c].moving ? 2.0 * at[c].brake / speed : 0.0;
    return (1.0 + fast * fast) * speed / Slow::ahead + stops + Slow::least;
  }

  // G of point c along a direction in its tangents.
  double own_influence(int c, double p, double q) const {
    const double* G = G_ + (first_of(c) + 1) * (n_ + 1);
    return p * (G[0] * p + 2.0 * G[1] * q) + q * G[n_ + 1] * q;
  }

  // The direction of friction at sliding point c: its `own`, that of hdot_T, or the one kept, at rest
  // or turning back, and from which that of a slow point turns.
  void find_direction(int c, bool own) {
    double* d = direction_[c];
    for (int k = 0; k < 2; ++k)
      d[k] = own ? hdot[3 * c + 1 + k] : dot3(frame_[c] + 3 * (k + 1), at[c].along);
    make_unit(d);
  }

  static void make_unit(double* d) {
    const double size = sqrt(d[0] * d[0] + d[1] * d[1]);
    for (int k = 0; k < 2; ++k) d[k] = size > 0.0 ? d[k] / size : 0.0;
  }

  // One of Newton's steps on the directions of slow points and all forces.
  template <class F>
  Turn turn_slow(const F& f, const double* asked, const double* reference) {
    int slow[room(C)], n_slow = 0;
    double firm[room(C)], goal[room(C)];
    for (int c = 0; c < n; ++c) {
      if (!looks_ahead(c)) continue;
      const int i = first_of(c);
      const double *d = direction_[c], rate = rate_ahead(c);
      const double push = in->friction[at[c].pair] * y_[i];
      if (!(push > 0.0)) continue;  // it lifts
      double onward = 0.0;
      for (int k = 0; k < 2; ++k) {
        double then = hdot[3 * c + 1 + k] * rate + asked[i + 1 + k];
        for (int j = 0; j < n_; ++j) then -= G_[(i + 1 + k) * n_ + j] * y_[j];
        onward += d[k] * then;
      }
      const double none = Slow::negligible_influence * own_influence(c, -d[1], d[0]);
      if (onward < -none * push) return NOT_THERE;  // it stops
      slow[n_slow] = c;
      firm[n_slow] = fmax(onward / push, none);
      goal[n_slow++] = rate * (d[0] * hdot[3 * c + 2] - d[1] * hdot[3 * c + 1]);
    }
    list_unknowns(f, true, true);
    const int first = directed_.n;
    for (int s = 0; s < n_slow; ++s) {
      const double* d = direction_[slow[s]];
      directed_.add_across(first_of(slow[s]), -d[1], d[0], firm[s], goal[s]);
    }
    directed_.solve(G_, n_, asked, reference, y_);
    double most = 0.0;
    for (int s = 0; s < n_slow; ++s) {
      const int c = slow[s];
      const double push = in->friction[at[c].pair] * y_[first_of(c)];
      const double turn = directed_.size_of(first + s);
      double* d = direction_[c];
      if (!(push > 0.0)) return NOT_THERE;
      most = fmax(most, fabs(turn / push));
      const double turned[2] = {push * d[0] - turn * d[1], push * d[1] + turn * d[0]};
      for (int k = 0; k < 2; ++k) d[k] = turned[k];
      make_unit(d);
    }
    return most > Slow::turned ? FURTHER : THERE;
  }
};

}  // namespace fan
