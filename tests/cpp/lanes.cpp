// The time-stepper on bundles of doubles, compared with the scalar one.
//
// stdin: n_steps, dt, recovery speed, cap; then for each lane q_D, v_D, slip, q_K, and for every
// driven coordinate an amplitude, a frequency and a phase: q_K(t) = q_K + a (cos(p) - cos(w t +
// p)). All driven coordinates are scalars. Parameters and winches follow, the same for all lanes.
//
// stdout, one number per line with its name: values asserted in Python.
#define FAN_LANES 8

#include <cstdio>
#include <cstring>
#include <vector>

#include "model_of.hpp"
#include "fantoccini/timestepping/step.hpp"

namespace {

using fan::array_size;
using fan::Model;
constexpr int W = FAN_LANES;
constexpr int NQ = Model::n_qD, N = Model::n_vD, NK = Model::n_vK, M = Model::n_rows;
constexpr int S = Model::n_strings, LEDGER = 5;
static_assert(Model::n_qK == NK, "scalar inputs only");

struct Lane {
  double q_D[array_size(NQ)], v_D[array_size(N)], slip[array_size(S)], q_K[array_size(NK)],
      amplitude[array_size(NK)], omega[array_size(NK)], phase[array_size(NK)];

  double input(int j, double t) const {
    return q_K[j] + amplitude[j] * (cos(phase[j]) - cos(omega[j] * t + phase[j]));
  }
};

double numbers_left_out = 0;

void read_numbers(double* out, int n) {
  for (int i = 0; i < n; ++i)
    if (std::scanf("%lf", out + i) != 1) numbers_left_out += 1;
}

double& at(double& x, int) { return x; }
decltype(auto) at(fan::Lanes<W>& x, int lane) { return x[lane]; }
double get(const double& x, int) { return x; }
double get(const fan::Lanes<W>& x, int lane) { return x[lane]; }
bool get(const bool& x, int) { return x; }
bool get(const fan::Traits<fan::Lanes<W>>::Mask& x, int lane) { return x[lane]; }

// A stepper for several lanes; `lane_at` gives their positions in the bundle: position k contains
// lane_at[k].
template <class Real>
struct Bundle {
  static constexpr int width = fan::Traits<Real>::width;
  fan::TimeStep<Model, Real> step;
  Real q_D[array_size(NQ)], v_D[array_size(N)], q_K[array_size(NK)], v_K[array_size(NK)],
      acc_K[array_size(NK)], u_D[array_size(N)], p[array_size(Model::n_p)];
  fan::Winches<S> winches;
  int lane_at[width];

  Bundle(
      const std::vector<Lane>& lanes, const double* parameters, const fan::Winches<S>& all_winches,
      const int* positions)
      : winches(all_winches) {
    for (int r = 0; r < M; ++r) {
      step.set_row(r, Real(0.0) > Real(1.0), Real(0.0) > Real(1.0));
      step.tension[r] = Real(0.0);
    }
    for (int k = 0; k < N; ++k) u_D[k] = Real(0.0);
    for (int i = 0; i < Model::n_p; ++i) p[i] = Real(parameters[i]);
    for (int l = 0; l < width; ++l) {
      lane_at[l] = positions[l];
      const Lane& lane = lanes[lane_at[l]];
      for (int i = 0; i < NQ; ++i) at(q_D[i], l) = lane.q_D[i];
      for (int k = 0; k < N; ++k) at(v_D[k], l) = lane.v_D[k];
      for (int i = 0; i < S; ++i) at(step.slip[i], l) = lane.slip[i];
    }
  }

  void advance(const std::vector<Lane>& lanes, int n, double dt, double recovery, double cap) {
    for (int l = 0; l < width; ++l)
      for (int j = 0; j < NK; ++j) {
        const Lane& lane = lanes[lane_at[l]];
        const double before = lane.input(j, (n - 1) * dt), here = lane.input(j, n * dt);
        const double next = lane.input(j, (n + 1) * dt);
        at(q_K[j], l) = here;
        at(v_K[j], l) = (next - here) / dt;
        at(acc_K[j], l) = (next - 2 * here + before) / (dt * dt);
      }
    Real q_next[array_size(NQ)], v_next[array_size(N)];
    step.step(q_D, v_D, q_K, v_K, acc_K, u_D, dt, recovery, cap, winches, p, q_next, v_next);
    for (int i = 0; i < NQ; ++i) q_D[i] = q_next[i];
    for (int k = 0; k < N; ++k) v_D[k] = v_next[k];
  }

  // All results of a step in a lane.
  std::vector<double> all(int l) const {
    std::vector<double> out;
    for (int i = 0; i < NQ; ++i) out.push_back(get(q_D[i], l));
    for (int k = 0; k < N; ++k) out.push_back(get(v_D[k], l));
    for (int i = 0; i < S; ++i) out.push_back(get(step.slip[i], l));
    for (int r = 0; r < M; ++r) out.push_back(get(step.tension[r], l));
    for (int r = 0; r < M; ++r) out.push_back(get(step.taut[r], l) ? 1.0 : 0.0);
    out.push_back(get(step.work, l));
    out.push_back(get(step.eval.loss, l));
    out.push_back(get(step.impact, l));
    out.push_back(get(step.slip_loss, l));
    out.push_back(get(step.violation, l));
    out.push_back(get(step.settled, l) ? 1.0 : 0.0);
    return out;
  }
};

struct LargestError {
  double value = 0.0;
  void operator()(double error, double scale) {
    const double relative = fabs(error) / (scale > 1.0 ? scale : 1.0);
    if (!(relative <= value)) value = relative;  // keeps NaN
  }
};

bool differ(const std::vector<double>& a, const std::vector<double>& b) {
  return std::memcmp(a.data(), b.data(), sizeof(double) * a.size()) != 0;
}

double largest(const double* x, int n) {
  double largest_size = 0.0;
  for (int i = 0; i < n; ++i)
    if (!(fabs(x[i]) <= largest_size)) largest_size = fabs(x[i]);
  return largest_size;
}

}  // namespace

int main() {
  double header[4];
  read_numbers(header, 4);
  const int n_steps = int(header[0]);
  const double dt = header[1], recovery = header[2], cap = header[3];
  std::vector<Lane> lanes(W);
  for (Lane& lane : lanes) {
    read_numbers(lane.q_D, NQ);
    read_numbers(lane.v_D, N);
    read_numbers(lane.slip, S);
    read_numbers(lane.q_K, NK);
    read_numbers(lane.amplitude, NK);
    read_numbers(lane.omega, NK);
    read_numbers(lane.phase, NK);
  }
  double p[array_size(Model::n_p)];
  read_numbers(p, Model::n_p);
  double table[array_size(3 * S)];
  read_numbers(table, 3 * S);
  fan::Winches<S> winches;
  winches.set(table);

  int in_order[W], permuted[W];
  for (int l = 0; l < W; ++l) {
    in_order[l] = l;
    permuted[l] = (3 * l + 5) % W;
  }
  using Wide = fan::Lanes<W>;
  Bundle<Wide> first(lanes, p, winches, in_order), second(lanes, p, winches, permuted);
  std::vector<Bundle<Wide>> uniform;  // bundles with the same lane in all positions
  std::vector<Bundle<double>> single;
  for (int l = 0; l < W; ++l) {
    const int same[W] = {l, l, l, l, l, l, l, l};
    uniform.emplace_back(lanes, p, winches, same);
    single.emplace_back(lanes, p, winches, &in_order[l]);
  }

  LargestError q, v, slip, tension, ledger;
  long long modes_apart = 0, bits_apart = 0, unsettled = 0;
  std::vector<long long> changes(W, 0), slips(W, 0);
  long long steps_unlike = 0;  // steps with different modes of lanes
  for (int n = 0; n < n_steps; ++n) {
    std::vector<std::vector<bool>> was(W);
    // Every scalar stepper starts the step from the state of its lane.
    for (int l = 0; l < W; ++l) {
      for (int i = 0; i < NQ; ++i) single[l].q_D[i] = first.q_D[i][l];
      for (int k = 0; k < N; ++k) single[l].v_D[k] = first.v_D[k][l];
      for (int i = 0; i < S; ++i) single[l].step.slip[i] = first.step.slip[i][l];
      for (int r = 0; r < M; ++r) {
        single[l].step.set_row(r, first.step.taut[r][l], first.step.held[r][l]);
        was[l].push_back(first.step.taut[r][l]);
      }
    }
    first.advance(lanes, n, dt, recovery, cap);
    second.advance(lanes, n, dt, recovery, cap);
    bool differs = false;
    for (int l = 0; l < W; ++l) {
      single[l].advance(lanes, n, dt, recovery, cap);
      uniform[l].advance(lanes, n, dt, recovery, cap);
      const std::vector<double> in_lanes = first.all(l), alone = single[l].all(0);
      const double *a = in_lanes.data(), *b = alone.data();
      for (int i = 0; i < NQ; ++i) q(a[i] - b[i], largest(b, NQ));
      a += NQ, b += NQ;
      for (int i = 0; i < N; ++i) v(a[i] - b[i], largest(b, N));
      a += N, b += N;
      for (int i = 0; i < S; ++i) slip(a[i] - b[i], largest(b, S));
      for (int i = 0; i < S; ++i) slips[l] += a[i] > lanes[l].slip[i];
      a += S, b += S;
      for (int i = 0; i < M; ++i) tension(a[i] - b[i], largest(b, M));
      a += M, b += M;
      for (int i = 0; i < M; ++i) modes_apart += a[i] != b[i];
      for (int i = 0; i < M; ++i) changes[l] += (a[i] > 0.5) != was[l][i];
      for (int i = 0; i < M; ++i) differs = differs || get(first.step.taut[i], 0) != (a[i] > 0.5);
      a += M, b += M;
      for (int i = 0; i < LEDGER; ++i) ledger(a[i] - b[i], largest(b, LEDGER));
      unsettled += a[LEDGER] < 0.5;
      for (int k = 0; k < W; ++k) {
        bits_apart += second.lane_at[k] == l && differ(second.all(k), in_lanes);
        bits_apart += differ(uniform[l].all(k), in_lanes);
      }
    }
    steps_unlike += differs;
  }
  long long fewest = changes[0], slipped = 0;
  for (long long c : changes) fewest = c < fewest ? c : fewest;
  for (long long c : slips) slipped += c > 0;
  std::printf("numbers_left_out %g\n", numbers_left_out);
  std::printf(
      "q %.3e\nv %.3e\nslip %.3e\ntension %.3e\nledger %.3e\n", q.value, v.value, slip.value,
      tension.value, ledger.value);
  std::printf(
      "modes_apart %lld\nbits_apart %lld\nunsettled %lld\n", modes_apart, bits_apart, unsettled);
  std::printf("lanes_that_slipped %lld\n", slipped);
  std::printf("fewest_changes %lld\nsteps_unlike %lld\n", fewest, steps_unlike);
  return 0;
}
