// One evaluation of the generated model, and its complementarity problems over one-sided rows.
//
//   hddot = gamma + A_D acc_D,   acc_D = F^-1 (w0 + W lambda),   W = F^-T A_D^T,   M_DD = F^T F
//
// solve_factor applies F^-1 and solve_factor_transposed F^-T, both from L, the generated code's
// factor of M_DD.
//
// Rows are the strings, then the limits. The generated code computes W and G = W^T W of the
// strings; a limit's column of W is computed when the limit is in a problem.
#pragma once

#include "fantoccini/contract.hpp"
#include "fantoccini/math/manifold.hpp"
#include "fantoccini/model/string_length.hpp"
#include "fantoccini/solvers/complementarity.hpp"

namespace fan {

// Model contains the generated sizes and tables, and for each Real the generated functions.
template <class Model, class Real>
struct Evaluation {
  static constexpr int N = Model::n_vD, S = Model::n_strings, K = Model::n_limits;
  Real L[array_size(Model::n_packed)], w0[array_size(N)] = {}, W[array_size(N * S)],
                                       G[array_size(S * S)];
  Real h[array_size(S)], hdot[array_size(S)] = {}, gamma[array_size(S)] = {},
                         a0[array_size(S)] = {}, hdot_K[array_size(S)] = {};
  Real h_limit[array_size(K)], J_limit[array_size(3 * K)], gamma_limit[array_size(K)] = {};
  Real power0, M_DK_v_K[array_size(N)], loss;
  Real f_M[array_size(Model::n_motors)],
      y_M[array_size(Model::n_motors)];  // force of a step: f_M - y_M dv

  FAN_FN void at(
      const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K, const Real* acc_K,
      const Real* u_D, const Real* p) {
    Call<Model, Real>::dynamics(
        q_D, v_D, q_K, v_K, acc_K, u_D, p, *this, constants_ != OF_DYNAMICS);
    constants_ = OF_DYNAMICS;
  }

  // For a step dt, with its damping and drag in F and velocity products of v_ahead; gamma is not
  // changed.
  FAN_FN void at(
      const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K, const Real* acc_K,
      const Real* u_D, const Real* v_ahead, Real dt, const Real* p) {
    Call<Model, Real>::step_dynamics(
        q_D, v_D, q_K, v_K, acc_K, u_D, v_ahead, dt, p, *this, constants_ != OF_STEP);
    constants_ = OF_STEP;
  }

  // At a node of a variational run. firm gets L, W and G of the factor with damping over dt, and
  // J_limit.
  FAN_FN void at_node(
      const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K, const Real* acc_K,
      const Real* u_D, Real dt, const Real* p, Evaluation& firm) {
    struct {
      Real *L, *w0, *W, *G, *h, *hdot, *a0, *hdot_K, *h_limit, *J_limit, *power0, *M_DK_v_K, *loss;
      Real *L_firm, *W_firm, *G_firm;
    } to;
    to.L = L, to.w0 = w0, to.W = W, to.G = G, to.h = h, to.hdot = hdot, to.a0 = a0;
    to.hdot_K = hdot_K, to.h_limit = h_limit, to.J_limit = J_limit, to.power0 = &power0;
    to.M_DK_v_K = M_DK_v_K, to.loss = &loss;
    to.L_firm = firm.L, to.W_firm = firm.W, to.G_firm = firm.G;
    Call<Model, Real>::node(q_D, v_D, q_K, v_K, acc_K, u_D, dt, p, to, constants_ != OF_NODE);
    constants_ = OF_NODE;
    for (int i = 0; i < 3 * K; ++i) firm.J_limit[i] = J_limit[i];
  }

  // acc = F^-1 w.
  FAN_FN void solve_factor(const Real* w, Real* acc) const {
    Call<Model, Real>::solve_factor(L, w, acc);
  }

  // hdot of the limits at the velocity v_D.
  FAN_FN void limit_rates(const Real* v_D, Real* rates) const {
    Call<Model, Real>::limit_rates(J_limit, v_D, rates);
  }

  // hdot of limit i at the velocity v_D.
  FAN_FN Real limit_rate(int i, const Real* v_D) const {
    Real rate = Real(0.0);
    for (int k = 0; k < Model::limit_n[i]; ++k)
      rate += J_limit[3 * i + k] * v_D[Model::limit_v[i] + k];
    return rate;
  }

  FAN_FN Real height(int row) const { return row < S ? h[row] : h_limit[row - S]; }

 private:
  // The last function that wrote the constant entries of W, J_limit and M_DK_v_K; it does not write
  // them again.
  enum { NOBODYS, OF_DYNAMICS, OF_STEP, OF_NODE } constants_ = NOBODYS;
};

// Lists all strings, and the limits that are in the problem of any lane, in order, so that no
// lane's sums depend on its neighbours. Returns their number.
template <class Model, class Mask>
FAN_FN int rows_in_some_lane(const Mask* takes_part, int* list) {
  int n = 0;
  for (int r = 0; r < Model::n_rows; ++r)
    if (r < Model::n_strings || any(takes_part[r])) list[n++] = r;
  return n;
}

// The rows of a complementarity problem, in increasing order.
template <class Model, class Real>
struct RowSystem {
  static constexpr int N = Model::n_vD, S = Model::n_strings, M = Model::n_rows;
  using Eval = Evaluation<Model, Real>;

  int n = 0;
  int row[array_size(M)];
  const Real* column[array_size(M)];  // W's column of each row
  Real own[array_size(N * Model::n_limits)] = {};
  Real hdot[array_size(M)];      // at the velocity of the evaluation
  Real hddot[array_size(M)];     // at zero multipliers
  Real free_acc[array_size(M)];  // A_D acc_free: change of hdot per unit time without gamma
  Real hdot_K[array_size(M)];
  bool two_sided[array_size(M)];
  // Straight-line code is used for few strings: it grows with the third power of their number.
  static constexpr int leading = S <= 8 ? S : 0;
  Complementarity<Real, M, leading> problem;

  FAN_FN void gather(const Eval& e, const Real* v_D, const int* rows, int n_rows) {
    for (int i = 0; i < Model::n_limits; ++i) made_[i] = false;
    gather_more(e, v_D, rows, n_rows);
  }

  // The same for more rows of the same evaluation; columns are not computed again.
  FAN_FN void gather_more(const Eval& e, const Real* v_D, const int* rows, int n_rows) {
    n = problem.n = n_rows;
    gather_from(0, e, v_D, rows);
    problem.use(problem.G, Complementarity<Real, M>::N);
  }

  // The first `leading` rows of gather(), which are strings; without hddot, and without their block
  // of G, which is not copied from the equations.
  FAN_FN void gather_leading(const Eval& e) {
    for (int i = 0; i < Model::n_limits; ++i) made_[i] = false;
    each<leading>([&](int r) FAN_INLINE {
      row[r] = r;
      column[r] = e.W + N * r;
      two_sided[r] = Model::wire[r];
    });
    each<leading>([&](int r) FAN_INLINE {
      hdot[r] = e.hdot[r];
      free_acc[r] = e.a0[r];
      hdot_K[r] = e.hdot_K[r];
    });
    problem.use(e.G, S);
  }

  // Writes the entries of problem.G between the first rows, which gather_leading() leaves out.
  FAN_FN void copy_leading(const Eval& e) {
    constexpr int stride = Complementarity<Real, M>::N;
    for (int a = 0; a < leading; ++a)
      for (int b = 0; b <= a; ++b)
        problem.G[a * stride + b] = problem.G[b * stride + a] = e.G[b + S * a];
  }

  // The other rows, after gather_leading() or, in the same evaluation, after fewer rows.
  FAN_FN void gather_others(const Eval& e, const Real* v_D, const int* rows, int n_rows) {
    n = problem.n = n_rows;
    gather_from(leading, e, v_D, rows);
  }

  // w <- w + W y over the rows; in the lanes of V for several vectors.
  template <class V>
  FAN_FN void add(const V* y, V* w) const {
    add_from(0, y, w);
  }

  // w = dt w0 + W y, after gather_leading().
  FAN_FN void push(const Eval& e, double dt, const Real* y, Real* w) const {
    unrolled<0, N>([&](auto k) FAN_INLINE {
      Real sum = dt * e.w0[k];
      unrolled<0, leading>([&](auto i) FAN_INLINE {
        if constexpr (moves(i, k)) sum += e.W[N * i + k] * y[i];
      });
      w[k] = sum;
    });
    add_from(leading, y, w);
  }

  // Whether no velocity moves both gathered row a and `moved`: their entries do not overlap.
  template <class Moved>
  FAN_FN bool is_apart(int a, const Moved& moved) const {
    const Entries of = entries(row[a]);
    const int* entry = moved.entries();
    return of.n == 0 || moved.n == 0 || of[of.n - 1] < entry[0] || entry[moved.n - 1] < of[0];
  }

  // W^T w over the rows, likewise; two sums at a time, since each addition waits for the last one.
  template <class V>
  FAN_FN void along(const V* w, V* out) const {
    for (int a = 0; a < n; ++a) {
      const Entries of = entries(row[a]);
      V even = V(0.0), odd = V(0.0);
      int j = 0;
      for (; j + 2 <= of.n; j += 2) {
        even += column[a][of[j]] * w[of[j]];
        odd += column[a][of[j + 1]] * w[of[j + 1]];
      }
      if (j < of.n) even += column[a][of[j]] * w[of[j]];
      out[a] = even + odd;
    }
  }

 private:
  // Whether string i moves velocity k.
  static constexpr bool moves(int i, int k) {
    for (int j = Model::string_begin[i]; j < Model::string_begin[i + 1]; ++j)
      if (Model::string_entry[j] == k) return true;
    return false;
  }

  FAN_FN void gather_from(int first, const Eval& e, const Real* v_D, const int* rows) {
    for (int a = first; a < n; ++a) {
      const int r = row[a] = rows[a];
      if (r < S) {
        column[a] = e.W + N * r;
        hdot[a] = e.hdot[r];
        hddot[a] = e.gamma[r] + e.a0[r];
        free_acc[a] = e.a0[r];
        hdot_K[a] = e.hdot_K[r];
      } else {
        limit(e, v_D, a, r - S);
      }
      two_sided[a] = r < S && Model::wire[r];
    }
    constexpr int stride = Complementarity<Real, M>::N;
    for (int a = first; a < n; ++a) {
      Real* G = problem.G + a * stride;
      if (row[a] < S)
        for (int b = 0; b <= a; ++b) G[b] = e.G[row[b] + S * row[a]];
      else products(a, G);
      for (int b = 0; b < a; ++b) problem.G[b * stride + a] = G[b];
    }
  }

  template <class V>
  FAN_FN void add_from(int first, const V* y, V* w) const {
    for (int a = first; a < n; ++a) {
      if (!any(y[a] != V(0.0))) continue;
      const Entries of = entries(row[a]);
      for (int j = 0; j < of.n; ++j) w[of[j]] += column[a][of[j]] * y[a];
    }
  }

  // The nonzero entries of a row's column.
  struct Entries {
    const int* place;
    int n;
    FAN_FN int operator[](int j) const { return place ? place[j] : j; }
  };

  FAN_FN Entries entries(int r) const {
    if (r < S) {
      const int* begin = Model::string_begin + r;
      return {Model::string_entry + begin[0], begin[1] - begin[0]};
    }
    const int i = r - S;
    // w = F^-T x is zero after the last nonzero entry of x, since links follow their parents.
    if (Model::n_columns == 0) return {nullptr, Model::limit_v[i] + Model::limit_n[i]};
    const int* begin = Model::column_begin + Model::limit_column[i];
    return {Model::column_entry + begin[0], begin[1] - begin[0]};
  }

  // Row a of W^T W up to its diagonal, four sums at a time, since each addition waits for the last.
  FAN_FN void products(int a, Real* out) const {
    const Real* own_column = column[a];
    const Entries of = entries(row[a]);
    for (int b = 0; b <= a; b += 4) {
      const Real* c[4];
      for (int j = 0; j < 4; ++j) c[j] = column[b + j <= a ? b + j : a];
      Real sum[4] = {Real(0.0), Real(0.0), Real(0.0), Real(0.0)};
      for (int j = 0; j < of.n; ++j) {
        const int k = of[j];
        sum[0] += own_column[k] * c[0][k];
        sum[1] += own_column[k] * c[1][k];
        sum[2] += own_column[k] * c[2][k];
        sum[3] += own_column[k] * c[3][k];
      }
      for (int j = 0; j < 4 && b + j <= a; ++j) out[b + j] = sum[j];
    }
  }

  FAN_FN void limit(const Eval& e, const Real* v_D, int a, int i) {
    Real* w = own + N * i;
    const Entries of = entries(S + i);
    if (!made_[i]) {
      make(e, i, of, w);
      made_[i] = true;
    }
    column[a] = w;
    hdot[a] = e.limit_rate(i, v_D);
    Real free_rate = Real(0.0);
    for (int j = 0; j < of.n; ++j) free_rate += w[of[j]] * e.w0[of[j]];
    free_acc[a] = free_rate;
    hddot[a] = e.gamma_limit[i] + free_rate;
    hdot_K[a] = Real(0.0);
  }

  // The column w = F^-T A_D^T of limit i. Entries that are always zero are not written.
  FAN_FN void make(const Eval& e, int i, const Entries& of, Real* w) {
    if (Model::n_columns > 0) {
      Real found[array_size(N)];
      Call<Model, Real>::column(Model::limit_column[i], e.L, e.J_limit + 3 * i, found);
      for (int j = 0; j < of.n; ++j) w[of[j]] = found[j];
      return;
    }
    Real x[array_size(N)];
    for (int k = 0; k < N; ++k) x[k] = Real(0.0);
    for (int k = 0; k < Model::limit_n[i]; ++k) x[Model::limit_v[i] + k] = e.J_limit[3 * i + k];
    Call<Model, Real>::solve_factor_transposed(e.L, x, w);
  }

  bool made_[array_size(
      Model::n_limits)];  // whether a limit's column was computed for this evaluation
};

}  // namespace fan
