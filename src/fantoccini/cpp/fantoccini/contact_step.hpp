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

#include "contact_aims.hpp"
#include "contact_share.hpp"

FAN_LOOPS_BEGIN

namespace fan {

template <class Model, class Real>
class ContactStep : public ContactAims<Model, Real> {
  using Problem = ContactProblem<Model, Real>;
  using Aims = ContactAims<Model, Real>;

 public:
  using Problem::C, Problem::N, Problem::M, Problem::width, Problem::residual;
  using typename Problem::Mask, typename Problem::Tolerance;
  using typename Aims::Push;
  using Aims::n, Aims::push;

  Real violation, work, impact, friction;  // depth; energies of the step

  bool too_many(int lane) const { return points_.too_many[lane]; }

  // Nothing has touched anything yet.
  FAN_FN void begin(const ContactArrays& in) {
    points_.begin(in);
    for (int l = 0; l < width; ++l) {
      n[l] = 0;
      points_.too_many[l] = false;
    }
    points_.most = 0;
  }

  template <class Memory>
  FAN_FN void remember(Memory& memory) {
    memory.keep_of_lanes(n);
    memory.keep_of_lanes(push);
    memory.keep_of_lanes(points_.too_many);
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
    points_.find(in, q_D, v_D, q_K, v_K, p, dt, idle, [&](int l) { recognise(l); });
    violation = work = impact = friction = residual = Real(0.0);
    for (int l = 0; l < width; ++l) {
      chosen_[l] = 0;
      for (int i = 0; i < points_.n[l]; ++i) {
        if (!points_.has(l, i)) continue;
        const double depth = -points_.point[l][i].gap;
        if (depth > lane_of(violation, l)) lane_of(violation, l) = depth;
      }
    }
    for (int r = 0; r < M; ++r) row_x_[r] = row_s_[r] = Real(0.0);
    columns_.begin();
    looks_ = 0;
    for (int l = 0; l < width; ++l) {
      for (int r = 0; r < M; ++r) pulls_[l][r] = false;
      bounces_[l] = false;
      scale_[l] = 1.0;
      solved_with_[l] = 0;
    }
    if (points_.most == 0) return;
    Real v[room(N)];
    unhindered(eval, v_D, dt, v);
    for (int i = 0; i < points_.most; ++i) {
      const Triple<Real> now = rates(i, v);
      for (int d = 0; d < 3; ++d) {
        x_[3 * i + d] = Real(0.0);
        b_[3 * i + d] = before_[3 * i + d] = now[d];
      }
    }
    for (int l = 0; l < width; ++l) recall(l);
    for (int i = 0; i < points_.most; ++i) {
      const Triple<Real> start = rates(i, v_D);
      for (int d = 0; d < 3; ++d) hdot_[3 * i + d] = start[d];
      if constexpr (width > 1) aim_lanes(i, dt, whole, recovery_speed);
      else aim(0, i, dt, whole, recovery_speed);
    }
  }

  // Looks again where impulses have made links faster, by acc over the step from v_D, than the
  // margins of find() allow for, and adds the points that would be passed; whether there are any.
  FAN_FN bool look_again(
      const Evaluation<Model, Real>& eval, const Real* v_D, const Real* acc, const Real* v_K,
      double dt, double whole, double recovery_speed, const Mask& idle) {
    const Mask lanes = !idle && points_.outruns(acc, dt);
    if (!any(lanes) || looks_ == Tolerance::looks) return false;
    ++looks_;
    Real v[room(N)];
    int known[width];
    const int most = points_.most;
    for (int l = 0; l < width; ++l) known[l] = points_.n[l];
    for (int k = 0; k < N; ++k) v[k] = v_D[k] + acc[k];
    if (!points_.find_more(*in_, v, v_K, dt, lanes)) return false;
    for (int i = 3 * most; i < 3 * points_.most; ++i) x_[i] = Real(0.0);
    unhindered(eval, v_D, dt, v);
    for (int l = 0; l < width; ++l)
      for (int i = known[l]; i < points_.n[l]; ++i) {
        columns_.renew(i);
        const Triple<Real> now = rates(i, v);
        for (int d = 0; d < 3; ++d)
          lane_of(b_[3 * i + d], l) = lane_of(before_[3 * i + d], l) = lane_of(now[d], l);
        const Triple<Real> start = rates(i, v_D);
        for (int d = 0; d < 3; ++d) lane_of(hdot_[3 * i + d], l) = lane_of(start[d], l);
        steps_[l][i] = 0;
        near_[l][i] = true;
        is_carried_[l][i] = false;
        aim(l, i, dt, whole, recovery_speed);
      }
    return true;
  }

  // Whether points take part in all lanes but these.
  FAN_FN bool take_part(const Mask& idle) const {
    for (int l = 0; l < width; ++l)
      if (chosen_[l] == 0 && !lane_of(idle, l)) return false;
    return true;
  }

  // Adds the points that would be passed at the velocity v; whether there are any.
  FAN_FN bool watch(const Real* v) {
    bool more = false;
    for (int i = 0; i < points_.most; ++i) {
      const Real now = rates(i, v)[0];
      for (int l = 0; l < width; ++l) {
        if (!points_.has(l, i) || near_[l][i]) continue;
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
  // tells which rows take part; a lane to which none were added since keeps its solution. `guess` (n_rows) are impulses of the rows to begin with, `before`
  // is the gathered rows' hdot after the step without impulses.
  FAN_FN void settle(
      const Evaluation<Model, Real>& eval, RowSystem<Model, Real>& rows, const Mask* near,
      Real* guess, const Real* before, double cap, Mask& settled) {
    this->make_columns(eval, rows, near, guess);
    Real found[room(M)], s[room(M)], of_lane = Real(0.0), well = Real(0.0);
    int taking_part[width];
    Real to_solve = Real(0.0), n_near = Real(0.0);
    for (int r = 0; r < M; ++r) n_near += select(near[r], Real(1.0), Real(0.0));
    for (int l = 0; l < width; ++l) {
      taking_part[l] = chosen_[l] + int(lane_of(n_near, l));
      if (chosen_[l] != 0 && taking_part[l] != solved_with_[l] && !bounces_[l])
        lane_of(to_solve, l) = 1.0;
    }
    const Mask tried = to_solve > Real(width > 1 ? 0.5 : 2.0);
    Mask together = tried;
    if constexpr (width > 1)
      if (any(tried))
        together = this->solve_together(together, rows, near, guess, cap, found, s);
    for (int l = 0; l < width; ++l) {
      if (chosen_[l] == 0) continue;
      if (taking_part[l] != solved_with_[l]) {
        solved_with_[l] = taking_part[l];
        cone_.is_hard = lane_of(tried, l);
        well_[l] = (width > 1 && lane_of(together, l)) ||
                   this->bounce(l, rows, near, guess, before, cap, found, s);
        for (int a = 0; a < rows.n; ++a) {
          lane_of(row_x_[rows.row[a]], l) = lane_of(found[a], l);
          lane_of(row_s_[rows.row[a]], l) = lane_of(s[a], l);
        }
      }
      lane_of(of_lane, l) = 1.0;
      if (well_[l]) lane_of(well, l) = 1.0;
    }
    const Mask here = of_lane > Real(0.5);
    settled = (settled && !here) || (here && well > Real(0.5));
    auto& problem = rows.problem;
    for (int a = 0; a < rows.n; ++a) {
      const Real x = row_x_[rows.row[a]];
      problem.x[a] = select(here, x, problem.x[a]);
      problem.s[a] = select(here, row_s_[rows.row[a]], problem.s[a]);
      problem.high[a] = (problem.high[a] && !here) || (here && !(x < problem.upper[a] * (1.0 - Tolerance::at_bound)));
    }
  }

  // w <- w - W x over the points.
  FAN_FN void add(Real* w) const {
    for (int i = 0; i < points_.most; ++i)
      if (pushes(i)) columns_.take(i, x_ + 3 * i, points_.moved[i], w);
  }

  // What the impulses take from hdot of gathered row a.
  FAN_FN Real rate_by_impulses(int a) const {
    Real sum = Real(0.0);
    for (int i = 0; i < points_.most; ++i) {
      if (!pushes(i)) continue;
      const Triple<Real>& by = columns_.across[i][a];
      sum += by[0] * x_[3 * i] + by[1] * x_[3 * i + 1] + by[2] * x_[3 * i + 2];
    }
    return sum;
  }

  // The energies of the step, and what pushes at its end. Returns 1 in lanes with an impact, else
  // 0.
  FAN_FN Real account() {
    Real struck = Real(0.0);
    for (int l = 0; l < width; ++l)
      for (int i = 0; i < points_.n[l]; ++i)
        if (lane_of(x_[3 * i], l) > 0.0 && strikes(l, i)) lane_of(struck, l) = 1.0;
    for (int l = 0; l < width; ++l) {
      int pushes = 0;
      Push now[room(C)];
      for (int i = 0; i < points_.n[l]; ++i)
        if (lane_of(x_[3 * i], l) > 0.0) {
          const double x[3] = {
              lane_of(x_[3 * i], l), lane_of(x_[3 * i + 1], l), lane_of(x_[3 * i + 2], l)};
          const Push made = pushing(l, i, x);
          int place = pushes++;
          for (; place > 0 && earlier(made, now[place - 1]); --place) now[place] = now[place - 1];
          now[place] = made;
          if (lane_of(struck, l) > 0.5) book_impact(l, i);
          else book_friction(l, i);
        }
      for (int i = 0; i < pushes; ++i) push[l][i] = now[i];
      n[l] = pushes;
    }
    return struck;
  }

  // What pushes at the end of the step as it is reported: where points share what they carry, the
  // impulses of least norm. Of one trajectory, not of lanes. Returns how many there are.
  int shared(
      const Evaluation<Model, Real>& eval, const RowSystem<Model, Real>& rows,
      ContactShare<M + 3 * C>& share, Push* out) {
    static_assert(width == 1);
    int found = 0, n_out = 0;
    for (int i = 0; i < points_.n[0]; ++i) found += lane_of(x_[3 * i], 0) > 0.0;
    if (chosen_[0] == 0 || found != n[0]) {
      for (int i = 0; i < n[0]; ++i) out[i] = push[0][i];
      return n[0];
    }
    this->take_all(eval, rows);
    for (int g = 0; g < groups_.n; ++g) {
      this->choose(g);
      if (n_triple_ == 0) continue;
      this->write(0, rows);
      for (int i = 0; i < n_single_; ++i) cone_.x[i] = lane_of(rows.problem.x[single_[i]], 0);
      for (int k = 0; k < n_triple_; ++k)
        for (int d = 0; d < 3; ++d)
          cone_.x[n_single_ + 3 * k + d] = lane_of(x_[3 * triple_[k] + d], 0);
      cone_.find_s();
      double x[room(3 * C)];
      share.find(cone_, x);
      for (int k = 0; k < n_triple_; ++k) {
        if (!(x[3 * k] > 0.0)) continue;
        const Push made = pushing(0, triple_[k], x + 3 * k);
        int place = n_out++;
        for (; place > 0 && earlier(made, out[place - 1]); --place) out[place] = out[place - 1];
        out[place] = made;
      }
    }
    return n_out;
  }

 private:
  using Problem::cone_, Problem::groups_, Problem::n_single_, Problem::single_, Problem::triple_, Problem::n_triple_;
  using Problem::points_, Problem::columns_, Problem::in_, Problem::near_, Problem::chosen_;
  using Problem::pulls_;
  using Problem::x_, Problem::s_, Problem::b_, Problem::before_, Problem::rebound_;
  using Problem::parting_, Problem::bounces_, Problem::scale_;
  using Aims::steps_, Aims::is_carried_, Aims::hdot_, Aims::aim, Aims::aim_lanes, Aims::earlier;
  using Aims::recall, Aims::recognise;

  // The velocities after the step without impulses.
  FAN_FN static void unhindered(
      const Evaluation<Model, Real>& eval, const Real* v_D, double dt, Real* v) {
    Real w[room(N)];
    for (int k = 0; k < N; ++k) w[k] = dt * eval.w0[k];
    eval.back(w, v);
    for (int k = 0; k < N; ++k) v[k] += v_D[k];
  }

  // hdot of the rows of point i at the velocity v.
  FAN_FN Triple<Real> rates(int i, const Real* v) const {
    Triple<Real> out = points_.moved[i].along(points_.row[i], v);
    out.add(Real(1.0), points_.rate_K[i]);
    return out;
  }

  // Whether point i has an impulse in some lane.
  FAN_FN bool pushes(int i) const {
    const Real* x = x_ + 3 * i;
    return any(x[0] != Real(0.0) || x[1] != Real(0.0) || x[2] != Real(0.0));
  }

  // Point i of lane l as it pushes with the impulse x.
  FAN_FN Push pushing(int l, int i, const double* x) const {
    const auto& from = points_.point[l][i];
    Push out;
    out.pair = from.pair;
    out.feature = from.feature;
    out.steps = closes(l, i) ? 1 : steps_[l][i] + (steps_[l][i] <= Tolerance::steps_of_impact);
    out.rested = rested(l, i);
    out.gap = from.gap;
    for (int c = 0; c < 3; ++c) {
      out.at[c] = from.at[c];
      out.normal[c] = from.frame[c];
      out.impulse[c] = out.velocity[c] = 0.0;
      for (int d = 0; d < 3; ++d) {
        out.impulse[c] += x[d] * from.frame[3 * d + c];
        out.velocity[c] -= after(l, 3 * i + d) * from.frame[3 * d + c];
      }
    }
    return out;
  }

  // hdot of row i after the step.
  FAN_FN double after(int l, int i) const {
    return lane_of(before_[i], l) - lane_of(s_[i], l) - lane_of(b_[i], l);
  }

  // Whether the forces of one step alone have closed point i as fast as it closes at the start.
  FAN_FN bool rested(int l, int i) const {
    const double hdot = lane_of(hdot_[3 * i], l), by_forces = lane_of(before_[3 * i], l) - hdot;
    return hdot <= (by_forces > Tolerance::passing_speed ? by_forces : Tolerance::passing_speed);
  }

  // Whether point i is part of an impact. A corner on which a body that rests comes to stand is not.
  FAN_FN bool strikes(int l, int i) const {
    return (steps_[l][i] < Tolerance::steps_of_impact && !rested(l, i)) || closes(l, i);
  }

  // Whether point i, if it pushes, ends the step as fast as closes its gap.
  FAN_FN bool closes(int l, int i) const { return -parting_[l][i] > Tolerance::closing_speed; }

  // Adds what the friction of point i takes, at the velocity after the step.
  FAN_FN void book_friction(int l, int i) {
    for (int d = 3 * i; d < 3 * i + 3; ++d) {
      const double x = lane_of(x_[d], l);
      lane_of(work, l) += x * lane_of(points_.rate_K[i][d - 3 * i], l);
      if (d != 3 * i) lane_of(friction, l) += x * after(l, d);
    }
  }

  // The same in a step with an impact, whose impulses also act where solids rest: each takes what it
  // takes at the mean of the velocities before and after the step.
  FAN_FN void book_impact(int l, int i) {
    for (int d = 3 * i; d < 3 * i + 3; ++d) {
      const double x = lane_of(x_[d], l), end = after(l, d);
      const double rubs = d == 3 * i || strikes(l, i) ? 0.0 : x * end;
      lane_of(work, l) += x * lane_of(points_.rate_K[i][d - 3 * i], l);
      lane_of(friction, l) += rubs;
      lane_of(impact, l) += 0.5 * x * (lane_of(hdot_[d], l) + end) - rubs;
    }
  }

  int looks_ = 0;                  // how often was looked again
  // Of each lane's last solve in the step: how many rows and points took part, whether it went well;
  // impulses and s of the rows.
  int solved_with_[width];
  bool well_[width];
  Real row_x_[room(M)], row_s_[room(M)];
};

}  // namespace fan

FAN_LOOPS_END
