// A step within linear bounds:
//
//   min 1/2 d . Q d + g . d   subject to   a_c . d <= b_c
//
// by its dual over the bounds that would be violated, which join one after another
// (complementarity.hpp):
//
//   d = -Q^-1 (g + A^T x),   0 <= x complementary to b - A d >= 0
#pragma once

#include "fantoccini/math/dense_ldl.hpp"
#include "fantoccini/solvers/complementarity.hpp"

namespace fan {

// For n unknowns and bounds of `kinds` kinds; at most one side of each takes part.
template <int unknowns, int kinds>
class BoundedStep {
 public:
  static constexpr int U = array_size(unknowns), C = array_size(kinds), UP = padded(U);

  int n = 0;
  double Q[U * U], g[U], d[U];
  double x[C];  // multiplier of every kind; negative for lower bounds

  // Begins a step, before bounds are added. Returns false if Q is not positive definite.
  bool begin() {
    taken_ = 0;
    for (int c = 0; c < C; ++c) x[c] = 0.0, side_[c] = 0;
    Q_.resize(n);
    for (int i = 0; i < n; ++i)
      for (int j = i / 4 * 4; j < Q_.stride; ++j)
        Q_.A[i * Q_.stride + j] = j < n ? Q[i * n + j] : 0.0;
    if (!Q_.factorise()) return false;
    double first[UP];
    for (int i = 0; i < n; ++i) first[i] = -g[i];
    Q_.substitute(first);
    for (int i = 0; i < n; ++i) d[i] = first_[i] = first[i];
    return true;
  }

  // Adds a bound of a kind, low <= row . d <= high, if d violates it. Returns whether it did.
  bool add(int kind, const double* row, double low, double high, double tolerance) {
    double value = 0.0;
    for (int i = 0; i < n; ++i) value += row[i] * d[i];
    const int side = value > high + tolerance ? 1 : value < low - tolerance ? -1 : 0;
    if (side == 0 || side_[kind] == side) return false;
    double z[UP], size = 0.0;
    for (int i = 0; i < n; ++i) z[i] = side * row[i];
    Q_.substitute(z);
    for (int i = 0; i < n; ++i) size += side * row[i] * z[i];
    if (!(size > 1e-300)) return false;  // no step moves it
    int place = taken_;
    if (side_[kind] != 0) {
      for (place = 0; kind_[place] != kind;) ++place;
    } else {
      ++taken_;
    }
    side_[kind] = side;
    kind_[place] = kind;
    scale_[place] = 1.0 / std::sqrt(size);
    bound_[place] = scale_[place] * (side > 0 ? high : -low);
    for (int i = 0; i < n; ++i) {
      row_[place * UP + i] = scale_[place] * side * row[i];
      z_[place * UP + i] = scale_[place] * z[i];
    }
    return true;
  }

  // d within the added bounds. Returns false if they contradict one another.
  bool solve() {
    dual_.n = taken_;
    for (int a = 0; a < taken_; ++a) {
      double value = -bound_[a];
      for (int i = 0; i < n; ++i) value += row_[a * UP + i] * first_[i];
      dual_.b[a] = value;
      dual_.lower[a] = 0.0;
      dual_.upper[a] = unbounded;
      dual_.active[a] = true;
      dual_.high[a] = false;
      for (int b = 0; b < taken_; ++b) {
        double sum = 0.0;
        for (int i = 0; i < n; ++i) sum += row_[a * UP + i] * z_[b * UP + i];
        dual_.G[a * C + b] = sum;
      }
    }
    const bool solved = taken_ == 0 || dual_.solve_firmly(false);
    for (int i = 0; i < n; ++i) d[i] = first_[i];
    for (int c = 0; c < C; ++c) x[c] = 0.0;
    for (int a = 0; a < taken_; ++a) {
      const double own = maximum(dual_.x[a], 0.0);
      x[kind_[a]] = side_[kind_[a]] * own * scale_[a];
      for (int i = 0; i < n; ++i) d[i] -= own * z_[a * UP + i];
    }
    return solved;
  }

 private:
  static double maximum(double a, double b) { return a > b ? a : b; }

  int taken_ = 0, side_[C], kind_[C];
  double first_[U], bound_[C], scale_[C], row_[C * UP], z_[C * UP];
  DenseLdl<unknowns> Q_;
  Complementarity<double, kinds> dual_;
};

}  // namespace fan
