// Convex quadratic programs of stages with bounds, and rows that may be violated at a price:
//
//   min sum_i 1/2 x_i^T H_i x_i + g_i . x_i + x_{i-1}^T D_i u_i + sum_rows price (s + s^2 / 2)
//   z_{i+1} = A_i z_i + B_i u_i + e_i,   low <= x <= high,   row_low - s <= C (x_{i-1}, u_i) <=
//   row_high + s
//
// by a primal-dual interior point method with Mehrotra's predictor and corrector (Nocedal and
// Wright, Numerical Optimization, algorithm 16.4). Every step is one Riccati recursion. All
// iterates satisfy the dynamics.
#pragma once

#include <algorithm>

#include "fantoccini/contract.hpp"
#include "fantoccini/search/stage_riccati.hpp"

namespace fan {

class StageProgramSolver {
 public:
  // Reads the program and solves it; the previous iterates may be the start.
  void solve(StageProgramArrays& in) {
    read(in);
    in.iterations = 0;
    in.solved = 0;
    if (!start(in)) return;
    while (!in.solved && in.iterations < in.most_iterations) {
      if (!iterate(in)) break;
    }
    write(in);
  }

 private:
  static constexpr double first_barrier = 0.1, first_slack = 1e-2;

  // sign x <= limit (a bound), or sign C x - s <= limit (a side of a row).
  struct Side {
    int stage, place;
    double sign, limit, t, multiplier, dt, dmultiplier, target;
  };
  // The violation s of a row.
  struct Elastic {
    double price, s, multiplier, ds, dmultiplier, target;  // target: of s times its multiplier
    // Coefficient and right-hand side of the stationarity of s after the sides are eliminated.
    double curvature, slope;
  };

  StageRiccati riccati_;
  std::vector<Side> bounds_, sides_;
  std::vector<int> first_side_;  // (N m + 1,) sides of a row
  std::vector<Elastic> elastic_;
  std::vector<double> g_, e_, x_, dx_, gradient_, costate_, slope_, value_;

  double* row_of(std::vector<double>& a, int i) { return a.data() + size_t(i) * riccati_.ld; }

  void read(const StageProgramArrays& in) {
    StageRiccati& r = riccati_;
    const int N = int(in.N), n_z = in.n_z, k = in.k, m = in.m, s = n_z + k;
    const double scale = 1.0 / in.unit;
    bool couples = false;
    for (int i = 0; i < N && !couples; ++i) {
      const double *H = in.H + size_t(i) * s * s, *D = in.cross + size_t(i) * s * k;
      for (int j = 0; j < k * k && i; ++j) couples = couples || D[j] != 0.0;
      for (int a = 0; a < k; ++a) {
        for (int b = k; b < s; ++b) couples = couples || H[a * s + b] != 0.0;
      }
      for (int j = 0; j < m && i; ++j) {
        const double* C = in.C + (size_t(i) * m + j) * (s + k);
        for (int a = 0; a < k; ++a) couples = couples || C[a] != 0.0;
      }
    }
    r.resize(N, n_z, k, m, couples);
    const size_t all = size_t(N) * r.ld;
    for (auto* a : {&g_, &e_, &x_, &dx_, &gradient_, &costate_}) a->assign(all, 0.0);
    for (int i = 0; i < N; ++i) {
      // The caller's order is (u_i, z_{i+1}).
      const double* H = in.H + size_t(i) * s * s;
      for (int a = 0; a < s; ++a) {
        const double* from = H + size_t(a < n_z ? k + a : a - n_z) * s;
        double* to = r.H_of(i) + a * r.ld;
        for (int b = 0; b < n_z; ++b) to[b] = scale * from[k + b];
        for (int b = 0; b < k; ++b) to[n_z + b] = scale * from[b];
      }
      for (int a = 0; a < s; ++a) {
        row_of(g_, i)[a] = scale * in.g[size_t(i) * s + (a < n_z ? k + a : a - n_z)];
      }
      for (int a = 0; a < n_z; ++a) {
        double* to = r.M_of(i) + a * r.ld;
        const double* A = in.A + (size_t(i) * n_z + a) * n_z;
        const double* B = in.B + (size_t(i) * n_z + a) * k;
        for (int b = 0; b < n_z; ++b) to[b] = A[b];
        for (int b = 0; b < k; ++b) to[n_z + b] = B[b];
        row_of(e_, i)[a] = in.e[size_t(i) * n_z + a];
      }
      const double* D = in.cross + size_t(i) * s * k;
      for (int a = 0; a < k; ++a) {
        double* to = r.D_of(i) + a * r.ld;
        for (int b = 0; b < n_z; ++b) to[b] = scale * D[(k + b) * k + a];
        for (int b = 0; b < k; ++b) to[n_z + b] = scale * D[b * k + a];
      }
    }
    r.find_bands();
    read_sides(in, scale);
  }

  void read_sides(const StageProgramArrays& in, double scale) {
    StageRiccati& r = riccati_;
    const int N = r.N, n_z = r.n_z, k = r.k, m = r.m, s = n_z + k;
    bounds_.clear(), sides_.clear(), elastic_.clear(), first_side_.assign(1, 0);
    auto add = [&](std::vector<Side>& to, int i, int place, double low, double high) {
      if (high < in.unbounded) to.push_back({i, place, 1.0, high, 0, 0, 0, 0, 0});
      if (low > -in.unbounded) to.push_back({i, place, -1.0, -low, 0, 0, 0, 0, 0});
    };
    for (int i = 0; i < N; ++i) {
      for (int a = 0; a < s; ++a) {
        const size_t from = size_t(i) * s + (a < n_z ? k + a : a - n_z);
        add(bounds_, i, a, in.low[from], in.high[from]);
      }
      for (int j = 0; j < m; ++j) {
        // The caller's order is (u_{i-1}, z_i, u_i).
        const size_t row = size_t(i) * m + j;
        const double* C = in.C + row * (s + k);
        for (int b = 0; b < n_z && i; ++b) r.C_of(i)[j * r.ld + b] = C[k + b];
        for (int b = 0; b < k && i; ++b) r.C_of(i)[j * r.ld + n_z + b] = C[b];
        for (int b = 0; b < k; ++b) r.Cu_of(i)[j * r.ld_k + b] = C[s + b];
        add(sides_, i, j, in.row_low[row], in.row_high[row]);
        first_side_.push_back(int(sides_.size()));
        elastic_.push_back({scale * in.price[row], 0, 0, 0, 0, 0, 0, 0});
      }
    }
    slope_.assign(size_t(N) * m, 0.0), value_.assign(size_t(N) * m, 0.0);
  }

  // Sets x to the minimum without bounds, a solution if it satisfies them, else the start of the
  // iteration. Returns false if the problem is not convex.
  bool start(StageProgramArrays& in) {
    StageRiccati& r = riccati_;
    for (int i = 0; i < r.N; ++i) {
      double* x = row_of(x_, i);
      r.propagate(i, i ? x - r.ld : nullptr, x);
      for (int a = 0; a < r.n_z; ++a) x[a] += row_of(e_, i)[a];
    }
    std::fill(r.diagonal.begin(), r.diagonal.end(), 0.0);
    std::fill(r.weight.begin(), r.weight.end(), 0.0);
    if (!r.factorise()) return false;
    ++in.iterations;
    cost_gradient();
    r.solve(gradient_.data(), dx_.data());
    for (size_t j = 0; j < x_.size(); ++j) x_[j] += dx_[j];
    rows_of(x_, value_);
    double least = HUGE_VAL;
    for (const Side& b : bounds_) least = std::min(least, slack_of(b));
    for (const Side& b : sides_) least = std::min(least, slack_of_row(b));
    if (least >= 0.0) {
      in.solved = 1;
      return true;
    }
    const double inner = std::max(first_slack, 0.1 * std::min(-least, 1.0));
    for (Side& b : bounds_) {
      b.t = std::max(slack_of(b), inner);
      b.multiplier = first_barrier / b.t;
    }
    for (size_t row = 0; row < elastic_.size(); ++row) {
      Elastic& elastic = elastic_[row];
      elastic.s = inner;
      for (int j = first_side_[row]; j < first_side_[row + 1]; ++j) {
        elastic.s = std::max(elastic.s, inner - slack_of_row(sides_[j]));
      }
      elastic.multiplier = first_barrier / elastic.s;
      for (int j = first_side_[row]; j < first_side_[row + 1]; ++j) {
        Side& b = sides_[j];
        b.t = std::max(slack_of_row(b) + elastic.s, inner);
        b.multiplier = first_barrier / b.t;
      }
    }
    return true;
  }

  double slack_of(const Side& b) { return b.limit - b.sign * row_of(x_, b.stage)[b.place]; }
  double slack_of_row(const Side& b) {
    return b.limit - b.sign * value_[size_t(b.stage) * riccati_.m + b.place];
  }

  // Makes one step. Returns false if none is possible.
  bool iterate(StageProgramArrays& in) {
    StageRiccati& r = riccati_;
    rows_of(x_, value_);
    cost_gradient();
    const double barrier = mean_product();
    if (converged(in, barrier)) {
      in.solved = 1;
      return true;
    }
    std::fill(r.diagonal.begin(), r.diagonal.end(), 0.0);
    for (const Side& b : bounds_) row_of(r.diagonal, b.stage)[b.place] += b.multiplier / b.t;
    for (size_t row = 0; row < elastic_.size(); ++row) r.weight[row] = weight_of(row);
    ++in.iterations;
    if (!r.factorise()) return false;
    for (Side& b : bounds_) b.target = 0.0;
    for (Side& b : sides_) b.target = 0.0;
    for (Elastic& s : elastic_) s.target = 0.0;
    direction();
    const double reach = longest_step();
    double after = 0.0;
    for (const auto* all : {&bounds_, &sides_}) {
      for (const Side& b : *all)
        after += (b.t + reach * b.dt) * (b.multiplier + reach * b.dmultiplier);
    }
    for (const Elastic& s : elastic_) {
      after += (s.s + reach * s.ds) * (s.multiplier + reach * s.dmultiplier);
    }
    after /= double(bounds_.size() + sides_.size() + elastic_.size());
    const double ratio = after / barrier, least = std::max(in.barrier, 0.1 * in.tolerance);
    const double target = std::max(ratio * ratio * ratio * barrier, least);
    for (auto* all : {&bounds_, &sides_}) {
      for (Side& b : *all) b.target = target - b.dt * b.dmultiplier;
    }
    for (Elastic& s : elastic_) s.target = target - s.ds * s.dmultiplier;
    direction();
    const double alpha = std::min(1.0, (1.0 - std::min(0.01, 0.1 * barrier)) * longest_step());
    if (!(alpha > 1e-10)) return false;
    for (size_t j = 0; j < x_.size(); ++j) x_[j] += alpha * dx_[j];
    for (auto* all : {&bounds_, &sides_}) {
      for (Side& b : *all) b.t += alpha * b.dt, b.multiplier += alpha * b.dmultiplier;
    }
    for (Elastic& s : elastic_) s.s += alpha * s.ds, s.multiplier += alpha * s.dmultiplier;
    return true;
  }

  double mean_product() const {
    double sum = 0.0;
    for (const auto* all : {&bounds_, &sides_}) {
      for (const Side& b : *all) sum += b.t * b.multiplier;
    }
    for (const Elastic& s : elastic_) sum += s.s * s.multiplier;
    return sum / double(bounds_.size() + sides_.size() + elastic_.size());
  }

  // W of a row: weight of (C dx)^2 / 2 after its sides and its violation are eliminated.
  double weight_of(size_t row) {
    Elastic& elastic = elastic_[row];
    const double soft = elastic.price + elastic.multiplier / elastic.s;
    double sum = 0.0, product = 1.0;
    int count = 0;
    for (int j = first_side_[row]; j < first_side_[row + 1]; ++j, ++count) {
      const double w = sides_[j].multiplier / sides_[j].t;
      sum += w, product *= w;
    }
    elastic.curvature = soft + sum;
    return ((count == 2 ? 4.0 * product : 0.0) + sum * soft) / elastic.curvature;
  }

  // Residual of a side's equation.
  double residual_of(const Side& b, bool row) {
    if (!row) return b.t - slack_of(b);
    return b.t - slack_of_row(b) - elastic_[size_t(b.stage) * riccati_.m + b.place].s;
  }

  double elastic_residual(size_t row) const {
    const Elastic& elastic = elastic_[row];
    double sum = elastic.price * (1.0 + elastic.s) - elastic.multiplier;
    for (int j = first_side_[row]; j < first_side_[row + 1]; ++j) sum -= sides_[j].multiplier;
    return sum;
  }

  // Computes Newton's step for the products t multiplier = target, with the current factors.
  void direction() {
    StageRiccati& r = riccati_;
    std::vector<double>& q = costate_;  // workspace for the gradient of the step
    q = gradient_;
    auto shift = [](const Side& b, double residual) {
      return (b.target - b.t * b.multiplier + b.multiplier * residual) / b.t;
    };
    for (const Side& b : bounds_) {
      row_of(q, b.stage)[b.place] += b.sign * (b.multiplier + shift(b, residual_of(b, false)));
    }
    for (size_t row = 0; row < elastic_.size(); ++row) {
      Elastic& elastic = elastic_[row];
      double sum = 0.0, signed_sum = 0.0;
      elastic.slope =
          -elastic_residual(row) + (elastic.target - elastic.s * elastic.multiplier) / elastic.s;
      for (int j = first_side_[row]; j < first_side_[row + 1]; ++j) {
        const Side& b = sides_[j];
        const double a = shift(b, residual_of(b, true));
        elastic.slope += a;
        sum += b.sign * (b.multiplier + a);
        signed_sum += b.sign * b.multiplier / b.t;
      }
      slope_[row] = sum - signed_sum * elastic.slope / elastic.curvature;
    }
    add_rows(slope_, q);
    r.solve(q.data(), dx_.data());
    for (Side& b : bounds_) {
      const double residual = residual_of(b, false);
      b.dt = -residual - b.sign * row_of(dx_, b.stage)[b.place];
      b.dmultiplier = (b.target - b.t * b.multiplier - b.multiplier * b.dt) / b.t;
    }
    rows_of(dx_, slope_);
    for (size_t row = 0; row < elastic_.size(); ++row) {
      Elastic& elastic = elastic_[row];
      double sum = elastic.slope;
      for (int j = first_side_[row]; j < first_side_[row + 1]; ++j) {
        sum += sides_[j].sign * sides_[j].multiplier / sides_[j].t * slope_[row];
      }
      elastic.ds = sum / elastic.curvature;
      elastic.dmultiplier =
          (elastic.target - elastic.s * elastic.multiplier - elastic.multiplier * elastic.ds) /
          elastic.s;
      for (int j = first_side_[row]; j < first_side_[row + 1]; ++j) {
        Side& b = sides_[j];
        b.dt = -residual_of(b, true) - b.sign * slope_[row] + elastic.ds;
        b.dmultiplier = (b.target - b.t * b.multiplier - b.multiplier * b.dt) / b.t;
      }
    }
  }

  // The longest step that keeps all slacks and multipliers positive.
  double longest_step() const {
    double alpha = 1.0;
    auto keep = [&](double value, double change) {
      if (value + alpha * change < 0.0) alpha = -value / change;
    };
    for (const auto* all : {&bounds_, &sides_}) {
      for (const Side& b : *all) keep(b.t, b.dt), keep(b.multiplier, b.dmultiplier);
    }
    for (const Elastic& s : elastic_) keep(s.s, s.ds), keep(s.multiplier, s.dmultiplier);
    return alpha;
  }

  bool converged(StageProgramArrays& in, double barrier) {
    double primal = 0.0, dual = 0.0, size = 1.0;
    for (const Side& b : bounds_) primal = std::max(primal, std::fabs(residual_of(b, false)));
    for (const Side& b : sides_) primal = std::max(primal, std::fabs(residual_of(b, true)));
    for (size_t row = 0; row < elastic_.size(); ++row) {
      dual = std::max(dual, std::fabs(elastic_residual(row)));
    }
    for (double g : g_) size = std::max(size, std::fabs(g));
    dual = std::max(dual, residual());
    in.primal = primal, in.dual = dual / size, in.gap = barrier;
    return primal <= in.tolerance && dual <= in.tolerance * size &&
           barrier <= std::max(10.0 * in.tolerance, 1.5 * in.barrier);
  }

  // Sets the gradient: H x + g and the terms that couple stages.
  void cost_gradient() {
    StageRiccati& r = riccati_;
    for (int i = 0; i < r.N; ++i) {
      double *to = row_of(gradient_, i), *x = row_of(x_, i);
      const double* H = r.H_of(i);
      for (int a = 0; a < r.n_x; ++a) to[a] = row_of(g_, i)[a] + dot(H + a * r.ld, x, r.ld);
      if (i == 0) continue;
      for (int a = 0; a < r.k; ++a) {
        to[r.n_z + a] += dot(r.D_of(i) + a * r.ld, x - r.ld, r.ld);
        add_scaled(x[r.n_z + a], r.D_of(i) + a * r.ld, to - r.ld, r.ld);
      }
    }
  }

  // Sets `out` to C (x_{i-1}, u_i) of all rows.
  void rows_of(std::vector<double>& x, std::vector<double>& out) {
    StageRiccati& r = riccati_;
    for (int i = 0; i < r.N; ++i) {
      for (int j = 0; j < r.m; ++j) {
        double sum = i ? dot(r.C_of(i) + j * r.ld, row_of(x, i - 1), r.ld) : 0.0;
        const double* cu = r.Cu_of(i) + j * r.ld_k;
        for (int a = 0; a < r.k; ++a) sum += cu[a] * row_of(x, i)[r.n_z + a];
        out[size_t(i) * r.m + j] = sum;
      }
    }
  }

  // Adds C^T by.
  void add_rows(const std::vector<double>& by, std::vector<double>& to) {
    StageRiccati& r = riccati_;
    for (int i = 0; i < r.N; ++i) {
      for (int j = 0; j < r.m; ++j) {
        const double value = by[size_t(i) * r.m + j];
        if (i) add_scaled(value, r.C_of(i) + j * r.ld, row_of(to, i - 1), r.ld);
        const double* cu = r.Cu_of(i) + j * r.ld_k;
        for (int a = 0; a < r.k; ++a) row_of(to, i)[r.n_z + a] += value * cu[a];
      }
    }
  }

  // Sets the adjoint variables. Returns the largest slope of the Lagrangian along inputs.
  double residual() {
    StageRiccati& r = riccati_;
    costate_ = gradient_;
    for (const Side& b : bounds_) row_of(costate_, b.stage)[b.place] += b.sign * b.multiplier;
    for (size_t row = 0; row < elastic_.size(); ++row) {
      double sum = 0.0;
      for (int j = first_side_[row]; j < first_side_[row + 1]; ++j) {
        sum += sides_[j].sign * sides_[j].multiplier;
      }
      slope_[row] = sum;
    }
    add_rows(slope_, costate_);
    double largest = 0.0;
    std::vector<double> h(r.ld);
    for (int i = r.N - 1; i >= 0; --i) {
      double* p = row_of(costate_, i);
      r.multiply_transposed(i, p, h.data());
      for (int a = r.n_z; a < r.n_x; ++a) largest = std::max(largest, std::fabs(p[a] + h[a]));
      for (int a = 0; a < r.n_z && i; ++a) p[a - r.ld] += h[a];
    }
    return largest;
  }

  void write(StageProgramArrays& in) {
    StageRiccati& r = riccati_;
    cost_gradient();
    residual();
    for (int i = 0; i < r.N; ++i) {
      const double* x = row_of(x_, i);
      for (int a = 0; a < r.k; ++a) in.u[size_t(i) * r.k + a] = x[r.n_z + a];
      for (int a = 0; a < r.n_z; ++a) {
        in.z[size_t(i) * r.n_z + a] = x[a];
        in.costate[size_t(i) * r.n_z + a] = in.unit * row_of(costate_, i)[a];
      }
    }
    rows_of(x_, value_);
    for (size_t row = 0; row < elastic_.size(); ++row) {
      double violation = 0.0;
      for (int j = first_side_[row]; j < first_side_[row + 1]; ++j) {
        violation = std::max(violation, -slack_of_row(sides_[j]));
      }
      in.passed[row] = violation;
      in.force[row] = in.unit * slope_[row];
    }
    if (in.gain) r.first_gain(in.gain);
  }
};

}  // namespace fan
