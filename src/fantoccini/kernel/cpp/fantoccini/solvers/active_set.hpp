// Complementarity with bounds, solved exactly:
//
//   s = W^T W x - b,   s_i >= 0 where x_i = 0,   s_i = 0 where 0 < x_i < upper_i,
//   s_i <= 0 where x_i = upper_i                  (two-sided rows: s_i = 0, x_i of any sign)
//
// These are the conditions of max b.x - |W x|^2 / 2 over 0 <= x <= upper, and z = W x is the
// shortest z with W^T z >= b (Gauss's principle of least constraint). With b the rows' hddot at
// zero tension, x are tensions and -s is hddot; with b the rows' hdot before a catch, x are
// impulses and -s is hdot after it. For one string this is the paper's delta_1 delta_2 and Eq. 15.
//
// The dual active-set method (Goldfarb and Idnani, Mathematical Programming 27, 1983, with bounds
// on the multipliers): every round raises the multiplier of a violated row until the row holds,
// dropping rows from the basis as their multipliers reach a bound. The objective grows from round
// to round, so the method terminates; the basis, stored as W_B = Q R, stays independent, so
// redundant rows do no harm; and if the growth is unbounded, the multipliers' direction is a Farkas
// ray: y >= 0 with W y = 0 and b.y > 0, which proves that no z satisfies the rows with y_i > 0
// together.
#pragma once

#include "fantoccini/contract.hpp"
#include "fantoccini/math/real.hpp"

namespace fan {

// Residuals |s| are relative to `terms`, the sum of the magnitudes of their terms; rounding there
// is about 1e-15. The two that decide about consistency have the absolute `noise` of b added.
struct ActiveSetTolerances {
  // A row is violated above this: just above rounding.
  static constexpr double violated_residual = 1e-14;
  // A row with x = 0 joins the basis up to this, if it is independent.
  static constexpr double joining_residual = 1e-12;
  // A row that depends on the basis holds with it up to this: the basis may be ill-conditioned.
  static constexpr double consistent_residual = 1e-10;
  // Rows that no multipliers satisfy together still count as consistent up to this.
  static constexpr double infeasible_residual = 1e-7;
  // Distance of a column from the basis' span, relative to the column, below which the row depends
  // on the basis: its multiplier |s| / distance^2 would magnify rounding 1e12 times.
  static constexpr double dependent_distance = 1e-6;
  // The same for complete(): above it a row with x = 0 may join the basis; below it a row that
  // holds is idle or pinned.
  static constexpr double independent_distance = 1e-3;
  // The same for LeastNorm: rows at a larger distance keep their tension, since sharing it would
  // change the motion.
  static constexpr double sharing_distance = 1e-9;
  // Distance from the span, relative to the largest column, below which a row is dependent, too:
  // its multiplier moves nothing.
  static constexpr double negligible_column = 1e-9;
  // Change of a multiplier per unit of the raised one; a smaller one is rounding.
  static constexpr double negligible_rate = 1e-13;
  // Largest violation of a multiplier's bound, relative to the largest, before its row leaves.
  static constexpr double bound_excess = 1e-12;
};

template <int n_columns, int n_dimensions>
struct ActiveSet {
  using Tolerance = ActiveSetTolerances;
  static constexpr int C = array_size(n_columns), D = array_size(n_dimensions);
  // IDLE and PINNED rows depend on the basis and hold with it, at 0 and at `upper`.
  enum Place : signed char { LOW, BASIC, HIGH, IDLE, PINNED };

  int n = 0, dim = n_dimensions;
  double noise = 0.0;  // error of b, by which dependent rows may disagree
  const double* column[C];
  double b[C], upper[C];  // solve() sets b below `negligible` to 0
  bool two_sided[C];
  Place place[C];  // before solve(), the guess
  double x[C], s[C];
  double terms[C];  // sum of the magnitudes of the terms of s
  double ray[C];    // of an infeasible problem

  Solved solve() {
    begin();
    for (int round = 0; round < 20 + 10 * n; ++round) {
      residuals();
      const int d = most_violated();
      if (d < 0) {
        if (polish()) return Solved::YES;
        continue;
      }
      const Solved raised = raise(d);
      if (raised != Solved::YES) return raised;
    }
    return Solved::UNSETTLED;
  }

  // Continues from x and places of another solver's solution: computes the basis, but not s.
  void adopt() {
    bool basic[C];
    measure();
    for (int i = 0; i < n; ++i) {
      basic[i] = place[i] == BASIC;
      if (basic[i]) place[i] = IDLE;
    }
    join_all(basic);
  }

  // Whether row i holds as an equality, to the accuracy of its terms.
  bool holds(int i) const {
    return fabs(s[i]) <= Tolerance::consistent_residual * terms[i] + noise;
  }

  // Adds every row that holds to the basis or, where it depends on the basis, marks it idle or
  // pinned. A row with x = 0 joins the basis only if it `stays`. Call this after solve().
  void complete(const bool* stays) {
    bool wanted[C];
    for (int i = 0; i < n; ++i)
      wanted[i] = place[i] == LOW && stays[i] &&
                  fabs(s[i]) <= Tolerance::joining_residual * terms[i] &&
                  project(i) > Tolerance::independent_distance * size_[i];
    join_all(wanted);
    for (int i = 0; i < n; ++i) {
      const bool depends = holds(i) && project(i) <= Tolerance::independent_distance * size_[i];
      if (place[i] == BASIC || !(two_sided[i] || depends)) continue;
      place[i] = place[i] == LOW ? IDLE : PINNED;
    }
  }

  // Coefficients of column i on the basis, column i = sum_j c_j column[basis[j]]. Returns the
  // distance of the column from that, relative to its length.
  double coefficients(int i, double* c) {
    const double distance = project(i);
    for (int j = 0; j < k_; ++j) c[j] = along_[j];
    back_substitute(c);
    return size_[i] > 0.0 ? distance / size_[i] : 0.0;
  }

  int basis_size() const { return k_; }
  int basis(int j) const { return basis_[j]; }

 private:
  // Empties the basis and computes the columns' sizes.
  void measure() {
    k_ = 0;
    top_ = 0.0;
    for (int i = 0; i < n; ++i) {
      size_[i] = sqrt(product(column[i], column[i]));
      if (size_[i] > top_) top_ = size_[i];
    }
  }

  void begin() {
    measure();
    for (int i = 0; i < n; ++i) {
      if (fabs(b[i]) < negligible) b[i] = 0.0;
      implied_[i] = false;
      if (place[i] != BASIC && !(place[i] == HIGH && upper[i] < unbounded)) place[i] = LOW;
    }
    bool first[C], guessed[C];
    for (int i = 0; i < n; ++i) {
      first[i] = two_sided[i];
      guessed[i] = !two_sided[i] && place[i] == BASIC;
      if (place[i] == BASIC || two_sided[i]) place[i] = LOW;
    }
    join_all(first);
    join_all(guessed);
    // A guess is a valid start only if its multipliers are within their bounds.
    do fit();
    while (!drop_beyond(0.0));
  }

  // Raises (or lowers) x_d until row d holds or a bound of x_d is met.
  Solved raise(int d) {
    const double sign = s[d] < 0.0 ? 1.0 : -1.0;
    double c[D];
    for (int inner = 0; inner <= n + 1; ++inner) {
      const double distance = project(d);
      const bool depends = is_dependent(d, distance);
      if (depends && holds(d)) {
        implied_[d] = true;
        return Solved::YES;
      }
      for (int j = 0; j < k_; ++j) c[j] = along_[j];
      back_substitute(c);
      double t = depends ? unbounded : fabs(s[d]) / (distance * distance);
      int stop = -1;  // place in the basis of the row that meets a bound; k_: x_d itself
      const double own_range = sign > 0.0 ? upper[d] - x[d] : x[d];
      if (!two_sided[d] && own_range < t) {
        t = own_range;
        stop = k_;
      }
      for (int j = 0; j < k_; ++j) {
        const int i = basis_[j];
        if (two_sided[i]) continue;
        const double rate = -sign * c[j];
        if (fabs(rate) <= Tolerance::negligible_rate) continue;
        if (rate > 0.0 && upper[i] >= unbounded) continue;
        const double range = rate < 0.0 ? x[i] : upper[i] - x[i];
        if (range < t * fabs(rate)) {
          t = range / fabs(rate);
          stop = j;
        }
      }
      if (!(t < unbounded)) {
        if (fabs(s[d]) <= Tolerance::infeasible_residual * terms[d] + noise) {
          implied_[d] = true;
          return Solved::YES;
        }
        for (int i = 0; i < n; ++i) ray[i] = 0.0;
        ray[d] = sign;
        for (int j = 0; j < k_; ++j) ray[basis_[j]] = -sign * c[j];
        return Solved::INFEASIBLE;
      }
      if (t < 0.0) t = 0.0;
      for (int i = 0; i < n; ++i) implied_[i] = false;
      x[d] += sign * t;
      for (int j = 0; j < k_; ++j) x[basis_[j]] -= sign * t * c[j];
      if (!depends) s[d] += sign * t * distance * distance;
      if (stop < 0) {
        place[d] = BASIC;
        join(d);
        return Solved::YES;
      }
      if (stop == k_) {
        place[d] = sign > 0.0 ? HIGH : LOW;
        x[d] = sign > 0.0 ? upper[d] : 0.0;
        return Solved::YES;
      }
      const int i = basis_[stop];
      const bool low = -sign * c[stop] < 0.0;
      place[i] = low ? LOW : HIGH;
      x[i] = low ? 0.0 : upper[i];
      leave(stop);
    }
    return Solved::UNSETTLED;
  }

  int most_violated() const {
    int worst = -1;
    double largest = Tolerance::violated_residual;
    for (int i = 0; i < n; ++i) {
      if (place[i] == BASIC || implied_[i]) continue;
      const double wrong = two_sided[i] ? fabs(s[i]) : (place[i] == HIGH ? s[i] : -s[i]);
      if (wrong > largest * terms[i]) {
        largest = wrong / terms[i];
        worst = i;
      }
    }
    return worst;
  }

  // Recomputes x of the basis, without the rounding errors of the rounds. Returns false if a row
  // had to leave.
  bool polish() {
    fit();
    double largest = 0.0;
    for (int i = 0; i < n; ++i)
      if (fabs(x[i]) > largest) largest = fabs(x[i]);
    if (!drop_beyond(Tolerance::bound_excess * largest)) return false;
    for (int i = 0; i < n; ++i) {
      if (two_sided[i]) continue;
      if (x[i] < 0.0) x[i] = 0.0;
      if (x[i] > upper[i]) x[i] = upper[i];
    }
    residuals();
    return true;
  }

  // Drops the rows whose x is beyond a bound by more than `slack`. Returns true if there are none.
  bool drop_beyond(double slack) {
    bool none = true;
    for (int j = k_ - 1; j >= 0; --j) {
      const int i = basis_[j];
      if (two_sided[i] || (x[i] >= -slack && x[i] <= upper[i] + slack)) continue;
      place[i] = x[i] < 0.0 ? LOW : HIGH;
      leave(j);
      none = false;
    }
    return none;
  }

  // Solves R^T R x = b_B - W_B^T W_H upper_H for x of the basis, with one refinement; other x
  // follow from their places.
  void fit() {
    double sum[D], residual[D];
    for (int a = 0; a < dim; ++a) sum[a] = 0.0;
    for (int i = 0; i < n; ++i) {
      x[i] = place[i] == HIGH ? upper[i] : 0.0;
      for (int a = 0; a < dim && x[i] != 0.0; ++a) sum[a] += column[i][a] * x[i];
    }
    for (int round = 0; round < 2; ++round) {
      for (int j = 0; j < k_; ++j) residual[j] = b[basis_[j]] - product(column[basis_[j]], sum);
      for (int j = 0; j < k_; ++j) {
        for (int l = 0; l < j; ++l) residual[j] -= R_[l * D + j] * residual[l];
        residual[j] /= R_[j * D + j];
      }
      back_substitute(residual);
      for (int j = 0; j < k_; ++j) {
        x[basis_[j]] += residual[j];
        for (int a = 0; a < dim; ++a) sum[a] += column[basis_[j]][a] * residual[j];
      }
    }
  }

  void residuals() {
    double z[D], size[D];
    for (int a = 0; a < dim; ++a) z[a] = size[a] = 0.0;
    for (int i = 0; i < n; ++i) {
      for (int a = 0; a < dim && x[i] != 0.0; ++a) {
        const double part = column[i][a] * x[i];
        z[a] += part;
        size[a] += fabs(part);
      }
    }
    for (int i = 0; i < n; ++i) {
      s[i] = -b[i];
      terms[i] = fabs(b[i]);
      for (int a = 0; a < dim; ++a) {
        s[i] += column[i][a] * z[a];
        terms[i] += fabs(column[i][a]) * size[a];
      }
    }
  }

  // Adds row i to the basis unless its column depends on the basis.
  bool join(int i) {
    if (k_ == dim) return false;
    const double distance = project(i);
    if (is_dependent(i, distance)) return false;
    for (int j = 0; j < k_; ++j) R_[j * D + k_] = along_[j];
    R_[k_ * D + k_] = distance;
    for (int a = 0; a < dim; ++a) Q_[k_][a] = rest_[a] / distance;
    basis_[k_++] = i;
    return true;
  }

  // Adds the wanted rows to the basis, those farthest from its span first, so that of redundant
  // rows the best conditioned are included.
  void join_all(bool* wanted) {
    for (;;) {
      int best = -1;
      double farthest = -1.0;
      for (int i = 0; i < n; ++i) {
        if (!wanted[i]) continue;
        const double distance = project(i);
        if (distance > farthest) {
          farthest = distance;
          best = i;
        }
      }
      if (best < 0 || !join(best)) return;
      place[best] = BASIC;
      wanted[best] = false;
    }
  }

  // Removes the row at index j from the basis.
  void leave(int j) {
    int after[D], n_after = 0;
    for (int l = j + 1; l < k_; ++l) after[n_after++] = basis_[l];
    k_ = j;
    for (int l = 0; l < n_after; ++l)
      if (!join(after[l])) place[after[l]] = LOW;
  }

  // Projects column i on the basis: along_ are its coefficients, rest_ is the difference, whose
  // length is returned.
  double project(int i) {
    for (int a = 0; a < dim; ++a) rest_[a] = column[i][a];
    for (int j = 0; j < k_; ++j) along_[j] = 0.0;
    for (int twice = 0; twice < 2; ++twice)
      for (int j = 0; j < k_; ++j) {
        const double part = product(Q_[j], rest_);
        along_[j] += part;
        for (int a = 0; a < dim; ++a) rest_[a] -= part * Q_[j][a];
      }
    return sqrt(product(rest_, rest_));
  }

  bool is_dependent(int i, double distance) const {
    return distance <= Tolerance::dependent_distance * size_[i] ||
           distance <= Tolerance::negligible_column * top_;
  }

  // c <- R^-1 c.
  void back_substitute(double* c) const {
    for (int j = k_ - 1; j >= 0; --j) {
      for (int l = j + 1; l < k_; ++l) c[j] -= R_[j * D + l] * c[l];
      c[j] /= R_[j * D + j];
    }
  }

  double product(const double* p, const double* q) const {
    double sum = 0.0;
    for (int a = 0; a < dim; ++a) sum += p[a] * q[a];
    return sum;
  }

  int k_ = 0;
  int basis_[D];
  double Q_[D][D], R_[D * D], along_[D], rest_[D];
  double size_[C], top_ = 0.0;
  bool implied_[C];
};

}  // namespace fan
