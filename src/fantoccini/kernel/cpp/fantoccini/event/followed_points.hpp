// The contact points that an event-driven run follows: those that touch, or have just parted. Their
// positions, their velocities, and
//
//   gamma, the part of hddot without accelerations of the puppet,
//
// the derivative of the points' velocities along the motion with velocities frozen, by fourth-order
// central differences of the narrow phase. Signs are those of contact/points.hpp: hdot = -u.
#pragma once

#include "fantoccini/contact/points_at.hpp"

namespace fan {

enum ContactMode { PARTED, RESTING, STICKING, SLIDING };

struct HeldContactTolerances {
  // Step of differences, relative to a full turn or to a solid's size: errors are 1e-13.
  static constexpr double turn = 1e-3;
  static constexpr double slowest = 1.0;  // 1/s: lower bound of rates
  // Near the end of a point's region the step is multiplied by `finer` repeatedly, down to
  // `least_turn`.
  static constexpr double finer = 0.1, least_turn = 1e-6;
  // Gap below which points are considered [m].
  static constexpr double margin = 1e-3;
  // m: overlap above which a point that has just parted touches again, and distance at which one
  // without force no longer rests.
  static constexpr double caught = 1e-13, max_rest_distance = 1e-11;
  // m: rounding of a gap.
  static constexpr double rounding = 1e-15;
  // m: gap above which a parted point is open.
  static constexpr double open_gap = 1e-14;
  // m/s: a parted point that opens faster will soon be open.
  static constexpr double leaving_speed = 1e-8;
  // m/s: a point stops sliding where u falls to this along its direction. This is far above the
  // error of integration, which would determine the direction of friction at lower speeds.
  static constexpr double stopped = 3e-9;
  // Least normal influence of a sliding point's force, relative to that without friction: below it,
  // friction jams (Painleve).
  static constexpr double least_influence = 1e-6;
  // Normal influence below which, and force of a sliding point, relative to the weight, above which
  // too small steps are attributed to jamming.
  static constexpr double jamming_influence = 1e-2, jamming_force = 100.0;
  // |hddot| of a resting point, relative to Flow::hddot_scale; negligible force, relative to the
  // weight.
  static constexpr double parting_acceleration = 1e-8, negligible_force = 1e-12;
};

template <class Model>
class FollowedPoints {
 public:
  static constexpr int C = Model::n_contacts, N = Model::n_vD, M = Model::n_rows;
  static constexpr int NQ = Model::n_qD, NQK = Model::n_qK, NK = Model::n_vK;
  using Tolerance = HeldContactTolerances;
  using Points = ContactPointsAt<Model>;

  struct Contact {
    int pair, feature, region;  // identity, as in ContactPointsAt::matches
    ContactMode mode;
    bool moving;      // slides faster than Tolerance::stopped
    bool reported;    // its sliding is among the events
    bool fresh;       // touches since this instant
    bool leaves;      // it rebounds at this instant
    double along[3];  // of friction on the first solid where it slides, in the world
    double force[3];  // at the last event, in the world
    double over;      // m: overlap of a parted point when it parted
    double back;      // m/s: initial speed of a sliding point against its direction
    double since;     // s: start of sliding
    bool slow;        // slides so slowly that its friction looks ahead (held_rows.hpp)
    double brake;     // m/s^2: its deceleration in that case
  };

  const ContactArrays* in = nullptr;
  int n = 0;
  Contact at[array_size(C)];
  bool too_many = false;

  // Of the latest evaluation.
  double gap[array_size(C)];
  double hdot[array_size(3 * C)], x[array_size(3 * C)],
      after[array_size(3 * C)];  // after: hddot with all forces
  double lawful[array_size(3 * C)],
      after_lawful[array_size(3 * C)];         // likewise, at the end of modes
  double overlap = -unbounded, closing = 0.0;  // of the deepest point: overlap and closing speed
  double safe = unbounded;     // s: time within which no solid passes through another
  bool exists[array_size(C)];  // whether a point exists there
  double point[array_size(C)][3], frame[array_size(C)][9];
  // Of the rows: A_D, A_K v_K, and gamma.
  double row[array_size(3 * C)][array_size(N)], rate_K[array_size(3 * C)],
      gamma[array_size(3 * C)] = {};
  double tension[array_size(M)] = {};  // at the last event

  // Evaluates all near points at a state; f's evaluation, except for accelerations, must be that of
  // the state.
  template <class F>
  void search(const F& f, const double* q_D, const double* v_D) {
    points_.pose(*in, q_D, v_D, f.q_K, f.v_K, f.p);
    points_.search(*in, Tolerance::margin);
    too_many = points_.too_many();
    safe = points_.safe_time(*in);
    overlap = -Tolerance::margin;
    closing = 0.0;
    for (int c = 0; c < n; ++c) {
      const int i = points_.find_feature(*in, at[c].pair, at[c].feature, at[c].region, exists + c);
      known_[c] = i >= 0;
      exists[c] = exists[c] && known_[c];
      if (known_[c]) load(i, c, v_D);
    }
    for (int i = 0; i < points_.n(); ++i) {
      const auto& from = points_.point(i);
      const int c = index_of(from);
      double over = -from.gap;
      if ((c >= 0 && at[c].mode != PARTED) || !points_.touches_there(i)) continue;
      if (c >= 0) over -= at[c].over + (at[c].leaves ? Tolerance::rounding : Tolerance::caught);
      if (over > overlap) {
        overlap = over;
        double u[3];
        points_.velocity(*in, i, u);
        closing = -dot3(u, from.frame);
      }
    }
  }

  // Drops parted points that have opened, and stores the directions of sliding ones, which hold for
  // the next step even if their speed crosses zero. The latest evaluation must be that of the
  // present state.
  void update_directions() {
    int kept = 0;
    for (int c = 0; c < n; ++c) {
      if (at[c].mode == PARTED && (!exists[c] || gap[c] > Tolerance::open_gap)) continue;
      if (at[c].mode == SLIDING && exists[c] && along(c) > 0.0 &&
          sliding_speed(c) > 2.0 * Tolerance::stopped) {
        at[c].moving = true;
        direction(c, at[c].along);
      }
      at[c].fresh = false;
      copy(c, kept++);
    }
    n = kept;
  }

  // Adds all points with a gap of at most `max_gap` at the latest evaluation as parted ones, up to
  // the capacity (too_many).
  template <class F>
  void take_closed(const F& f, const double* q_D, const double* v_D, double max_gap) {
    bool more = false, full = false;
    for (int i = 0; i < points_.n(); ++i) {
      const auto& from = points_.point(i);
      if (from.gap > max_gap || index_of(from) >= 0 || !points_.touches_there(i)) continue;
      full = n == C;
      if (full) break;
      bool reported = false;
      for (int c = 0; c < n; ++c)
        reported = reported || (meet(at[c].pair, from.pair) && at[c].reported);
      at[n++] = {
          from.pair,
          from.feature,
          from.region,
          PARTED,
          false,
          reported,
          true,
          false,
          {0.0, 0.0, 0.0},
          {0.0, 0.0, 0.0},
          from.gap < 0.0 ? -from.gap : 0.0,
          0.0,
          f.t,
          false,
          0.0};
      more = true;
    }
    if (more) {
      sort();
      search(f, q_D, v_D);
    }
    too_many = too_many || full;
  }

  // Stores the overlaps and speeds that points keep after an event.
  void accept_overlaps() {
    for (int c = 0; c < n; ++c) {
      at[c].over = at[c].mode == RESTING ? fabs(gap[c]) : fmax(-gap[c], 0.0);
      at[c].back = at[c].mode == SLIDING ? fmax(-along(c), 0.0) : 0.0;
      at[c].leaves = hdot[3 * c] < -Tolerance::leaving_speed;
    }
  }

  // Whether two pairs have the same two names (ContactArrays::meetings).
  bool meet(int pair, int other) const { return in->meetings[pair] == in->meetings[other]; }

  // Largest |hdot| of the normals of held points.
  double fastest_normal() const {
    double fastest = 0.0;
    for (int c = 0; c < n; ++c)
      if (at[c].mode == STICKING || at[c].mode == SLIDING)
        fastest = fmax(fastest, fabs(hdot[3 * c]));
    return fastest;
  }

  // Clears `slow` of all points. Returns whether any was slow.
  bool forget_slow() {
    bool any = false;
    for (int c = 0; c < n; ++c) {
      any = any || at[c].slow;
      at[c].slow = false;
    }
    return any;
  }

  // Sliding velocity of point c along its direction; negative if it slides back.
  double along(int c) const {
    double sum = 0.0;
    for (int d = 1; d < 3; ++d) sum += hdot[3 * c + d] * dot3(frame[c] + 3 * d, at[c].along);
    return sum;
  }

  double sliding_speed(int c) const {
    return sqrt(hdot[3 * c + 1] * hdot[3 * c + 1] + hdot[3 * c + 2] * hdot[3 * c + 2]);
  }

  // The direction of hdot_T at point c, in the world.
  void direction(int c, double* out) const {
    const double size = sliding_speed(c);
    for (int k = 0; k < 3; ++k)
      out[k] = (hdot[3 * c + 1] * frame[c][3 + k] + hdot[3 * c + 2] * frame[c][6 + k]) / size;
  }

  // A force in point c's frame, in the world.
  void in_world(int c, const double* force, double* out) const {
    for (int k = 0; k < 3; ++k)
      out[k] = force[0] * frame[c][k] + force[1] * frame[c][3 + k] + force[2] * frame[c][6 + k];
  }

  // Stores the latest forces as those of an event.
  template <class F>
  void keep_forces(const F& f) {
    for (int c = 0; c < n; ++c) in_world(c, x + 3 * c, at[c].force);
    for (int r = 0; r < M; ++r) tension[r] = f.tension[r];
  }

  void forget_forces() {
    for (int c = 0; c < n; ++c)
      for (int k = 0; k < 3; ++k) at[c].force[k] = 0.0;
    for (int r = 0; r < M; ++r) tension[r] = 0.0;
  }

  // Forces of points and rows, as left by keep_forces.
  struct Forces {
    double point[array_size(C)][3], row[array_size(M)];
  };

  Forces forces() const {
    Forces out;
    for (int c = 0; c < n; ++c)
      for (int k = 0; k < 3; ++k) out.point[c][k] = at[c].force[k];
    for (int r = 0; r < M; ++r) out.row[r] = tension[r];
    return out;
  }

  void set_forces(const Forces& from) {
    for (int c = 0; c < n; ++c)
      for (int k = 0; k < 3; ++k) at[c].force[k] = from.point[c][k];
    for (int r = 0; r < M; ++r) tension[r] = from.row[r];
  }

  // Sets gamma: derivatives of hdot along the motion without accelerations of the puppet but with
  // those of the driven coordinates. If a point is lost ahead or enters another region, as at a
  // corner, differences are taken backwards or with a smaller step; a point lost here keeps its
  // latest gamma.
  template <class F>
  void differ(const F& f, const double* q_D, const double* v_D) {
    double rate = Tolerance::slowest;
    for (int c = 0; c < n; ++c)
      rate = fmax(rate, points_.rate_of_turning(*in, at[c].pair, speed(c)));
    bool done[array_size(C)];
    int remaining = n;
    for (int c = 0; c < n; ++c) {
      done[c] = !known_[c];
      remaining -= done[c];
    }
    for (double step = Tolerance::turn / rate; remaining > 0 && step * rate > Tolerance::least_turn;
         step *= Tolerance::finer)
      for (const Differences& scheme : schemes_) {
        if (remaining > 0) remaining -= differ(f, q_D, v_D, scheme, step, done);
      }
  }

  // Writes the points' negated gaps at a configuration to out[3 c]; 0 for points that are lost.
  template <class F>
  void measure_gaps(const F& f, const double* q_D, double* out) {
    const double v_D[array_size(N)] = {}, v_K[array_size(NK)] = {};
    near_.pose(*in, q_D, v_D, f.q_K, v_K, f.p);
    for (int c = 0, pair = -1; c < n; ++c) {
      if (at[c].pair != pair) near_.search_one_pair(*in, pair = at[c].pair, Tolerance::margin);
      bool holds;
      const int i = near_.find_feature(*in, pair, at[c].feature, at[c].region, &holds);
      out[3 * c] = i < 0 ? 0.0 : -near_.point(i).gap;
    }
  }

 private:
  // Positions in steps and weights times 12; `own`: the weight of the present position.
  struct Differences {
    double at[4], weight[4], own;
  };

  // Fourth-order differences: central, backward and forward.
  static constexpr Differences schemes_[] = {
      {{-2, -1, 1, 2}, {1, -8, 8, -1}, 0},
      {{-4, -3, -2, -1}, {3, -16, 36, -48}, 25},
      {{1, 2, 3, 4}, {48, -36, 16, -3}, -25},
  };

  // Sets gamma of the points that are not done and exist at all positions. Returns their number.
  template <class F>
  int differ(
      const F& f, const double* q_D, const double* v_D, const Differences& scheme, double step,
      bool* done) {
    double sum[array_size(3 * C)];
    bool all[array_size(C)];
    for (int c = 0; c < n; ++c) {
      all[c] = !done[c];
      for (int d = 0; d < 3; ++d) sum[3 * c + d] = -scheme.own * hdot[3 * c + d];
    }
    for (int k = 0; k < 4; ++k) {
      const double tau = scheme.at[k] * step;
      double q_next[array_size(NQ)], q_K_next[array_size(NQK)], move[array_size(N)],
          move_K[array_size(NK)], v_K[array_size(NK)];
      for (int j = 0; j < N; ++j) move[j] = tau * v_D[j];
      for (int j = 0; j < NK; ++j) {
        move_K[j] = tau * f.v_K[j];
        v_K[j] = f.v_K[j] + tau * f.acc_K[j];
      }
      retract<typename Model::Dynamic>(q_D, move, q_next);
      retract<typename Model::Driven>(f.q_K, move_K, q_K_next);
      near_.pose(*in, q_next, v_D, q_K_next, v_K, f.p);
      for (int c = 0, pair = -1; c < n; ++c) {
        if (!all[c]) continue;
        if (at[c].pair != pair) {
          pair = at[c].pair;
          near_.search_one_pair(*in, pair, 2.0 * Tolerance::margin + 2.0 * fabs(tau) * speed(c));
        }
        bool holds;
        const int i = near_.find_feature(*in, pair, at[c].feature, at[c].region, &holds);
        all[c] = i >= 0 && near_.point(i).region == region_[c];
        if (!all[c]) continue;
        double u[3];
        near_.velocity(*in, i, u);
        sum[3 * c] += scheme.weight[k] * dot3(u, near_.point(i).frame);
        for (int d = 1; d < 3; ++d) sum[3 * c + d] += scheme.weight[k] * dot3(u, frame[c] + 3 * d);
      }
    }
    int count = 0;
    for (int c = 0; c < n; ++c) {
      if (!all[c]) continue;
      for (int d = 0; d < 3; ++d) gamma[3 * c + d] = -sum[3 * c + d] / (12.0 * step);
      done[c] = true;
      ++count;
    }
    return count;
  }

  // Loads the position of point c, its rows and its velocity from point i of `points_`.
  void load(int i, int c, const double* v_D) {
    const auto& from = points_.point(i);
    gap[c] = from.gap;
    region_[c] = from.region;
    for (int d = 0; d < 3; ++d) point[c][d] = from.at[d];
    for (int d = 0; d < 9; ++d) frame[c][d] = from.frame[d];
    points_.make_rows(*in, i);
    for (int d = 0; d < 3; ++d) {
      for (int k = 0; k < N; ++k) row[3 * c + d][k] = points_.row(i)[k][d];
      rate_K[3 * c + d] = points_.rate_K(i)[d];
      double sum = rate_K[3 * c + d];
      for (int k = 0; k < N; ++k) sum += row[3 * c + d][k] * v_D[k];
      hdot[3 * c + d] = sum;
    }
  }

  // Index of a followed point; -1 if it is not followed.
  int index_of(const typename Points::Point& point) const {
    for (int c = 0; c < n; ++c)
      if (Points::matches(at[c], point.pair, point.feature, point.region)) return c;
    return -1;
  }

  // Order of the points.
  static bool is_before(const Contact& a, const Contact& b) {
    if (a.pair != b.pair) return a.pair < b.pair;
    return a.feature != b.feature ? a.feature < b.feature : a.region < b.region;
  }

  void sort() {
    for (int c = 1; c < n; ++c)
      for (int b = c; b > 0 && is_before(at[b], at[b - 1]); --b) {
        const Contact earlier = at[b];
        at[b] = at[b - 1];
        at[b - 1] = earlier;
      }
  }

  // Copies point c's entries of the latest evaluation to those of an earlier one.
  void copy(int c, int to) {
    if (c == to) return;
    at[to] = at[c];
    exists[to] = exists[c];
    known_[to] = known_[c];
    gap[to] = gap[c];
    region_[to] = region_[c];
    for (int k = 0; k < 3; ++k) point[to][k] = point[c][k];
    for (int k = 0; k < 9; ++k) frame[to][k] = frame[c][k];
    for (int d = 0; d < 3; ++d) {
      hdot[3 * to + d] = hdot[3 * c + d];
      x[3 * to + d] = x[3 * c + d];
      after[3 * to + d] = after[3 * c + d];
      lawful[3 * to + d] = lawful[3 * c + d];
      after_lawful[3 * to + d] = after_lawful[3 * c + d];
      rate_K[3 * to + d] = rate_K[3 * c + d];
      gamma[3 * to + d] = gamma[3 * c + d];
      for (int k = 0; k < N; ++k) row[3 * to + d][k] = row[3 * c + d][k];
    }
  }

  double speed(int c) const {
    return fabs(hdot[3 * c]) + fabs(hdot[3 * c + 1]) + fabs(hdot[3 * c + 2]);
  }

  Points points_, near_;       // of the latest evaluation; at displaced configurations
  bool known_[array_size(C)];  // exists, or its features alone define it
  int region_[array_size(C)];
};

}  // namespace fan
