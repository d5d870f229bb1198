// Contacts of a completed time step: each point that pushes in its mode, the derivatives of its
// position, and conditions on the edge between two modes.
//
//   u_n+ >= w,  w = min(-gap/dt, recovery speed) or -e u_n of a new contact that rebounds
//
// at the start, or at the touch of a rebounding point, where a landing has the rest of dt. The
// derivative of a mode is that of the step where the law holds strictly: points that push have a
// force, sticking ones stay inside their cone, open ones open.
#pragma once

#include "fantoccini/collision/differences.hpp"
#include "fantoccini/derivatives/step_delay.hpp"
#include "fantoccini/math/least_span.hpp"
#include "fantoccini/timestepping/trajectory.hpp"

namespace fan {

struct StepModeTolerances {
  static constexpr double speed = 1e-8;   // rounding, relative to 1 m/s or the largest speed
  static constexpr double force = 1e-8;   // rounding, relative to the weight
  static constexpr double cone = 1e-6;    // margin of a sticking point, relative to its cone
  static constexpr double gap = 1e-12;    // m: accuracy of gaps
  static constexpr double askew = 1e-6;   // angle between directions of sliding that count as equal
  static constexpr double margin = 1e-3;  // m: largest gap of points with derivatives
  static constexpr double spare = 1.5;  // likewise, relative to the gaps that close within the step
  static constexpr double by_p = 1e-3;  // step of parameters, relative to 1 or to them
};

template <class Model>
class StepModes {
 public:
  static constexpr int N = Model::n_vD, K = Model::n_vK, P = Model::n_p, M = Model::n_rows;
  static constexpr int C = Model::n_contacts, L = Model::n_links, E = N + K;
  using Trajectory = TimeSteppingTrajectory<Model, double>;

  int edges = 0;              // edges of the last step
  int pair = -1;              // of the point with the largest `edges`; -1 for none
  int* pair_edges = nullptr;  // of every pair: added to, unless null

  // Start of a step, its rate dq_K/dt and the parameters, all of which must outlive this object,
  // and the time for which it continues before any rebound.
  void begin(
      const double* q_D, const double* v_D, const double* q_K, const double* rate, const double* p,
      double delay) {
    delay_.begin(q_D, v_D, q_K, rate, delay);
    q_D_ = delay_.q_D();
    v_D_ = v_D;
    q_K_ = delay_.q_K();
    rate_ = rate;
    p_ = p;
  }

  // Finds the points that push in the step of `run`, for which begin() was called; at most C.
  // Returns their number.
  int find(Trajectory& run, double reference_force, StepContact* out) {
    solids_ = run.opt.contacts;
    dt_ = run.opt.dt;
    recovery_speed_ = run.opt.recovery_speed;
    reference_force_ = reference_force;
    edges = 0;
    pair = -1;
    const int n = run.at.contacts.shared(run.at.eval, run.at.rows, share_, push_);
    pose(p_, poses_, screws_);
    before_.make(screws_, v_D_, rate_);
    after_.make(screws_, run.state().v_D, rate_);
    still_ = Tolerance::speed * fmax(1.0, fmax(before_.fastest(), after_.fastest()));
    run.at.eval.solve_factor(run.at.eval.w0, free_acc_);
    double reach = 0.0;
    for (int k = 0; k < n; ++k) reach = fmax(reach, push_[k].gap);
    const double margin = fmax(Tolerance::margin, Tolerance::spare * reach);
    for (int k = 0; k < n; ++k) {
      if (k == 0 || push_[k].pair != push_[k - 1].pair)
        differences_.take(*solids_, push_[k].pair, poses_, margin);
      note(hold(push_[k], out[k]), push_[k].pair);
    }
    check_open_points(run.at.contacts.candidates(), n, out);
    if (run.at.touching.parts && n > 0) note(LAW_CHANGED, out[0].pair);
    int n_first = 0;
    for (int k = 0; k < n; ++k) n_first += out[k].bounces > 0.0 && out[k].gap > -Tolerance::gap;
    // After a small change another one touches first, or before the step.
    const bool is_edge = delay_.time > 0.0 ? n_first > 1 : n_first > 0;
    if (is_edge) note(REBOUND_BEGINS, out[first_touch(out, n)].pair);
    return n;
  }

  // The screws (E, 6) at the start, and, of puppets with parameters, twists of the links and
  // changes of the screws (L + E, 6, P) by these.
  void screws(double* out, double* by_p) {
    pose(p_, poses_, out);
    if (P > 0) differ_by_parameters(by_p);
  }

 private:
  using Tolerance = StepModeTolerances;

  // What is left of the step at the touch [s].
  double left() const { return fmax(dt_ - delay_.time, TouchingStepTolerances::least_left * dt_); }

  void note(int more, int of_pair) {
    if (more > edges) pair = of_pair;
    edges |= more;
    if (pair_edges) pair_edges[of_pair] |= more;
  }

  void pose(const double* p, double* poses, double* screws) const {
    struct {
      double *poses, *screw_D, *screw_K;
    } to{poses, screws, screws + 6 * N};
    Call<Model, double>::screws(q_D_, q_K_, p, to);
  }

  // Twists of the links and changes of the screws, by sixth-order central differences.
  void differ_by_parameters(double* out) {
    constexpr double weights[3] = {45.0 / 60, -9.0 / 60, 1.0 / 60};
    double p[array_size(P)];
    for (int k = 0; k < P; ++k) p[k] = p_[k];
    for (int k = 0; k < P; ++k) {
      const double step = Tolerance::by_p * fmax(1.0, fabs(p_[k]));
      for (int j = 0; j < 12 * L + 6 * E; ++j) change_[j] = 0.0;
      for (int o = 1; o <= 3; ++o) {
        p[k] = p_[k] + o * step;
        pose(p, high_, high_ + 12 * L);
        p[k] = p_[k] - o * step;
        pose(p, low_, low_ + 12 * L);
        for (int j = 0; j < 12 * L + 6 * E; ++j)
          change_[j] += weights[o - 1] / step * (high_[j] - low_[j]);
      }
      p[k] = p_[k];
      for (int i = 0; i < L; ++i) {
        const double *R = poses_ + 12 * i, *dR = change_ + 12 * i, *r = R + 9, *dr = dR + 9;
        const auto turn = [&](int a, int b) {  // of dR R^T
          return dR[a] * R[b] + dR[3 + a] * R[3 + b] + dR[6 + a] * R[6 + b];
        };
        const double w[3] = {turn(2, 1), turn(0, 2), turn(1, 0)};
        double carried[3];
        cross(w, r, carried);
        for (int c = 0; c < 3; ++c) {
          out[(6 * i + c) * P + k] = dr[c] - carried[c];
          out[(6 * i + 3 + c) * P + k] = w[c];
        }
      }
      for (int j = 0; j < 6 * E; ++j) out[(6 * L + j) * P + k] = change_[12 * L + j];
    }
  }

  // Loads a point that pushes. Returns the edges it is on.
  int hold(const ContactPush& push, StepContact& out) {
    const ContactArrays& solids = *solids_;
    int edges = 0;
    out.pair = push.pair;
    out.feature = push.feature;
    for (int side = 0; side < 2; ++side)
      out.links[side] = solids.solids[solids.pairs[2 * push.pair + side]].link;
    out.friction = solids.friction[push.pair];
    out.gap = push.gap;
    double across[3], pulled[3];
    for (int c = 0; c < 3; ++c) {
      out.at[c] = push.at[c];
      out.normal[c] = push.normal[c];
      out.force[c] = push.impulse[c] / dt_;
      out.velocity[c] = push.velocity[c];
      out.along[c] = 0.0;
    }
    const double* n = out.normal;
    const double u_n = dot3(n, out.velocity), f_n = dot3(n, out.force);
    for (int c = 0; c < 3; ++c) {
      across[c] = out.velocity[c] - n[c] * u_n;
      pulled[c] = out.force[c] - n[c] * f_n;
    }
    const double speed = sqrt(dot3(across, across));
    out.turns = out.friction > 0.0 && speed > still_;
    out.sticks = out.friction > 0.0 && !out.turns;
    for (int c = 0; c < 3 && out.turns; ++c) out.along[c] = across[c] / speed;
    if (out.sticks && sqrt(dot3(pulled, pulled)) > (1.0 - Tolerance::cone) * out.friction * f_n)
      edges |= STRAINED;
    if (!differences_.find(out.feature, out.by)) edges |= NOT_SMOOTH;
    if (f_n < Tolerance::force * reference_force_) edges |= WITHOUT_FORCE;
    return edges | aim(out, u_n, push.steps == 1 && push.gap > 0.0 ? left() : dt_);
  }

  // Required rate of a point's normal row, which closes its gap within `span`. Returns the edges on
  // which it is.
  int aim(StepContact& out, double u_n, double span) {
    const double e = solids_->restitution[out.pair];
    const double parting = fmin(-out.gap / span, recovery_speed_);
    const double rounding = still_ + Tolerance::gap / dt_;
    double u[3];
    before_.velocity(out.links, out.at, u);
    const double speed = dot3(u, out.normal);
    out.closes = out.bounces = 0.0;
    if (fabs(u_n - parting) <= rounding) {
      if (parting < recovery_speed_) out.closes = 1.0 / span;
      const double gain = dt_ * along(out.links, out.at, out.normal, free_acc_);
      return e > 0.0 && fabs(-e * speed - fmax(parting, -gain)) <= rounding ? REBOUND_BEGINS : 0;
    }
    if (!(e > 0.0) || !(fabs(u_n + e * speed) <= rounding)) return LAW_CHANGED;
    out.bounces = e;
    return 0;
  }

  // Points that close without force, except where those that push close them anyway.
  template <class Points>
  void check_open_points(const Points& points, int n, const StepContact* held) {
    bool spanned = false;
    for (int i = 0; i < points.n[0]; ++i) {
      const auto& own = points.point[0][i];
      bool pushes = false;
      for (int k = 0; k < n; ++k)
        pushes = pushes || (held[k].pair == own.pair && held[k].feature == own.feature);
      if (pushes) continue;
      int links[2];
      for (int side = 0; side < 2; ++side)
        links[side] = solids_->solids[solids_->pairs[2 * own.pair + side]].link;
      double u[3], row[array_size(N)];
      after_.velocity(links, own.at, u);
      const double* normal = own.frame;
      const double parting = fmin(-own.gap / left(), recovery_speed_);
      if (dot3(u, normal) - parting > still_) continue;
      if (!spanned) span(n, held);
      spanned = true;
      make_row(links, own.at, normal, row);
      if (span_.leaves(row)) note(WITHOUT_FORCE, own.pair);
      else if (slides_askew(u, normal, own.pair, n, held)) note(SLIDES_ELSEWHERE, own.pair);
    }
  }

  // The rows that hold the points.
  void span(int n, const StepContact* held) {
    span_.begin();
    for (int k = 0; k < n; ++k) {
      double frame[9];
      for (int c = 0; c < 3; ++c) frame[c] = held[k].normal[c];
      add_tangents(frame);
      for (int d = 0; d < (held[k].sticks ? 3 : 1); ++d)
        make_row(held[k].links, held[k].at, frame + 3 * d, span_.next());
    }
    span_.find();
  }

  // Whether a point with velocity u would have friction in another direction than the held points:
  // after a small change it may carry part of their force, with another direction.
  bool slides_askew(
      const double* u, const double* normal, int pair, int n, const StepContact* held) const {
    double across[3], off[3];
    for (int c = 0; c < 3; ++c) across[c] = u[c] - normal[c] * dot3(normal, u);
    const double speed = sqrt(dot3(across, across));
    for (int k = 0; k < n; ++k) {
      if (held[k].pair != pair || held[k].sticks || !(held[k].friction > 0.0)) continue;
      cross(held[k].along, across, off);
      if (speed <= still_ || sqrt(dot3(off, off)) > Tolerance::askew * speed) return true;
    }
    return false;
  }

  // Row of v_D for the velocity along a direction at a point, of the first link relative to the
  // second.
  void make_row(const int* links, const double* at, const double* direction, double* row) const {
    double moment[3];
    cross(at, direction, moment);
    for (int k = 0; k < N; ++k) row[k] = 0.0;
    for (int side = 0; side < 2; ++side) {
      if (links[side] < 0) continue;
      const int *begin = Model::moved_D_begin + links[side], *entry = Model::moved_D_entry;
      for (int j = begin[0]; j < begin[1]; ++j) {
        const double* s = screws_ + 6 * entry[j];
        row[entry[j]] += (side ? -1.0 : 1.0) * (dot3(direction, s) + dot3(moment, s + 3));
      }
    }
  }

  double along(
      const int* links, const double* at, const double* direction, const double* v_D) const {
    double row[array_size(N)], sum = 0.0;
    make_row(links, at, direction, row);
    for (int k = 0; k < N; ++k) sum += row[k] * v_D[k];
    return sum;
  }

  // The twists of all links at some velocities.
  struct Twists {
    double of[L][6];

    void make(const double* screws, const double* v_D, const double* v_K) {
      for (int i = 0; i < L; ++i) {
        for (int c = 0; c < 6; ++c) of[i][c] = 0.0;
        add(i, Model::moved_D_begin, Model::moved_D_entry, screws, v_D);
        add(i, Model::moved_K_begin, Model::moved_K_entry, screws + 6 * N, v_K);
      }
    }

    void add(int i, const int* begin, const int* entry, const double* screws, const double* v) {
      for (int j = begin[i]; j < begin[i + 1]; ++j)
        for (int c = 0; c < 6; ++c) of[i][c] += screws[6 * entry[j] + c] * v[entry[j]];
    }

    double fastest() const {
      double most = 0.0;
      for (int i = 0; i < L; ++i)
        for (int c = 0; c < 6; ++c) most = fmax(most, fabs(of[i][c]));
      return most;
    }

    // Velocity of the first link relative to the second at a point.
    void velocity(const int* links, const double* at, double* u) const {
      double twist[6] = {};
      for (int side = 0; side < 2; ++side)
        for (int c = 0; c < 6 && links[side] >= 0; ++c)
          twist[c] += (side ? -1.0 : 1.0) * of[links[side]][c];
      cross(twist + 3, at, u);
      for (int c = 0; c < 3; ++c) u[c] += twist[c];
    }
  };

  StepDelay<Model> delay_;
  ContactShare<M + 3 * C> share_;
  ContactPush push_[array_size(C)];
  TouchDifferences<Model> differences_;
  LeastSpan<3 * C, N> span_;
  Twists before_, after_;
  const ContactArrays* solids_;
  const double *q_D_, *v_D_, *q_K_, *rate_, *p_;
  double dt_, recovery_speed_, reference_force_, still_, free_acc_[array_size(N)];
  double poses_[12 * L], screws_[array_size(6 * E)];
  double high_[12 * L + 6 * E], low_[12 * L + 6 * E], change_[12 * L + 6 * E];
};

}  // namespace fan
