// The cost of a search for places, and its derivatives by the chosen variables:
//
//   1/2 sum_i w_i |place_i(q_D, q_K, p) - target_i|^2,   H = J^T W J,   g = J^T W (place - target)
//
// with the places' Jacobian J at equilibrium poses (hanging.hpp).
#pragma once

#include <cmath>
#include <cstring>

#include "fantoccini/search/hanging.hpp"

namespace fan {

template <class Model>
class ReachCost {
 public:
  using Hang = Hanging<Model>;
  static constexpr int N = Hang::N, K = Hang::K, P = Hang::P, U = Hang::U, NP = Hang::NP;
  static constexpr double difference = 1e-4;  // of the parameters, for differences of places

  explicit ReachCost(const Hang& hang) : hang_(hang) {}

  const ReachArrays* in = nullptr;
  const int *joint_q = nullptr, *driven_q = nullptr;  // indices in q of scalars, by velocity
  double value = 0.0, H[array_size(U * U)], g[array_size(U)];
  double top = 0.0;    // the largest curvature
  double apart = 0.0;  // sum |place_i - target_i|^2, without weights

  // The positions of the targets' points, the cost, and its derivatives by the chosen variables;
  // with `move`, to first order after a move of q_D.
  void evaluate(long long i, const int* chosen, int n, const double* move = nullptr) {
    chosen_ = chosen;
    n_ = n;
    const auto& at = hang_.at;
    Call<Model, double>::screws(at.q_D, at.q_K, at.p, screws_);
    value = apart = top = 0.0;
    for (int a = 0; a < n_ * n_; ++a) H[a] = 0.0;
    for (int a = 0; a < n_; ++a) g[a] = 0.0;
    places_by_parameters();
    const double* wanted = in->places + i * in->n_targets * 3;
    double* left = in->left + i * in->n_targets * 3;
    for (int t = 0; t < in->n_targets; ++t)
      for (int c = 0; c < 3; ++c) {
        const double target = wanted[3 * t + c];
        double& off = left[3 * t + c];
        off = 0.0;
        if (std::isnan(target) || (in->links[t] < 0 && c > 0)) continue;
        double slope[array_size(N + K)] = {}, place;
        if (in->links[t] < 0) {
          const int v = in->columns[t];
          place = v < N ? at.q_D[joint_q[v]] : at.q_K[driven_q[v - N]];
          slope[v] = 1.0;
        } else {
          double x[3];
          point(screws_.poses, t, x);
          place = x[c];
          const int a = (c + 1) % 3, b = (c + 2) % 3;
          for (int v = 0; v < N + K; ++v) {
            if (!in->moves[t * (N + K) + v]) continue;
            const double* s = v < N ? screws_.screw_D + 6 * v : screws_.screw_K + 6 * (v - N);
            slope[v] = s[c] + s[3 + a] * x[b] - s[3 + b] * x[a];
          }
        }
        off = place - target;
        apart += off * off;
        double moved = off;
        for (int k = 0; k < N && move; ++k) moved += slope[k] * move[k];
        add(moved, slope, t, c);
      }
    for (int a = 0; a < n_; ++a) top = maximum(H[a * n_ + a], top);
  }

 private:
  void point(const double* poses, int t, double* x) const {
    const double *pose = poses + 12 * in->links[t], *at = in->at + 3 * t;
    for (int c = 0; c < 3; ++c)
      x[c] = pose[9 + c] + pose[c] * at[0] + pose[3 + c] * at[1] + pose[6 + c] * at[2];
  }

  // Adds a residual to the cost.
  void add(double off, const double* slope, int t, int c) {
    const double weight = in->weights[t];
    value += 0.5 * weight * off * off;
    double row[array_size(U)];
    int moving[array_size(N)], n_moving = 0;
    for (int k = 0; k < N; ++k)
      if (slope[k] != 0.0) moving[n_moving++] = k;
    for (int a = 0; a < n_; ++a) {
      const int u = chosen_[a];
      const double* x = hang_.by_u + u * NP;
      double sum = u < K ? slope[N + u] : by_p_[(u - K) * 3 * max_targets + 3 * t + c];
      for (int m = 0; m < n_moving; ++m) sum += slope[moving[m]] * x[moving[m]];
      row[a] = sum;
    }
    for (int a = 0; a < n_; ++a) {
      const double weighted = weight * row[a];
      if (weighted == 0.0) continue;
      g[a] += off * weighted;
      for (int b = 0; b < n_; ++b) H[a * n_ + b] += weighted * row[b];
    }
  }

  // Derivatives of the points by the parameters at a fixed pose, by central differences.
  void places_by_parameters() {
    if constexpr (P > 0)
      for (int k = 0; k < P; ++k) {
        if (!in->moved[K + k]) continue;
        double p[array_size(P)], step = difference * maximum(fabs(hang_.at.p[k]), 0.1);
        std::memcpy(p, hang_.at.p, P * sizeof(double));
        for (int side = 0; side < 2; ++side) {
          p[k] = hang_.at.p[k] + (side ? -step : step);
          Call<Model, double>::screws(hang_.at.q_D, hang_.at.q_K, p, other_);
          for (int t = 0; t < in->n_targets; ++t) {
            if (in->links[t] < 0) continue;
            double x[3];
            point(other_.poses, t, x);
            for (int c = 0; c < 3; ++c) {
              double& by = by_p_[k * 3 * max_targets + 3 * t + c];
              by = side ? (by - x[c]) / (2.0 * step) : x[c];
            }
          }
        }
      }
  }

  static constexpr int max_targets = 64;

  const Hang& hang_;
  const int* chosen_ = nullptr;
  int n_ = 0;
  double by_p_[array_size(P * 3 * max_targets)] = {};
  struct Screws {
    double poses[array_size(12 * Model::n_links)], screw_D[array_size(6 * N)],
        screw_K[array_size(6 * K)];
  } screws_, other_;
};

}  // namespace fan
