#pragma once
#include <math.h>
#include "real.hpp"
namespace fan {
template <int capacity>
struct ConeProblem {
  static constexpr int N = room(capacity);
  int n_single = 0, n_contacts = 0;
  double G[N * N], b[N], lower[N], upper[N], mu[N], x[N], s[N];
  double residual = 0.0;
  int iterations = 0;
  bool solve() {
    const int n = n_single + 3 * n_contacts;
    double top = 1e-300;
    for (int i = 0; i < n; ++i) if (G[i * n + i] > top) top = G[i * n + i];
    for (int k = 0; k < n; ++k) prev_[k] = x[k];
    iterations = 0;
    for (int outer = 0; outer < 40; ++outer) {
      for (int k = 0; k < n; ++k) prev_[k] = x[k];
      for (int inner = 0; inner < 40; ++inner) {
        ++iterations;
        assemble(n, 1e-10 * top);
        if (!lu(n)) return false;
        for (int k = 0; k < n; ++k) x[k] -= F_[k];
        if (check(n) < 1e-11) return true;
      }
    }
    return residual < 1e-9;
  }
 private:
  double check(int n) {
    double scale = 1e-300, worst = 0.0;
    for (int i = 0; i < n; ++i) {
      double sum = -b[i];
      for (int j = 0; j < n; ++j) sum += G[i * n + j] * x[j];
      s[i] = sum;
      if (fabs(b[i]) > scale) scale = fabs(b[i]);
    }
    for (int i = 0; i < n_single; ++i) {
      const double g = G[i * n + i] > 0 ? G[i * n + i] : 1.0;
      double w = x[i] - s[i] / g;
      w = w < lower[i] ? lower[i] : (w > upper[i] ? upper[i] : w);
      const double e = fabs(x[i] - w) * g;
      if (!(e <= worst)) worst = e;
    }
    for (int c = 0; c < n_contacts; ++c) {
      const int o = n_single + 3 * c;
      const double g = (G[o * n + o] + G[(o + 1) * n + o + 1] + G[(o + 2) * n + o + 2]) / 3;
      const double un = s[o] + mu[c] * hypot(s[o + 1], s[o + 2]);
      double w[3] = {x[o] - un / g, x[o + 1] - s[o + 1] / g, x[o + 2] - s[o + 2] / g};
      const double t = hypot(w[1], w[2]), m = mu[c];
      double p[3];
      if (t <= m * w[0]) for (int d = 0; d < 3; ++d) p[d] = w[d];
      else if (m * t <= -w[0]) p[0] = p[1] = p[2] = 0;
      else { const double a = (w[0] + m * t) / (1 + m * m); p[0] = a; p[1] = m * a * w[1] / t; p[2] = m * a * w[2] / t; }
      for (int d = 0; d < 3; ++d) { const double e = fabs(x[o + d] - p[d]) * g; if (!(e <= worst)) worst = e; }
    }
    return residual = worst / scale;
  }
  void assemble(int n, double reg) {
    double s2[N];
    for (int i = 0; i < n; ++i) {
      double sum = -b[i] + reg * (x[i] - prev_[i]);
      for (int j = 0; j < n; ++j) sum += G[i * n + j] * x[j];
      s2[i] = sum;
    }
    for (int i = 0; i < n; ++i) for (int j = 0; j < n; ++j) A_[i * n + j] = 0;
    auto full = [&](int i, double f) { for (int j = 0; j < n; ++j) A_[i * n + j] += f * (G[i * n + j] + (i == j ? reg : 0)); };
    for (int i = 0; i < n_single; ++i) {
      const double g = G[i * n + i] > 0 ? G[i * n + i] : 1.0, w = x[i] - s2[i] / g;
      if (w <= lower[i]) { F_[i] = x[i] - lower[i]; A_[i * n + i] = 1; }
      else if (w >= upper[i]) { F_[i] = x[i] - upper[i]; A_[i * n + i] = 1; }
      else { F_[i] = s2[i]; full(i, 1); }
    }
    for (int c = 0; c < n_contacts; ++c) {
      const int o = n_single + 3 * c;
      const double rho = 3 / (G[o * n + o] + G[(o + 1) * n + o + 1] + G[(o + 2) * n + o + 2]);
      const double wn = x[o] - rho * s2[o], w1 = x[o + 1] - rho * s2[o + 1], w2 = x[o + 2] - rho * s2[o + 2];
      if (wn <= 0) { for (int d = 0; d < 3; ++d) { F_[o + d] = x[o + d]; A_[(o + d) * n + o + d] = 1; } continue; }
      F_[o] = s2[o]; full(o, 1);
      const double lim = mu[c] * wn, nt = hypot(w1, w2);
      if (nt <= lim) { for (int d = 1; d < 3; ++d) { F_[o + d] = s2[o + d]; full(o + d, 1); } continue; }
      const double d1 = w1 / nt, d2 = w2 / nt, k = lim / nt;
      const double P[2][2] = {{1 - d1 * d1, -d1 * d2}, {-d1 * d2, 1 - d2 * d2}}, d[2] = {d1, d2};
      for (int r = 0; r < 2; ++r) {
        const int i = o + 1 + r;
        F_[i] = x[i] - lim * d[r];
        A_[i * n + i] += 1;
        A_[i * n + o] -= mu[c] * d[r];
        for (int j = 0; j < n; ++j) A_[i * n + j] += mu[c] * d[r] * rho * (G[o * n + j] + (o == j ? reg : 0));
        for (int q = 0; q < 2; ++q) {
          const int u = o + 1 + q;
          A_[i * n + u] -= k * P[r][q];
          for (int j = 0; j < n; ++j) A_[i * n + j] += k * P[r][q] * rho * (G[u * n + j] + (u == j ? reg : 0));
        }
      }
    }
  }
  bool lu(int n) {
    for (int c = 0; c < n; ++c) {
      int p = c;
      for (int i = c + 1; i < n; ++i) if (fabs(A_[i * n + c]) > fabs(A_[p * n + c])) p = i;
      if (!(fabs(A_[p * n + c]) > 0)) return false;
      if (p != c) { for (int j = 0; j < n; ++j) { double t = A_[p * n + j]; A_[p * n + j] = A_[c * n + j]; A_[c * n + j] = t; } double t = F_[p]; F_[p] = F_[c]; F_[c] = t; }
      for (int i = c + 1; i < n; ++i) {
        const double f = A_[i * n + c] / A_[c * n + c];
        if (f == 0) continue;
        for (int j = c; j < n; ++j) A_[i * n + j] -= f * A_[c * n + j];
        F_[i] -= f * F_[c];
      }
    }
    for (int i = n - 1; i >= 0; --i) {
      for (int j = i + 1; j < n; ++j) F_[i] -= A_[i * n + j] * F_[j];
      F_[i] /= A_[i * n + i];
    }
    return true;
  }
  double prev_[N], F_[N], A_[N * N];
};
}
