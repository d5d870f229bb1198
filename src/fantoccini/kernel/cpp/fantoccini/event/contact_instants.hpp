// An instant with contacts: impacts of strings, limits and contact points as one problem, and the
// choice of the modes that follow.
//
//   hdot+ = hdot- - G Lambda, hdot_n+ <= -e hdot_n-, complementary, Lambda in Coulomb's cones
//   hddot = hddot_0 - G x,    hddot_n <= 0, complementary, x in the cones, where hdot_n = 0;
//   x_T = mu x_n d of points that slide already (solvers/cone.hpp)
//
// A string on a slipping winch takes no impulse: while hdot > 0 its winch slips, and its tension is
// the winch's largest.
#pragma once

#include "fantoccini/contact/share.hpp"
#include "fantoccini/event/attempts.hpp"
#include "fantoccini/event/flow.hpp"
#include "fantoccini/solvers/cone.hpp"

namespace fan {

struct ContactInstantTolerances {
  // m/s, times the largest velocity if above 1: speed up to which a point sticks or may stick.
  static constexpr double sliding_speed = 1e-8;
  // Likewise, above which a closed point strikes; slower ones are brought to rest.
  static constexpr double striking_speed = 1e-9;
  // Negligible force, relative to the largest.
  static constexpr double no_force = 1e-9;
  // |hddot| of a point at rest, relative to Flow::hddot_scale.
  static constexpr double at_rest = 1e-8;
  // Bisections of the common factor that keeps restitutions from adding energy.
  static constexpr int halvings = 40;
  // Rounding of energy, relative to that exchanged by the impulses.
  static constexpr double rounding = 1e-13;
  // Relative distance from its cone at which a force counts as on it.
  static constexpr double at_cone = 1e-7;
  // Likewise from its winch's largest tension, relative to the largest force.
  static constexpr double at_largest = ClosedRowTolerances::tension_at_bound;
  // Cosine of the largest angle between friction that begins to act and the direction opposite to
  // the acceleration, and number of corrections of its direction.
  static constexpr double opposed = 0.9;
  static constexpr int turns = 4;
};

template <class Model>
class ContactInstants {
 public:
  using F = Flow<Model>;
  using Tolerance = ContactInstantTolerances;
  using Held = HeldContacts<Model>;
  static constexpr int C = F::C, N = F::N, NQ = F::NQ, S = F::S, M = F::M, R = Held::R;

  double impulse[array_size(M)],
      point_impulse[array_size(C)];  // of the last impact: rows; normal ones of points
  double speed[array_size(M)], point_speed[array_size(C)];  // hdot before it
  double lost = 0.0;                                        // J

  // Gathers the rows that are closed, and the points that touch, at (t, y), which must be the
  // flow's latest evaluation.
  void gather(F& f, const bool* closed) {
    int list[array_size(M)], n = 0;
    for (int r = 0; r < M; ++r)
      if (closed[r]) list[n++] = r;
    f.rows.gather(f.eval, f.y + NQ, list, n);
    f.contacts.points.differ(f, f.y, f.y + NQ);
    f.contacts.rows.assemble(f.contacts.points, f);
  }

  // Whether a point that is parted closes.
  bool strikes(const F& f) const {
    for (int c = 0; c < f.contacts.points.n; ++c)
      if (is_struck(f, c)) return true;
    return false;
  }

  bool is_struck(const F& f, int c) const {
    return f.contacts.points.at[c].mode == PARTED && f.contacts.points.exists[c] &&
           f.contacts.points.hdot[3 * c] > Tolerance::striking_speed * speed_scale(f);
  }

  // Stores the speeds before an impact, which has no impulses yet.
  void begin_impact(const F& f) {
    for (int r = 0; r < M; ++r) {
      impulse[r] = 0.0;
      speed[r] = f.rate_of(r, f.y + NQ);
    }
    for (int c = 0; c < f.contacts.points.n; ++c) {
      point_impulse[c] = 0.0;
      point_speed[c] = f.contacts.points.hdot[3 * c];
    }
  }

  // Applies the impulse over the gathered rows and points and adds its work.
  Status strike(F& f) {
    const auto& cone = f.contacts.cone;
    const Held& held = f.contacts;
    Status status = bounce(f, 1.0);
    if (status == RUNNING && lost < 0.0) {
      double low = 0.0, high = 1.0;
      for (int k = 0; k < Tolerance::halvings; ++k) {
        const double mid = 0.5 * (low + high);
        if (bounce(f, mid) != RUNNING || lost < 0.0) high = mid;
        else low = mid;
      }
      status = bounce(f, low);
    }
    if (status != RUNNING) return status;
    double w[array_size(N)] = {}, change[array_size(N)];
    held.rows.take(cone.x, w);
    f.eval.solve_factor(w, change);
    for (int a = 0; a < f.rows.n; ++a) {
      const int r = f.rows.row[a];
      impulse[r] = cone.x[a];
      f.y[F::WORK] += cone.x[a] * f.rows.hdot_K[a];
    }
    for (int c = 0; c < held.points.n; ++c) {
      const int i = held.rows.first_of(c);
      point_impulse[c] = cone.x[i];
      for (int d = 0; d < 3; ++d) f.y[F::WORK] += cone.x[i + d] * held.points.rate_K[3 * c + d];
    }
    for (int j = 0; j < N; ++j) {
      f.y[F::WORK] += f.eval.M_DK_v_K[j] * change[j];
      f.y[NQ + j] += change[j];
    }
    return RUNNING;
  }

  // Chooses the modes of the gathered rows, `next` (M,), and of all points at (t, y), which must be
  // the flow's latest evaluation, with winches that grip. Rows in `loose`, and points in
  // `loose_point`, have just lost their force; rows and points in `strained` and `strained_point`
  // have just reached their winch's largest tension or their cone.
  Status choose(
      F& f, const bool* loose, const bool* strained, const bool* loose_point,
      const bool* strained_point, Hold* next) {
    auto& cone = f.contacts.cone;
    Held& held = f.contacts;
    const double scale = f.hddot_scale(),
                 still = ClosedRowTolerances::max_rest_speed * speed_scale(f);
    for (int r = 0; r < M; ++r) next[r] = SLACK;
    Rest rest;
    rest.n_single = rest.n_points = 0;
    double free_hddot[array_size(R)];  // hddot with the tensions of the winches that slip
    for (int i = 0; i < held.rows.n; ++i) free_hddot[i] = held.rows.hddot[i];
    for (int a = 0; a < f.rows.n; ++a) {
      const int r = f.rows.row[a];
      if (fabs(f.rows.hdot[a]) <= still || f.rows.two_sided[a]) {
        rest.single[rest.n_single++] = a;
      } else if (f.winches.slips(r) && f.rows.hdot[a] > 0.0) {
        next[r] = SLIPPING;
        for (int i = 0; i < held.rows.n; ++i)
          free_hddot[i] -= held.rows.G[i * held.rows.n + a] * f.winches.largest(r);
      }
    }
    for (int c = 0; c < held.points.n; ++c)
      if (held.points.exists[c] && fabs(held.points.hdot[3 * c]) <= still)
        rest.point[rest.n_points++] = c;
    begin(f, rest.single, rest.n_single, rest.point, rest.n_points);
    for (int i = 0; i < rest.n_single; ++i) {
      const int r = f.rows.row[rest.single[i]];
      cone.b[i] = free_hddot[rest.single[i]];
      cone.x[i] = f.tension[r];
      cone.upper[i] = f.winches.largest(r);
    }
    for (int i = 0; i < rest.n_points; ++i) {
      const int c = rest.point[i], to = rest.n_single + 3 * i;
      const double mu = cone.mu[i];
      slides_[i] =
          mu > 0.0 && held.points.sliding_speed(c) > Tolerance::sliding_speed * speed_scale(f);
      double along[3] = {0.0, 0.0, 0.0};
      if (slides_[i]) held.points.direction(c, along);
      for (int d = 0; d < 3; ++d) {
        cone.b[to + d] = free_hddot[held.rows.first_of(c) + d];
        cone.x[to + d] = held.points.at[c].mode == PARTED ? 0.0 : held.points.x[3 * c + d];
        along_[i][d] = along[d];
        if (d > 0) given_[2 * i + d - 1] = dot3(held.points.frame[c] + 3 * d, along);
      }
      if (slides_[i] && jams(f, i, to)) return NO_UNIQUE_MOTION;
    }
    if (!cone.solve()) return NO_UNIQUE_MOTION;
    bool slips = false;
    for (int c = 0; c < held.points.n; ++c) slips = slips || strained_point[c];
    if (slips) {
      // Of redundant forces those of least norm, which may hold a point that others would let
      // slide.
      share_.find(cone, cone.x + rest.n_single);
      if (!slip(f, rest, Tolerance::at_rest * scale)) return NO_UNIQUE_MOTION;
    }
    decode(f, rest, loose, strained, loose_point, scale, next);
    return RUNNING;
  }

 private:
  // The rows and points that are at rest along their normals.
  struct Rest {
    int single[array_size(M)], point[array_size(C)], n_single, n_points;
  };

  static double speed_scale(const F& f) {
    double top = 1.0;
    for (int j = 0; j < N; ++j) top = fmax(top, fabs(f.y[NQ + j]));
    return top;
  }

  // Lets the points slide whose force has reached its cone, and solves again. If such a force does
  // not oppose the acceleration, as redundant forces need not, its direction is corrected.
  bool slip(F& f, const Rest& rest, double idle) {
    auto& cone = f.contacts.cone;
    bool begins[array_size(C)], more = false;
    for (int i = 0; i < rest.n_points; ++i) {
      const double* x = cone.x + rest.n_single + 3 * i;
      const double size = sqrt(x[1] * x[1] + x[2] * x[2]);
      const double least = (1.0 - Tolerance::at_cone) * cone.mu[i] * x[0];
      begins[i] = !slides_[i] && size > 0.0 && size >= least;
      if (begins[i]) set_direction(f, rest, i, x[1] / size, x[2] / size);
      more = more || begins[i];
    }
    for (int k = 0; more; ++k) {
      if (!cone.solve()) return false;
      more = false;
      for (int i = 0; i < rest.n_points && k < Tolerance::turns; ++i) {
        const double* s = cone.s + rest.n_single + 3 * i;
        const double size = sqrt(s[1] * s[1] + s[2] * s[2]);
        if (!begins[i] || size <= idle) continue;
        const double* d = given_ + 2 * i;
        if (-(s[1] * d[0] + s[2] * d[1]) >= Tolerance::opposed * size) continue;
        set_direction(f, rest, i, -s[1] / size, -s[2] / size);
        more = true;
      }
    }
    return true;
  }

  // Sets the direction of friction at point i of those at rest, in its tangents.
  void set_direction(F& f, const Rest& rest, int i, double p, double q) {
    slides_[i] = true;
    given_[2 * i] = p;
    given_[2 * i + 1] = q;
    const double force[3] = {0.0, p, q};
    f.contacts.points.in_world(rest.point[i], force, along_[i]);
  }

  // Fills the matrix and the bounds for gathered rows and points.
  void begin(F& f, const int* single, int n_single, const int* point, int n_points) {
    auto& cone = f.contacts.cone;
    const Held& held = f.contacts;
    const double* G = held.rows.G;
    const int all = held.rows.n, n = n_single + 3 * n_points;
    int of[array_size(R)];
    for (int i = 0; i < n_single; ++i) of[i] = single[i];
    for (int i = 0; i < n_points; ++i)
      for (int d = 0; d < 3; ++d) of[n_single + 3 * i + d] = held.rows.first_of(point[i]) + d;
    cone.resize(n_single, n_points);
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) cone.G[i * cone.stride + j] = G[of[i] * all + of[j]];
      const bool both = i < n_single && f.rows.two_sided[single[i]];
      cone.lower[i] = both ? -unbounded : 0.0;
      cone.upper[i] = unbounded;
    }
    for (int i = 0; i < n_points; ++i) {
      slides_[i] = false;
      cone.mu[i] = held.points.in->friction[held.points.at[point[i]].pair];
    }
    cone.slides = slides_;
    cone.along = given_;
  }

  // The impulses with every restitution times `share`, and the energy they remove.
  Status bounce(F& f, double share) {
    auto& cone = f.contacts.cone;
    const Held& held = f.contacts;
    int single[array_size(M)], point[array_size(C)];
    for (int a = 0; a < f.rows.n; ++a) single[a] = a;
    for (int c = 0; c < held.points.n; ++c) point[c] = c;
    begin(f, single, f.rows.n, point, held.points.n);
    const int n = held.rows.n;
    for (int i = 0; i < n; ++i) {
      const double hdot = held.rows.hdot[i];
      cone.b[i] = hdot;
      cone.x[i] = 0.0;
      if (i < f.rows.n && f.rows.row[i] < S && hdot > 0.0)
        cone.b[i] += share * f.winches.restitution[f.rows.row[i]] * hdot;
    }
    for (int c = 0; c < held.points.n; ++c) {
      const double hdot = held.points.hdot[3 * c];
      const double restitution = held.points.in->restitution[held.points.at[c].pair];
      if (hdot > 0.0) cone.b[held.rows.first_of(c)] += share * restitution * hdot;
    }
    double right[array_size(R)];
    for (int i = 0; i < n; ++i) right[i] = cone.b[i];
    if (!cone.solve()) return NOT_SETTLED;
    lost = 0.0;
    double gross = 0.0;
    for (int i = 0; i < n; ++i) {
      const double hdot = held.rows.hdot[i], after = hdot - cone.s[i] - right[i];
      lost += 0.5 * cone.x[i] * (hdot + after);
      gross += fabs(cone.x[i] * hdot);
    }
    if (fabs(lost) < Tolerance::rounding * gross) lost = 0.0;
    return RUNNING;
  }

  // Whether the normal force of sliding point i, whose rows begin at `to`, would not stop it.
  bool jams(const F& f, int i, int to) const {
    const auto& cone = f.contacts.cone;
    const double* row = cone.G + to * (cone.stride + 1);
    const double* d = given_ + 2 * i;
    const double own = row[0] + cone.mu[i] * (row[1] * d[0] + row[2] * d[1]);
    return own <= HeldContactTolerances::least_influence * row[0];
  }

  // Modes from the solution.
  void decode(
      F& f, const Rest& rest, const bool* loose, const bool* strained, const bool* loose_point,
      double scale, Hold* next) {
    const auto& cone = f.contacts.cone;
    Held& held = f.contacts;
    double most = 0.0;
    for (int i = 0; i < rest.n_single + 3 * rest.n_points; ++i) most = fmax(most, fabs(cone.x[i]));
    const double none = Tolerance::no_force * most, idle = Tolerance::at_rest * scale;
    for (int i = 0; i < rest.n_single; ++i) {
      const int r = f.rows.row[rest.single[i]];
      const bool max_of_winch = cone.x[i] >= cone.upper[i] - Tolerance::at_largest * most;
      if (max_of_winch && (strained[r] || cone.s[i] < -idle)) next[r] = SLIPPING;
      else if (f.rows.two_sided[rest.single[i]] || cone.x[i] > (loose[r] ? none : 0.0))
        next[r] = HELD;
      else if (!loose[r] && cone.s[i] <= idle) next[r] = IDLE;
      held.points.tension[r] = cone.x[i];
    }
    bool pushes[array_size(C)];
    for (int c = 0; c < held.points.n; ++c) pushes[c] = false;
    for (int i = 0; i < rest.n_points; ++i) {
      const int c = rest.point[i], k = rest.n_single + 3 * i;
      auto& own = held.points.at[c];
      const double* x = cone.x + k;
      const double* s = cone.s + k;
      held.points.in_world(c, x, own.force);
      own.slow = false;
      if (!(x[0] > (loose_point[c] ? none : 0.0))) {
        const bool stays = s[0] <= idle && !(loose_point[c] && own.mode != PARTED);
        own.mode = stays ? RESTING : PARTED;
        pushes[c] = stays;
        own.moving = false;
        continue;
      }
      pushes[c] = true;
      const double accelerates = sqrt(s[1] * s[1] + s[2] * s[2]);
      if (slides_[i]) {
        own.mode = SLIDING;
        for (int d = 0; d < 3; ++d) own.along[d] = along_[i][d];
      } else if (accelerates > idle || cone.mu[i] == 0.0) {
        own.mode = SLIDING;
        const double size = sqrt(x[1] * x[1] + x[2] * x[2]);
        const double share = size > 0.0 ? 1.0 / size : 0.0;
        const double force[3] = {0.0, share * x[1], share * x[2]};
        held.points.in_world(c, force, own.along);
      } else {
        own.mode = STICKING;
      }
      own.moving = own.mode == SLIDING &&
                   held.points.sliding_speed(c) > Tolerance::sliding_speed * speed_scale(f);
      if (!own.moving) own.since = f.t;
    }
    for (int c = 0; c < held.points.n; ++c)
      if (!pushes[c]) held.points.at[c].mode = PARTED;
  }

  ContactShare<R> share_;
  bool slides_[array_size(C)];
  double given_[2 * array_size(C)];  // directions of sliding points in their tangents
  double along_[array_size(C)][3];   // the same in the world
};

}  // namespace fan
