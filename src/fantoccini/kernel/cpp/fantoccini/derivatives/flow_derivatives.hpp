// Small changes Z along a smooth piece of an event-driven run, with the rows held in it:
//
//   dZ_q/dt = turning(v_D) Z_q + Z_v
//   dZ_v/dt = acc_q Z_q + acc_v Z_v + (acc_p, acc_inputs(t))
//
// integrated together with the state by dop853. The stages of a step depend on the state alone, so
// the derivatives at all of them are computed first.
#pragma once

#include <cmath>
#include <cstring>
#include <memory>

#include "fantoccini/derivatives/linear_flow.hpp"
#include "fantoccini/event/tableau.hpp"
#include "fantoccini/math/manifold.hpp"
#include "fantoccini/math/row_products.hpp"
#include "fantoccini/model/segments.hpp"

namespace fan {

struct FlowDerivativeTolerances {
  static constexpr double safety = 0.9, least = 0.2, most = 10.0;  // relative to the previous step
  static constexpr double least_error = 1e-4;  // lower bound of errors in trend()
};

template <class Model>
class FlowDerivatives {
 public:
  static constexpr int NQ = Model::n_qD, N = Model::n_vD, K = Model::n_vK, P = Model::n_p;
  static constexpr int M = Model::n_rows, NY = NQ + N, rows = 2 * N;
  using Linear = LinearFlow<Model>;
  using Tolerance = FlowDerivativeTolerances;

  explicit FlowDerivatives(const FlowDerivativeArrays& in)
      : in_(in),
        ld_(in_eights(in.m)),
        ld_inputs_(in_eights(in.n_inputs)),
        step_(in.step),
        linear_(in.n_inputs),
        points_(new FlowPoint<Model>[dop853::stages + 1]),
        Z_(size()),
        Z_at_(size()),
        Z_end_(size()),
        by_state_((dop853::stages + 1) * in_state),
        by_rest_((dop853::stages + 1) * in_rest()),
        powers_(n_powers * changes()),
        inputs_(changes()) {
    rate_.resize((dop853::stages + 1) * NY);
    for (auto& k : Z_rate_) k.resize(size());
    for (int j = 0; j < n_powers * Linear::n_changes; ++j)
      std::memcpy(
          powers_.data() + j * ld_inputs_, in.by_inputs + j * in.n_inputs,
          sizeof(double) * in.n_inputs);
    for (int j = 0; j < n_powers * changes(); ++j) {
      if (powers_[j] == 0.0) continue;
      degree_ = j / changes();
      if (j % changes() >= n_changing_) n_changing_ = changes();
    }
    linear_.look_at(powers_.data(), n_powers);
    for (int r = 0; r < M; ++r)
      if (in.held[r]) held_[n_held_++] = r;
    for (int j = 0; j < K; ++j) still_[j] = is_constant(in.input.coef + n_powers * j);
    std::memcpy(y_, in.q_D, sizeof(double) * NQ);
    std::memcpy(y_ + NQ, in.v_D, sizeof(double) * N);
    for (int k = 0; k < rows; ++k)
      std::memcpy(Z_.data() + k * ld_, in.changes + k * in.m, sizeof(double) * in.m);
  }

  // Writes the state and the changes at all times.
  int advance() {
    double t = in_.start;
    evaluate(0, t, y_);
    find(0, 1, t, 0.0);
    for (long long i = 0; i < in_.n_times; ++i) {
      while (t < in_.times[i]) {
        const double rest = in_.times[i] - t;
        const bool last = step_ >= rest;
        const double s = last ? rest : (2.0 * step_ > rest ? 0.5 * rest : step_);
        const double error = attempt(t, s);
        if (!(error <= 1.0)) {
          step_ = s * std::fmax(factor(error), Tolerance::least);
          if (!(step_ > 10.0 * (std::nextafter(t, in_.times[i]) - t))) return STEP_TOO_SMALL;
          continue;
        }
        t = last ? in_.times[i] : t + s;
        const double next = s * std::fmin(factor(error) * trend(error, s), Tolerance::most);
        if (next > step_ || s == step_) step_ = next;
        accept();
      }
      write(i);
    }
    return DONE;
  }

  // Length of the next trial step.
  double step() const { return step_; }

 private:
  static constexpr int in_state = rows * Linear::height;

  // Ratio of the next step to one with this error.
  static double factor(double error) { return Tolerance::safety * std::pow(error, -0.125); }

  // Factor (at most 1) of the next step for errors that grow from step to step (Gustafsson, ACM
  // Trans. Math. Softw. 20, 1994), after an accepted step.
  double trend(double error, double s) {
    const double per_step = std::pow(std::fmax(error, Tolerance::least_error), 0.125) / s;
    const double before = error_per_step_;
    error_per_step_ = per_step;
    return before > 0.0 && before < per_step ? before / per_step : 1.0;
  }

  // Products overwrite rows past the last.
  int size() const { return (N + Linear::height) * ld_; }
  int changes() const { return Linear::n_changes * ld_inputs_; }
  int in_rest() const { return Linear::height * in_eights(P + in_.n_inputs); }

  // Evaluates the state and its rate at a stage.
  void evaluate(int stage, double t, const double* y) {
    FlowPoint<Model>& at = points_[stage];
    std::memcpy(at.q_D, y, sizeof(at.q_D));
    std::memcpy(at.v_D, y + NQ, sizeof(at.v_D));
    const double s = t - in_.input.breaks[0];
    motion_of<typename Model::Driven>(
        in_.input.coef, in_.input.base, still_, s, at.q_K, at.v_K, at.acc_K);
    for (int j = 0; j < N; ++j) {
      double speed, second;
      at.u_D[j] = 0.0;
      if (in_.input.force) polynomial(in_.input.force + n_powers * j, s, at.u_D[j], speed, second);
    }
    at.accelerate(in_.p, held_, n_held_);
    double* rate = rate_.data() + stage * NY;
    configuration_rate(at.q_D, at.v_D, rate);
    std::memcpy(rate + NQ, at.acc, sizeof(double) * N);
  }

  static void configuration_rate(const double* q, const double* v, double* rate) {
    using Space = typename Model::Dynamic;
    for (int i = 0; i < Space::n_scalars; ++i) rate[Space::scalar_q[i]] = v[Space::scalar_v[i]];
    for (int i = 0; i < Space::n_quaternions; ++i) {
      const double* w = v + Space::quaternion_v[i];
      const double turn[4] = {0.0, 0.5 * w[0], 0.5 * w[1], 0.5 * w[2]};
      quaternion_product(q + Space::quaternion_q[i], turn, rate + Space::quaternion_q[i]);
    }
  }

  // Computes the derivatives of acc_D at n stages from `from` on, of a step h from t.
  void find(int from, int n, double t, double h) {
    constexpr int width = Traits<Wide>::width;
    for (int first = from; first < from + n; first += width) {
      const int n_states = from + n - first < width ? from + n - first : width;
      linear_.differentiate(points_.get() + first, n_states, in_.p);
      for (int stage = first; stage < first + n_states; ++stage) {
        change_inputs(t + dop853::C[stage] * h);
        linear_.find(
            stage - first, points_[stage], inputs_.data(), by_state_.data() + stage * in_state,
            by_rest_.data() + stage * in_rest(), in_eights(P + in_.n_inputs));
      }
    }
  }

  void change_inputs(double t) {
    const double s = (t - in_.start) / (in_.times[in_.n_times - 1] - in_.start);
    for (int j = 0; j < n_changing_; j += FAN_WIDTH) {
      Vec sum = vec(powers_.data() + degree_ * changes() + j);
      for (int power = degree_ - 1; power >= 0; --power)
        sum = sum * s + vec(powers_.data() + power * changes() + j);
      vec(inputs_.data() + j) = sum;
    }
  }

  // dZ/dt at a stage.
  void change_rate(int stage, const double* Z, double* out) const {
    std::memcpy(out, Z + N * ld_, sizeof(double) * N * ld_);
    using Space = typename Model::Dynamic;
    for (int i = 0; i < Space::n_quaternions; ++i) {
      const int k = Space::quaternion_v[i];
      const double* w = points_[stage].v_D + k;
      for (int r = 0; r < 3; ++r) {
        const int a = (r + 1) % 3, b = (r + 2) % 3;
        add_scaled(w[b], Z + (k + a) * ld_, out + (k + r) * ld_, ld_);
        add_scaled(-w[a], Z + (k + b) * ld_, out + (k + r) * ld_, ld_);
      }
    }
    double* lower = out + N * ld_;
    const int direct = P + in_.n_inputs, first = in_.m - direct;
    for (int k = 0; k < N; ++k) {
      std::memset(lower + k * ld_, 0, sizeof(double) * ld_);
      std::memcpy(
          lower + k * ld_ + first, by_rest_.data() + stage * in_rest() + k * in_eights(direct),
          sizeof(double) * direct);
    }
    add_product(
        rows, by_state_.data() + stage * in_state, Linear::height, Z, ld_, lower, ld_, N, in_.m);
  }

  // Tries a step of length h. Returns the size of its error relative to the tolerances.
  double attempt(double t, double h) {
    double at[NY];
    for (int s = 1; s < dop853::stages; ++s) {
      combine(dop853::A[s], s, h, at);
      evaluate(s, t + dop853::C[s] * h, at);
    }
    combine(dop853::B, dop853::stages, h, end_);
    normalise_all<typename Model::Dynamic>(end_);
    evaluate(dop853::stages, t + h, end_);
    find(1, dop853::stages, t, h);
    change_rate(0, Z_.data(), Z_rate_[0].data());
    for (int s = 1; s < dop853::stages; ++s) {
      change_at(s, h);
      change_rate(s, Z_at_.data(), Z_rate_[s].data());
    }
    return finish(h);
  }

  void combine(const double* weights, int n, double h, double* out) const {
    for (int j = 0; j < NY; ++j) {
      double sum = 0.0;
      for (int i = 0; i < n; ++i) sum += weights[i] * rate_[i * NY + j];
      out[j] = y_[j] + h * sum;
    }
  }

  // Z_at = Z + h sum_j A_sj k_j
  void change_at(int stage, double h) {
    const double* from[dop853::stages];
    double by[dop853::stages];
    int n = 0;
    for (int j = 0; j < stage; ++j)
      if (dop853::A[stage][j] != 0.0)
        by[n] = h * dop853::A[stage][j], from[n++] = Z_rate_[j].data();
    // There is an even number of rows.
    for (int j = 0; j < rows * ld_; j += 2 * FAN_WIDTH) {
      Vec sum = vec(Z_.data() + j), next = vec(Z_.data() + j + FAN_WIDTH);
      for (int i = 0; i < n; ++i) {
        sum += by[i] * vec(from[i] + j);
        next += by[i] * vec(from[i] + j + FAN_WIDTH);
      }
      vec(Z_at_.data() + j) = sum;
      vec(Z_at_.data() + j + FAN_WIDTH) = next;
    }
  }

  // Computes the state and the changes at the end, and the size of the error by Hairer's estimate.
  double finish(double h) {
    double five = 0.0, three = 0.0;
    for (int j = 0; j < NY; ++j)
      add_error(y_[j], end_[j], [&](int i) { return rate_[i * NY + j]; }, &five, &three);
    Wide fives = Wide(0.0), threes = Wide(0.0);
    for (int j = 0; j < rows * ld_; j += FAN_WIDTH) {
      const Wide from = loaded(Z_.data() + j);
      Wide rate = Wide(0.0);
      for (int i = 0; i < dop853::stages; ++i)
        if (dop853::B[i] != 0.0) rate += dop853::B[i] * loaded(Z_rate_[i].data() + j);
      const Wide to = from + h * rate;
      std::memcpy(Z_end_.data() + j, &to, sizeof(Wide));
      add_error(from, to, [&](int i) { return loaded(Z_rate_[i].data() + j); }, &fives, &threes);
    }
    for (int l = 0; l < Traits<Wide>::width; ++l)
      five += lane_of(fives, l), three += lane_of(threes, l);
    if (five == 0.0 && three == 0.0) return 0.0;
    return h * five / std::sqrt((five + 0.01 * three) * (NY + rows * in_.m));
  }

  template <class Real, class Rate>
  void add_error(
      const Real& from, const Real& to, const Rate& rate, Real* fives, Real* threes) const {
    using std::abs;
    Real five = Real(0.0), three = Real(0.0);
    for (int i = 0; i < dop853::stages; ++i)
      if (dop853::E3[i] != 0.0) {
        const Real stage_rate = rate(i);
        five += dop853::E5[i] * stage_rate;
        three += dop853::E3[i] * stage_rate;
      }
    const Real a = abs(from), b = abs(to);
    const Real scale = 1.0 / (in_.atol + in_.rtol * select(a > b, a, b));
    five *= scale;
    three *= scale;
    *fives += five * five;
    *threes += three * three;
  }

  // Accepts the step: its end becomes the next start.
  void accept() {
    std::memcpy(y_, end_, sizeof(y_));
    std::memcpy(rate_.data(), rate_.data() + dop853::stages * NY, sizeof(y_));
    Z_.swap(Z_end_);
    std::memcpy(points_[0].v_D, points_[dop853::stages].v_D, sizeof(points_[0].v_D));
    std::memcpy(
        by_state_.data(), by_state_.data() + dop853::stages * in_state, sizeof(double) * in_state);
    std::memcpy(
        by_rest_.data(), by_rest_.data() + dop853::stages * in_rest(), sizeof(double) * in_rest());
  }

  void write(long long i) const {
    std::memcpy(in_.q_D_at + i * NQ, y_, sizeof(double) * NQ);
    std::memcpy(in_.v_D_at + i * N, y_ + NQ, sizeof(double) * N);
    double* out = in_.changes_at + i * rows * in_.m;
    for (int k = 0; k < rows; ++k)
      std::memcpy(out + k * in_.m, Z_.data() + k * ld_, sizeof(double) * in_.m);
  }

  const FlowDerivativeArrays& in_;
  int ld_, ld_inputs_, n_held_ = 0, held_[array_size(M)];
  int degree_ = 0, n_changing_ = 3 * K * ld_inputs_;  // of changes of the inputs that are not zero
  bool still_[array_size(K)];
  double step_, error_per_step_ = 0.0;
  Linear linear_;
  std::unique_ptr<FlowPoint<Model>[]> points_;
  double y_[NY], end_[NY];
  std::vector<double> rate_;  // (stages + 1, NY); g++ 12 assumes such a member aligned without AVX
  std::vector<double> Z_, Z_at_, Z_end_, Z_rate_[dop853::stages];
  std::vector<double> by_state_, by_rest_, powers_, inputs_;
};

}  // namespace fan
