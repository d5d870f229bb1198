// A run through the C interface, called as the package does, for the sanitizers.
//
// stdin: event-driven (1 or 0), t, t_end, new inputs half way (1 or 0), the eleven options, q_D,
// v_D, slip, p, the winches, the input (n_segments, breaks, coef, base), and times to save (n,
// times). stdout: status, rows, events, events of slipping, steps, whether all rows are finite, the
// largest attribution, and the last row.
#include "model_of.hpp"

#include "fantoccini/interface/model.hpp"

#include <cstdio>
#include <vector>

namespace {

using fan::Model;

double take() {
  double x = 0.0;
  if (std::scanf("%lf", &x) != 1) std::printf("numbers_left_out 1\n");
  return x;
}

std::vector<double> take(int n) {
  std::vector<double> out;
  for (int i = 0; i < n; ++i) out.push_back(take());
  return out;
}

fan::Options options() {
  fan::Options o;
  for (double* x :
       {&o.rtol, &o.atol, &o.first_step, &o.max_step, &o.tension_cap, &o.energy_scale,
        &o.force_scale, &o.recovery_speed, &o.dt})
    *x = take();
  o.max_steps = static_cast<long long>(take());
  o.max_events = static_cast<long long>(take());
  o.save_steps = int(take());
  o.extrapolate = int(take());
  o.contacts = nullptr;
  return o;
}

constexpr long long kBudget = 20;  // steps of one call, much fewer than those of a run

// Records too small for a whole run, which is therefore returned in pieces.
struct Sheets {
  static constexpr int kRows = 96, kEvents = 16 * Model::n_rows + 64;
  std::vector<double> rows = std::vector<double>(kRows * fan::SampleLayout<Model>::width);
  std::vector<double> events = std::vector<double>(kEvents * fan::EventLayout::width);
  std::vector<double> last;
  fan::Record<Model> record{{rows.data(), kRows, 0, events.data(), kEvents, 0, nullptr, 0, 0}};
  long long n_rows = 0, n_events = 0, n_slips = 0;
  bool finite = true;

  void turn() {
    constexpr int width = fan::SampleLayout<Model>::width;
    for (long long i = 0; i < record.n_samples * width; ++i)
      finite = finite && fabs(rows[size_t(i)]) < 1e100;
    if (record.n_samples > 0)
      last.assign(
          rows.begin() + (record.n_samples - 1) * width, rows.begin() + record.n_samples * width);
    for (long long i = 0; i < record.n_events; ++i)
      n_slips += events[size_t(i * fan::EventLayout::width + fan::EventLayout::kind)] == fan::SLIP;
    n_rows += record.n_samples;
    n_events += record.n_events;
    record.n_samples = record.n_events = 0;
  }
};

int run_to(void* run, double t_end, Sheets& sheets) {
  int status = fan::RUNNING;
  while (status == fan::RUNNING) {
    status = fan_run(run, t_end, kBudget, &sheets.record);
    sheets.turn();
  }
  return status;
}

}  // namespace

int main() {
  const bool event_driven = take() != 0.0;
  const double t = take(), t_end = take();
  const bool twice = take() != 0.0;
  const fan::Options o = options();
  const auto q_D = take(Model::n_qD), v_D = take(Model::n_vD), slip = take(Model::n_strings);
  const auto p = take(Model::n_p), winches = take(3 * Model::n_strings);
  const int n = int(take());
  const auto breaks = take(n + 1), coef = take(n * Model::n_vK * 6), base = take(n * Model::n_qK);
  const auto save_at = take(int(take()));
  const fan::InputArrays input{n, breaks.data(), coef.data(), base.data(), nullptr};
  const fan::StartArrays start{
      t,
      q_D.data(),
      v_D.data(),
      slip.data(),
      p.data(),
      winches.data(),
      input,
      o,
      save_at.data(),
      static_cast<long long>(save_at.size()),
      1};

  void* run = fan_new(event_driven);
  Sheets sheets;
  int status = fan_start(run, &start, &sheets.record);
  sheets.turn();
  if (status == fan::RUNNING && twice) {
    status = run_to(run, 0.5 * (t + t_end), sheets);
    fan_set_input(run, &input);
  }
  if (status == fan::RUNNING || status == fan::DONE) status = run_to(run, t_end, sheets);
  fan::RunProgress progress;
  double attribution[fan::array_size(Model::n_rows + Model::n_watched)], most = 0.0;
  fan_progress(run, &progress);
  fan_attribution(run, status, attribution);
  fan_free(run);
  for (int r = 0; r < Model::n_rows; ++r) most = attribution[r] > most ? attribution[r] : most;

  std::printf(
      "status %d\nrows %lld\nevents %lld\nslips %lld\nsteps %g\nfinite %d\nattribution %g\n",
      status, sheets.n_rows, sheets.n_events, sheets.n_slips, double(progress.steps),
      int(sheets.finite), most);
  for (size_t i = 0; i < sheets.last.size(); ++i) std::printf("row%zu %.17g\n", i, sheets.last[i]);
  return 0;
}
