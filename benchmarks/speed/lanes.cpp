// Time of a bundle of lanes, each the same swing from the same state:
//
//   step            a time step with complementarity, without the work of a batch around it
//   step_dynamics   only its generated function
//
// argv and stdin are those of scalar.cpp. stdout: for each repetition, the processor time of one
// lane [s]; then the sum of the tensions [N] and the largest |h| of a string [m] at the end of the
// last one.
#include "main.cpp"
#include "given.hpp"

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>

namespace {

using fan::Model;
using fan::Wide;
constexpr int NQ = Model::n_qD, N = Model::n_vD, S = Model::n_strings, M = Model::n_rows;

fan::TimeSteppingTrajectory<Model, Wide> led;

// Constant inputs.
struct Still {
  void start(const Wide&, decltype(led)::Inputs& in) const {
    for (int i = 0; i < Model::n_qK; ++i) in.q_K[i] = Wide(base[i]);
    for (int j = 0; j < Model::n_vK; ++j) in.v_K[j] = in.acc_K[j] = Wide(0.0);
    for (int k = 0; k < N; ++k) in.u_D[k] = Wide(0.0);
    in.still = 1;
  }
  void fill(const Wide& t, decltype(led)::Inputs& in) const {
    if (in.still != 1) start(t, in);
  }
} inputs;

void begin() {
  for (int i = 0; i < NQ; ++i) led.state().q_D[i] = Wide(q_D[i]);
  for (int k = 0; k < N; ++k) led.state().v_D[k] = Wide(v_D[k]);
  for (int i = 0; i < Model::n_p; ++i) led.p()[i] = Wide(p[i]);
  for (int i = 0; i < S; ++i) led.at.slip[i] = Wide(0.0);
  fan::Options options{};
  options.dt = number[0];
  options.extrapolate = 1;
  options.recovery_speed = number[1];
  options.tension_cap = number[2];
  led.set(0.0, options, table.data());
  led.begin(inputs);
}

void step(int n) { fan::make_steps(led, inputs, fan::EvenSteps{number[0], n}); }

void step_dynamics(int n) {
  for (int i = 0; i < n; ++i)
    led.at.eval.at(
        led.state().q_D, led.state().v_D, led.inputs().q_K, led.inputs().v_K, led.inputs().acc_K,
        led.inputs().u_D, led.state().v_D, Wide(number[0]), led.p());
}

}  // namespace

int main(int, char** argv) {
  const bool stepping = !std::strcmp(argv[1], "step");
  const int times = std::atoi(argv[2]), n = std::atoi(argv[3]);
  take_all();
  // Constant inputs: the polynomials' constant terms.
  for (int i = 0; i < Model::Driven::n_scalars; ++i)
    base[Model::Driven::scalar_q[i]] = coef[6 * Model::Driven::scalar_v[i]];
  for (int i = 0; i <= times; ++i) {  // the first is a warm-up
    begin();
    const std::clock_t start = std::clock();
    (stepping ? step : step_dynamics)(n);
    const double took = double(std::clock() - start) / CLOCKS_PER_SEC;
    if (i > 0) std::printf("%.9g\n", took / n / fan::Traits<Wide>::width);
  }
  double sum = 0.0, apart = 0.0;
  for (int r = 0; r < S; ++r) {
    sum += fan::lane_of(led.at.tension[r], 0);
    const double h = fabs(fan::lane_of(led.at.eval.h[r], 0));
    if (!(h <= apart)) apart = h;
  }
  std::printf("%.9g %.9g\n", sum, apart);
  return 0;
}
