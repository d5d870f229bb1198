// Time of one full constrained evaluation: accelerations and all tensions from a state.
//
// stdin: repeats, evaluations of each, q_D, v_D, p, the input (n_segments, breaks, coef, base).
// stdout: one line a repeat, seconds an evaluation; then the sum of the tensions [N].
#include "main.cpp"

#include <chrono>
#include <cstdio>
#include <vector>

namespace {

std::vector<double> take(int n) {
  std::vector<double> out(static_cast<size_t>(n));
  for (double& x : out)
    if (std::scanf("%lf", &x) != 1) std::printf("nan\n");
  return out;
}

fan::Flow<fan::Model> flow;

}  // namespace

int main() {
  using fan::Model;
  const auto head = take(2), q_D = take(Model::n_qD), v_D = take(Model::n_vD), p = take(Model::n_p);
  const int n = int(take(1)[0]);
  const auto breaks = take(n + 1), coef = take(n * Model::n_vK * 6), base = take(n * Model::n_qK);
  flow.drive.set({n, breaks.data(), coef.data(), base.data(), nullptr});
  flow.drive.start_at(0.0);
  for (int i = 0; i < Model::n_p; ++i) flow.p[i] = p[i];
  for (int i = 0; i < Model::n_qD; ++i) flow.y[i] = q_D[i];
  for (int k = 0; k < Model::n_vD; ++k) flow.y[Model::n_qD + k] = v_D[k];
  for (int r = 0; r < Model::n_rows; ++r)
    flow.mode[r] = r < Model::n_strings ? fan::HELD : fan::SLACK;
  for (int i = 0; i < Model::n_strings; ++i) {
    flow.slip[i] = 0.0;
    flow.winches.max_tension[i] = fan::kUnlimited;
  }
  flow.opt.tension_cap = 1e9;

  double rate[fan::Flow<Model>::NY], sum = 0.0;
  for (int repeat = 0; repeat < int(head[0]); ++repeat) {
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < int(head[1]); ++i) {
      flow.evaluate(1e-9 * i, flow.y, rate);
      sum += rate[Model::n_qD];
    }
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    std::printf("%.9g\n", took.count() / head[1]);
  }
  double tension = 0.0;
  for (int r = 0; r < Model::n_strings; ++r) tension += flow.tension[r];
  std::printf("%.9g\n", tension + 0.0 * sum);
  return 0;
}
