// Trajectories of fixed steps that are advanced piece by piece, in bundles of lanes, each with its
// own parameters, under accelerations and forces that are held over a piece (StepperArrays).
//
// Between pieces a bundle is what its lanes remember and the caller's arrays: every worker has one
// trajectory of its own, in which it advances bundle after bundle.
#pragma once

#include <atomic>
#include <memory>
#include <new>

#include "fantoccini/runs/batch.hpp"
#include "fantoccini/runs/lane_memory.hpp"
#include "fantoccini/runs/step_grid.hpp"
#include "fantoccini/timestepping/lanes.hpp"

namespace fan {

// Inputs of a bundle with constant accelerations and forces from a configuration and velocity on.
template <class Space, int n_vD, class Real>
class HeldDrive {
 public:
  // Takes what is held; `in` has the configuration and velocity at the start, and u_D.
  template <class Inputs>
  FAN_FN void set(const Inputs& in, const Real* acc_K) {
    for (int i = 0; i < Space::n_q; ++i) base_[i] = in.q_K[i];
    for (int j = 0; j < Space::n_v; ++j) {
      Real* c = coef_ + n_powers * j;
      for (int k = 0; k < n_powers; ++k) c[k] = Real(0.0);
      c[1] = in.v_K[j];
      c[2] = 0.5 * acc_K[j];
    }
    for (int i = 0; i < Space::n_scalars; ++i)
      coef_[n_powers * Space::scalar_v[i]] = in.q_K[Space::scalar_q[i]];
    for (int j = 0; j < Space::n_v; ++j) still_[j] = is_constant(coef_ + n_powers * j);
    bool still = true;
    for (int j = 0; j < Space::n_v; ++j) still = still && still_[j];
    for (int k = 0; k < n_vD; ++k) {
      u_D_[k] = in.u_D[k];
      still = still && !any(u_D_[k] != Real(0.0));
    }
    still_number_ = still ? ++numbers_ : 0;
  }

  // The inputs at t; those that hold still are written once.
  template <class Inputs>
  FAN_FN void fill(const Real& t, Inputs& in) const {
    if (still_number_ != 0 && in.still == still_number_) return;
    start(t, in);
  }

  template <class Inputs>
  FAN_FN void start(const Real& t, Inputs& in) const {
    motion_of<Space>(coef_, base_, still_, t, in.q_K, in.v_K, in.acc_K);
    for (int k = 0; k < n_vD; ++k) in.u_D[k] = u_D_[k];
    in.still = still_number_;
  }

 private:
  bool still_[room(Space::n_v)];
  long long still_number_ = 0, numbers_ = 0;  // as those of LaneDrive
  Real coef_[room(Space::n_v * n_powers)], base_[room(Space::n_q)], u_D_[room(n_vD)];
};

template <class Model, class Real>
class LaneStepper {
 public:
  static constexpr int width = Traits<Real>::width;

  // Whether there was memory for n trajectories and this many workers.
  bool make(long long n, int workers) {
    n_bundles_ = (n + width - 1) / width;
    LaneMemory<Real> count(Memory::COUNT, nullptr, Real(0.0) < Real(1.0));
    workers_.reset(new (std::nothrow) std::unique_ptr<Worker>[workers]);
    if (!workers_) return false;
    for (int i = 0; i < workers; ++i) {
      workers_[i].reset(new (std::nothrow) Worker());
      if (!workers_[i]) return false;
    }
    workers_[0]->bundle.trajectory.remember(count);
    size_ = (count.size() + Memory::alignment - 1) / Memory::alignment * Memory::alignment;
    memory_.reset(new (
        std::align_val_t(Memory::alignment), std::nothrow) unsigned char[n_bundles_ * size_]());
    return memory_ != nullptr;
  }

  // A piece for work(); the arrays must live until all workers are done.
  void begin(const StepperArrays& arrays) {
    arrays_ = arrays;
    next_.store(0);
  }

  // Advances bundles until none are left.
  void work(int worker) {
    for (long long i = next_.fetch_add(1); i < n_bundles_; i = next_.fetch_add(1))
      advance(*workers_[worker], i);
  }

 private:
  using Memory = LaneMemory<Real>;
  using Mask = typename Traits<Real>::Mask;
  static constexpr int NQ = Model::n_qD, N = Model::n_vD, S = Model::n_strings, NK = Model::n_vK;
  static constexpr int NP = Model::n_p, M = Model::n_rows, D = Model::n_watched;

  struct Worker {
    FixedLanes<Model, Real> bundle;
    HeldDrive<typename Model::Driven, N, Real> drive;
  };
  struct Free {
    void operator()(unsigned char* place) const {
      ::operator delete[](place, std::align_val_t(Memory::alignment));
    }
  };

  void advance(Worker& worker, long long which) {
    const StepperArrays& in = arrays_;
    auto& bundle = worker.bundle;
    const long long first = which * width;
    const int n = int(in.n - first < width ? in.n - first : width);
    unsigned char* place = memory_.get() + which * size_;
    Real fresh = Real(0.0);
    for (int l = 0; l < n; ++l) lane_of(fresh, l) = in.fresh[first + l] ? 1.0 : 0.0;
    load(worker, first, n);
    if (any(fresh > Real(0.5))) {
      bundle.begin(worker.drive);
      // Lanes beyond the last one repeat it.
      for (int l = n; l < width; ++l) lane_of(fresh, l) = lane_of(fresh, n - 1);
      Memory memory(Memory::WRITE, place, fresh > Real(0.5));
      bundle.trajectory.remember(memory);
      load(worker, first, n);
      for (int l = 0; l < n; ++l) in.fresh[first + l] = 0;
    }
    bundle.resume(worker.drive);
    Memory before(Memory::READ, place, Real(0.0) < Real(1.0));
    bundle.trajectory.remember(before);
    bundle.take_up();
    const StepGrid grid{0.0, in.duration, in.options.dt};
    double t = 0.0;
    for (long long step = 1; t < grid.end() && any(bundle.runs()); ++step) {
      const double next = grid.at(step);
      bundle.advance(worker.drive, t, next);
      t = next;
    }
    Memory after(Memory::WRITE, place, Real(0.0) < Real(1.0));
    bundle.trajectory.remember(after);
    write(bundle, first, n);
  }

  // The present states, inputs and parameters. Lanes beyond the last one repeat it.
  void load(Worker& worker, long long first, int n) {
    const StepperArrays& in = arrays_;
    auto& bundle = worker.bundle;
    bundle.set(0.0, in.options, in.winches);
    auto& inputs = bundle.inputs();
    Real acc_K[room(NK)];
    for (int l = 0; l < width; ++l) {
      const long long who = first + (l < n ? l : n - 1);
      put(bundle.q_D(), NQ, l, in.q_D + who * NQ);
      put(bundle.v_D(), N, l, in.v_D + who * N);
      put(bundle.slip(), S, l, in.slip + who * S);
      put(bundle.p(), NP, l, in.p + who * NP);
      put(inputs.q_K, Model::n_qK, l, in.q_K + who * Model::n_qK);
      put(inputs.v_K, NK, l, in.v_K + who * NK);
      put(acc_K, NK, l, of(in.acc_K, who));
      const double* force = of(in.u_D, who);
      for (int k = 0; k < N; ++k) lane_of(inputs.u_D[k], l) = force ? force[k] : 0.0;
    }
    worker.drive.set(inputs, acc_K);
  }

  void write(FixedLanes<Model, Real>& bundle, long long first, int n) {
    const StepperArrays& in = arrays_;
    const auto& inputs = bundle.inputs();
    Real books[5];
    bundle.books(books);
    for (int l = 0; l < n; ++l) {
      const long long who = first + l;
      take(bundle.q_D(), NQ, l, in.q_D + who * NQ);
      take(bundle.v_D(), N, l, in.v_D + who * N);
      take(bundle.slip(), S, l, in.slip + who * S);
      const Status status = Status(int(lane_of(bundle.status, l)));
      // A lane that has stopped keeps its inputs, too.
      if (status == RUNNING) {
        take(inputs.q_K, Model::n_qK, l, in.q_K + who * Model::n_qK);
        take(inputs.v_K, NK, l, in.v_K + who * NK);
      }
      take(bundle.tension(), M, l, in.tension + who * M);
      take(bundle.taut(), M, l, in.taut + who * M);
      take(books, 5, l, in.books + who * 5);
      in.violation[who] = lane_of(bundle.worst_violation, l);
      in.advanced[who] = lane_of(bundle.t, l);
      in.status[who] = status == RUNNING ? bundle.motors().verdict(l) : status;
      for (int r = 0; r < M; ++r) in.blame[who * (M + D) + r] = bundle.blame_of(l)[r];
      bundle.motors().blame(Status(in.status[who]), l, in.blame + who * (M + D) + M);
    }
  }

  static void put(Real* to, int n, int lane, const double* from) {
    for (int k = 0; k < n; ++k) lane_of(to[k], lane) = from[k];
  }

  template <class From, class To>
  static void take(const From* from, int n, int lane, To* to) {
    for (int k = 0; k < n; ++k) to[k] = To(lane_of(from[k], lane));
  }

  long long n_bundles_ = 0, size_ = 0;
  std::unique_ptr<std::unique_ptr<Worker>[]> workers_;
  std::unique_ptr<unsigned char[], Free> memory_;
  StepperArrays arrays_{};
  std::atomic<long long> next_{0};
};

}  // namespace fan

// The C interface of the steppers of a puppet's lanes.
#define FAN_STEPPERS(...)                                                                 \
  /* Null where there was no memory. */                                                   \
  FAN_EXPORT void* fan_steppers_new(long long n, int workers) {                           \
    auto* made = new (std::nothrow) __VA_ARGS__();                                        \
    if (made && made->make(n, workers)) return made;                                      \
    delete made;                                                                          \
    return nullptr;                                                                       \
  }                                                                                       \
  FAN_EXPORT void fan_steppers_free(void* all) { delete static_cast<__VA_ARGS__*>(all); } \
  FAN_EXPORT void fan_steppers_begin(void* all, const fan::StepperArrays* arrays) {       \
    static_cast<__VA_ARGS__*>(all)->begin(*arrays);                                       \
  }                                                                                       \
  FAN_EXPORT void fan_steppers_work(void* all, int worker) {                              \
    static_cast<__VA_ARGS__*>(all)->work(worker);                                         \
  }
