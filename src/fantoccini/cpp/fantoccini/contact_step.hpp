// Contacts of a time step, solved as one problem with the strings and limits that take part:
//
//   gap/dt + u_n >= 0, complementary to x_n >= 0;   |x_t| <= mu x_n,
//   x_t = -mu x_n u_t/|u_t| where u_t != 0                    (Signorini, Coulomb; cone.hpp)
//
// with u the velocity of the first solid against the second after the step, x the impulse on the
// first. As for strings, solids that overlap part at the recovery speed at most. A new contact with
// restitution e leaves with u_n+ = -e u_n- at least, unless the forces of one step would take the
// rebound back. With friction, or unequal e, that may add energy; all are then scaled down until
// none is added. The problem of each lane is its own, so that no lane's result depends on its
// neighbours.
#pragma once

#include "cone.hpp"
#include "contact_columns.hpp"
#include "contact_points.hpp"
#include "contact_push.hpp"

namespace fan {

template <class Model, class Real>
class ContactStep {
 public:
  static constexpr int C = Model::n_contacts, N = Model::n_vD, S = Model::n_strings;
  static constexpr int M = Model::n_rows, width = Traits<Real>::width;
  using Mask = typename Traits<Real>::Mask;
  using Points = ContactPoints<Model, Real>;
  using Tolerance = ContactStepTolerances;
  using Push = ContactPush;

  int n[width] = {};      // points that push
  Push push[width][room(C)];
  int n_before[width] = {};
  int pair_before[width][room(C)];  // of the points that pushed in the step before
  Real violation, work, impact, friction;  // depth; energies of the step
  double residual[width] = {};  // of the law, in the last step

  bool too_many(int lane) const { return points_.too_many[lane]; }

  // Nothing has touched anything yet.
  FAN_FN void begin(const ContactArrays& in) {
    points_.begin(in);
    for (int l = 0; l < width; ++l) {
      n[l] = n_before[l] = 0;
      points_.too_many[l] = false;
      residual[l] = 0.0;
    }
    points_.most = 0;
  }

  // What pushes now and was at rest has pushed for long; all else has touched nothing yet.
  FAN_FN void take_as_resting() {
    for (int l = 0; l < width; ++l) {
      int kept = 0;
      for (int i = 0; i < n[l]; ++i) {
        if (!push[l][i].rested) continue;
        push[l][kept] = push[l][i];
        push[l][kept++].steps = Tolerance::steps_of_impact + 1;
      }
      n[l] = kept;
    }
  }

  // Finds the points at the start of a step of length dt and their speeds without impulses; eval is
  // that of the step.
  FAN_FN void find(
      const ContactArrays& in, const Evaluation<Model, Real>& eval, const Real* q_D,
      const Real* v_D, const Real* q_K, const Real* v_K, const Real* p, double dt, double whole,
      double recovery_speed, const Mask& idle) {
    in_ = &in;
    points_.find(in, q_D, v_D, q_K, v_K, p, dt, idle);
    violation = work = impact = friction = Real(0.0);
    for (int l = 0; l < width; ++l) {
      chosen_[l] = 0;
      for (int i = 0; i < points_.n[l]; ++i) {
        const double depth = -points_.point[l][i].gap;
        if (depth > lane_of(violation, l)) lane_of(violation, l) = depth;
      }
    }
    if (points_.most == 0) return;
    Real v[room(N)], w[room(N)];
    for (int k = 0; k < N; ++k) w[k] = dt * eval.w0[k];
    eval.back(w, v);
    for (int k = 0; k < N; ++k) v[k] += v_D[k];
    for (int i = 0; i < 3 * points_.most; ++i) {
      x_[i] = Real(0.0);
      b_[i] = before_[i] = rate(i, v);
    }
    for (int l = 0; l < width; ++l) recall(l);
    for (int i = 0; i < points_.most; ++i) {
      hdot_[i] = rate(3 * i, v_D);
      for (int l = 0; l < width; ++l)
        if (i < points_.n[l]) aim(l, i, dt, whole, recovery_speed);
    }
    columns_.begin();
  }

  // Whether any point takes part in lane l.
  bool takes_part(int lane) const { return chosen_[lane] > 0; }

  // Adds the points that would be passed at the velocity v; whether there are any.
  FAN_FN bool watch(const Real* v) {
    bool more = false;
    for (int i = 0; i < points_.most; ++i) {
      const Real now = rate(3 * i, v);
      for (int l = 0; l < width; ++l) {
        if (i >= points_.n[l] || near_[l][i]) continue;
        const double closing =
            lane_of(now, l) + lane_of(b_[3 * i], l) - lane_of(before_[3 * i], l);
        if (!(closing > Tolerance::passing_speed)) continue;
        near_[l][i] = more = true;
        ++chosen_[l];
      }
    }
    return more;
  }

  // Solves for the impulses of the points and of the gathered rows that take part, in the lanes in
  // which points do; the rows' problem holds their bounds, and then their impulses x and s. near
  // tells which rows take part. `guess` (n_rows) are impulses of the rows to begin with, `before`
  // is the gathered rows' hdot after the step without impulses.
  FAN_FN void settle(
      const Evaluation<Model, Real>& eval, RowSystem<Model, Real>& rows, const Mask* near,
      const Real* guess, const Real* before, double cap, Mask& settled) {
    make_columns(eval, rows);
    Real found[room(M)], s[room(M)], of_lane = Real(0.0), well = Real(0.0);
    for (int a = 0; a < rows.n; ++a) {
      found[a] = rows.problem.x[a];
      s[a] = rows.problem.s[a];
    }
    for (int l = 0; l < width; ++l) {
      if (chosen_[l] == 0) continue;
      lane_of(of_lane, l) = 1.0;
      if (bounce(l, rows, near, guess, before, cap, found, s)) lane_of(well, l) = 1.0;
    }
    const Mask here = of_lane > Real(0.5);
    settled = (settled && !here) || (here && well > Real(0.5));
    auto& problem = rows.problem;
    for (int a = 0; a < rows.n; ++a) {
      problem.x[a] = select(here, found[a], problem.x[a]);
      problem.s[a] = select(here, s[a], problem.s[a]);
      problem.high[a] = (problem.high[a] && !here) || (here && !(found[a] < problem.upper[a]));
    }
  }

  // w <- w - W x over the points.
  FAN_FN void add(Real* w) const {
    for (int i = 0; i < 3 * points_.most; ++i) {
      if (!any(x_[i] != Real(0.0))) continue;
      columns_.take(i, x_[i], points_.moved[i / 3], w);
    }
  }

  // What the impulses take from hdot of gathered row a.
  FAN_FN Real rate_by_impulses(int a) const {
    Real sum = Real(0.0);
    for (int i = 0; i < 3 * points_.most; ++i)
      if (any(x_[i] != Real(0.0))) sum += columns_.across[i][a] * x_[i];
    return sum;
  }

  // The energies of the step, and what pushes at its end. Returns 1 in lanes with an impact, else
  // 0.
  FAN_FN Real account() {
    Real struck = Real(0.0);
    for (int l = 0; l < width; ++l) {
      n_before[l] = n[l];
      for (int i = 0; i < n[l]; ++i) pair_before[l][i] = push[l][i].pair;
      int pushes = 0;
      Push now[room(C)];
      for (int i = 0; i < points_.n[l]; ++i)
        if (lane_of(x_[3 * i], l) > 0.0) {
          now[pushes] = pushing(l, i);
          const bool strikes = now[pushes++].steps <= Tolerance::steps_of_impact;
          if (strikes) lane_of(struck, l) = 1.0;
          book(l, i, strikes);
        }
      for (int i = 0; i < pushes; ++i) push[l][i] = now[i];
      n[l] = pushes;
    }
    return struck;
  }

 private:
  // hdot of row i at the velocity v.
  FAN_FN Real rate(int i, const Real* v) const {
    return points_.rate_K[i] + points_.moved[i / 3].along(points_.row[i], v);
  }

  // What the normal impulse of a point must take away: the speed at which it closes without
  // impulses, and the gap over the step, or the rebound.
  FAN_FN void aim(int l, int i, double dt, double whole, double recovery_speed) {
    const double h = -points_.point[l][i].gap, before = lane_of(before_[3 * i], l);
    const double hdot = lane_of(hdot_[i], l);
    const double back = h / (h > 0.0 && whole > dt ? whole : dt);
    const double parting = back < recovery_speed ? back : recovery_speed;
    const double rebound = in_->restitution[points_.point[l][i].pair] * hdot;
    const bool new_one = steps_[l][i] == 0 && before + parting > 0.0;
    const bool bounces = new_one && rebound > parting && rebound > before - hdot;
    rebound_[l][i] = bounces ? rebound : 0.0;
    parting_[l][i] = parting;
    bounces_[l] = bounces_[l] || bounces;
    lane_of(b_[3 * i], l) = before + (bounces ? rebound : parting);
    near_[l][i] = near_[l][i] || lane_of(b_[3 * i], l) > 0.0;
    chosen_[l] += near_[l][i];
  }

  // Finds the points of a lane that pushed in the step before, with their impulses as the first
  // guess; they take part.
  FAN_FN void recall(int l) {
    bounces_[l] = false;
    scale_[l] = 1.0;
    int j = 0;
    for (int i = 0; i < points_.n[l]; ++i) {
      const auto& p = points_.point[l][i];
      while (j < n[l] && earlier(push[l][j], p)) ++j;
      const bool pushed = j < n[l] && push[l][j].pair == p.pair && push[l][j].feature == p.feature;
      steps_[l][i] = pushed ? push[l][j].steps : 0;
      near_[l][i] = pushed;
      if (!pushed) continue;
      for (int d = 0; d < 3; ++d)
        lane_of(x_[3 * i + d], l) = dot3(p.frame + 3 * d, push[l][j].impulse);
    }
  }

  template <class Other>
  FAN_FN static bool earlier(const Push& a, const Other& b) {
    return a.pair < b.pair || (a.pair == b.pair && a.feature < b.feature);
  }

  // The columns of the points that take part in some lane.
  FAN_FN void make_columns(
      const Evaluation<Model, Real>& eval, const RowSystem<Model, Real>& rows) {
    bool some[room(C)];
    for (int i = 0; i < points_.most; ++i) {
      some[i] = false;
      for (int l = 0; l < width; ++l) some[i] = some[i] || (i < points_.n[l] && near_[l][i]);
    }
    columns_.make(eval, rows, points_.row, points_.moved, some, points_.most);
  }

  // Solves lane l with the restitutions, scaled down until they add no energy.
  FAN_FN bool bounce(
      int l, const RowSystem<Model, Real>& rows, const Mask* near, const Real* guess,
      const Real* before, double cap, Real* found, Real* s) {
    bool solved = solve(l, rows, near, guess, cap, found, s);
    for (int k = 1; bounces_[l] && k <= Tolerance::tries && adds(l, rows, before, found); ++k) {
      scale_[l] *= k < Tolerance::tries ? Tolerance::less_restitution : 0.0;
      for (int i = 0; i < points_.n[l]; ++i) {
        const double back = scale_[l] * rebound_[l][i], parting = parting_[l][i];
        lane_of(b_[3 * i], l) = lane_of(before_[3 * i], l) + (back > parting ? back : parting);
      }
      solved = solve(l, rows, near, guess, cap, found, s);
    }
    return solved;
  }

  // Whether the impulses of lane l add energy, apart from what driven solids do:
  //   sum of x . (before - A_K v_K - G x / 2) < 0,   G x the change of hdot
  FAN_FN bool adds(
      int l, const RowSystem<Model, Real>& rows, const Real* before, const Real* found) const {
    constexpr int stride = Complementarity<Real, M>::N;
    double lost = 0.0, exchanged = 0.0;
    const auto add = [&](double x, double own) {
      lost += x * own;
      exchanged += fabs(x * own);
    };
    for (int a = 0; a < rows.n; ++a) {
      double change = 0.0;
      for (int b = 0; b < rows.n; ++b)
        change += lane_of(rows.problem.G[a * stride + b], l) * lane_of(found[b], l);
      for (int d = 0; d < 3 * points_.n[l]; ++d)
        if (near_[l][d / 3]) change += 2.0 * lane_of(columns_.across[d][a], l) * lane_of(x_[d], l);
      add(lane_of(found[a], l), lane_of(before[a], l) - lane_of(rows.hdot_K[a], l) - 0.5 * change);
    }
    for (int d = 0; d < 3 * points_.n[l]; ++d) {
      if (!near_[l][d / 3]) continue;
      double change = 0.0;
      for (int e = 0; e < 3 * points_.n[l]; ++e)
        if (near_[l][e / 3]) change += lane_of(columns_.G(d, e), l) * lane_of(x_[e], l);
      add(lane_of(x_[d], l),
          lane_of(before_[d], l) - lane_of(points_.rate_K[d], l) - 0.5 * change);
    }
    return lost < -Tolerance::rounding * exchanged;
  }

  // Solves lane l.
  FAN_FN bool solve(
      int l, const RowSystem<Model, Real>& rows, const Mask* near, const Real* guess, double cap,
      Real* found, Real* s) {
    int single[room(M)], triple[room(C)], n_single = 0, n_triple = 0;
    for (int a = 0; a < rows.n; ++a)
      if (lane_of(near[rows.row[a]], l)) single[n_single++] = a;
    for (int i = 0; i < points_.n[l]; ++i)
      if (near_[l][i]) triple[n_triple++] = i;
    auto& problem = cone_;
    problem.n_single = n_single;
    problem.n_contacts = n_triple;
    const int size = n_single + 3 * n_triple;
    constexpr int stride = Complementarity<Real, M>::N;
    const auto& from = rows.problem;
    for (int i = 0; i < n_single; ++i) {
      const int a = single[i];
      for (int j = 0; j < n_single; ++j)
        problem.G[i * size + j] = lane_of(from.G[a * stride + single[j]], l);
      problem.b[i] = lane_of(from.b[a], l);
      problem.lower[i] = lane_of(from.lower[a], l);
      problem.upper[i] = lane_of(from.upper[a], l);
      problem.x[i] = lane_of(guess[rows.row[a]], l);
    }
    for (int i = 0; i < n_triple; ++i) {
      problem.mu[i] = in_->friction[points_.point[l][triple[i]].pair];
      for (int d = 0; d < 3; ++d) {
        const int to = n_single + 3 * i + d, own = 3 * triple[i] + d;
        for (int j = 0; j < n_single; ++j)
          problem.G[to * size + j] = problem.G[j * size + to] = lane_of(columns_.across[own][single[j]], l);
        for (int j = 0; j <= i; ++j)
          for (int e = 0; e < 3 && (j < i || e <= d); ++e) {
            const int at = n_single + 3 * j + e;
            problem.G[to * size + at] = problem.G[at * size + to] =
                lane_of(columns_.G(own, 3 * triple[j] + e), l);
          }
        problem.b[to] = lane_of(b_[own], l);
        problem.x[to] = lane_of(x_[own], l);
        problem.lower[to] = d == 0 ? 0.0 : -cap;
        problem.upper[to] = cap;
      }
    }
    bool solved = problem.solve();
    for (const double share : Tolerance::softness)
      if (!solved && problem.residual > Tolerance::accepted_residual)
        solved = problem.solve_softly(share) && problem.residual <= Tolerance::accepted_residual;
    residual[l] = problem.residual;
    for (int a = 0; a < rows.n; ++a) {
      lane_of(found[a], l) = 0.0;
      lane_of(s[a], l) = -lane_of(from.b[a], l);
    }
    for (int i = 0; i < n_single; ++i) {
      lane_of(found[single[i]], l) = problem.x[i];
      lane_of(s[single[i]], l) = problem.s[i];
    }
    for (int i = 0; i < n_triple; ++i)
      for (int d = 0; d < 3; ++d) {
        lane_of(x_[3 * triple[i] + d], l) = problem.x[n_single + 3 * i + d];
        lane_of(s_[3 * triple[i] + d], l) = problem.s[n_single + 3 * i + d];
      }
    return solved || residual[l] <= Tolerance::accepted_residual;
  }

  // Point i of lane l as it pushes.
  FAN_FN Push pushing(int l, int i) const {
    const auto& from = points_.point[l][i];
    Push out;
    out.pair = from.pair;
    out.feature = from.feature;
    out.steps = steps_[l][i] + (steps_[l][i] <= Tolerance::steps_of_impact);
    const double hdot = lane_of(hdot_[i], l), by_forces = lane_of(before_[3 * i], l) - hdot;
    out.rested = hdot <= (by_forces > Tolerance::passing_speed ? by_forces : Tolerance::passing_speed);
    out.gap = from.gap;
    for (int c = 0; c < 3; ++c) {
      out.at[c] = from.at[c];
      out.normal[c] = from.frame[c];
      out.impulse[c] = out.velocity[c] = 0.0;
      for (int d = 0; d < 3; ++d) {
        out.impulse[c] += lane_of(x_[3 * i + d], l) * from.frame[3 * d + c];
        out.velocity[c] -= after(l, 3 * i + d) * from.frame[3 * d + c];
      }
    }
    return out;
  }

  // hdot of row i after the step.
  FAN_FN double after(int l, int i) const {
    return lane_of(before_[i], l) - lane_of(s_[i], l) - lane_of(b_[i], l);
  }

  // Adds the energies of point i: an impact takes what its impulse takes at the mean velocity, of
  // the friction of other points counts what it takes at the velocity after the step.
  FAN_FN void book(int l, int i, bool strikes) {
    for (int d = 3 * i; d < 3 * i + 3; ++d) {
      const double x = lane_of(x_[d], l), end = after(l, d);
      lane_of(work, l) += x * lane_of(points_.rate_K[d], l);
      if (strikes) lane_of(impact, l) += 0.5 * x * (lane_of(before_[d], l) + end);
      else if (d != 3 * i) lane_of(friction, l) += x * end;
    }
  }

  Points points_;
  const ContactArrays* in_ = nullptr;
  int steps_[width][room(C)];      // for which a point has pushed
  bool near_[width][room(C)];      // whether a point takes part
  // m/s: e u_n- of new contacts, 0 of others; how fast solids part without it.
  double rebound_[width][room(C)], parting_[width][room(C)];
  bool bounces_[width];            // whether any contact bounces
  double scale_[width];            // of the restitutions of the step
  int chosen_[width] = {};         // how many do
  Real x_[room(3 * C)], s_[room(3 * C)], b_[room(3 * C)];
  Real before_[room(3 * C)];       // hdot after the step without impulses
  Real hdot_[room(C)];             // of the normals, at its start
  ContactColumns<Model, Real> columns_;
  ConeProblem<M + 3 * C> cone_;
};

}  // namespace fan
