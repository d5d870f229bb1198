// A batch in bundles of lanes, one trajectory per lane, all on one clock.
#pragma once

#include "fantoccini/math/lane_of.hpp"
#include "fantoccini/model/segments.hpp"
#include "fantoccini/runs/batch.hpp"
#include "fantoccini/runs/stepping.hpp"

namespace fan {

// The inputs of a bundle: for every lane the polynomials of its current piece.
template <class Space, int n_vD, class Real>
class LaneDrive {
 public:
  static constexpr int width = Traits<Real>::width;

  void set(int lane, const InputArrays& input) {
    input_[lane] = input;
    piece_[lane] = -1;
    forced_ = input.force != nullptr;
  }

  // Evaluates the inputs at t: at an inner break, those of the piece that begins there.
  template <class Inputs>
  void at(const Real& t, Inputs& in) {
    find(t, false);
    motion(in);
    force(in.u_D);
  }

  // at() for a run that keeps `in` from step to step: inputs constant in all lanes are written
  // once.
  template <class Inputs>
  void fill(const Real& t, Inputs& in) {
    find(t, false);
    if (still_number_ != 0 && in.still == still_number_) return;
    motion(in);
    force(in.u_D);
    in.still = still_number_;
  }

  // at() for the start of a run: at the last break, inputs are already constant.
  template <class Inputs>
  void start(const Real& t, Inputs& in) {
    find(t, true);
    motion(in);
    force(in.u_D);
  }

  // Evaluates u_D only.
  void force(const Real& t, Real* u) {
    find(t, false);
    force(u);
  }

 private:
  // Finds the current piece of every lane, and the time within it.
  void find(const Real& times, bool starts) {
    bool entered = false, changed = false;
    for (int l = 0; l < width; ++l) {
      const InputArrays& in = input_[l];
      const int n = in.n_segments;
      const double t = lane_of(times, l);
      int i = piece_[l] < 0 ? 0 : piece_[l];
      while (i > 0 && t < in.breaks[i]) --i;
      while (i < n - 1 && t >= in.breaks[i + 1]) ++i;
      if (i != piece_[l]) {
        load(l, i);
        entered = true;
      }
      const bool after = starts ? t >= in.breaks[n] : t > in.breaks[n], before = t < in.breaks[0];
      const double at = before ? in.breaks[0] : (after ? in.breaks[n] : t);
      lane_of(s_, l) = at - in.breaks[i];
      const double moves = before || after ? 0.0 : 1.0;
      changed = changed || entered || moves != lane_of(moves_, l);
      lane_of(moves_, l) = moves;
    }
    if (entered)
      for (int j = 0; j < Space::n_v; ++j) still_[j] = is_constant(coef_ + n_powers * j);
    if (changed) number_constant();
  }

  // Gives inputs that are constant in all lanes a number of their own; 0 for others.
  void number_constant() {
    bool still = !forced_;
    for (int j = 0; j < Space::n_v; ++j) still = still && still_[j];
    still_number_ = still || !any(moves_ != Real(0.0)) ? ++numbers_ : 0;
  }

  template <class Inputs>
  void motion(Inputs& in) const {
    motion_of<Space>(coef_, base_, still_, s_, in.q_K, in.v_K, in.acc_K);
    for (int j = 0; j < Space::n_v; ++j) {
      in.v_K[j] *= moves_;
      in.acc_K[j] *= moves_;
    }
  }

  void force(Real* u) const {
    for (int k = 0; k < n_vD; ++k) {
      Real rate, second;
      if (!forced_) {
        u[k] = Real(0.0);
        continue;
      }
      polynomial(force_ + n_powers * k, s_, u[k], rate, second);
      u[k] *= moves_;
    }
  }

  void load(int lane, int piece) {
    const InputArrays& in = input_[lane];
    piece_[lane] = piece;
    const double* coef = in.coef + (long long)piece * Space::n_v * n_powers;
    const double* base = in.base + (long long)piece * Space::n_q;
    for (int k = 0; k < Space::n_v * n_powers; ++k) lane_of(coef_[k], lane) = coef[k];
    for (int k = 0; k < Space::n_q; ++k) lane_of(base_[k], lane) = base[k];
    if (!forced_) return;
    const double* force = in.force + (long long)piece * n_vD * n_powers;
    for (int k = 0; k < n_vD * n_powers; ++k) lane_of(force_[k], lane) = force[k];
  }

  InputArrays input_[width];
  int piece_[width];
  bool forced_ = false, still_[array_size(Space::n_v)];
  long long still_number_ = 0, numbers_ = 0;
  Real s_;                  // s: time since the piece began
  Real moves_ = Real(0.0);  // 1 within the input, 0 before and after it
  Real coef_[array_size(Space::n_v * n_powers)], base_[array_size(Space::n_q)],
      force_[array_size(n_vD * n_powers)];
};

// Trajectory advances one trajectory per lane: TimeSteppingTrajectory or VariationalTrajectory.
template <class Trajectory>
class LaneBatch {
  using Model = typename Trajectory::Model;
  using Real = typename Trajectory::Real;

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
  static constexpr int M = Model::n_rows;
  static constexpr int steps_per_report = 64;  // steps between checks of the pool

  // Lanes beyond the last trajectory repeat it and are not written.
  void begin(const BatchArrays& in, long long first, int n) {
    first_ = first;
    n_ = n;
    bundle_.set(in.t, in.options, in.winches);
    for (int l = 0; l < width; ++l) {
      const StartArrays start = start_of(in, first + (l < n ? l : n - 1));
      load_start(bundle_, l, start);
      drive_.set(l, start.input);
      caught_[l] = released_[l] = 0;
      reached_[l] = in.t;
    }
    bundle_.begin(drive_);
  }

  void run(Pool& pool) {
    const BatchArrays& in = pool.arrays;
    Writer writer{*this, pool, in.t};
    StepCount count{in.t, in.options.dt};
    write(in, writer.row++);
    make_steps(bundle_, drive_, StepGrid{in.t, in.t_end, in.options.dt}, count, writer);
    if (!pool.stopped()) pool.advance(n_ * (in.t_end - writer.reported) / (in.t_end - in.t));
    for (int l = 0; l < n_; ++l) {
      const Status status = verdict(bundle_, l, writer.ended);
      const double violation = lane_of(bundle_.worst_violation, l);
      const BatchEnd end{status, reached_[l], violation, caught_[l], released_[l]};
      put_end<Model>(in, first_ + l, end, l, bundle_.q_D(), bundle_.v_D());
      write_attribution(bundle_, status, l, attribution_of<Model>(in, first_ + l));
    }
  }

  // Writes the rows that are due, and reports the bundle's progress to the pool.
  struct Writer {
    LaneBatch& batch;
    Pool& pool;
    double reported;      // s: last time reported to the pool
    long long row = 0;    // index of the next row
    Status ended = DONE;  // at the end of the grid; else the reason for leaving it

    bool ready(const StepCount& count) {
      const BatchArrays& in = pool.arrays;
      if (count.n_total >= in.options.max_steps) ended = TOO_MANY_STEPS;
      if (count.n_total % steps_per_report == 0 && count.n_total > 0) {
        pool.advance(batch.n_ * (count.t - reported) / (in.t_end - in.t));
        reported = count.t;
        if (pool.stopped() && ended == DONE) ended = STOPPED;
      }
      return ended == DONE;
    }

    void record(const StepCount& count, bool) {
      const BatchArrays& in = pool.arrays;
      batch.count_changes();
      if (count.n_total % in.save_every == 0 || count.t >= in.t_end) batch.write(in, row++);
    }
  };

  // Counts catches and releases in the last step.
  void count_changes() {
    bool advanced[width];
    for (int l = 0; l < n_; ++l) {
      advanced[l] = lane_of(bundle_.t, l) > reached_[l];
      reached_[l] = lane_of(bundle_.t, l);
    }
    for (int r = 0; r < M; ++r) {
      const auto caught = bundle_.caught(r), released = bundle_.released(r);
      if (!any(caught || released)) continue;
      for (int l = 0; l < n_; ++l) {
        caught_[l] += advanced[l] && lane_of(caught, l);
        released_[l] += advanced[l] && lane_of(released, l);
      }
    }
  }

  // Writes a row for all lanes that still run.
  void write(const BatchArrays& in, long long row) {
    const auto& inputs = bundle_.inputs();
    put_lanes(in, Part::q_D, row, bundle_.q_D());
    put_lanes(in, Part::v_D, row, bundle_.v_D());
    put_lanes(in, Part::acc_D, row, bundle_.acc());
    put_lanes(in, Part::q_K, row, inputs.q_K);
    put_lanes(in, Part::v_K, row, inputs.v_K);
    put_lanes(in, Part::acc_K, row, inputs.acc_K);
    put_lanes(in, Part::force, row, bundle_.tension());
    put_lanes(in, Part::taut, row, bundle_.taut());
    put_lanes(in, Part::slip, row, bundle_.slip());
    const Real residual = bundle_.contact_residual();
    put_lanes(in, Part::contact_residual, row, &residual);
    if (!in.parts[Part::energy_terms]) return;
    Real energy_terms[7];
    struct {
      Real *T, *V;
    } energy{energy_terms, energy_terms + 1};
    Call<Model, Real>::energy(
        bundle_.q_D(), bundle_.v_D(), inputs.q_K, inputs.v_K, bundle_.p(), energy);
    bundle_.energy_terms(energy_terms + 2);
    put_lanes(in, Part::energy_terms, row, energy_terms);
  }

  template <class Number>
  void put_lanes(const BatchArrays& in, int part, long long row, const Number* values) {
    if (!in.parts[part]) return;
    const auto runs = bundle_.runs();
    for (int l = 0; l < n_; ++l)
      if (lane_of(runs, l))
        put_part(in, part, part_width<Model>(part), first_ + l, row, [&](int k) {
          return double(lane_of(values[k], l));
        });
  }

  Trajectory bundle_;
  LaneDrive<typename Model::Driven, Model::n_vD, Real> drive_;
  long long first_ = 0, caught_[width], released_[width];
  int n_ = 0;
  double reached_[width];
};

}  // namespace fan
