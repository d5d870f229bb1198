// Many trajectories: their starts and inputs, the destinations of their rows, and the pool from
// which workers take them. Any number of threads may work on one pool; a trajectory's result
// depends only on its own start and inputs.
#pragma once

#include <atomic>
#include <new>

#include "fantoccini/contract.hpp"
#include "fantoccini/math/lane_of.hpp"
#include "fantoccini/runs/drive.hpp"
#include "fantoccini/runs/record.hpp"
#include "fantoccini/runs/shared.hpp"

namespace fan {

// The input of trajectory i, without the zero-length pieces that pad shorter inputs.
inline InputArrays input_of(const BatchArrays& in, long long i) {
  const double* times = of(in.breaks, i);
  int n = in.n_segments;
  while (n > 1 && times[n - 1] >= times[n]) --n;
  return {n, times, of(in.coef, i), of(in.base, i), of(in.force, i)};
}

// The start of trajectory i.
inline StartArrays start_of(const BatchArrays& in, long long i) {
  return {in.t,        of(in.q_D, i), of(in.v_D, i),   of(in.slip, i),
          of(in.p, i), in.winches,    input_of(in, i), in.options,
          in.save_at,  in.n_samples,  in.save_every};
}

// End of a trajectory.
struct BatchEnd {
  Status status;
  double reached, violation;
  long long catches, releases;
};

// Writes the end of trajectory i, in lane `lane` of q_D and v_D.
template <class Model, class Real>
void put_end(
    const BatchArrays& in, long long i, const BatchEnd& end, int lane, const Real* q_D,
    const Real* v_D) {
  in.status[i] = end.status;
  in.reached[i] = end.reached;
  in.violation[i] = end.violation;
  in.catches[i] = end.catches;
  in.releases[i] = end.releases;
  take_lane(q_D, Model::n_qD, lane, in.end_q_D + i * Model::n_qD);
  take_lane(v_D, Model::n_vD, lane, in.end_v_D + i * Model::n_vD);
}

// Destination of the attribution of trajectory i's status.
template <class Model>
double* attribution_of(const BatchArrays& in, long long i) {
  return in.attribution + i * (Model::n_rows + Model::n_watched);
}

// Writes `width` numbers, read by `value(k)`, as row `row` of trajectory `index`.
template <class Value>
void put_part(
    const BatchArrays& in, int part, int width, long long index, long long row,
    const Value& value) {
  const long long first = (index * in.n_samples + row) * width;
  if (part == Part::taut) {
    unsigned char* out = static_cast<unsigned char*>(in.parts[part]) + first;
    for (int k = 0; k < width; ++k) out[k] = value(k) != 0.0;
  } else {
    double* out = static_cast<double*>(in.parts[part]) + first;
    for (int k = 0; k < width; ++k) out[k] = value(k);
  }
}

// Writes a sample as row `row` of trajectory `index`; `from` points behind the sample's time.
template <class Model>
void put_row(const BatchArrays& in, long long index, long long row, const double* from) {
  for (int part = 0; part < Part::n; ++part) {
    const int width = part_width<Model>(part);
    if (in.parts[part]) put_part(in, part, width, index, row, [&](int k) { return from[k]; });
    from += width;
  }
}

// The pool of a batch: workers take `grain` trajectories at a time until none are left.
class Pool {
 public:
  explicit Pool(const BatchArrays& arrays) : arrays(arrays) {}

  const BatchArrays arrays;

  // The next trajectories [first, last). Returns false if there are none, or the batch was stopped.
  bool take(long long grain, long long* first, long long* last) {
    *first = next_.fetch_add(grain);
    if (stopped() || *first >= arrays.n) return false;
    *last = *first + grain < arrays.n ? *first + grain : arrays.n;
    return true;
  }

  void stop() { stop_.store(true); }
  bool stopped() const { return stop_.load(std::memory_order_relaxed); }

  // Adds `share` of a trajectory, 0 to 1, to the progress.
  void advance(double share) { done_.fetch_add((long long)(share * units)); }
  double done() const { return double(done_.load()) / units; }  // trajectories

 private:
  static constexpr double units = 1e6;  // a trajectory's progress is counted in millionths
  std::atomic<long long> next_{0}, done_{0};
  std::atomic<bool> stop_{false};
};

// Runs a new worker on a pool; returns 1 if memory is exhausted, else 0.
template <class Worker>
int work_on(void* pool) {
  Worker* worker = new (std::nothrow) Worker();
  if (!worker) return 1;
  worker->work(*static_cast<Pool*>(pool));
  delete worker;
  return 0;
}

}  // namespace fan

// The C interface of batches with workers of the given type.
#define FAN_BATCHES(...)                                                                \
  FAN_EXPORT void* fan_batch_new(const fan::BatchArrays* arrays) {                      \
    return new (std::nothrow) fan::Pool(*arrays);                                       \
  }                                                                                     \
  FAN_EXPORT void fan_batch_free(void* pool) { delete static_cast<fan::Pool*>(pool); }  \
  FAN_EXPORT void fan_batch_stop(void* pool) { static_cast<fan::Pool*>(pool)->stop(); } \
  FAN_EXPORT double fan_batch_done(const void* pool) {                                  \
    return static_cast<const fan::Pool*>(pool)->done();                                 \
  }                                                                                     \
  /* Works on a pool until nothing is left; 0, or 1 where there was no memory. */       \
  FAN_EXPORT int fan_batch_work(void* pool) { return fan::work_on<__VA_ARGS__>(pool); }
