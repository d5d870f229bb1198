// Trajectories with fixed steps that are advanced piece by piece, in bundles of lanes, each with
// its own parameters, under constant accelerations and forces over a piece (StepperArrays).
//
// Between pieces a bundle exists as the memory of its lanes and the caller's arrays: every worker
// has one trajectory, with which it advances bundle after bundle.
#pragma once

#include <atomic>
#include <cstring>
#include <memory>
#include <new>

#include "fantoccini/runs/batch.hpp"
#include "fantoccini/runs/held_drive.hpp"
#include "fantoccini/runs/lane_memory.hpp"
#include "fantoccini/runs/stepping.hpp"
#include "fantoccini/timestepping/trajectory.hpp"

namespace fan {

template <class Model, class Real>
class LaneStepper {
 public:
  static constexpr int width = Traits<Real>::width;

  // Allocates n trajectories and this many workers. Returns whether there was memory.
  bool make(long long n, int workers) {
    n_bundles_ = (n + width - 1) / width;
    LaneMemory<Real> count(Memory::COUNT, nullptr, Real(0.0) < Real(1.0));
    workers_.reset(new (std::nothrow) std::unique_ptr<Worker>[workers]);
    if (!workers_) return false;
    for (int i = 0; i < workers; ++i) {
      workers_[i].reset(new (std::nothrow) Worker());
      if (!workers_[i]) return false;
    }
    workers_[0]->bundle.remember(count);
    size_ = (count.size() + Memory::alignment - 1) / Memory::alignment * Memory::alignment;
    memory_.reset(new (
        std::align_val_t(Memory::alignment), std::nothrow) unsigned char[n_bundles_ * size_]());
    return memory_ != nullptr;
  }

  // Sets a piece for work(); the arrays must live until all workers are done.
  void begin(const StepperArrays& arrays) {
    arrays_ = arrays;
    next_.store(0);
  }

  // Writes the memory of all bundles to `out`, or reads it from `from`, written by steppers of the
  // same library and number; either may be null. Returns its size in bytes.
  long long remember(unsigned char* out, const unsigned char* from) {
    const long long size = n_bundles_ * size_;
    if (out) std::memcpy(out, memory_.get(), size);
    if (from) std::memcpy(memory_.get(), from, size);
    return size;
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
    TimeSteppingTrajectory<Model, Real> bundle;
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
      bundle.remember(memory);
      load(worker, first, n);
      for (int l = 0; l < n; ++l) in.fresh[first + l] = 0;
    }
    bundle.resume(worker.drive);
    Memory before(Memory::READ, place, Real(0.0) < Real(1.0));
    bundle.remember(before);
    bundle.continue_from();
    make_steps(bundle, worker.drive, StepGrid{0.0, in.duration, in.options.dt});
    Memory after(Memory::WRITE, place, Real(0.0) < Real(1.0));
    bundle.remember(after);
    write(bundle, first, n);
  }

  // The present states, inputs and parameters. Lanes beyond the last one repeat it.
  void load(Worker& worker, long long first, int n) {
    const StepperArrays& in = arrays_;
    auto& bundle = worker.bundle;
    bundle.set(0.0, in.options, in.winches);
    auto& inputs = bundle.inputs();
    Real acc_K[array_size(NK)];
    for (int l = 0; l < width; ++l) {
      const long long index = first + (l < n ? l : n - 1);
      put_lane(in.q_D + index * NQ, NQ, l, bundle.q_D());
      put_lane(in.v_D + index * N, N, l, bundle.v_D());
      put_lane(in.slip + index * S, S, l, bundle.slip());
      put_lane(in.p + index * NP, NP, l, bundle.p());
      put_lane(in.q_K + index * Model::n_qK, Model::n_qK, l, inputs.q_K);
      put_lane(in.v_K + index * NK, NK, l, inputs.v_K);
      put_lane(of(in.acc_K, index), NK, l, acc_K);
      const double* force = of(in.u_D, index);
      for (int k = 0; k < N; ++k) lane_of(inputs.u_D[k], l) = force ? force[k] : 0.0;
    }
    worker.drive.set(inputs, acc_K);
  }

  void write(TimeSteppingTrajectory<Model, Real>& bundle, long long first, int n) {
    const StepperArrays& in = arrays_;
    const auto& inputs = bundle.inputs();
    Real energy_terms[5], energy[2];
    bundle.energy_terms(energy_terms);
    struct {
      Real *T, *V;
    } parts{energy, energy + 1};
    Call<Model, Real>::energy(
        bundle.q_D(), bundle.v_D(), inputs.q_K, inputs.v_K, bundle.p(), parts);
    for (int l = 0; l < n; ++l) {
      const long long index = first + l;
      take_lane(bundle.q_D(), NQ, l, in.q_D + index * NQ);
      take_lane(bundle.v_D(), N, l, in.v_D + index * N);
      take_lane(bundle.slip(), S, l, in.slip + index * S);
      // A stopped lane also keeps its inputs.
      if (lane_of(bundle.runs(), l)) {
        take_lane(inputs.q_K, Model::n_qK, l, in.q_K + index * Model::n_qK);
        take_lane(inputs.v_K, NK, l, in.v_K + index * NK);
      }
      take_lane(bundle.tension(), M, l, in.tension + index * M);
      take_lane(bundle.taut(), M, l, in.taut + index * M);
      take_lane(energy_terms, 5, l, in.energy_terms + index * 5);
      take_lane(energy, 2, l, in.energy + index * 2);
      in.violation[index] = lane_of(bundle.worst_violation, l);
      in.advanced[index] = lane_of(bundle.t, l);
      in.status[index] = verdict(bundle, l);
      write_attribution(bundle, Status(in.status[index]), l, in.attribution + index * (M + D));
    }
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
  }                                                                                       \
  FAN_EXPORT long long fan_steppers_memory(                                               \
      void* all, unsigned char* out, const unsigned char* from) {                         \
    return static_cast<__VA_ARGS__*>(all)->remember(out, from);                           \
  }
