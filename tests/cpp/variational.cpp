// The variational integrator on bundles of doubles, compared with the scalar one; inputs are
// constant.
//
// stdin: n_steps, dt; then for each lane q_D, v_D, q_K; then the parameters.
// stdout, one number per line with its name: values asserted in Python.
#define FAN_LANES 8

#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>
#include <vector>

#include "fantoccini/math/elementary.hpp"
#include "fantoccini/math/lanes.hpp"
#include "model.hpp"

namespace fan {
namespace scalar {
#define casadi_real double
#include "model.c"
#undef casadi_real
}  // namespace scalar
namespace wide {
#define casadi_real fan::Lanes<FAN_LANES>
#include "model.c"
#undef casadi_real
}  // namespace wide

struct Model : ModelTables {
  using Wide = Lanes<FAN_LANES>;
#define FAN_FUNCTION(NAME)                                    \
  static int NAME(const double** arg, double** res) {         \
    return scalar::fan_##NAME(arg, res, nullptr, nullptr, 0); \
  }                                                           \
  static int NAME(const Wide** arg, Wide** res) {             \
    return wide::fan_##NAME(arg, res, nullptr, nullptr, 0);   \
  }
  FAN_FUNCTION(node_varying)
  FAN_FUNCTION(limit_rates)
  FAN_FUNCTION(energy)
  FAN_FUNCTION(solve_factor_transposed)
  FAN_FUNCTION(solve_factor)
  FAN_FUNCTION(midpoint_rule)
  FAN_FUNCTION(momenta)
  static void node_constants(double** res) { scalar::fan_node_constants(res); }
  static void node_constants(Wide** res) { wide::fan_node_constants(res); }
  static void column(int which, const double** arg, double** res) {
    scalar::fan_column(which, arg, res);
  }
  static void column(int which, const Wide** arg, Wide** res) { wide::fan_column(which, arg, res); }
};
}  // namespace fan

#include "fantoccini/variational/trajectory.hpp"

namespace {

using fan::array_size;
using fan::Model;
using Wide = fan::Lanes<FAN_LANES>;
constexpr int W = FAN_LANES, NQ = Model::n_qD, N = Model::n_vD, M = Model::n_rows;
constexpr int S = Model::n_strings, NQK = Model::n_qK, NK = Model::n_vK;

struct Lane {
  double q_D[array_size(NQ)], v_D[array_size(N)], q_K[array_size(NQK)];
};

double numbers_left_out = 0;

void take(double* out, int n) {
  for (int i = 0; i < n; ++i)
    if (std::scanf("%lf", out + i) != 1) numbers_left_out += 1;
}

double& at(double& x, int) { return x; }
double& at(Wide& x, int lane) { return x[lane]; }
bool get(bool x, int) { return x; }
bool get(const fan::Traits<Wide>::Mask& x, int lane) { return x[lane]; }

// Runs in several lanes; position k contains lane_at[k].
template <class Real>
struct Bundle {
  static constexpr int width = fan::Traits<Real>::width;
  using Led = fan::VariationalTrajectory<Model, Real>;

  // Constant inputs.
  struct Still {
    typename Led::Inputs inputs;

    void start(const Real&, typename Led::Inputs& in) { in = inputs; }
    void at(const Real&, typename Led::Inputs& in) { in = inputs; }
    void force(const Real&, Real* u) {
      for (int k = 0; k < N; ++k) u[k] = Real(0.0);
    }
  };

  Led led;
  Still drive;
  double t = 0.0;
  int lane_at[width];

  Bundle(const std::vector<Lane>& lanes, const double* p, const int* positions, double dt) {
    double winches[array_size(3 * S)];
    for (int i = 0; i < S; ++i) {
      winches[3 * i] = fan::unbounded;
      winches[3 * i + 1] = winches[3 * i + 2] = 0.0;
    }
    fan::Options options = {};
    options.dt = dt;
    options.tension_cap = 1e7;
    led.set(t, options, winches);
    for (int i = 0; i < Model::n_p; ++i) led.p()[i] = p[i];
    auto& in = drive.inputs;
    for (int i = 0; i < S; ++i) led.slip()[i] = Real(0.0);
    for (int k = 0; k < N; ++k) in.u_D[k] = Real(0.0);
    for (int j = 0; j < NK; ++j) in.v_K[j] = in.acc_K[j] = Real(0.0);
    for (int l = 0; l < width; ++l) {
      const Lane& lane = lanes[lane_at[l] = positions[l]];
      for (int i = 0; i < NQ; ++i) at(led.q_D()[i], l) = lane.q_D[i];
      for (int k = 0; k < N; ++k) at(led.v_D()[k], l) = lane.v_D[k];
      for (int j = 0; j < NQK; ++j) at(in.q_K[j], l) = lane.q_K[j];
    }
    led.begin(drive);
  }

  void advance(double dt) {
    led.advance(drive, t + dt, dt);
    t += dt;
  }

  // Lanes with a divided last step.
  int halved(double dt) {
    int n = 0;
    for (int l = 0; l < width; ++l) n += at(led.node().since, l) < 0.9 * dt;
    return n;
  }

  int stopped() {
    int n = 0;
    for (int l = 0; l < width; ++l) n += !get(led.runs(), l);
    return n;
  }

  std::vector<double> all(int l) {
    std::vector<double> out;
    for (int i = 0; i < NQ; ++i) out.push_back(at(led.q_D()[i], l));
    for (int k = 0; k < N; ++k) out.push_back(at(led.v_D()[k], l));
    for (int r = 0; r < M; ++r) out.push_back(at(led.pull[r], l));
    for (int r = 0; r < M; ++r) out.push_back(get(led.taut()[r], l) ? 1.0 : 0.0);
    out.push_back(at(led.work, l));
    out.push_back(at(led.damping, l));
    out.push_back(at(led.impact, l));
    return out;
  }
};

}  // namespace

int main() {
  double head[2];
  take(head, 2);
  const int n_steps = int(head[0]);
  const double dt = head[1];
  std::vector<Lane> lanes(W);
  for (Lane& lane : lanes) {
    take(lane.q_D, NQ);
    take(lane.v_D, N);
    take(lane.q_K, NQK);
  }
  double p[array_size(Model::n_p)];
  take(p, Model::n_p);
  int in_order[W], turned[W];
  for (int l = 0; l < W; ++l) {
    in_order[l] = l;
    turned[l] = (3 * l + 5) % W;
  }
  const auto first = std::make_unique<Bundle<Wide>>(lanes, p, in_order, dt);
  const auto second = std::make_unique<Bundle<Wide>>(lanes, p, turned, dt);
  std::vector<std::unique_ptr<Bundle<double>>> single;
  for (int l = 0; l < W; ++l)
    single.push_back(std::make_unique<Bundle<double>>(lanes, p, &in_order[l], dt));
  double apart = 0.0;
  int halved = 0;
  long long bits_apart = 0, modes_apart = 0, changes = 0;
  for (int n = 0; n < n_steps; ++n) {
    std::vector<std::vector<double>> was;
    for (int l = 0; l < W; ++l) was.push_back(first->all(l));
    first->advance(dt);
    second->advance(dt);
    const int now_halved = first->halved(dt);
    if (now_halved < W) halved += now_halved;
    for (int l = 0; l < W; ++l) {
      single[l]->advance(dt);
      const std::vector<double> mine = first->all(l), own = single[l]->all(0);
      for (int i = 0; i < NQ + N; ++i) apart = fmax(apart, fabs(mine[i] - own[i]));
      for (int r = NQ + N + M; r < NQ + N + 2 * M; ++r) {
        modes_apart += mine[r] != own[r];
        changes += mine[r] != was[l][r];
      }
      for (int k = 0; k < W; ++k)
        if (second->lane_at[k] == l)
          bits_apart +=
              std::memcmp(second->all(k).data(), mine.data(), sizeof(double) * mine.size()) != 0;
    }
  }
  std::printf("numbers_left_out %g\napart %.3e\n", numbers_left_out, apart);
  std::printf(
      "bits_apart %lld\nmodes_apart %lld\nchanges %lld\n", bits_apart, modes_apart, changes);
  std::printf("stopped %d\n", first->stopped() + second->stopped());
  std::printf("halved %d\n", halved);
  return 0;
}
