// Many trajectories: what they start from, where their rows go, and the pool that workers take
// them from. Any number of threads may work on one pool; a trajectory's result depends on nothing
// but its own start and inputs.
#pragma once

#include <atomic>
#include <new>

#include "drive.hpp"
#include "options.hpp"
#include "record.hpp"
#include "status.hpp"

namespace fan {

// Numbers that Python gives for each trajectory, `stride` of them apart; stride 0 shares one.
struct Shared {
  const double* first;
  long long stride;

  const double* of(long long i) const { return first ? first + i * stride : nullptr; }
};

// What is written for every row: the parts of a Record's row, in its order.
enum Part : int { Q_D, V_D, ACC_D, Q_K, V_K, ACC_K, FORCE, TAUT, BOOKS, SLIP_LENGTH, N_PARTS };

// The arrays of a batch. Rows: (n, n_rows, width) of every part that is not null; doubles, and one
// byte a row for TAUT.
struct BatchArrays {
  long long n;        // trajectories
  double t, t_end;    // s, of all
  Shared q_D, v_D, slip;
  int n_segments;     // of every input
  Shared breaks, coef, base, force;
  const double* p;        // of all
  const double* winches;  // of all
  Options options;
  int save_every;         // fixed steps: from row to row
  const double* save_at;  // event-driven: (n_rows,) times, the first t and the last t_end
  long long n_rows;
  void* parts[N_PARTS];
  int* status;        // (n,) Status
  double* reached;    // (n,) s
  double* violation;  // (n,) worst, of fixed steps
  long long* events;  // (n, 2) catches and releases
  double* blame;      // (n, rows and drives that are watched)
  double* end_q_D;    // (n, n_qD) the configuration reached
  double* end_v_D;    // (n, n_vD) the velocities there

  // Shorter inputs are filled up with pieces that last no time at their end.
  InputArrays input(long long i) const {
    const double* times = breaks.of(i);
    int n = n_segments;
    while (n > 1 && times[n - 1] >= times[n]) --n;
    return {n, times, coef.of(i), base.of(i), force.of(i)};
  }
};

// Writes `width` numbers, read by `value(k)`, as row `row` of trajectory `who`.
template <class Value>
void put_part(
    const BatchArrays& in, int part, int width, long long who, long long row, const Value& value) {
  const long long first = (who * in.n_rows + row) * width;
  if (part == TAUT) {
    unsigned char* out = static_cast<unsigned char*>(in.parts[part]) + first;
    for (int k = 0; k < width; ++k) out[k] = value(k) != 0.0;
  } else {
    double* out = static_cast<double*>(in.parts[part]) + first;
    for (int k = 0; k < width; ++k) out[k] = value(k);
  }
}

template <class Model>
constexpr int part_width(int part) {
  constexpr int N = Model::n_vD, M = Model::n_rows;
  const int widths[N_PARTS] = {Model::n_qD, N, N,  Model::n_qK, Model::n_vK,
                               Model::n_vK, M, M,  6,           Model::n_strings};
  return widths[part];
}

// Writes a Record's row, from `from` on behind its time, as row `row` of trajectory `who`.
template <class Model>
void put_row(const BatchArrays& in, long long who, long long row, const double* from) {
  for (int part = 0; part < N_PARTS; ++part) {
    const int width = part_width<Model>(part);
    if (in.parts[part]) put_part(in, part, width, who, row, [&](int k) { return from[k]; });
    from += width;
  }
}

// The pool of a batch: workers take `grain` trajectories at a time until none are left.
class Pool {
 public:
  explicit Pool(const BatchArrays& arrays) : arrays(arrays) {}

  const BatchArrays arrays;

  // The next trajectories [first, last); false where there are none, or the batch was stopped.
  bool take(long long grain, long long* first, long long* last) {
    *first = next_.fetch_add(grain);
    if (stopped() || *first >= arrays.n) return false;
    *last = *first + grain < arrays.n ? *first + grain : arrays.n;
    return true;
  }

  void stop() { stop_.store(true); }
  bool stopped() const { return stop_.load(std::memory_order_relaxed); }

  // Books `share` of a trajectory, 0 to 1, as done.
  void advance(double share) { done_.fetch_add((long long)(share * kWhole)); }
  double done() const { return double(done_.load()) / kWhole; }  // trajectories

 private:
  static constexpr double kWhole = 1e6;
  std::atomic<long long> next_{0}, done_{0};
  std::atomic<bool> stop_{false};
};

// Has a new worker work on a pool; 1 where there is no memory for it.
template <class Worker>
int work_on(void* pool) {
  Worker* worker = new (std::nothrow) Worker();
  if (!worker) return 1;
  worker->work(*static_cast<Pool*>(pool));
  delete worker;
  return 0;
}

}  // namespace fan

// The pool's part of a C interface; the including file defines fan_batch_work.
#define FAN_POOL                                                                        \
  FAN_EXPORT void* fan_batch_new(const fan::BatchArrays* arrays) {                      \
    return new (std::nothrow) fan::Pool(*arrays);                                       \
  }                                                                                     \
  FAN_EXPORT void fan_batch_free(void* pool) { delete static_cast<fan::Pool*>(pool); } \
  FAN_EXPORT void fan_batch_stop(void* pool) { static_cast<fan::Pool*>(pool)->stop(); } \
  FAN_EXPORT double fan_batch_done(const void* pool) {                                  \
    return static_cast<const fan::Pool*>(pool)->done();                                 \
  }
