// The derivatives of ContactPartials multiplied from the left: of the sum
//
//   z . Q + sum of y_d r_d
//
// over the rows r_d that a point holds, over dt, at fixed multipliers, acc_D, z and y. With the
// changes of position P, normal n and gap by the twist of the first link relative to the second,
// the total change is
//
//   a . dP + b . dn + c dh + wrenches . changes of the twists after and before the step and at z
//
// with h the gap, so that every velocity that moves a link adds a few products.
#pragma once

#include "fantoccini/contract.hpp"
#include "fantoccini/derivatives/link_screws.hpp"
#include "fantoccini/math/space.hpp"

FAN_LOOPS_BEGIN

namespace fan {

template <class Model>
class ContactPull {
 public:
  static constexpr int N = Model::n_vD, K = Model::n_vK, P = Model::n_p, E = N + K;
  static constexpr int L = Model::n_links, n_columns = 2 * E + P;

  // As ContactPartials::begin.
  void begin(
      const double* screws, const double* v_D, const double* v_next, const double* rate,
      const double* by_p, double dt) {
    s_ = screws;
    by_p_ = by_p;
    dt_ = dt;
    for (int k = 0; k < N; ++k) {
      v_[AFTER][k] = v_next[k];
      v_[BEFORE][k] = v_D[k];
    }
    for (int k = 0; k < K; ++k) {
      v_[AFTER][N + k] = v_[BEFORE][N + k] = rate[k];
      v_[ALONG_Z][N + k] = 0.0;
    }
  }

  // Takes z (N,).
  void take(const double* z) {
    for (int k = 0; k < N; ++k) v_[ALONG_Z][k] = z[k];
  }

  // Adds the derivatives by q_D, q_K, v_D, dq_K/dt and p (n_columns,) of a point with the y of its
  // rows, 1 or 3.
  void add(const StepContact& point, const double* y, double* out) {
    point_ = &point;
    for (int t = 0; t < n_twists; ++t) find_velocity(t);
    weigh(y);
    for (int side = 0; side < 2; ++side)
      if (point.links[side] >= 0) add_link(side, out);
  }

 private:
  enum Twist { AFTER, BEFORE, ALONG_Z };
  static constexpr int n_twists = 3;

  // The twist of the first link relative to the second, and its velocity at the point.
  void find_velocity(int t) {
    double twist[6] = {};
    for (int side = 0; side < 2; ++side) {
      const int link = point_->links[side];
      if (link < 0) continue;
      each_screw<Model>(link, [&](int k) {
        const double v = side ? -v_[t][k] : v_[t][k];
        for (int c = 0; c < 6; ++c) twist[c] += v * s_[6 * k + c];
      });
    }
    for (int c = 0; c < 3; ++c) turn_[t][c] = twist[3 + c];
    cross(turn_[t], point_->at, u_[t]);
    for (int c = 0; c < 3; ++c) u_[t][c] += twist[c];
  }

  // a, b, c, and the wrenches.
  void weigh(const double* y) {
    const StepContact& at = *point_;
    const double *n = at.normal, *f = at.force, *u = u_[AFTER], *u_z = u_[ALONG_Z];
    const double normal = dot3(n, u);
    double frame[9], by_u[3], by_start[3];
    for (int c = 0; c < 3; ++c) frame[c] = n[c];
    add_tangents(frame);
    gap_ = -at.closes * y[0] / dt_;
    for (int c = 0; c < 3; ++c) {
      by_u[c] = -y[0] * n[c] / dt_;
      by_start[c] = at.bounces * by_u[c];
      normal_[c] = -y[0] * (u[c] + at.bounces * u_[BEFORE][c]) / dt_;
      for (int d = 1; d < (at.sticks ? 3 : 1); ++d) {
        by_u[c] -= y[d] * frame[3 * d + c] / dt_;
        normal_[c] += y[d] * normal * frame[3 * d + c] / dt_;
      }
    }
    if (at.turns) {
      // f changes by x_n (dn - mu dd), and d with the velocity across the normal.
      const double *d = at.along, push = dot3(n, f), part = dot3(d, u_z);
      double across[3], e[3];
      for (int c = 0; c < 3; ++c) {
        across[c] = u[c] - normal * n[c];
        e[c] = u_z[c] - part * d[c];
      }
      const double bends = at.friction * push / sqrt(dot3(across, across)), e_n = dot3(e, n);
      for (int c = 0; c < 3; ++c) {
        by_u[c] -= bends * (e[c] - e_n * n[c]);
        normal_[c] += push * u_z[c] + bends * (normal * e[c] + e_n * u[c]);
      }
    } else {
      double moment[3], turned[3];
      cross(f, u_z, moment);
      cross(moment, n, turned);
      for (int c = 0; c < 3; ++c) normal_[c] += turned[c];
    }
    set_wrench(AFTER, by_u);
    set_wrench(BEFORE, by_start);
    set_wrench(ALONG_Z, f);
    for (int c = 0; c < 3; ++c) place_[c] = 0.0;
    for (int t = 0; t < n_twists; ++t) {
      double more[3];
      cross(wrench_[t], turn_[t], more);
      for (int c = 0; c < 3; ++c) place_[c] += more[c];
    }
    for (int c = 0; c < 6; ++c) {
      apart_[c] = gap_ * at.by[c];
      for (int d = 0; d < 3; ++d)
        apart_[c] += place_[d] * at.by[6 * (1 + d) + c] + normal_[d] * at.by[6 * (4 + d) + c];
    }
    // The twist of the point's common motion with its second link.
    cross(at.at, place_, along_ + 3);
    double more[3];
    cross(n, normal_, more);
    for (int c = 0; c < 3; ++c) {
      along_[c] = place_[c];
      along_[3 + c] += more[c];
    }
  }

  // The wrench of a force at the point.
  void set_wrench(int t, const double* force) {
    for (int c = 0; c < 3; ++c) wrench_[t][c] = force[c];
    cross(point_->at, force, wrench_[t] + 3);
  }

  void add_link(int side, double* out) {
    const int link = point_->links[side];
    const double sign = side ? -1.0 : 1.0;
    double pose[6], speed[6], carried[E][n_twists][6];
    for (int c = 0; c < 6; ++c) {
      pose[c] = sign * apart_[c] + (side ? along_[c] : 0.0);
      speed[c] = sign * (wrench_[AFTER][c] + wrench_[BEFORE][c]);
    }
    each_screw<Model>(link, [&](int j) {
      for (int t = 0; t < n_twists; ++t)
        for (int c = 0; c < 6; ++c) carried[j][t][c] = 0.0;
    });
    each_screw<Model>(link, [&](int k) {
      const double* s = s_ + 6 * k;
      for (int j = Model::carried_begin[k]; j < Model::carried_begin[k + 1]; ++j)
        for (int t = 0; t < n_twists; ++t)
          for (int c = 0; c < 6; ++c) carried[Model::carried_entry[j]][t][c] += v_[t][k] * s[c];
      out[E + k] += dot6(speed, s);
      for (int p = 0; p < P; ++p)
        for (int c = 0; c < 6; ++c) {
          double by = 0.0;
          for (int t = 0; t < n_twists; ++t) by += v_[t][k] * wrench_[t][c];
          out[2 * E + p] += sign * by * by_p_[(6 * (L + k) + c) * P + p];
        }
    });
    each_screw<Model>(link, [&](int j) {
      double sum = 0.0;
      for (int t = 0; t < n_twists; ++t) {
        double turned[6];
        bracket(s_ + 6 * j, carried[j][t], turned);
        sum += dot6(wrench_[t], turned);
      }
      out[j] += dot6(pose, s_ + 6 * j) + sign * sum;
    });
    for (int p = 0; p < P; ++p)
      for (int c = 0; c < 6; ++c) out[2 * E + p] += pose[c] * by_p_[(6 * link + c) * P + p];
  }

  const double *s_, *by_p_;
  const StepContact* point_;
  double dt_, v_[n_twists][array_size(E)];
  // Velocity, angular velocity and weight of each twist at the point; derivatives of the sum by
  // position, normal and gap.
  double u_[n_twists][3], turn_[n_twists][3], wrench_[n_twists][6];
  double place_[3], normal_[3], gap_, apart_[6], along_[6];
};

}  // namespace fan

FAN_LOOPS_END
