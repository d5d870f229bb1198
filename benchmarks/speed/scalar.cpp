// Time of the scalar runtime's work from a state with all strings taut:
//
//   evaluate        accelerations and all tensions
//   rk4             a step of the classical Runge-Kutta method, four evaluations with tensions
//   step            a time step with complementarity, as in a run
//   dynamics        only the generated function of an evaluation
//   step_dynamics   likewise of a step
//
// argv: the work, the number of repetitions, the number of calls in each.
// stdin: q_D, v_D, p, winches, dt, recovery speed, tension cap, the input (n_segments, breaks,
// coef, base).
// stdout: for each repetition, the processor time of one call [s]; then the sum of the tensions [N]
// and the largest |h| of a string [m] at the end of the last one.
#include "main.cpp"
#include "given.hpp"

#include <ctime>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace {

using fan::Model;
constexpr int NQ = Model::n_qD, N = Model::n_vD, S = Model::n_strings, M = Model::n_rows;
constexpr int NY = fan::Flow<Model>::NY;

fan::Flow<Model> flow;
fan::GridRun<fan::TimeSteppingTrajectory<Model, double>> run;

template <class Drive>
void set_input(Drive& drive) {
  drive.set({n_segments, breaks.data(), coef.data(), base.data(), nullptr});
  drive.start_at(0.0);
}

void hold_all_strings() {
  set_input(flow.drive);
  for (int i = 0; i < Model::n_p; ++i) flow.p[i] = p[i];
  for (int i = 0; i < NQ; ++i) flow.y[i] = q_D[i];
  for (int k = 0; k < N; ++k) flow.y[NQ + k] = v_D[k];
  for (int k = NQ + N; k < NY; ++k) flow.y[k] = 0.0;
  for (int r = 0; r < M; ++r) flow.row_state[r] = r < S ? fan::HELD : fan::SLACK;
  for (int i = 0; i < S; ++i) flow.slip[i] = 0.0;
  flow.winches.set(table.data());
  flow.opt.tension_cap = number[2];
  double rate[NY];
  flow.evaluate(0.0, flow.y, rate);
}

void evaluate(int n) {
  double rate[NY];
  for (int i = 0; i < n; ++i) flow.evaluate(1e-9 * i, flow.y, rate);
}

void rk4(int n) {
  const double dt = number[0];
  double k1[NY], k2[NY], k3[NY], k4[NY], at[NY];
  double* y = flow.y;
  for (int i = 0; i < n; ++i) {
    const double t = i * dt;
    flow.evaluate(t, y, k1);
    for (int j = 0; j < NY; ++j) at[j] = y[j] + 0.5 * dt * k1[j];
    flow.evaluate(t + 0.5 * dt, at, k2);
    for (int j = 0; j < NY; ++j) at[j] = y[j] + 0.5 * dt * k2[j];
    flow.evaluate(t + 0.5 * dt, at, k3);
    for (int j = 0; j < NY; ++j) at[j] = y[j] + dt * k3[j];
    flow.evaluate(t + dt, at, k4);
    for (int j = 0; j < NY; ++j) y[j] += dt / 6.0 * (k1[j] + 2.0 * (k2[j] + k3[j]) + k4[j]);
    fan::normalise_all<Model::Dynamic>(y);
  }
}

// Calls the generated functions at the state, with the inputs of its latest evaluation.
void dynamics(int n) {
  for (int i = 0; i < n; ++i)
    flow.eval.at(flow.y, flow.y + NQ, flow.q_K, flow.v_K, flow.acc_K, flow.u_D, flow.p);
}

void step_dynamics(int n) {
  const double dt = number[0];
  for (int i = 0; i < n; ++i)
    flow.eval.at(
        flow.y, flow.y + NQ, flow.q_K, flow.v_K, flow.acc_K, flow.u_D, flow.y + NQ, dt, flow.p);
}

constexpr int row_capacity = 4, some_events = 4 * (M + S + 1);
double row[fan::Record<Model>::Layout::width * row_capacity];
double event[fan::EventLayout::width * some_events];

fan::Record<Model> record() {
  fan::Record<Model> out{};
  out.samples = row, out.sample_capacity = row_capacity;
  out.events = event, out.event_capacity = some_events;
  return out;
}

void begin_steps() {
  auto out = record();
  ::begin_steps(run, nullptr, out);
}

void steps(int n) {
  fan::Record<Model> out = record();
  if (run.run(n * number[0], n + 1, out) != fan::DONE) std::exit(3);
}

}  // namespace

int main(int, char** argv) {
  const bool stepping = !std::strcmp(argv[1], "step");
  void (*work)(int) = steps;
  const struct {
    const char* name;
    void (*work)(int);
  } works[] = {
      {"evaluate", evaluate},
      {"rk4", rk4},
      {"dynamics", dynamics},
      {"step_dynamics", step_dynamics}};
  for (const auto& known : works)
    if (!std::strcmp(argv[1], known.name)) work = known.work;
  const int times = std::atoi(argv[2]), n = std::atoi(argv[3]);
  take_all();
  for (int i = 0; i <= times; ++i) {  // the first is a warm-up
    stepping ? begin_steps() : hold_all_strings();
    const std::clock_t start = std::clock();
    work(n);
    const double took = double(std::clock() - start) / CLOCKS_PER_SEC;
    if (i > 0) std::printf("%.9g\n", took / n);
  }
  const double* tension = stepping ? run.trajectory().at.tension : flow.tension;
  const auto& eval = stepping ? run.trajectory().at.eval : flow.eval;
  double sum = 0.0, apart = 0.0;
  for (int r = 0; r < S; ++r) {
    sum += tension[r];
    if (!(fabs(eval.h[r]) <= apart)) apart = fabs(eval.h[r]);
  }
  std::printf("%.9g %.9g\n", sum, apart);
  return 0;
}
