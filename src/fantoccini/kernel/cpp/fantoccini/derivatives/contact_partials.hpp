// Contribution of contacts to the derivatives of a step, each point in its mode. With u the
// velocity of the first solid relative to the second at the point P, n the normal, t1 and t2
// tangents, and U = du/dv_D, a point that
//
//   sticks  holds n.u, t1.u and t2.u          by f = x_n n + x_1 t1 + x_2 t2,
//   slides  holds n.u                         by f = x_n (n - mu d),  d = u_T/|u_T|.
//
// Q = U^T f are generalised forces. Tangents turn with the normal and not about it; d turns with u:
// dd = (1 - d d^T) du_T/|u_T|. A small change dq moves a link by the twist xi = sum of s_k dq_k and
// turns the screws as a motion does: ds_k = [xi_k, s_k].
//
// Changes are columns: of q_D, q_K, v_D, dq_K/dt and p.
#pragma once

#include "fantoccini/contract.hpp"
#include "fantoccini/derivatives/link_screws.hpp"
#include "fantoccini/math/space.hpp"

FAN_LOOPS_BEGIN

namespace fan {

// Adds a fraction of the largest force to the points' forces, distributed by `idle` over their
// rows, which follow n_held others.
inline void share_otherwise(
    StepContact* points, int n, int n_held, const double* idle, double fraction) {
  double largest = 0.0;
  for (int i = 0; i < n; ++i) largest = fmax(largest, sqrt(dot3(points[i].force, points[i].force)));
  for (int i = 0, a = n_held; i < n; ++i) {
    StepContact& own = points[i];
    double frame[9];
    for (int c = 0; c < 3; ++c) frame[c] = own.normal[c];
    add_tangents(frame);
    for (int d = 0; d < (own.sticks ? 3 : 1); ++d, ++a)
      for (int c = 0; c < 3; ++c)
        own.force[c] +=
            fraction * largest * idle[a] * (frame[3 * d + c] - own.friction * own.along[c]);
  }
}

template <class Model>
class ContactPartials {
 public:
  static constexpr int N = Model::n_vD, K = Model::n_vK, P = Model::n_p, E = N + K;
  static constexpr int L = Model::n_links, n_columns = 2 * E + P;

  // `screws` (E, 6) at the start of a step, the velocities before and after it, and the changes by
  // parameters (L + E, 6, P) must outlive this object.
  void begin(
      const double* screws, const double* v_D, const double* v_next, const double* rate,
      const double* by_p, double dt) {
    s_ = screws;
    by_p_ = by_p;
    dt_ = dt;
    for (int k = 0; k < N; ++k) {
      before_[k] = v_D[k];
      after_[k] = v_next[k];
    }
    for (int k = 0; k < K; ++k) before_[N + k] = after_[N + k] = rate[k];
  }

  // Adds the generalised force of a point to Q (N,).
  void push(const StepContact& point, double* Q) {
    point_ = &point;
    find_subspace();
    for (int k = 0; k < N; ++k)
      for (int c = 0; c < 3; ++c) Q[k] += U_[c][k] * point.force[c];
  }

  // Adds a point that pushes. Writes the number `n` of its held rows, the `rows` of -u along their
  // directions, the negated generalised `forces` of their multipliers, and the changes of the rows
  // over dt, `rates`. Adds the negated changes of the generalised forces to `by` (n_columns, N).
  // Returns whether friction turns with u; the force of that is z^T z acc_D, z written to `drag`.
  bool take(
      const StepContact& point, int* n, double (*rows)[array_size(N)],
      double (*forces)[array_size(N)], double (*rates)[array_size(n_columns)], double* drag,
      double* by) {
    set(point, n, rows, forces);
    set_pose_changes();
    set_rate_changes(*n, rates);
    find_speed();
    set_force_changes();
    subtract_force_changes(by);
    return find_drag(drag);
  }

  // Changes of the gap of a point (n_columns,); valid until the next call.
  const double* gap_by(const StepContact& point) {
    point_ = &point;
    set_pose_changes();
    return gap_by_;
  }

  // As take(), for the rows, the generalised forces of the multipliers and the drag only.
  bool hold(
      const StepContact& point, int* n, double (*rows)[array_size(N)],
      double (*forces)[array_size(N)], double* drag) {
    set(point, n, rows, forces);
    if (!point.turns) return false;
    find_velocity();
    find_speed();
    return find_drag(drag);
  }

 private:
  using Columns = double[3][array_size(n_columns)];

  // Loads a point, its held rows, and the generalised forces of its multipliers, negated.
  void set(
      const StepContact& point, int* n, double (*rows)[array_size(N)],
      double (*forces)[array_size(N)]) {
    point_ = &point;
    find_subspace();
    double frame[9];
    find_frame(frame);
    *n = point.sticks ? 3 : 1;
    for (int d = 0; d < *n; ++d)
      for (int k = 0; k < N; ++k) {
        rows[d][k] = forces[d][k] = 0.0;
        for (int c = 0; c < 3; ++c) {
          rows[d][k] -= frame[3 * d + c] * U_[c][k];
          forces[d][k] -= (frame[3 * d + c] - point.friction * point.along[c]) * U_[c][k];
        }
      }
  }

  void find_frame(double* frame) const {
    for (int c = 0; c < 3; ++c) frame[c] = point_->normal[c];
    add_tangents(frame);
  }

  // Sets the changes of the n rows over dt; those of P and n must be set. Leaves the velocity after
  // the step in u.
  void set_rate_changes(int n, double (*rates)[array_size(n_columns)]) {
    const StepContact& point = *point_;
    double frame[9];
    find_frame(frame);
    if (point.bounces != 0.0) set_velocity_changes(before_, u_, u_by_);
    for (int c = 0; c < n_columns && point.bounces != 0.0; ++c)
      rebound_[c] = point.bounces * (along(frame, u_by_, c) + across(n_by_, u_, c));
    set_velocity_changes(after_, u_, u_by_);
    const double normal = dot3(point.normal, u_);
    for (int c = 0; c < n_columns; ++c) {
      const double back = point.bounces != 0.0 ? rebound_[c] : 0.0;
      const double change = along(frame, u_by_, c) + across(n_by_, u_, c);
      rates[0][c] = -(change + point.closes * gap_by_[c] + back) / dt_;
      for (int d = 1; d < n; ++d)
        rates[d][c] =
            -(along(frame + 3 * d, u_by_, c) - normal * along(frame + 3 * d, n_by_, c)) / dt_;
    }
  }

  // Sets u to the velocity after the step.
  void find_velocity() {
    double twist[6] = {};
    each_link([&](int link, double sign) {
      each_screw<Model>(link, [&](int k) {
        for (int c = 0; c < 6; ++c) twist[c] += sign * after_[k] * s_[6 * k + c];
      });
    });
    velocity(twist, u_);
  }

  // Sets the sliding speed from u.
  void find_speed() {
    const double *n = point_->normal, normal = dot3(n, u_);
    double across_u[3];
    for (int c = 0; c < 3; ++c) across_u[c] = u_[c] - n[c] * normal;
    speed_ = sqrt(dot3(across_u, across_u));
  }

  static double along(const double* direction, const Columns& of, int c) {
    return direction[0] * of[0][c] + direction[1] * of[1][c] + direction[2] * of[2][c];
  }
  static double across(const Columns& of, const double* u, int c) { return along(u, of, c); }

  // Calls f with the index and the sign of each link that moves.
  template <class F>
  void each_link(const F& f) const {
    for (int side = 0; side < 2; ++side)
      if (point_->links[side] >= 0) f(point_->links[side], side ? -1.0 : 1.0);
  }

  // Calls f with every velocity that carries the axis of k.
  template <class F>
  static void each_carrier(int k, const F& f) {
    for (int j = Model::carried_begin[k]; j < Model::carried_begin[k + 1]; ++j)
      f(Model::carried_entry[j]);
  }

  // Change by a parameter: of link i, or of screw k.
  double xi_p(int i, int c, int p) const { return by_p_[(6 * i + c) * P + p]; }
  double s_p(int k, int c, int p) const { return by_p_[(6 * (L + k) + c) * P + p]; }

  static void clear(Columns& x) {
    for (int c = 0; c < 3; ++c)
      for (int i = 0; i < n_columns; ++i) x[c][i] = 0.0;
  }

  // Sets U (3, N).
  void find_subspace() {
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < N; ++k) U_[c][k] = 0.0;
    each_link([&](int link, double sign) {
      for (int j = Model::moved_D_begin[link]; j < Model::moved_D_begin[link + 1]; ++j) {
        const int k = Model::moved_D_entry[j];
        double u[3];
        velocity(s_ + 6 * k, u);
        for (int c = 0; c < 3; ++c) U_[c][k] += sign * u[c];
      }
    });
  }

  // Velocity at the point, from a twist.
  void velocity(const double* twist, double* u) const {
    cross(twist + 3, point_->at, u);
    for (int c = 0; c < 3; ++c) u[c] += twist[c];
  }

  // Sets the changes of gap, P and n: those by the twist xi_1 - xi_2, and the common motion with
  // the second link.
  void set_pose_changes() {
    clear(P_by_);
    clear(n_by_);
    for (int i = 0; i < n_columns; ++i) gap_by_[i] = 0.0;
    for (int side = 0; side < 2; ++side) {
      const int link = point_->links[side];
      if (link < 0) continue;
      each_screw<Model>(link, [&](int k) { move_by(side, k, s_ + 6 * k); });
      for (int p = 0; p < P; ++p) {
        double xi[6];
        for (int c = 0; c < 6; ++c) xi[c] = xi_p(link, c, p);
        move_by(side, 2 * E + p, xi);
      }
    }
  }

  void move_by(int side, int column, const double* xi) {
    const double sign = side ? -1.0 : 1.0, *by = point_->by;
    double moved[7], carried[3] = {}, turned[3] = {};
    for (int i = 0; i < 7; ++i) {
      moved[i] = 0.0;
      for (int c = 0; c < 6; ++c) moved[i] += sign * by[6 * i + c] * xi[c];
    }
    if (side) {
      velocity(xi, carried);
      cross(xi + 3, point_->normal, turned);
    }
    gap_by_[column] += moved[0];
    for (int c = 0; c < 3; ++c) {
      P_by_[c][column] += moved[1 + c] + carried[c];
      n_by_[c][column] += moved[4 + c] + turned[c];
    }
  }

  // Sets u at velocities v (E,), and its changes.
  void set_velocity_changes(const double* v, double* u, Columns& by) {
    double twist[6] = {};
    clear(by);
    each_link([&](int link, double sign) {
      double carried[E][6];
      each_screw<Model>(link, [&](int j) {
        for (int c = 0; c < 6; ++c) carried[j][c] = 0.0;
      });
      each_screw<Model>(link, [&](int k) {
        const double* s = s_ + 6 * k;
        for (int c = 0; c < 6; ++c) twist[c] += sign * v[k] * s[c];
        each_carrier(k, [&](int j) {
          for (int c = 0; c < 6; ++c) carried[j][c] += v[k] * s[c];
        });
        add(by, E + k, sign, s);
        for (int p = 0; p < P; ++p) {
          double turned[6];
          for (int c = 0; c < 6; ++c) turned[c] = v[k] * s_p(k, c, p);
          add(by, 2 * E + p, sign, turned);
        }
      });
      each_screw<Model>(link, [&](int j) {
        double turned[6];
        bracket(s_ + 6 * j, carried[j], turned);
        add(by, j, sign, turned);
      });
    });
    velocity(twist, u);
    const double* w = twist + 3;
    for (int c = 0; c < 3; ++c) {
      const int a = (c + 1) % 3, b = (c + 2) % 3;
      for (int i = 0; i < n_columns; ++i) by[c][i] += w[a] * P_by_[b][i] - w[b] * P_by_[a][i];
    }
  }

  // Adds the velocity at the point of the twist of a column.
  void add(Columns& by, int column, double sign, const double* twist) const {
    double u[3];
    velocity(twist, u);
    for (int c = 0; c < 3; ++c) by[c][column] += sign * u[c];
  }

  // Sets the changes of f at fixed multipliers and acc_D.
  void set_force_changes() {
    const StepContact& at = *point_;
    const double *n = at.normal, *d = at.along, *f = at.force;
    const double push = dot3(n, f), normal = dot3(n, u_);
    for (int i = 0; i < n_columns; ++i) {
      const double n_by[3] = {n_by_[0][i], n_by_[1][i], n_by_[2][i]};
      double f_by[3];
      if (at.turns) {
        const double by_n = along(n, u_by_, i) + dot3(u_, n_by);
        double turned[3];
        for (int c = 0; c < 3; ++c) turned[c] = u_by_[c][i] - n_by[c] * normal - n[c] * by_n;
        const double part = dot3(d, turned);
        for (int c = 0; c < 3; ++c)
          f_by[c] = push * (n_by[c] - at.friction * (turned[c] - d[c] * part) / speed_);
      } else {
        double turned[3];
        cross(n, n_by, turned);
        cross(turned, f, f_by);
      }
      for (int c = 0; c < 3; ++c) f_by_[c][i] = f_by[c];
    }
  }

  // Subtracts the changes of Q from `by`.
  void subtract_force_changes(double* by) {
    const double* f = point_->force;
    double wrench[6];
    for (int c = 0; c < 3; ++c) wrench[c] = f[c];
    cross(point_->at, f, wrench + 3);
    for (int c = 0; c < 3; ++c) {
      const int a = (c + 1) % 3, b = (c + 2) % 3;
      const double* at = point_->at;
      for (int i = 0; i < n_columns; ++i)
        moment_by_[c][i] =
            P_by_[a][i] * f[b] - P_by_[b][i] * f[a] + at[a] * f_by_[b][i] - at[b] * f_by_[a][i];
    }
    each_link([&](int link, double sign) {
      for (int j = Model::moved_D_begin[link]; j < Model::moved_D_begin[link + 1]; ++j) {
        const int k = Model::moved_D_entry[j];
        const double* s = s_ + 6 * k;
        for (int i = 0; i < n_columns; ++i)
          by[i * N + k] -= sign * (along(s, f_by_, i) + along(s + 3, moment_by_, i));
        each_carrier(k, [&](int carrier) {
          double turned[6];
          bracket(s_ + 6 * carrier, s, turned);
          by[carrier * N + k] -= sign * (dot3(turned, wrench) + dot3(turned + 3, wrench + 3));
        });
        for (int p = 0; p < P; ++p)
          for (int c = 0; c < 6; ++c) by[(2 * E + p) * N + k] -= sign * s_p(k, c, p) * wrench[c];
      }
    });
  }

  // Writes z of take(). Returns whether there is any.
  bool find_drag(double* drag) const {
    const StepContact& at = *point_;
    if (!at.turns) return false;
    double side[3];
    cross(at.normal, at.along, side);
    const double size = sqrt(at.friction * dot3(at.normal, at.force) * dt_ / speed_);
    for (int k = 0; k < N; ++k)
      drag[k] = size * (side[0] * U_[0][k] + side[1] * U_[1][k] + side[2] * U_[2][k]);
    return true;
  }

  const double *s_, *by_p_;
  const StepContact* point_;
  double dt_, before_[array_size(E)], after_[array_size(E)], u_[3], speed_;
  double U_[3][array_size(N)], gap_by_[array_size(n_columns)], rebound_[array_size(n_columns)];
  Columns P_by_, n_by_, u_by_, f_by_, moment_by_;
};

}  // namespace fan

FAN_LOOPS_END
