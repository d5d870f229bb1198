// First time steps from many states, with what touches in them: each point that pushes in its mode,
// the derivatives of where it is, and what lies on the edge between two modes.
//
//   u_n+ >= w,  w = min(-gap/dt, recovery speed) or -e u_n of a new contact that springs back
//
// A mode's derivative is that of the step where the law holds strictly: points that push do so with
// force, those that stick stay inside their cone, open ones open.
#pragma once

#include "least_span.hpp"
#include "timestepping_trajectory.hpp"
#include "touch_differences.hpp"

namespace fan {

struct StepTouchTolerances {
  static constexpr double speed = 1e-8;  // that is none, relative to 1 m/s or the largest
  static constexpr double force = 1e-8;  // that is none, relative to the weight
  static constexpr double cone = 1e-6;   // part of its cone by which what sticks must stay inside
  static constexpr double gap = 1e-12;   // m: to which a gap is known
  static constexpr double askew = 1e-6;  // angle between directions of sliding that are one
  static constexpr double margin = 1e-3;  // m: gap within which points are differenced
  static constexpr double spare = 1.5;    // the same, in gaps that close within the step
  static constexpr double by_p = 1e-3;  // step of differences by parameters, relative to 1 or them
};

template <class Model>
class StepTouches {
 public:
  static constexpr int NQ = Model::n_qD, N = Model::n_vD, NQK = Model::n_qK, K = Model::n_vK;
  static constexpr int P = Model::n_p, S = Model::n_strings, M = Model::n_rows;
  static constexpr int C = Model::n_contacts, L = Model::n_links, E = N + K;

  // Node i of the arrays.
  void find(const TouchingStepArrays& in, long long i) {
    step(in, i);
    StepContact* out = in.points + i * in.room;
    int edges = 0, n = 0;
    if (Status(int(trajectory_.status)) == RUNNING) {
      n = trajectory_.at.contacts.shared(trajectory_.at.eval, trajectory_.at.rows, share_, push_);
      if (n > in.room) edges = CROWDED, n = 0;
      else edges = look(in, n, out);
    }
    in.n_points[i] = n;
    in.edges[i] = edges;
    write(in, i);
  }

 private:
  using Tolerance = StepTouchTolerances;

  void step(const TouchingStepArrays& in, long long i) {
    auto& run = trajectory_;
    run.opt = in.options;
    run.winches.set(in.winches);
    dt_ = in.options.dt;
    p_ = of(in.p, i);
    for (int k = 0; k < P; ++k) run.p[k] = p_[k];
    q_D_ = in.q_D + i * NQ;
    v_D_ = in.v_D + i * N;
    q_K_ = in.q_K + i * NQK;
    rate_ = in.rate + i * K;
    for (int k = 0; k < NQ; ++k) run.state().q_D[k] = q_D_[k];
    for (int k = 0; k < N; ++k) run.state().v_D[k] = v_D_[k];
    for (int k = 0; k < S; ++k) run.at.slip[k] = 0.0;
    auto &now = run.inputs(), &then = run.coming();
    const double *v_K = in.v_K + i * K, *acc_K = of(in.acc_K, i), *mean = in.mean + i * K;
    const double* force = of(in.u_D, i);
    for (int k = 0; k < NQK; ++k) now.q_K[k] = q_K_[k];
    retract<typename Model::Driven>(q_K_, rate_, dt_, then.q_K);
    for (int k = 0; k < K; ++k) {
      now.v_K[k] = v_K[k];
      now.acc_K[k] = then.acc_K[k] = acc_K[k];
      then.v_K[k] = v_K[k] + dt_ * mean[k];
    }
    for (int k = 0; k < N; ++k) now.u_D[k] = then.u_D[k] = force ? force[k] : 0.0;
    run.begin();
    run.advance(dt_);
  }

  static const double* of(const Shared& all, long long i) {
    return all.first ? all.first + i * all.stride : nullptr;
  }

  void write(const TouchingStepArrays& in, long long i) {
    auto& run = trajectory_;
    for (int k = 0; k < NQ; ++k) in.q_D_next[i * NQ + k] = run.state().q_D[k];
    for (int k = 0; k < N; ++k) in.v_D_next[i * N + k] = run.state().v_D[k];
    for (int k = 0; k < NQK; ++k) in.q_K_next[i * NQK + k] = run.inputs().q_K[k];
    for (int k = 0; k < K; ++k) in.v_K_next[i * K + k] = run.inputs().v_K[k];
    for (int r = 0; r < M; ++r) in.tension[i * M + r] = run.at.tension[r];
    const Status status = Status(int(run.status));
    in.status[i] = status == RUNNING ? run.motors.verdict(0) : status;
    double* screws = in.screws + i * 6 * E;
    pose(p_, poses_, screws);
    if (P > 0) differ_by_parameters(in.by_p + i * (L + E) * 6 * P);
  }

  void pose(const double* p, double* poses, double* screws) const {
    struct {
      double *poses, *screw_D, *screw_K;
    } to{poses, screws, screws + 6 * N};
    Call<Model, double>::screws(q_D_, q_K_, p, to);
  }

  // Twists of the links and changes of the screws, by central differences of sixth order.
  void differ_by_parameters(double* out) {
    constexpr double weights[3] = {45.0 / 60, -9.0 / 60, 1.0 / 60};
    double p[room(P)];
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

  // The n points that push; returns what the step is on the edge of.
  int look(const TouchingStepArrays& in, int n, StepContact* out) {
    pose(p_, poses_, screws_);
    before_.make(screws_, v_D_, rate_);
    after_.make(screws_, trajectory_.state().v_D, rate_);
    still_ = Tolerance::speed * fmax(1.0, fmax(before_.fastest(), after_.fastest()));
    trajectory_.at.eval.back(trajectory_.at.eval.w0, kick_);
    double reach = 0.0;
    for (int k = 0; k < n; ++k) reach = fmax(reach, push_[k].gap);
    const double margin = fmax(Tolerance::margin, Tolerance::spare * reach);
    int edges = 0;
    for (int k = 0; k < n; ++k) {
      const ContactArrays& solids = *in.options.contacts;
      if (k == 0 || push_[k].pair != push_[k - 1].pair)
        differences_.take(solids, push_[k].pair, poses_, margin);
      edges |= hold(in, push_[k], out[k]);
    }
    return edges | look_at_open(in, n, out);
  }

  // A point that pushes; returns what edge it is on.
  int hold(const TouchingStepArrays& in, const ContactPush& push, StepContact& out) {
    const ContactArrays& solids = *in.options.contacts;
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
    if (f_n < Tolerance::force * in.reference_force) edges |= WITHOUT_FORCE;
    return edges | aim(in, out, u_n);
  }

  // What the normal row of a point asks for; returns what edge that is on.
  int aim(const TouchingStepArrays& in, StepContact& out, double u_n) {
    const double e = in.options.contacts->restitution[out.pair];
    const double parting = fmin(-out.gap / dt_, in.options.recovery_speed);
    const double rounding = still_ + Tolerance::gap / dt_;
    double u[3];
    before_.velocity(out.links, out.at, u);
    const double speed = dot3(u, out.normal);
    out.closes = out.bounces = 0.0;
    if (fabs(u_n - parting) <= rounding) {
      if (parting < in.options.recovery_speed) out.closes = 1.0 / dt_;
      const double gain = dt_ * along(out.links, out.at, out.normal, kick_);
      return e > 0.0 && fabs(-e * speed - fmax(parting, -gain)) <= rounding ? MAY_REBOUND : 0;
    }
    if (!(e > 0.0 && fabs(u_n + e * speed) <= rounding)) return LEAVES_LAW;
    out.bounces = e;
    return 0;
  }

  // Points that close without force, but where those that push close them anyway.
  int look_at_open(const TouchingStepArrays& in, int n, const StepContact* held) {
    const auto& points = trajectory_.at.contacts.candidates();
    const ContactArrays& solids = *in.options.contacts;
    bool spanned = false;
    int edges = 0;
    for (int i = 0; i < points.n[0]; ++i) {
      const auto& own = points.point[0][i];
      bool pushes = false;
      for (int k = 0; k < n; ++k)
        pushes = pushes || (held[k].pair == own.pair && held[k].feature == own.feature);
      if (pushes) continue;
      int links[2];
      for (int side = 0; side < 2; ++side)
        links[side] = solids.solids[solids.pairs[2 * own.pair + side]].link;
      double u[3], row[room(N)];
      after_.velocity(links, own.at, u);
      const double* normal = own.frame;
      const double parting = fmin(-own.gap / dt_, in.options.recovery_speed);
      if (dot3(u, normal) - parting > still_) continue;
      if (!spanned) span(n, held);
      spanned = true;
      make_row(links, own.at, normal, row);
      if (span_.leaves(row)) edges |= WITHOUT_FORCE;
      else if (slides_askew(u, normal, own.pair, n, held)) edges |= ASKEW;
    }
    return edges;
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

  // Whether a point with velocity u would have friction in another direction than those held: a
  // motion near by may then put force on it instead of on them, which turns it otherwise.
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

  // The velocity along a direction at a point, of the first link against the second, by v_D.
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
    double row[room(N)], sum = 0.0;
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

    // Of the first link against the second at a point.
    void velocity(const int* links, const double* at, double* u) const {
      double twist[6] = {};
      for (int side = 0; side < 2; ++side)
        for (int c = 0; c < 6 && links[side] >= 0; ++c)
          twist[c] += (side ? -1.0 : 1.0) * of[links[side]][c];
      cross(twist + 3, at, u);
      for (int c = 0; c < 3; ++c) u[c] += twist[c];
    }
  };

  TimeSteppingTrajectory<Model, double> trajectory_;
  ContactShare<M + 3 * C> share_;
  ContactPush push_[room(C)];
  TouchDifferences<Model> differences_;
  LeastSpan<3 * C, N> span_;
  Twists before_, after_;
  const double *q_D_, *v_D_, *q_K_, *rate_, *p_;
  double dt_, still_, kick_[room(N)];
  double poses_[12 * L], screws_[room(6 * E)];
  double high_[12 * L + 6 * E], low_[12 * L + 6 * E], change_[12 * L + 6 * E];
};

// The C interface of StepTouches: the nodes [first, last) of the arrays; 1 where there was no memory,
// else 0.
template <class Model>
int find_step_touches(const TouchingStepArrays& in, long long first, long long last) {
  if constexpr (Model::n_contacts > 0) {
    auto* made = new (std::nothrow) StepTouches<Model>();
    if (!made) return 1;
    for (long long i = first; i < last; ++i) made->find(in, i);
    delete made;
  }
  return 0;
}

}  // namespace fan
