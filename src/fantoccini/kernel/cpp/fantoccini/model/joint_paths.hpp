// Bounds of the motion of joints, and of the lengths of the paths of a puppet's points:
//
//   path(x) = sum over the links i from x's link to the world of slide_i + turn_i (|x - r_i| +
//   path of x relative to link i)
//
// with r_i the origin of link i, about which its joint turns, slide_i the path length of r_i in the
// frame of its parent, and turn_i the angle by which its joint turns.
#pragma once

#include "fantoccini/contract.hpp"
#include "fantoccini/math/manifold.hpp"
#include "fantoccini/model/string_length.hpp"

namespace fan {

struct JointPathTolerances {
  static constexpr double arcsine = 0.5708;  // asin(x) <= x + 0.5708 x^3 for 0 <= x <= 1
  static constexpr double parabola = 0.375;  // sag^2 / (length * excess) of a shallow string
};

template <class Model, class Real>
struct JointPaths {
  using Tol = JointPathTolerances;
  static constexpr int L = Model::n_links, S = Model::n_strings;

  Real slide[array_size(L)], turn[array_size(L)];
  Real wound[array_size(S)];  // bounds of the changes of the strings' lengths
  // 1.0 for strings that may go slack on the way although they are straight now; else 0.0.
  Real loose[array_size(S)];
  // Bounds of a string's length minus its span, if known; otherwise they are computed from the
  // paths.
  bool known = false;
  Real least_excess[array_size(S)], most_excess[array_size(S)];

  FAN_FN void clear() {
    known = false;
    for (int i = 0; i < L; ++i) slide[i] = turn[i] = Real(0.0);
    for (int i = 0; i < S; ++i) wound[i] = loose[i] = Real(0.0);
  }

  // Adds `fraction` times the motion of the joints between two configurations at constant velocity.
  FAN_FN void add(
      const ClearanceArrays& in, const Real* q_D, const Real* q_K, const Real* to_D,
      const Real* to_K, double fraction = 1.0) {
    using std::abs;
    using std::sqrt;
    for (int i = 0; i < L; ++i) {
      const JointPlace& joint = in.joints[i];
      if (joint.role == 0) continue;
      const Real* from = (joint.role == 1 ? q_D : q_K) + joint.q;
      const Real* to = (joint.role == 1 ? to_D : to_K) + joint.q;
      Real square = Real(0.0);
      for (int k = 0; k < joint.slides; ++k) square += (to[k] - from[k]) * (to[k] - from[k]);
      if (joint.slides) slide[i] += fraction * sqrt(square);
      from += joint.slides;
      to += joint.slides;
      if (joint.turns == 1) turn[i] += fraction * abs(to[0] - from[0]);
      if (joint.turns == 4) turn[i] += fraction * angle_bound(from, to);
    }
    for (int i = 0; i < S; ++i)
      wound[i] += fraction * abs(string_length<Model, Real>(i, to_D, to_K) -
                                 string_length<Model, Real>(i, q_D, q_K));
  }

  // Bound of the path of all points within `beyond` of a point x of a link; link -1 is the world.
  FAN_FN Real path(
      const ClearanceArrays& in, const Real* poses, int link, const Real* x,
      double beyond = 0.0) const {
    using std::sqrt;
    Real moved = Real(0.0);
    for (; link >= 0; link = in.joints[link].parent) {
      if (in.joints[link].role == 0) continue;
      moved += slide[link];
      if (!in.joints[link].turns) continue;
      const Real* r = poses + 12 * link + 9;
      Real square = Real(0.0);
      for (int c = 0; c < 3; ++c) square += (x[c] - r[c]) * (x[c] - r[c]);
      moved += turn[link] * (sqrt(square) + beyond + moved);
    }
    return moved;
  }

  // Bound of the change of a string's sag if its excess (length less span) changes by up to
  // `x`. A shallow string sags by sqrt(3/8 length excess), a steep one by half of the excess.
  FAN_FN static Real sag(const Real& length, const Real& span, const Real& x) {
    using std::sqrt;
    const Real zero = Real(0.0), excess = length - span,
               scale = Tol::parabola * maximum(Real(length + x), zero);
    const Real high = maximum(excess + x, zero), low = maximum(excess - x, zero);
    return select(high > zero, Real(sqrt(scale * high) - sqrt(scale * low) + x), zero);
  }

 private:
  // Bound of the angle between orientations: |a - b| = 2 sin(angle / 4) for unit quaternions.
  FAN_FN static Real angle_bound(const Real* a, const Real* b) {
    using std::sqrt;
    Real same_sign = Real(0.0), opposite_sign = Real(0.0);
    for (int k = 0; k < 4; ++k) {
      same_sign += (a[k] - b[k]) * (a[k] - b[k]);
      opposite_sign += (a[k] + b[k]) * (a[k] + b[k]);
    }
    const Real half = 0.5 * sqrt(minimum(same_sign, opposite_sign));
    return 4.0 * (half + Tol::arcsine * half * half * half);
  }
};

}  // namespace fan
