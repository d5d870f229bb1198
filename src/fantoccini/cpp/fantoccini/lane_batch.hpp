// A batch by time-stepping: bundles of lanes, a trajectory a lane, all on one clock.
#pragma once

#include "batch.hpp"
#include "lane_of.hpp"
#include "led_step.hpp"

namespace fan {

// The inputs of a bundle: for every lane the polynomials of the piece it is in.
template <class Space, int n_vD, class Real>
class LaneDrive {
 public:
  static constexpr int width = Traits<Real>::width;

  void set(int lane, const InputArrays& input) {
    input_[lane] = input;
    piece_[lane] = -1;
    forced_ = input.force != nullptr;
  }

  // The inputs at t: at a break inside, those of the piece that begins there; at the start of a run
  // also at the last break, after which all stands still.
  void evaluate(double t, bool starts, Real* q, Real* v, Real* a, Real* u) {
    Real s, moves;
    bool entered = false;
    for (int l = 0; l < width; ++l) {
      const InputArrays& in = input_[l];
      const int n = in.n_segments;
      int i = piece_[l] < 0 ? 0 : piece_[l];
      while (i > 0 && t < in.breaks[i]) --i;
      while (i < n - 1 && t >= in.breaks[i + 1]) ++i;
      if (i != piece_[l]) {
        load(l, i);
        entered = true;
      }
      const bool after = starts ? t >= in.breaks[n] : t > in.breaks[n], before = t < in.breaks[0];
      const double at = before ? in.breaks[0] : (after ? in.breaks[n] : t);
      lane_of(s, l) = at - in.breaks[i];
      lane_of(moves, l) = before || after ? 0.0 : 1.0;
    }
    if (entered)
      for (int j = 0; j < Space::n_v; ++j) still_[j] = is_constant(coef_ + kPowers * j);
    motion_of<Space>(coef_, base_, still_, s, q, v, a);
    for (int j = 0; j < Space::n_v; ++j) {
      v[j] *= moves;
      a[j] *= moves;
    }
    for (int k = 0; k < n_vD; ++k) {
      Real rate, second;
      if (!forced_) {
        u[k] = Real(0.0);
        continue;
      }
      polynomial(force_ + kPowers * k, s, u[k], rate, second);
      u[k] *= moves;
    }
  }

 private:
  void load(int lane, int piece) {
    const InputArrays& in = input_[lane];
    piece_[lane] = piece;
    const double* coef = in.coef + (long long)piece * Space::n_v * kPowers;
    const double* base = in.base + (long long)piece * Space::n_q;
    for (int k = 0; k < Space::n_v * kPowers; ++k) lane_of(coef_[k], lane) = coef[k];
    for (int k = 0; k < Space::n_q; ++k) lane_of(base_[k], lane) = base[k];
    if (!forced_) return;
    const double* force = in.force + (long long)piece * n_vD * kPowers;
    for (int k = 0; k < n_vD * kPowers; ++k) lane_of(force_[k], lane) = force[k];
  }

  InputArrays input_[width];
  int piece_[width];
  bool forced_ = false, still_[room(Space::n_v)];
  Real coef_[room(Space::n_v * kPowers)], base_[room(Space::n_q)], force_[room(n_vD * kPowers)];
};

template <class Model, class Real>
class LaneBatch {
 public:
  static constexpr int width = Traits<Real>::width;

  void work(Pool& pool) {
    long long first, last;
    while (pool.take(width, &first, &last)) {
      begin(pool.arrays, first, int(last - first));
      run(pool);
    }
  }

 private:
  static constexpr int NQ = Model::n_qD, N = Model::n_vD, S = Model::n_strings;
  static constexpr int M = Model::n_rows;
  static constexpr int kTold = 64;  // steps between two looks at the pool

  // Places beyond the last trajectory repeat it and are not written.
  void begin(const BatchArrays& in, long long first, int n) {
    first_ = first;
    n_ = n;
    led_.opt = in.options;
    led_.winches.set(in.winches);
    for (int i = 0; i < Model::n_p; ++i) led_.p[i] = Real(in.p[i]);
    for (int l = 0; l < width; ++l) {
      const long long who = first + (l < n ? l : n - 1);
      put(led_.state().q_D, NQ, l, in.q_D.of(who));
      put(led_.state().v_D, N, l, in.v_D.of(who));
      put(led_.at.slip, S, l, in.slip.of(who));
      drive_.set(l, in.input(who));
      caught_[l] = released_[l] = 0;
      reached_[l] = in.t;
    }
    look(in.t, true);
    led_.take_inputs();
    led_.begin();
  }

  void run(Pool& pool) {
    const BatchArrays& in = pool.arrays;
    const double dt = in.options.dt;
    double t = in.t;
    double told = t;
    long long row = 0;
    write(in, row++);
    for (long long step = 1; t < in.t_end - 1e-9 * dt; ++step) {
      double next = in.t + double(step) * dt;
      if (next > in.t_end - 1e-6 * dt) next = in.t_end;
      for (int r = 0; r < M; ++r) was_[r] = led_.at.taut[r];
      look(next, false);
      led_.advance(next - t);
      t = next;
      count(t);
      if (step % in.save_every == 0 || t >= in.t_end) write(in, row++);
      if (step % kTold != 0) continue;
      pool.advance(n_ * (t - told) / (in.t_end - in.t));
      told = t;
      if (pool.stopped() || !any(led_.status < Real(RUNNING + 0.5))) break;
    }
    if (!pool.stopped()) pool.advance(n_ * (in.t_end - told) / (in.t_end - in.t));
    for (int l = 0; l < n_; ++l) {
      const int status = int(lane_of(led_.status, l));
      const long long who = first_ + l;
      in.status[who] = status != RUNNING ? status : (t >= in.t_end ? DONE : STOPPED);
      in.reached[who] = reached_[l];
      in.violation[who] = lane_of(led_.worst_violation, l);
      in.events[2 * who] = caught_[l];
      in.events[2 * who + 1] = released_[l];
    }
  }

  void look(double t, bool starts) {
    auto& in = led_.coming();
    drive_.evaluate(t, starts, in.q_K, in.v_K, in.acc_K, in.u_D);
  }

  // Counts what was caught and released in the step to t.
  void count(double t) {
    bool runs[width];
    for (int l = 0; l < n_; ++l) {
      runs[l] = lane_of(led_.status, l) < RUNNING + 0.5;
      if (runs[l]) reached_[l] = t;
    }
    for (int r = 0; r < M; ++r) {
      if (!any(was_[r] != led_.at.taut[r])) continue;
      for (int l = 0; l < n_; ++l) {
        const bool before = lane_of(was_[r], l), after = lane_of(led_.at.taut[r], l);
        caught_[l] += runs[l] && after && !before;
        released_[l] += runs[l] && before && !after;
      }
    }
  }

  // The row of all lanes that still run.
  void write(const BatchArrays& in, long long row) {
    const auto& state = led_.state();
    const auto& inputs = led_.inputs();
    put_lanes(in, Q_D, row, state.q_D);
    put_lanes(in, V_D, row, state.v_D);
    put_lanes(in, ACC_D, row, led_.at.acc);
    put_lanes(in, Q_K, row, inputs.q_K);
    put_lanes(in, V_K, row, inputs.v_K);
    put_lanes(in, ACC_K, row, inputs.acc_K);
    put_lanes(in, FORCE, row, led_.at.tension);
    put_lanes(in, TAUT, row, led_.at.taut);
    put_lanes(in, SLIP_LENGTH, row, led_.at.slip);
    if (!in.parts[BOOKS]) return;
    Real T, V;
    const Real* arg[] = {state.q_D, state.v_D, inputs.q_K, inputs.v_K, led_.p};
    Real* res[] = {&T, &V};
    Model::energy(arg, res);
    const Real books[] = {T, V, led_.work, led_.damping, led_.impact, led_.slip_loss};
    put_lanes(in, BOOKS, row, books);
  }

  template <class Number>
  void put_lanes(const BatchArrays& in, Part part, long long row, const Number* values) {
    if (!in.parts[part]) return;
    for (int l = 0; l < n_; ++l)
      if (lane_of(led_.status, l) < RUNNING + 0.5)
        put_part(in, part, part_width<Model>(part), first_ + l, row, [&](int k) {
          return double(lane_of(values[k], l));
        });
  }

  static void put(Real* to, int n, int lane, const double* from) {
    for (int k = 0; k < n; ++k) lane_of(to[k], lane) = from[k];
  }

  LedStep<Model, Real> led_;
  LaneDrive<typename Model::Driven, N, Real> drive_;
  typename Traits<Real>::Mask was_[room(M)];
  long long first_ = 0, caught_[width], released_[width];
  int n_ = 0;
  double reached_[width];
};

}  // namespace fan
