// A batch of variational runs, one trajectory at a time.
#pragma once

#include "batch.hpp"
#include "variational_run.hpp"

namespace fan {

template <class Model>
class VariationalBatch {
 public:
  void work(Pool& pool) {
    long long first, last;
    while (pool.take(1, &first, &last)) run(pool, first);
  }

 private:
  using Row = Record<Model>;
  static constexpr int N = Model::n_vD, S = Model::n_strings, M = Model::n_rows;
  static constexpr int kRows = 256, kEvents = 1024 + 4 * (M + S);
  static constexpr long long kBudget = 200;  // steps between two looks at the pool

  void run(Pool& pool, long long who) {
    const BatchArrays& in = pool.arrays;
    Row out{rows_, kRows, 0, events_, kEvents, 0};
    caught_ = released_ = row_ = 0;
    run_.opt = in.options;
    run_.save_every = in.save_every;
    run_.drive.set(in.input(who));
    run_.set(in.t, in.q_D.of(who), in.v_D.of(who), in.slip.of(who), in.p, in.winches);
    run_.start(out);
    Status status = RUNNING;
    double told = in.t;
    while (status == RUNNING) {
      status = run_.run(in.t_end, kBudget, out);
      hand_over(in, who, out);
      pool.advance((run_.t - told) / (in.t_end - in.t));
      told = run_.t;
      if (status == RUNNING && pool.stopped()) status = STOPPED;
    }
    in.status[who] = status;
    in.reached[who] = run_.t;
    in.violation[who] = run_.worst_violation;
    in.events[2 * who] = caught_;
    in.events[2 * who + 1] = released_;
    for (int r = 0; r < M; ++r) in.blame[who * M + r] = run_.blame[r];
  }

  // Rows are at the times of the batch; one within a step, where a run has stopped, is at none.
  void hand_over(const BatchArrays& in, long long who, Row& out) {
    for (long long i = 0; i < out.n_rows; ++i) {
      const double* row = out.rows + i * Row::row_width;
      if (row_ < in.n_rows && fabs(row[0] - in.save_at[row_]) < 1e-6 * in.options.dt)
        put_row<Model>(in, who, row_++, row + 1);
    }
    for (long long i = 0; i < out.n_events; ++i) {
      const int kind = int(out.events[i * Row::event_width + 1]);
      caught_ += kind == CATCH;
      released_ += kind == RELEASE;
    }
    out.n_rows = out.n_events = 0;
  }

  VariationalRun<Model> run_;
  double rows_[kRows * Row::row_width], events_[kEvents * Row::event_width];
  long long caught_ = 0, released_ = 0, row_ = 0;
};

}  // namespace fan
