// Derivatives of acc_D along a smooth motion, with the rows held in it:
//
//   M dacc + A_D^T dtension = -r_d,   A_D dacc = -hddot_d
//
// r is the residual of Eq. 10, d a change of q_D, v_D or the parameters, or one along which the
// inputs change. r_d and hddot_d are evaluated at several states at once; columns are solved in
// bundles.
#pragma once

#include <cstring>
#include <vector>

#include "fantoccini/derivatives/in_lanes.hpp"
#include "fantoccini/math/lane_of.hpp"
#include "fantoccini/math/row_products.hpp"
#include "fantoccini/model/evaluation.hpp"
#include "fantoccini/solvers/held_factor.hpp"

namespace fan {

// A state of the motion, its acceleration and the factors of its equations.
template <class Model>
struct FlowPoint {
  static constexpr int N = Model::n_vD, K = Model::n_vK, M = Model::n_rows;

  double q_D[array_size(Model::n_qD)], v_D[array_size(N)], acc[array_size(N)],
      tension[array_size(M)] = {};
  double q_K[array_size(Model::n_qK)], v_K[array_size(K)], acc_K[array_size(K)], u_D[array_size(N)];
  Evaluation<Model, double> eval;
  RowSystem<Model, double> rows;
  HeldFactor<M> factor;

  // Computes acc and tension from the other members.
  void accelerate(const double* p, const int* held, int n_held) {
    eval.at(q_D, v_D, q_K, v_K, acc_K, u_D, p);
    rows.gather(eval, v_D, held, n_held);
    factor.factorise(rows.problem.G, Complementarity<double, M>::N, rows.n);
    double pull[array_size(M)], w[array_size(N)];
    for (int a = 0; a < rows.n; ++a) pull[a] = rows.hddot[a];
    factor.solve(pull);
    for (int a = 0; a < rows.n; ++a) tension[rows.row[a]] = pull[a], pull[a] = -pull[a];
    for (int k = 0; k < N; ++k) w[k] = eval.w0[k];
    rows.add(pull, w);
    eval.solve_factor(w, acc);
  }
};

template <class Model>
class LinearFlow {
 public:
  static constexpr int N = Model::n_vD, K = Model::n_vK, P = Model::n_p, M = Model::n_rows;
  static constexpr int width = Traits<Wide>::width;
  static constexpr int height = in_eights(N);  // of a column by the state, with zeros
  static constexpr int n_changes = 3 * K + N;  // q_K, v_K, acc_K, u_D
  using Point = FlowPoint<Model>;

  explicit LinearFlow(int n_inputs)
      : n_inputs_(n_inputs), row_(in_eights(n_inputs)), moving_((n_inputs + width - 1) / width) {
    for (auto& force : force_) force.resize(N * columns + 8);
    for (auto& rate : rate_) rate.resize(M * columns + 8);
  }

  // Records which of q_K, v_K and acc_K each input changes: usually one of them.
  //
  // powers: (n, n_changes, in_eights(n_inputs)) coefficients of the inputs' changes in time.
  void look_at(const double* powers, int n) {
    for (int first = 0; first < n_inputs_; first += width)
      for (int r = 0; r < 3 * K; ++r) {
        bool changes = false;
        for (int k = 0; k < n; ++k)
          for (int l = first; l < first + width && l < n_inputs_; ++l)
            changes |= powers[(k * n_changes + r) * row_ + l] != 0.0;
        if (changes) moving_[first / width].push_back(r);
      }
  }

  // r_d and hddot_d of the held rows at n points, at most the number of lanes.
  void differentiate(const Point* points, int n, const double* p) {
    for (int l = 0; l < n; ++l) {
      const Point& at = points[l];
      put_lane(at.q_D, Model::n_qD, l, states_.q_D);
      put_lane(at.v_D, N, l, states_.v_D);
      put_lane(at.acc, N, l, states_.acc);
      put_lane(at.q_K, Model::n_qK, l, states_.q_K);
      put_lane(at.v_K, K, l, states_.v_K);
      put_lane(at.acc_K, K, l, states_.acc_K);
      put_lane(at.tension, M, l, states_.tension);
      put_lane(p, P, l, states_.p);
    }
    forces_.find(states_, 0.0);
    double* to[width];
    for (int l = 0; l < n; ++l) to[l] = force_[l].data();
    forces_.write(to, n);
    const int n_rows = points[0].rows.n;
    if (n_rows == 0) return;
    const StatesInLanes<Model>& at = states_;
    Call<Model, Wide>::rows_by(at.q_D, at.v_D, at.acc, at.q_K, at.v_K, at.acc_K, at.p, by_, fresh_);
    fresh_ = false;
    const Wide* parts[] = {by_.hddot_q,  by_.hddot_v, by_.hddot_qK,
                           by_.hddot_vK, by_.A_K,     by_.hddot_p};
    constexpr int widths[] = {N, N, K, K, K, P};
    int c = 0;
    for (int part = 0; part < 6; ++part)
      for (int k = 0; k < widths[part]; ++k, ++c)
        for (int a = 0; a < n_rows; ++a) {
          const Wide& all = parts[part][M * k + points[0].rows.row[a]];
          for (int l = 0; l < n; ++l) rate_[l][c * M + a] = lane_of(all, l);
        }
  }

  // dacc at the point in one lane of the last differentiation.
  //
  // by_state: (2 N, height) by q_D and v_D, column by column.
  // by_rest: (N, ld) by the parameters and along the inputs' changes, row by row.
  // inputs: (n_changes, in_eights(n_inputs)) these changes.
  void find(
      int lane, const Point& at, const double* inputs, double* by_state, double* by_rest, int ld) {
    const int n = at.rows.n;
    const double *rates = rate_[lane].data(), *forces = force_[lane].data();
    Bundle x;
    for (int first = 0; first < 2 * N + P; first += width) {
      const int count = 2 * N + P - first < width ? 2 * N + P - first : width;
      const double *force[width], *rate[width];
      for (int l = 0; l < width; ++l) {
        // The parameters' columns come after those of the driven coordinates.
        const int at_l = first + (l < count ? l : 0), c = at_l < 2 * N ? at_l : at_l + 3 * K;
        force[l] = forces + c * N;
        rate[l] = rates + c * M;
      }
      pack(force, N, x.force);
      pack(rate, n, x.rate);
      for (int k = 0; k < N; ++k) x.force[k] = -x.force[k];
      solve(at, x);
      const int by = 2 * N - first < count ? (2 * N - first > 0 ? 2 * N - first : 0) : count;
      double* to[width];
      for (int l = 0; l < by; ++l) to[l] = by_state + (first + l) * height;
      unpack(x.acc, N, to, by);
      for (int l = by; l < count; ++l)
        for (int k = 0; k < N; ++k) by_rest[k * ld + first + l - 2 * N] = lane_of(x.acc[k], l);
    }
    if (n_inputs_) along(lane, at, inputs, by_rest + P, ld);
  }

 private:
  static constexpr int columns = 2 * N + 3 * K + P;

  // Several columns: -r_d, hddot_d, and dacc.
  struct Bundle {
    Wide force[array_size(N)], rate[array_size(M)], acc[array_size(N)];
  };

  // dacc along the changes of the inputs.
  void along(int lane, const Point& at, const double* inputs, double* out, int ld) {
    // Where driven coordinates move no mass and no drive follows them, their accelerations act only
    // through the rows.
    constexpr int acting = Model::accelerated ? 3 * K : 2 * K;
    const double *forces = force_[lane].data() + 2 * N * N, *rates = rate_[lane].data() + 2 * N * M;
    const double* pushes = inputs + 3 * K * row_;
    for (int first = 0; first < n_inputs_; first += width) {
      Bundle x;
      for (int k = 0; k < N; ++k) x.force[k] = loaded(pushes + k * row_ + first);
      for (int a = 0; a < at.rows.n; ++a) x.rate[a] = Wide(0.0);
      for (int r : moving_[first / width]) {
        const Wide by = loaded(inputs + r * row_ + first);
        if (r < acting)
          for (int k = 0; k < N; ++k) x.force[k] -= forces[r * N + k] * by;
        for (int a = 0; a < at.rows.n; ++a) x.rate[a] += rates[r * M + a] * by;
      }
      solve(at, x);
      const int count = n_inputs_ - first < width ? n_inputs_ - first : width;
      for (int k = 0; k < N; ++k)
        std::memcpy(out + k * ld + first, &x.acc[k], sizeof(double) * count);
    }
  }

  void solve(const Point& at, Bundle& x) const {
    Wide w[array_size(N)];
    Model::solve_factor_transposed_of(at.eval.L, x.force, w);
    Wide y[array_size(M)];
    at.rows.along(w, y);
    for (int a = 0; a < at.rows.n; ++a) y[a] += x.rate[a];
    at.factor.solve(y);
    for (int a = 0; a < at.rows.n; ++a) y[a] = -y[a];
    at.rows.add(y, w);
    Model::solve_factor_of(at.eval.L, w, x.acc);
  }

  int n_inputs_, row_;
  std::vector<double> force_[width], rate_[width];
  std::vector<std::vector<int>> moving_;  // of a bundle of inputs: the rows that are not all zero
  bool fresh_ = true;
  StatesInLanes<Model> states_;
  ForcesInLanes<Model> forces_;
  struct {
    Wide A_D[array_size(M * N)], A_K[array_size(M * K)], h_p[array_size(M * P)],
        hdot_q[array_size(M * N)];
    Wide hdot_qK[array_size(M * K)], hdot_p[array_size(M * P)], hddot_q[array_size(M * N)],
        hddot_v[array_size(M * N)];
    Wide hddot_qK[array_size(M * K)], hddot_vK[array_size(M * K)], hddot_p[array_size(M * P)];
  } by_;
};

}  // namespace fan
