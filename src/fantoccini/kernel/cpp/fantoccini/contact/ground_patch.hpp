// patch.hpp for one foot of a bundle of lanes: each lane may have other points, one to four corners
// of a face.
//
// The patch's frame is turned so that its points lie in the plane of its tangents though their gaps
// differ: F, T and the rates of points are then related exactly,
//
//   F = sum of x_i,   T = sum of d_i x x_i,   rate of point i = h + theta x d_i
//
// with h and theta the rates of the patch's rows.
#pragma once

#include "fantoccini/contact/ground_feet.hpp"
#include "fantoccini/contact/patch.hpp"

FAN_LOOPS_BEGIN

namespace fan {

template <class Model, class Real>
class GroundPatch {
 public:
  using Mask = typename Traits<Real>::Mask;
  using Foot = typename GroundFeet<Model, Real>::Foot;
  using Point = typename GroundFeet<Model, Real>::Point;
  using Tolerance = ContactPatchTolerances;
  static constexpr int features = GroundFeet<Model, Real>::features;

  Foot* foot;
  Mask here, several, many;  // lanes with points, with more than one, with more than two
  int rank;  // number of rows: three of F, then those of T; the largest of all lanes
  Real middle[3], frame[9];  // normal and tangents
  Real size;                 // m: rows of T are this times an angular velocity
  Real required[6];          // rates of the rows that meet those required of the points' normals
  Real misfit;               // m/s: largest difference between the two

  // Lanes that have row k.
  FAN_FN Mask has_row(int k) const { return k < 3 ? here : k < 5 ? several : many; }

  // Loads the points that take part. Returns the lanes in which they are flat.
  FAN_FN Mask load(Foot& in, const double* ground) {
    foot = &in;
    Real count = Real(0.0);
    for (int c = 0; c < 3; ++c) middle[c] = Real(0.0);
    n_ = 0;
    // Corners in this order go around each face of a box.
    constexpr int around[features] = {0, 1, 3, 2, 6, 7, 5, 4};
    for (const int k : around) {
      const Point& p = in.point[k];
      bool is_listed = false;
      for (int j = 0; j < in.n; ++j) is_listed = is_listed || in.listed[j] == k;
      if (!is_listed || !any(p.joins)) continue;
      which_[n_++] = k;
      count += select(p.joins, Real(1.0), Real(0.0));
      for (int c = 0; c < 3; ++c) middle[c] += select(p.joins, p.at[c], Real(0.0));
    }
    here = count > Real(0.5);
    several = count > Real(1.5);
    many = count > Real(2.5);
    rank = any(many) ? 6 : any(several) ? 5 : 3;
    share_ = Real(1.0) / select(here, count, Real(1.0));
    for (int c = 0; c < 3; ++c) middle[c] *= share_;
    return set_frame(ground) && set_required_rates();
  }

  // Sums up the points' impulses of the previous step.
  FAN_FN void sum_impulses(Real* x) const {
    for (int k = 0; k < 6; ++k) x[k] = Real(0.0);
    for (int j = 0; j < n_; ++j) {
      const Point& p = foot->point[which_[j]];
      Real own[3];
      for (int d = 0; d < 3; ++d)
        own[d] = select(p.joins && p.pushes, dot3(frame + 3 * d, p.impulse), Real(0.0));
      for (int d = 0; d < 3; ++d) x[d] += own[d];
      x[3] += d_[j][0] * own[2] - d_[j][1] * own[1];
      x[4] += d_[j][1] * own[0];
      x[5] -= d_[j][0] * own[0];
    }
    for (int k = 3; k < 6; ++k) x[k] /= size;
  }

  // Normal component at listed point j of rates of the patch's rows.
  FAN_FN Real normal_rate(int j, const Real* rate) const {
    const Real scaled = Real(1.0) / size, *d = d_[j];
    const Real along = rate[0] + scaled * (d[1] * rate[4] - d[0] * rate[5]);
    const Real first = rate[1] - scaled * d[1] * rate[3],
               second = rate[2] + scaled * d[0] * rate[3];
    return turn_[0] * along + turn_[3] * first + turn_[6] * second;
  }

  // Distributes F and T among the points: sets their impulses in the world. Returns the lanes in
  // which all lie within their cones. Where the centre of pressure lies beyond an edge, or the foot
  // would have to be pulled, marks the points that are not on that edge.
  FAN_FN Mask share(const Real* x, const double* ground) {
    using std::sqrt;
    const Real N = x[0], zero = Real(0.0), unity = Real(1.0);
    const Mask presses = N > zero;
    Mask good = presses;
    const Real by = unity / select(good, N, unity);
    const Real c[2] = {
        select(many, Real(-size * by * x[5]), zero), select(several, Real(size * by * x[4]), zero)};
    good = good && set_weights(c);
    for (int j = 0; j < n_; ++j) {
      Point& own = foot->point[which_[j]];
      own.would_pull = own.joins && (outside_[j] || !presses);
    }
    const Real F[2] = {by * x[1], by * x[2]};
    Real inertia = zero;
    for (int j = 0; j < n_; ++j) {
      const Real p = d_[j][0] - c[0], q = d_[j][1] - c[1];
      inertia += weight_[j] * (p * p + q * q);
    }
    const Real turning = size * by * x[3] - (c[0] * F[1] - c[1] * F[0]);
    const Real alpha = select(several, Real(turning / select(several, inertia, unity)), zero);
    const double square = foot->friction * foot->friction;
    for (int j = 0; j < n_; ++j) {
      Point& to = foot->point[which_[j]];
      const Real own = N * weight_[j];
      const Real p = own * (F[0] - alpha * (d_[j][1] - c[1])),
                 q = own * (F[1] + alpha * (d_[j][0] - c[0]));
      Real e[3];  // along the ground's normal and tangents
      FAN_UNROLL for (int d = 0; d < 3; ++d) e[d] =
          turn_[d] * own + turn_[3 + d] * p + turn_[6 + d] * q;
      good = good && (!to.joins || e[1] * e[1] + e[2] * e[2] <= square * (e[0] * e[0]));
      FAN_UNROLL for (int k = 0; k < 3; ++k) impulse_[j][k] =
          ground[k] * e[0] + ground[3 + k] * e[1] + ground[6 + k] * e[2];
    }
    return good;
  }

  // The patch's points in their order around it, and their impulses.
  FAN_FN int n() const { return n_; }
  FAN_FN Point& point(int j) const { return foot->point[which_[j]]; }
  FAN_FN const Real* impulse(int j) const { return impulse_[j]; }

 private:
  // Sets the frame and the points' positions in it. Returns the lanes in which the points are flat.
  FAN_FN Mask set_frame(const double* ground) {
    using std::abs;
    using std::sqrt;
    const Real zero = Real(0.0), unity = Real(1.0);
    Real along[features][3], s11 = zero, s12 = zero, s22 = zero, z1 = zero, z2 = zero;
    Real first[3] = {zero, zero, zero};
    Mask has_first = zero > unity;
    for (int j = 0; j < n_; ++j) {
      const Point& p = foot->point[which_[j]];
      Real d[3];
      FAN_UNROLL for (int c = 0; c < 3; ++c) d[c] =
          select(p.joins, Real(p.at[c] - middle[c]), zero);
      Real* own = along[j];
      FAN_UNROLL for (int k = 0; k < 3; ++k) own[k] =
          d[0] * ground[3 * k] + d[1] * ground[3 * k + 1] + d[2] * ground[3 * k + 2];
      s11 += own[1] * own[1];
      s12 += own[1] * own[2];
      s22 += own[2] * own[2];
      z1 += own[0] * own[1];
      z2 += own[0] * own[2];
      const Mask is_first = p.joins && !has_first;
      for (int k = 0; k < 3; ++k) first[k] = select(is_first, own[k], first[k]);
      has_first = has_first || p.joins;
    }
    const Real det = s11 * s22 - s12 * s12;
    const Mask plane = many && det > Tolerance::line * (s11 + s22) * (s11 + s22);
    const Real by = unity / select(plane, det, unity);
    const Real a = select(plane, Real((z1 * s22 - z2 * s12) * by), zero);
    const Real b = select(plane, Real((z2 * s11 - z1 * s12) * by), zero);
    // Of three or more points: n' ~ (1, -a, -b), t1' ~ (a, 1, 0); of two: t2' along their line.
    const Mask pair = several && !many;
    const Real length = dot3(first, first), flat = first[1] * first[1] + first[2] * first[2];
    const Mask line = pair && flat > zero;
    const Real p = unity / sqrt(select(line, length, unity)),
               q = unity / sqrt(select(line, flat, unity));
    const Real r = unity / sqrt(unity + a * a), s = unity / sqrt(unity + a * a + b * b);
    Real n[3], t[3];
    const Real e[3] = {p * first[0], p * first[1], p * first[2]};
    t[0] = select(line, zero, Real(r * a));
    t[1] = select(line, Real(q * first[2]), r);
    t[2] = select(line, Real(-q * first[1]), zero);
    cross(t, e, n);
    n[0] = select(line, n[0], s);
    n[1] = select(line, n[1], Real(-s * a));
    n[2] = select(line, n[2], Real(-s * b));
    cross(n, t, turn_ + 6);
    for (int k = 0; k < 3; ++k) {
      turn_[k] = n[k];
      turn_[3 + k] = t[k];
    }
    for (int k = 0; k < 9; k += 3)
      FAN_UNROLL for (int c = 0; c < 3; ++c) frame[k + c] =
          turn_[k] * ground[c] + turn_[k + 1] * ground[3 + c] + turn_[k + 2] * ground[6 + c];
    Real square = zero, off = zero;
    for (int j = 0; j < n_; ++j) {
      d_[j][0] = dot3(t, along[j]);
      d_[j][1] = dot3(turn_ + 6, along[j]);
      square = maximum(Real(d_[j][0] * d_[j][0] + d_[j][1] * d_[j][1]), square);
      off = maximum(Real(abs(dot3(n, along[j]))), off);
    }
    size = select(several, Real(sqrt(square)), unity);
    return !here || (off <= Tolerance::flat * size && (!pair || line) && (!many || plane));
  }

  // Sets the required rates of the rows. Returns the lanes in which they are determined.
  FAN_FN Mask set_required_rates() {
    using std::abs;
    const Real zero = Real(0.0);
    Real mean = zero, first = zero, second = zero, s11 = zero, s12 = zero, s22 = zero;
    for (int j = 0; j < n_; ++j) {
      const Point& p = foot->point[which_[j]];
      const Real own = select(p.joins, p.required, zero), *d = d_[j];
      mean += own * share_;
      first += d[1] * own;
      second -= d[0] * own;
      s11 += d[0] * d[0];
      s12 += d[0] * d[1];
      s22 += d[1] * d[1];
    }
    const Real det = s11 * s22 - s12 * s12, unity = Real(1.0);
    const Real line = select(several, Real(first / select(several, s22, unity)), zero);
    const Real by = unity / select(many, det, unity);
    const Real theta[2] = {
        select(many, Real((s11 * first + s12 * second) * by), line),
        select(many, Real((s12 * first + s22 * second) * by), zero)};
    for (int k = 0; k < 3; ++k) required[k] = mean * turn_[3 * k];
    if (foot->is_round)
      for (int k = 0; k < 3; ++k)
        for (int d = 0; d < 3; ++d)
          required[k] += select(here, Real(turn_[3 * k + d] * foot->point[0].drift[d]), zero);
    required[3] = zero;
    required[4] = size * turn_[0] * theta[0];
    required[5] = size * turn_[0] * theta[1];
    misfit = zero;
    for (int j = 0; j < n_; ++j) {
      const Point& p = foot->point[which_[j]];
      const Real beyond = p.required - mean, *d = d_[j];
      const Real left = turn_[0] * (beyond - (d[1] * theta[0] - d[0] * theta[1]));
      const Real worst = maximum(
          Real(abs(left)), maximum(Real(abs(turn_[3] * beyond)), Real(abs(turn_[6] * beyond))));
      misfit = select(p.joins, maximum(worst, misfit), misfit);
    }
    return misfit < Real(unbounded) || !here;
  }

  // Sets the points' shares of a normal impulse with its centre at c (Wachspress's coordinates).
  // Returns the lanes in which c lies inside.
  FAN_FN Mask set_weights(const Real* c) {
    const Real zero = Real(0.0), unity = Real(1.0);
    const Mask pair = several && !many;
    Mask good = here, begun = zero > unity;
    Real e[features][2], before[features][2], after[features][2], next[2] = {zero, zero},
                                                                  round = zero;
    for (int j = 0; j < n_; ++j)
      for (int k = 0; k < 2; ++k) e[j][k] = d_[j][k] - c[k];
    // Neighbours: the nearest of the lane's points in both directions, cyclically.
    const auto walk = [&](int j, Real(*beside)[2]) {
      const Mask& own = foot->point[which_[j]].joins;
      for (int k = 0; k < 2; ++k) {
        beside[j][k] = next[k];
        next[k] = select(own, e[j][k], next[k]);
      }
    };
    for (int twice = 0; twice < 2; ++twice)
      for (int j = 0; j < n_; ++j) walk(j, before);
    for (int twice = 0; twice < 2; ++twice)
      for (int j = n_ - 1; j >= 0; --j) walk(j, after);
    for (int j = 0; j < n_; ++j)
      round += select(foot->point[which_[j]].joins, area(before[j], e[j]), zero);
    const Real sense = select(round < zero, Real(-1.0), unity);
    Real sum = zero;
    Mask beyond = zero > unity;
    for (int j = 0; j < n_; ++j) {
      const Mask& own = foot->point[which_[j]].joins;
      const Real one_side = sense * area(before[j], e[j]), other = sense * area(e[j], after[j]);
      const Mask inside = one_side > zero && other > zero;
      const Real whole = (one_side + other) - sense * area(before[j], after[j]);
      Real weight = whole / select(inside, Real(one_side * other), unity);
      good = good && (!own || !many || (inside && weight >= zero));
      outside_[j] = own && many && one_side > zero && other > zero;
      beyond = beyond || (own && many && !inside);
      // Of two points the first lies at d, the other at -d.
      const Mask first = own && !begun;
      begun = begun || own;
      const Real of_first = 0.5 + 0.5 * c[1] / select(first && pair, d_[j][1], unity);
      if (j == 0 || any(first)) first_ = select(first, of_first, first_);
      weight = select(pair, select(first, of_first, Real(unity - first_)), weight);
      weight = select(several, weight, unity);
      weight_[j] = select(own, weight, zero);
      good = good && weight_[j] >= zero;
      outside_[j] = (pair && own && !(weight_[j] >= zero)) || (!pair && outside_[j]);
      sum += weight_[j];
    }
    for (int j = 0; j < n_; ++j) outside_[j] = outside_[j] && (beyond || pair);
    const Real scaled = unity / select(sum > zero, sum, unity);
    for (int j = 0; j < n_; ++j) weight_[j] *= scaled;
    return good;
  }

  // Twice the area of the triangle of two points and the centre.
  FAN_FN static Real area(const Real* a, const Real* b) { return a[0] * b[1] - a[1] * b[0]; }

  int n_ = 0, which_[features];  // features that take part in some lane
  Real turn_[9];                 // the frame in the ground's: normal and tangents
  Real d_[features][2];          // of the points from the middle, along the tangents
  Real share_;                   // reciprocal of the number of points
  Mask outside_[features];
  Real weight_[features], impulse_[features][3], first_ = Real(0.0);
};

}  // namespace fan

FAN_LOOPS_END
