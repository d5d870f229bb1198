// A batch of event-driven runs, one trajectory at a time.
#pragma once

#include <optional>

#include "fantoccini/event/run.hpp"
#include "fantoccini/runs/batch.hpp"

namespace fan {

template <class Model>
class EventBatch {
 public:
  void work(Pool& pool) {
    long long first, last;
    while (pool.take(1, &first, &last)) run(pool, first);
  }

 private:
  using Row = Record<Model>;
  using Layout = SampleLayout<Model>;
  static constexpr int row_capacity = 256;
  static constexpr int event_capacity =
      1024 > 4 * EventRun<Model>::events_per_step ? 1024 : 4 * EventRun<Model>::events_per_step;
  static constexpr int contact_capacity = row_capacity * Model::n_contacts;
  static constexpr long long steps_per_report = 200;  // between two checks of the pool

  void run(Pool& pool, long long index) {
    const BatchArrays& in = pool.arrays;
    EventRun<Model>& run = run_.emplace();
    auto& flow = run.flow;
    Row out{{rows_, row_capacity, 0, events_, event_capacity, 0, contacts_, contact_capacity, 0}};
    caught_ = released_ = 0;
    row_ = 0;
    Status status = run.start(start_of(in, index), out);
    copy_samples(in, index, out);
    double reported = in.t;
    while (status == RUNNING) {
      status = run.run(in.t_end, steps_per_report, out);
      copy_samples(in, index, out);
      pool.advance((flow.t - reported) / (in.t_end - in.t));
      reported = flow.t;
      if (status == RUNNING && pool.stopped()) status = STOPPED;
    }
    const BatchEnd end{status, flow.t, 0.0, caught_, released_};
    put_end<Model>(in, index, end, 0, flow.y, flow.y + Model::n_qD);
    run.write_attribution(status, attribution_of<Model>(in, index));
  }

  // Copies the samples at the requested times to their rows. Of several samples at one time the
  // last, after the event, remains.
  void copy_samples(const BatchArrays& in, long long index, Row& out) {
    for (long long i = 0; i < out.n_samples; ++i) {
      const double* row = out.samples + i * Layout::width;
      const double t = row[Layout::t];
      while (row_ + 1 < in.n_samples && in.save_at[row_ + 1] <= t) ++row_;
      if (in.save_at[row_] != t) continue;
      put_row<Model>(in, index, row_, row + Layout::q_D);
    }
    for (long long i = 0; i < out.n_events; ++i) {
      const int kind = int(out.events[i * EventLayout::width + EventLayout::kind]);
      caught_ += kind == CATCH;
      released_ += kind == RELEASE;
    }
    out.n_samples = out.n_events = out.n_contacts = 0;
  }

  std::optional<EventRun<Model>> run_;
  double rows_[row_capacity * Layout::width], events_[event_capacity * EventLayout::width];
  double
      contacts_[array_size(contact_capacity * ContactLayout::width)];  // not copied to the results
  long long caught_ = 0, released_ = 0, row_ = 0;
};

}  // namespace fan
