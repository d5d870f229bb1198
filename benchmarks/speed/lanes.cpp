// Time of a time step in bundles of eight lanes, one trajectory a lane, each with its own input.
//
// argv: how often it is timed, how many steps in each.
// stdin: for every lane q_D and v_D; then p, winches, dt, recovery speed, tension cap, the input
// (n_segments, breaks, coef, base), which every lane evaluates for itself.
// stdout: one line a time, seconds of the processor for a step of one lane; then the sum of all
// tensions of all lanes [N] and the largest |h| of a string [m] at the end.
#define FAN_LANES 8

#include "model_of.hpp"
#include "fantoccini/drive.hpp"
#include "fantoccini/timestepping.hpp"

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <vector>

namespace {

using fan::Model;
using fan::room;
using Real = fan::Lanes<FAN_LANES>;
constexpr int W = FAN_LANES, NQ = Model::n_qD, N = Model::n_vD, NK = Model::n_vK;
constexpr int S = Model::n_strings, M = Model::n_rows;
static_assert(Model::n_qK == NK, "scalar inputs only");

std::vector<double> take(int n) {
  std::vector<double> out(static_cast<size_t>(n));
  for (double& x : out)
    if (std::scanf("%lf", &x) != 1) std::exit(2);
  return out;
}

struct Bundle {
  fan::Drive<typename Model::Driven, N> drive[W];
  fan::TimeStep<Model, Real> step;
  fan::Winches<S> winches;
  double q_now[W][room(NK)], v_now[W][room(NK)];
  Real q_D[room(NQ)], v_D[room(N)], q_K[room(NK)], v_K[room(NK)], acc_K[room(NK)], u_D[room(N)];
  Real p[room(Model::n_p)];

  void begin(const std::vector<double>& states) {
    double unused_a[room(NK)], unused_u[room(N)];
    for (int l = 0; l < W; ++l) {
      const double* from = states.data() + l * (NQ + N);
      for (int i = 0; i < NQ; ++i) q_D[i][l] = from[i];
      for (int k = 0; k < N; ++k) v_D[k][l] = from[NQ + k];
      drive[l].start_at(0.0);
      drive[l].evaluate(0.0, q_now[l], v_now[l], unused_a, unused_u);
    }
    for (int r = 0; r < M; ++r) {
      step.taut[r] = step.held[r] = Real(0.0) > Real(1.0);
      step.tension[r] = Real(0.0);
    }
    for (int i = 0; i < S; ++i) step.slip[i] = Real(0.0);
    step.stirred = Real(0.0) > Real(1.0);
  }

  void advance(double t, double dt, double recovery, double cap) {
    for (int l = 0; l < W; ++l) {
      double q[room(NK)], v[room(NK)], a[room(NK)], u[room(N)];
      drive[l].look_at(t + dt);
      drive[l].evaluate(t + dt, q, v, a, u);
      for (int j = 0; j < NK; ++j) {
        q_K[j][l] = q_now[l][j];
        v_K[j][l] = (q[j] - q_now[l][j]) / dt;
        acc_K[j][l] = (v[j] - v_now[l][j]) / dt;
        q_now[l][j] = q[j];
        v_now[l][j] = v[j];
      }
      for (int k = 0; k < N; ++k) u_D[k][l] = u[k];
    }
    step.step(q_D, v_D, q_K, v_K, acc_K, u_D, dt, recovery, cap, winches, p);
    if (fan::any(!step.settled)) std::exit(3);
  }
};

Bundle bundle;

}  // namespace

int main(int, char** argv) {
  const int times = std::atoi(argv[1]), n = std::atoi(argv[2]);
  const auto states = take(W * (NQ + N)), p = take(Model::n_p), table = take(3 * S);
  const auto number = take(3);
  const int n_segments = int(take(1)[0]);
  const auto breaks = take(n_segments + 1), coef = take(n_segments * NK * 6);
  const auto base = take(n_segments * Model::n_qK);
  for (auto& drive : bundle.drive)
    drive.set({n_segments, breaks.data(), coef.data(), base.data(), nullptr});
  for (int i = 0; i < Model::n_p; ++i) bundle.p[i] = Real(p[i]);
  bundle.winches.set(table.data());
  for (int i = 0; i <= times; ++i) {  // the first is a warm-up
    bundle.begin(states);
    const std::clock_t start = std::clock();
    for (int k = 0; k < n; ++k) bundle.advance(k * number[0], number[0], number[1], number[2]);
    const double took = double(std::clock() - start) / CLOCKS_PER_SEC;
    if (i > 0) std::printf("%.9g\n", took / n / W);
  }
  double sum = 0.0, apart = 0.0;
  for (int r = 0; r < S; ++r)
    for (int l = 0; l < W; ++l) {
      sum += bundle.step.tension[r][l];
      const double h = bundle.step.eval.h[r][l];
      if (!(fabs(h) <= apart)) apart = fabs(h);
    }
  std::printf("%.9g %.9g\n", sum, apart);
  return 0;
}
