// The contact point of an ellipsoid with a sphere, a capsule, a box or an ellipsoid.
//
// The gap of two convex solids along a unit vector n is, with their support functions h,
//
//     g(n) = n . c - h_1(n) - h_2(n),
//
// where c is the vector from the second's middle to the first's. The largest g is the distance, or
// minus the least depth. h(n) = sqrt(n . M n) for an ellipsoid and sum_k half_k |n_k| for a box, of
// which points and segments are special cases. g is smooth except on the folds n_k = 0 of the box.
// Newton's method on the unit sphere maximises g; components on a fold are held at 0 until g
// increases away from it, where the touching point leaves the box's face or edge. For solids
// apart, g has one maximum; for overlapping solids, the ascent starts at the best of a guess and
// the box's faces.
#pragma once

#include "fantoccini/collision/box_capsule.hpp"

namespace fan {

struct EllipsoidTolerances {
  static constexpr double slope = 1e-14;     // relative to the size: end of the ascent
  static constexpr double rounding = 1e-15;  // relative to the size: of the gap
  static constexpr double min_reach = 1e-9;  // relative to the size: of flat ellipsoids, across
  static constexpr int max_climbs = 60;      // Newton steps; about 6 are usual
  static constexpr int max_halvings = 30;    // of a step that does not ascend
};

// Solves A x = b for a symmetric positive definite A (3, 3). Returns whether A is. A is changed.
FAN_FN bool solve_definite(double* A, const double* b, double* x) {
  const double largest = fmax(A[0], fmax(A[4], A[8]));
  for (int k = 0; k < 3; ++k) x[k] = b[k];
  for (int i = 0; i < 3; ++i) {
    if (!(A[4 * i] > TouchTolerances::tiny * largest)) return false;
    for (int j = i + 1; j < 3; ++j) {
      const double factor = A[3 * j + i] / A[4 * i];
      for (int k = i; k < 3; ++k) A[3 * j + k] -= factor * A[3 * i + k];
      x[j] -= factor * x[i];
    }
  }
  for (int i = 2; i >= 0; --i) {
    for (int k = i + 1; k < 3; ++k) x[i] -= A[3 * i + k] * x[k];
    x[i] /= A[4 * i];
  }
  return true;
}

// An ellipsoid's support function h(n) = sqrt(n . M n).
struct EllipsoidReach {
  double M[9], least;

  // An ellipsoid with its axes as columns in some frame.
  FAN_FN EllipsoidReach(const double* axes, const double* radii) {
    const double size = fmax(radii[0], fmax(radii[1], radii[2]));
    least = fmax(EllipsoidTolerances::min_reach * size, DistanceTolerances::min_length);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        M[3 * i + j] = 0.0;
        for (int k = 0; k < 3; ++k)
          M[3 * i + j] += axes[3 * k + i] * axes[3 * k + j] * radii[k] * radii[k];
      }
  }

  // Value of h; out: the farthest point, which is the gradient of h.
  FAN_FN double farthest(const double* n, double* out) const {
    for (int i = 0; i < 3; ++i) out[i] = dot3(M + 3 * i, n);
    const double h = fmax(sqrt(fmax(dot3(n, out), 0.0)), least);
    for (int i = 0; i < 3; ++i) out[i] /= h;
    return h;
  }

  // Adds the second derivatives of h, from its value h and its gradient p.
  FAN_FN void add_curvature(double h, const double* p, double* to) const {
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) to[3 * i + j] += (M[3 * i + j] - p[i] * p[j]) / h;
  }
};

// Maximisation of the gap of an ellipsoid from a box (a point, a segment), with or without an
// ellipsoid around its middle, in the frame of the box.
class GapClimb {
 public:
  using Tol = EllipsoidTolerances;
  double n[3];  // the direction of the greatest gap

  // Ends early where the gap is certainly `enough`.
  FAN_FN GapClimb(
      const EllipsoidReach& first, const EllipsoidReach* second, const double* half,
      const double* centre, double enough)
      : first_(first), second_(second), half_(half), centre_(centre) {
    size_ = length3(centre) + length3(half) + extent(first);
    if (second) size_ += extent(*second);
    begin();
    for (int i = 0; i < Tol::max_climbs && at_.gap < enough && climb(); ++i) {
    }
  }

  FAN_FN double gap() const { return at_.gap; }

  // The first's point in this direction, in the frame of the box.
  FAN_FN void point_of_first(double* out) const { difference3(centre_, at_.p[0], out); }

 private:
  FAN_FN static double extent(const EllipsoidReach& x) { return sqrt(x.M[0] + x.M[4] + x.M[8]); }

  // Both solids' values and gradients for the gap along a direction.
  struct Reaches {
    double gap, h[2], p[2][3];
  };

  FAN_FN Reaches reaches_along(const double* m) const {
    Reaches out{};
    out.h[0] = first_.farthest(m, out.p[0]);
    if (second_) out.h[1] = second_->farthest(m, out.p[1]);
    out.gap = dot3(m, centre_) - out.h[0] - out.h[1];
    for (int k = 0; k < 3; ++k) out.gap -= half_[k] * fabs(m[k]);
    return out;
  }

  FAN_FN void begin() {
    double M[9], m[3];
    for (int i = 0; i < 9; ++i) M[i] = first_.M[i] + (second_ ? second_->M[i] : 0.0);
    for (int k = 0; k < 3; ++k) M[4 * k] += half_[k] * half_[k];
    axis3(0, 1.0, n);
    if (solve_definite(M, centre_, m) && unit3(m, 0.0)) copy3(m, n);
    at_ = reaches_along(n);
    for (int k = 0; k < 3; ++k) {
      if (!(half_[k] > 0.0)) continue;
      axis3(k, side_of(centre_[k]), m);
      take_if_higher(m, 0.0);
    }
  }

  FAN_FN bool take_if_higher(const double* m, double least) {
    const Reaches reaches = reaches_along(m);
    if (!(reaches.gap >= at_.gap + least)) return false;
    at_ = reaches;
    copy3(m, n);
    return true;
  }

  // Sets the gradient of the gap, and holds components on folds away from which it does not grow.
  FAN_FN void find_slope() {
    for (int k = 0; k < 3; ++k) {
      const double r = centre_[k] - at_.p[0][k] - at_.p[1][k];
      const bool folded = half_[k] > 0.0 && n[k] == 0.0;
      side_[k] = side_of(folded ? r : n[k]);
      held_[k] = folded && !(fabs(r) > half_[k]);
      slope_[k] = held_[k] ? 0.0 : r - side_[k] * half_[k];
    }
    along3(slope_, -dot3(slope_, n), n, slope_);
  }

  // Newton step. `bend`: curvature by the constraint |n| = 1, which is the gap; a larger one
  // guarantees ascent.
  FAN_FN bool find_step(double bend, double* step) const {
    double A[9] = {};
    first_.add_curvature(at_.h[0], at_.p[0], A);
    if (second_) second_->add_curvature(at_.h[1], at_.p[1], A);
    const double stiff = A[0] + A[4] + A[8];
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        if (held_[i] || held_[j]) A[3 * i + j] = 0.0;
        A[3 * i + j] += stiff * n[i] * n[j];
        if (i == j) A[3 * i + j] += held_[i] ? stiff : bend;
      }
    return solve_definite(A, slope_, step);
  }

  // Holds components that the step would move back across their fold. Returns whether there are
  // any.
  FAN_FN bool hold_back(const double* step) {
    bool any_held = false;
    for (int k = 0; k < 3; ++k) {
      if (!(half_[k] > 0.0) || held_[k] || n[k] != 0.0 || side_[k] * step[k] > 0.0) continue;
      held_[k] = any_held = true;
      slope_[k] = 0.0;
    }
    return any_held;
  }

  // Takes one step. Returns whether the next may ascend further.
  FAN_FN bool climb() {
    find_slope();
    if (!(length3(slope_) > Tol::slope * size_)) return false;
    double step[3];
    do {
      const double large_bend = fabs(at_.gap) + Tol::rounding * size_;
      if (!find_step(at_.gap, step) && !find_step(large_bend, step)) return false;
    } while (hold_back(step));
    // Stops at the first fold on the way.
    double fraction = 1.0;
    int fold = -1;
    for (int k = 0; k < 3; ++k) {
      if (!(half_[k] > 0.0) || n[k] == 0.0) continue;
      if ((n[k] + fraction * step[k] > 0.0) == (n[k] > 0.0)) continue;
      fraction = -n[k] / step[k];
      fold = k;
    }
    for (int i = 0; i < Tol::max_halvings; ++i, fraction *= 0.5) {
      double m[3];
      along3(n, fraction, step, m);
      if (fold >= 0 && i == 0) m[fold] = 0.0;
      if (unit3(m, 0.0) && take_if_higher(m, -Tol::rounding * size_)) return true;
    }
    return false;
  }

  const EllipsoidReach& first_;
  const EllipsoidReach* second_;
  const double *half_, *centre_;
  Reaches at_;
  double size_, slope_[3], side_[3];
  bool held_[3];
};

// Right-handed axes with u as the first; the world's axes for a zero vector.
FAN_FN void axes_along(const double* u, double* R) {
  for (int k = 0; k < 3; ++k) axis3(k, 1.0, R + 3 * k);
  if (!(dot3(u, u) > 0.0)) return;
  double across[3];
  axis3(smallest_of(u), 1.0, across);
  copy3(u, R);
  cross(u, across, R + 3);
  unit3(R + 3, 0.0);
  cross(R, R + 3, R + 6);
}

// Adds the point of an ellipsoid x and any solid but a half-space.
FAN_FN void touch_ellipsoid(const PlacedSolid& x, const PlacedSolid& y, Touches& to) {
  double x_at[3], y_at[3], apart[3], centre[3], R[9], axes[9];
  double half[3] = {0.0, 0.0, 0.0};
  centre3(x, x_at);
  centre3(y, y_at);
  if (y.kind == BOX || is_ellipsoid(y)) {
    for (int i = 0; i < 9; ++i) R[i] = y.R[i];
    for (int k = 0; y.kind == BOX && k < 3; ++k) half[k] = y.half[k];
  } else {
    const Core core(y.a, y.b);
    axes_along(core.u, R);
    half[0] = 0.5 * core.length;
  }
  difference3(x_at, y_at, apart);
  into_axes(R, apart, centre);
  for (int j = 0; j < 3; ++j) into_axes(R, x.R + 3 * j, axes + 3 * j);
  const double identity[] = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
  const EllipsoidReach first(axes, x.half), second(identity, y.half);
  const GapClimb climb(
      first, is_ellipsoid(y) ? &second : nullptr, half, centre, to.margin + to.y_radius);
  double local[3], p[3], q[3], normal[3];
  climb.point_of_first(local);
  out_of_axes(R, local, p);
  along3(y_at, 1.0, p, p);
  out_of_axes(R, climb.n, normal);
  along3(p, -climb.gap(), normal, q);
  to.add(p, q, normal, 0, y.kind == BOX ? region_of_box(climb.n) : 0);
}

}  // namespace fan
