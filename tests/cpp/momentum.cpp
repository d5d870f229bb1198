// Momentum of eight states, in lanes and individually.
//
// stdin: for each lane q_D, v_D, q_K, v_K; then the parameters.
// stdout: for each lane its momentum in lanes, then its individual momentum.
#define FAN_LANES 8

#include <cstdio>

#include "model_of.hpp"

#include "fantoccini/contract.hpp"

namespace {

using fan::array_size;
using fan::Model;
constexpr int NQ = Model::n_qD, N = Model::n_vD, NQK = Model::n_qK, NK = Model::n_vK;

template <class Real>
struct State {
  Real q_D[array_size(NQ)], v_D[array_size(N)], q_K[array_size(NQK)], v_K[array_size(NK)],
      p[array_size(Model::n_p)], out[6];

  void momentum() { fan::Call<Model, Real>::momentum(q_D, v_D, q_K, v_K, p, out); }
};

double next() {
  double x = 0.0;
  return std::scanf("%lf", &x) == 1 ? x : 0.0 / 0.0;
}

}  // namespace

int main() {
  static State<double> alone[FAN_LANES];
  static State<fan::Lanes<FAN_LANES>> lanes;
  for (int i = 0; i < FAN_LANES; ++i) {
    for (int k = 0; k < NQ; ++k) lanes.q_D[k][i] = alone[i].q_D[k] = next();
    for (int k = 0; k < N; ++k) lanes.v_D[k][i] = alone[i].v_D[k] = next();
    for (int k = 0; k < NQK; ++k) lanes.q_K[k][i] = alone[i].q_K[k] = next();
    for (int k = 0; k < NK; ++k) lanes.v_K[k][i] = alone[i].v_K[k] = next();
  }
  for (int k = 0; k < Model::n_p; ++k) {
    const double x = next();
    for (int i = 0; i < FAN_LANES; ++i) lanes.p[k][i] = alone[i].p[k] = x;
  }
  lanes.momentum();
  for (int i = 0; i < FAN_LANES; ++i) {
    alone[i].momentum();
    for (int k = 0; k < 6; ++k) std::printf("%.17g\n", double(lanes.out[k][i]));
    for (int k = 0; k < 6; ++k) std::printf("%.17g\n", alone[i].out[k]);
  }
}
