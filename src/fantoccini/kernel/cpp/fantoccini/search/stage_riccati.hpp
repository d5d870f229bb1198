// Riccati's recursion for programs of stages with variables x_i = (z_{i+1}, u_i), x_{-1} = 0:
//
//   min sum_i 1/2 x_i^T H_i x_i + x_{i-1}^T D_i u_i + 1/2 |C_i (x_{i-1}, u_i)|_W^2 + gradient . x_i
//   z_{i+1} = A_i z_i + B_i u_i
//
// (Frison and Jorgensen, ECC 2013). If costs couple neighbouring inputs, x_{i-1} is the state of
// stage i, otherwise z_i alone. Rows of (A B) with few entries, such as those of driven
// coordinates, d(q, v) = (q + h v + h^2 u / 2, v + h u), are stored as diagonal bands. Inputs may
// be bound to laws u_a = value + by . z_i, which removes them from the minimum.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "fantoccini/math/row_products.hpp"
#include "fantoccini/search/stage_laws.hpp"

namespace fan {

struct StageRiccati {
  int N = 0, n_z = 0, k = 0, m = 0;
  bool coupled = false;
  int n_x = 0, n_s = 0, n_dense = 0;  // variables, states; full rows of (A B)
  int ld = 0, ld_k = 0;               // lengths of rows
  std::vector<Band> bands;
  std::vector<double> M, band_values, H, D, C, C_u;  // see the accessors
  std::vector<double> diagonal, weight;  // (N, ld) added to H, (N, m) W: set before factorise
  std::vector<double> squares;           // (N, n_squares, ld) J, of which J^T J is added to H
  int n_squares = 0;
  std::vector<StageLaw> laws;      // (N, k), the first n_laws of a stage
  std::vector<int> n_laws;         // (N,)
  std::vector<double> from_later;  // (ld,) left by stage_gradient and state_gradient

  // Sets the sizes of all arrays; padding is 0 afterwards. May throw std::bad_alloc. With `n` rows
  // of squares there is no H. `keeps` stores the data of factorise(last).
  void resize(
      int stages, int states, int inputs, int rows, bool couples, int n = 0, bool keeps = false) {
    if (stages == N && states == n_z && inputs == k && rows == m && couples == coupled &&
        n == n_squares && keeps == !kept_.empty())
      return;
    N = stages, n_z = states, k = inputs, m = rows, coupled = couples, n_squares = n;
    n_x = n_z + k, n_s = coupled ? n_x : n_z;
    ld = in_eights(n_x), ld_k = in_eights(k);
    M.assign(size_t(N) * n_z * ld + slack, 0.0);
    H.assign(n ? 0 : size_t(N) * n_x * ld + slack, 0.0);
    squares.assign(size_t(N) * n * ld, 0.0);
    kept_.assign(keeps ? size_t(N + 1) * size_P() : 0, 0.0);
    laws.assign(size_t(N) * k, StageLaw{}), n_laws.assign(N, 0);
    D.assign(size_t(N) * k * ld, 0.0);
    C.assign(size_t(N) * m * ld, 0.0);
    C_u.assign(size_t(N) * m * ld_k, 0.0);
    diagonal.assign(size_t(N) * ld, 0.0);
    weight.assign(size_t(N) * m, 0.0);
    Y_.assign(size_t(N) * ld_k * ld, 0.0);
    L_.assign(size_t(N) * k * ld_k, 0.0);
    y_.assign(size_t(N) * ld_k, 0.0);
    P_.assign(size_t(ld) * ld + slack, 0.0);
    T_.assign(size_t(ld) * ld + slack, 0.0);
    G_.assign(size_t(ld) * ld + slack, 0.0);
    scaled_.assign(size_t(m) * ld, 0.0);
    bound_.assign(k, 0), free_.assign(size_t(k) * ld, 0.0);
    p_.assign(ld, 0.0), h_.assign(ld, 0.0), from_later.assign(ld, 0.0);
  }

  double* M_of(int i) { return M.data() + size_t(i) * n_z * ld; }  // n_z rows: (A B)
  double* H_of(int i) { return H.data() + size_t(i) * n_x * ld; }  // n_x rows
  double* squares_of(int i) { return squares.data() + size_t(i) * n_squares * ld; }
  double* D_of(int i) { return D.data() + size_t(i) * k * ld; }       // k rows: D^T
  double* C_of(int i) { return C.data() + size_t(i) * m * ld; }       // m rows, of x_{i-1}
  double* Cu_of(int i) { return C_u.data() + size_t(i) * m * ld_k; }  // m rows, of u_i
  double* y_of(int i) { return y_.data() + size_t(i) * ld_k; }
  // By the inputs, after gather().
  const double* hessian_of(int i) const { return L_.data() + size_t(i) * k * ld_k; }
  const double* gain_root(int i) const { return Y_.data() + size_t(i) * ld_k * ld; }

  // (k, n_z): the best u_0 is K z_0 for z_0 other than 0.
  void first_gain(double* K) const {
    const double *L = L_.data(), *Y = Y_.data();
    for (int a = k - 1; a >= 0; --a) {
      for (int j = 0; j < n_z; ++j) {
        double sum = -Y[a * ld + j];
        for (int b = a + 1; b < k; ++b) sum -= L[b * ld_k + a] * K[b * n_z + j];
        K[a * n_z + j] = sum / L[a * ld_k + a];
      }
    }
  }

  // Finds the bands, after M is set.
  void find_bands() {
    constexpr int few = 8;
    std::vector<unsigned char> used(size_t(n_z) * n_x, 0);
    n_dense = 0;
    for (int r = n_z - 1; r >= 0 && n_dense == 0; --r) {
      unsigned char* row_used = used.data() + r * n_x;
      int count = 0;
      for (int i = 0; i < N && count <= few; ++i) {
        const double* row = M_of(i) + r * ld;
        for (int c = 0; c < n_x; ++c) row_used[c] |= row[c] != 0.0;
        count = 0;
        for (int c = 0; c < n_x; ++c) count += row_used[c];
      }
      if (count > few) n_dense = r + 1;
    }
    bands.clear();
    for (int r = n_dense; r < n_z; ++r) {
      for (int c = 0; c < n_x; ++c) {
        if (!used[r * n_x + c]) continue;
        Band band{r, c, 0};
        for (; r + band.length < n_z && c + band.length < n_x; ++band.length) {
          unsigned char& at = used[(r + band.length) * n_x + c + band.length];
          if (!at) break;
          at = 0;
        }
        bands.push_back(band);
      }
    }
    n_values_ = 0;
    for (const Band& band : bands) n_values_ += in_eights(band.length);
    band_values.assign(size_t(N) * n_values_, 0.0);
    for (int i = 0; i < N; ++i) {
      double* value = values_of(i);
      for (const Band& band : bands) {
        for (int j = 0; j < band.length; ++j)
          value[j] = M_of(i)[(band.row + j) * ld + band.column + j];
        value += in_eights(band.length);
      }
    }
  }

  // The factors of all stages. Returns false if a Hessian by a stage's inputs is not positive.
  bool factorise() {
    begin();
    for (int i = N - 1; i >= 0; --i) {
      gather(i);
      if (!eliminate(i)) return false;
    }
    return true;
  }

  // The Hessian after the last stage.
  void begin() {
    double* P = P_at(N);
    std::fill_n(P, size_t(n_s) * ld, 0.0);
    for (int a = 0; a < n_s && !H.empty(); ++a) std::copy_n(H_of(N - 1) + a * ld, n_s, P + a * ld);
    add_squares(N - 1, P);
    for (int a = 0; a < n_s; ++a) P[a * (ld + 1)] += diagonal[size_t(N - 1) * ld + a];
    mirror(P, ld, n_s);
  }

  // Cost from stage i on: its Hessian by the inputs (lower triangle), and by both.
  void gather(int i) {
    value_by_dynamics(i);
    const double* G = G_.data();
    double *Y = Y_.data() + size_t(i) * ld_k * ld, *L = L_.data() + size_t(i) * k * ld_k;
    const double *C = C_of(i), *Cu = Cu_of(i), *W = weight.data() + size_t(i) * m;
    double* WC = scaled_.data();
    for (int a = 0; a < k; ++a) {
      const double *row = G + (n_z + a) * ld, *d = D_of(i) + a * ld;
      double* y = Y + a * ld;
      for (int j = 0; j < ld; ++j) y[j] = d[j] + (j < n_z ? row[j] : 0.0);
      for (int b = 0; b <= a; ++b) L[a * ld_k + b] = row[n_z + b];
    }
    for (int r = 0; r < m; ++r) {
      const double *c = C + r * ld, *cu = Cu + r * ld_k;
      for (int j = 0; j < ld; ++j) WC[r * ld + j] = W[r] * c[j];
      for (int a = 0; a < k; ++a) {
        if (cu[a] == 0.0) continue;
        add_scaled(cu[a], WC + r * ld, Y + a * ld, ld);
        for (int b = 0; b <= a; ++b) L[a * ld_k + b] += W[r] * cu[a] * cu[b];
      }
    }
  }

  // Minimises over u_i after gather(i), which leaves P of the state of stage i.
  bool eliminate(int i) {
    double *P = P_at(i), *G = G_.data();
    double *Y = Y_.data() + size_t(i) * ld_k * ld, *L = L_.data() + size_t(i) * k * ld_k;
    mark_bound(i);
    for (const StageLaw& law : laws_of(i)) {
      bound_[law.input] = 2;
      for (int b = 0; b < k; ++b) {
        if (bound_[b] == 2) continue;
        for (int t = 0; t < 2; ++t) Y[b * ld + law.at[t]] += entry(L, b, law.input) * law.by[t];
      }
    }
    for (int a = 0; a < k; ++a) {
      if (bound_[a]) continue;
      double *row = L + a * ld_k, *y = Y + a * ld;
      for (int b = 0; b < a; ++b) {
        if (bound_[b]) continue;
        for (int c = 0; c < b; ++c) {
          if (!bound_[c]) row[b] -= row[c] * L[b * ld_k + c];
        }
        row[b] /= L[b * ld_k + b];
        row[a] -= row[b] * row[b];
        add_scaled(-row[b], Y + b * ld, y, ld);
      }
      if (!(row[a] > 0.0 && row[a] < 1e300)) return false;
      row[a] = std::sqrt(row[a]);
      const double inverse = 1.0 / row[a];
      for (int j = 0; j < ld; ++j) y[j] *= inverse;
    }
    if (i == 0) return true;
    const int n = in_eights(n_s);
    for (int a = 0; a < n_s; ++a) {
      const double* g = G + a * ld;
      double* p = P + a * ld;
      const int own = a < n_z ? in_eights(a + 1) : 0;
      for (int j = 0; j < own; ++j) p[j] = g[j];
      for (int j = own; j < in_eights(a + 1); ++j) p[j] = 0.0;
      if (!H.empty()) add_scaled(1.0, H_of(i - 1) + a * ld, p, in_eights(a + 1));
      p[a] += diagonal[size_t(i - 1) * ld + a];
    }
    add_squares(i - 1, P);
    double *minus = T_.data(), *plus = free_.data();
    int n_free = 0;
    for (int a = 0; a < k; ++a) {
      if (bound_[a]) continue;
      const double* y = Y + a * ld;
      for (int j = 0; j < ld; ++j) minus[n_free * ld + j] = -y[j], plus[n_free * ld + j] = y[j];
      ++n_free;
    }
    add_product(n_free, minus, ld, plus, ld, P, ld, n, n, true);
    add_product(m, scaled_.data(), ld, C_of(i), ld, P, ld, n, n, true);
    mirror(P, ld, n_s);
    for (const StageLaw& law : laws_of(i)) add_law(law, L, Y, P);
    return true;
  }

  // dx (N, ld), the minimum for a gradient (N, ld).
  void solve(const double* gradient, double* dx) {
    pull_back(gradient);
    for (int i = 0; i < N; ++i) {
      double* x = dx + size_t(i) * ld;
      const double* before = i ? x - ld : nullptr;
      best_inputs(i, before, x);
      propagate(i, before, x);
    }
  }

  // Gradients of the cost to go at all stages, for best_inputs and slope.
  void pull_back(const double* gradient) {
    for (int i = N - 1; i >= 0; --i) {
      stage_gradient(i, gradient);
      state_gradient(i);
    }
  }

  // Gradient of the cost to go by stage i's state and inputs, after state_gradient(i + 1).
  void stage_gradient(int i, const double* gradient) {
    double *p = p_.data(), *h = h_.data(), *y = y_of(i);
    const double* own = gradient + size_t(i) * ld;
    for (int j = 0; j < ld; ++j) p[j] = own[j] + (i < N - 1 ? from_later[j] : 0.0);
    multiply_transposed(i, p, h);
    for (int a = 0; a < k; ++a) y[a] = h[n_z + a] + p[n_z + a];
    for (int j = 0; j < ld; ++j) from_later[j] = j < n_z ? h[j] : 0.0;
  }

  // The same by its state only, for inputs that are optimal or follow their laws.
  void state_gradient(int i) {
    double* p = from_later.data();
    const double *L = L_.data() + size_t(i) * k * ld_k, *Y = gain_root(i);
    double* y = y_of(i);
    mark_bound(i);
    for (const StageLaw& law : laws_of(i)) {
      const int c = law.input;
      const double force = y[c] + L[c * (ld_k + 1)] * law.value;
      for (int t = 0; t < 2; ++t) p[law.at[t]] += law.by[t] * force;
      add_scaled(law.value, Y + c * ld, p, in_eights(n_s));
      bound_[c] = 2;
      for (int b = 0; b < k; ++b) {
        if (bound_[b] != 2) y[b] += entry(L, b, c) * law.value;
      }
    }
    for (int a = 0; a < k; ++a) {
      if (bound_[a]) continue;
      for (int b = 0; b < a; ++b) {
        if (!bound_[b]) y[a] -= L[a * ld_k + b] * y[b];
      }
      y[a] /= L[a * (ld_k + 1)];
      add_scaled(-y[a], Y + a * ld, p, in_eights(n_s));
    }
  }

  // The inputs of stage i in x; `before` is null at the first.
  void best_inputs(int i, const double* before, double* x) {
    const double *L = L_.data() + size_t(i) * k * ld_k, *Y = gain_root(i);
    const double* y = y_.data() + size_t(i) * ld_k;
    double* h = h_.data();
    mark_bound(i);
    for (const StageLaw& law : laws_of(i)) {
      double value = law.value;
      for (int t = 0; t < 2 && before; ++t) value += law.by[t] * before[law.at[t]];
      x[n_z + law.input] = value;
    }
    for (int a = 0; a < k; ++a) {
      if (!bound_[a]) h[a] = y[a] + (before ? dot(Y + a * ld, before, in_eights(n_s)) : 0.0);
    }
    for (int a = k - 1; a >= 0; --a) {
      if (bound_[a]) continue;
      for (int b = a + 1; b < k; ++b) {
        if (!bound_[b]) h[a] += L[b * ld_k + a] * x[n_z + b];
      }
      x[n_z + a] = -h[a] / L[a * ld_k + a];
    }
  }

  // Entry (a, b) of a symmetric matrix from its lower triangle.
  double entry(const double* L, int a, int b) const {
    return a < b ? L[b * ld_k + a] : L[a * ld_k + b];
  }

  struct Laws {
    const StageLaw *first, *last;
    const StageLaw* begin() const { return first; }
    const StageLaw* end() const { return last; }
  };

  Laws laws_of(int i) const {
    const StageLaw* first = laws.data() + size_t(i) * k;
    return {first, first + n_laws[i]};
  }

  // Derivative of the least cost to go by an input bound to the l-th law of stage i.
  double slope(int i, int l, const double* before, const double* x) {
    const double *L = L_.data() + size_t(i) * k * ld_k, *Y = gain_root(i);
    const int c = laws[size_t(i) * k + l].input;
    double sum =
        y_[size_t(i) * ld_k + c] + (before ? dot(Y + c * ld, before, in_eights(n_s)) : 0.0);
    mark_bound(i);
    for (int e = 0; e <= l; ++e) bound_[laws[size_t(i) * k + e].input] = 2;
    sum += L[c * (ld_k + 1)] * x[n_z + c];
    for (int b = 0; b < k; ++b) {
      if (bound_[b] != 2) sum += entry(L, b, c) * x[n_z + b];
    }
    return sum;
  }

  // Computes z_{i+1} = A z_i + B u_i in x, which has u_i; z_i is 0 if `before` is null.
  void propagate(int i, const double* before, double* x) {
    double* from = p_.data();
    for (int j = 0; j < n_z; ++j) from[j] = before ? before[j] : 0.0;
    for (int j = n_z; j < ld; ++j) from[j] = j < n_x ? x[j] : 0.0;
    const double* row = M_of(i);
    for (int r = 0; r < n_dense; ++r, row += ld) x[r] = dot(row, from, ld);
    for (int r = n_dense; r < n_z; ++r) x[r] = 0.0;
    const double* value = values_of(i);
    for (const Band& band : bands) {
      for (int j = 0; j < band.length; ++j) x[band.row + j] += value[j] * from[band.column + j];
      value += in_eights(band.length);
    }
  }

  // h = (A B)^T p, over (z_i, u_i).
  void multiply_transposed(int i, const double* p, double* h) {
    for (int j = 0; j < ld; ++j) h[j] = 0.0;
    const double* row = M_of(i);
    int r = 0;
    for (; r + 4 <= n_dense; r += 4, row += 4 * ld) {
      for (int j = 0; j < ld; j += FAN_WIDTH) {
        vec(h + j) += (p[r] * vec(row + j) + p[r + 1] * vec(row + ld + j)) +
                      (p[r + 2] * vec(row + 2 * ld + j) + p[r + 3] * vec(row + 3 * ld + j));
      }
    }
    for (; r < n_dense; ++r, row += ld) add_scaled(p[r], row, h, ld);
    const double* value = values_of(i);
    for (const Band& band : bands) {
      for (int j = 0; j < band.length; ++j) h[band.column + j] += value[j] * p[band.row + j];
      value += in_eights(band.length);
    }
  }

 private:
  static constexpr int slack = 64;  // bands are read and added to in whole vectors
  int n_values_ = 0;
  std::vector<double> Y_, L_, y_, P_, T_, G_, scaled_, p_, h_, kept_, free_;
  std::vector<char> bound_;  // 1: bound to a law; 2: and eliminated

  double* values_of(int i) { return band_values.data() + size_t(i) * n_values_; }

  size_t size_P() const { return size_t(ld) * ld + slack; }

  // Hessian of the cost to go by the state of stage i.
  double* P_at(int i) { return kept_.empty() ? P_.data() : kept_.data() + size_t(i) * size_P(); }

  void mark_bound(int i) {
    std::fill(bound_.begin(), bound_.end(), 0);
    for (const StageLaw& law : laws_of(i)) bound_[law.input] = 1;
  }

  // J^T J of stage i in P's lower triangle.
  void add_squares(int i, double* P) {
    const int n = in_eights(n_s);
    if (n_squares) add_product(n_squares, squares_of(i), ld, squares_of(i), ld, P, ld, n, n, true);
  }

  // The lower triangle of G = M^T P M, over (z_i, u_i).
  void value_by_dynamics(int i) {
    double *T = T_.data(), *G = G_.data(), *P = P_at(i + 1);
    const double* M = M_of(i);
    const int n = in_eights(n_s);
    std::fill_n(T, n * ld, 0.0);
    add_product(n_dense, P, ld, M, ld, T, ld, n, ld);
    const double* value = values_of(i);
    for (const Band& band : bands) {
      const int length = in_eights(band.length);
      for (int a = 0; a < n_s; ++a) {
        const double* p = P + a * ld + band.row;
        double* t = T + a * ld + band.column;
        for (int j = 0; j < length; j += FAN_WIDTH) vec(t + j) += vec(value + j) * vec(p + j);
      }
      value += length;
    }
    if (coupled) {  // the input is a part of the next state
      for (int a = 0; a < n_s; ++a) {
        for (int j = n_z; j < n_x; ++j) T[a * ld + j] += P[a * ld + j];
      }
    }
    std::fill_n(G, ld * ld, 0.0);
    add_product(n_dense, M, ld, T, ld, G, ld, ld, ld, true);
    value = values_of(i);
    for (const Band& band : bands) {
      for (int j = 0; j < band.length; ++j) {
        const int row = band.column + j;
        add_scaled(value[j], T + (band.row + j) * ld, G + row * ld, in_eights(row + 1));
      }
      value += in_eights(band.length);
    }
    for (int j = n_z; j < n_x; ++j) {
      double* row = G + j * ld;
      if (coupled) add_scaled(1.0, T + j * ld, row, ld);
      if (!coupled) {
        for (int a = n_z; a <= j && !H.empty(); ++a) row[a] += H_of(i)[j * ld + a];
        row[j] += diagonal[size_t(i) * ld + j];
      }
    }
  }

  // Contribution to P of an input that follows the state.
  void add_law(const StageLaw& law, const double* L, const double* Y, double* P) {
    const double *y = Y + law.input * ld, own = L[law.input * (ld_k + 1)];
    for (int t = 0; t < 2; ++t) {
      const double by = law.by[t];
      if (by == 0.0) continue;
      double* row = P + law.at[t] * ld;
      add_scaled(by, y, row, in_eights(n_s));
      for (int j = 0; j < n_s; ++j) P[j * ld + law.at[t]] += by * y[j];
      for (int u = 0; u < 2; ++u) row[law.at[u]] += own * by * law.by[u];
    }
  }
};

}  // namespace fan
