// Points of one pair in flat, sticking contact: together they hold a relative twist, so that at
// most six rows replace three for each point,
//
//   F = sum of x_i,   T = sum of d_i x x_i          (d_i from the middle of the points)
//
// in a frame of the normal and two tangents: F alone for one point; F and two components of T for
// two, which do not hold the rotation about the line between them. Any impulses within the cones
// that add up to F and T give the same motion; these are used, with c the centre of pressure:
//
//   n_i = N times the polygon's coordinates of c (Wachspress),
//   t_i = n_i (F_t / N + alpha (d_i - c) turned by a right angle)
#pragma once

#include "fantoccini/collision/touch.hpp"
#include "fantoccini/contact/push.hpp"
#include "fantoccini/math/real.hpp"

FAN_LOOPS_BEGIN

namespace fan {

struct ContactPatchTolerances {
  // Distance of points from a plane, relative to their distance from the middle, and deviation of
  // normals; `line`: the same from a line, squared.
  static constexpr double flat = 1e-10;
  static constexpr double line = 1e-6;
};

class ContactPatch {
 public:
  using Tolerance = ContactPatchTolerances;

  int pair, n = 0;
  int point[max_touches];      // of the step
  int rank = 0;                // rows: three of F, then those of T
  double middle[3], frame[9];  // normal and tangents
  double size = 1.0;           // m: rows of T are this times an angular velocity
  double b[6];                 // hdot of the rows plus their required rates
  double misfit = 0.0;         // m/s: largest difference of b from the points' rates

  // Number of parts: 1 for F alone, 2 for F and T.
  FAN_FN int parts() const { return rank > 3 ? 2 : 1; }

  // Loads the listed points, with their hdot (three numbers each, by point) and the required rates
  // of their normals. Returns whether they are flat, and at most two where they lie on a line.
  template <class Point>
  FAN_FN bool make(const Point* at, const double* hdot, const double* required) {
    const double* own = at[point[0]].frame;
    for (int k = 0; k < 9; ++k) frame[k] = own[k];
    for (int c = 0; c < 3; ++c) middle[c] = 0.0;
    for (int i = 0; i < n; ++i)
      for (int c = 0; c < 3; ++c) middle[c] += at[point[i]].at[c] * (1.0 / n);
    misfit = 0.0;
    rank = 3;
    size = 1.0;
    if (n == 1) {
      d_[0][0] = d_[0][1] = sine_[0] = 0.0;
      cosine_[0] = 1.0;
      for (int k = 0; k < 3; ++k) b[k] = hdot[3 * point[0] + k];
      b[0] += required[point[0]];
      return true;
    }
    return set_positions(at) && fit(hdot, required);
  }

  // Sums up F and T from the impulses of the step's points, three each.
  FAN_FN void add_up(const double* impulses, double* x) const {
    double turn[3] = {};
    for (int k = 0; k < 3; ++k) x[k] = 0.0;
    for (int i = 0; i < n; ++i) {
      const double *own = impulses + 3 * point[i], *d = d_[i];
      const double p = cosine_[i] * own[1] - sine_[i] * own[2];
      const double q = sine_[i] * own[1] + cosine_[i] * own[2];
      x[0] += own[0];
      x[1] += p;
      x[2] += q;
      turn[0] += d[0] * q - d[1] * p;
      turn[1] += d[1] * own[0];
      turn[2] -= d[0] * own[0];
    }
    for (int k = 3; k < rank; ++k) x[k] = turn[k - 3] / size;
  }

  // Normal component at the patch's point i of rates of its rows.
  FAN_FN double normal_rate(int i, const double* rate) const {
    double out = rate[0];
    if (rank > 3) out += d_[i][1] * rate[4] / size;
    if (rank > 5) out -= d_[i][0] * rate[5] / size;
    return out;
  }

  // Computes the impulses of the points, three each, from F and T. Returns false if they leave a
  // cone.
  FAN_FN bool share(const double* x, double mu, double* impulses) const {
    const double N = x[0];
    if (!(N > 0.0)) return false;
    const double c[2] = {rank > 5 ? -size / N * x[5] : 0.0, rank > 3 ? size / N * x[4] : 0.0};
    double weight[max_touches];
    if (!find_weights(c, weight)) return false;
    const double F[2] = {x[1] / N, x[2] / N};
    double alpha = 0.0;
    if (rank > 3) {
      double inertia = 0.0;
      for (int i = 0; i < n; ++i) {
        const double p = d_[i][0] - c[0], q = d_[i][1] - c[1];
        inertia += weight[i] * (p * p + q * q);
      }
      alpha = (size * x[3] / N - (c[0] * F[1] - c[1] * F[0])) / inertia;
    }
    for (int i = 0; i < n; ++i) {
      const double p = F[0] - alpha * (d_[i][1] - c[1]), q = F[1] + alpha * (d_[i][0] - c[0]);
      if (!(p * p + q * q <= mu * mu)) return false;
      const double own = N * weight[i];
      impulses[3 * i] = own;
      impulses[3 * i + 1] = own * (cosine_[i] * p + sine_[i] * q);
      impulses[3 * i + 2] = own * (cosine_[i] * q - sine_[i] * p);
    }
    return true;
  }

 private:
  // Sets the positions of points along the tangents. For two points the tangents are turned so
  // that the second lies along the line between them.
  template <class Point>
  FAN_FN bool set_positions(const Point* at) {
    double square = 0.0, largest_height = 0.0, largest_turn = 0.0;
    for (int i = 0; i < n; ++i) {
      const auto& own = at[point[i]];
      double d[3], turned = 0.0;
      for (int c = 0; c < 3; ++c) {
        d[c] = own.at[c] - middle[c];
        turned += fabs(own.frame[c] - frame[c]);
      }
      d_[i][0] = dot3(frame + 3, d);
      d_[i][1] = dot3(frame + 6, d);
      const double own_square = d_[i][0] * d_[i][0] + d_[i][1] * d_[i][1];
      const double height = fabs(dot3(frame, d));
      square = own_square > square ? own_square : square;
      largest_height = height > largest_height ? height : largest_height;
      largest_turn = turned > largest_turn ? turned : largest_turn;
    }
    size = sqrt(square);
    if (!(size > 0.0) || largest_height > Tolerance::flat * size || largest_turn > Tolerance::flat)
      return false;
    if (n == 2) {
      // The first tangent becomes (y, -x), the second (x, y).
      const double x = d_[0][0] / size, y = d_[0][1] / size;
      for (int c = 3; c < 6; ++c) {
        const double first = frame[c], second = frame[c + 3];
        frame[c] = y * first - x * second;
        frame[c + 3] = x * first + y * second;
      }
      for (int i = 0; i < 2; ++i) {
        const double along = x * d_[i][0] + y * d_[i][1];
        d_[i][0] = 0.0;
        d_[i][1] = along;
      }
    }
    for (int i = 0; i < n; ++i) {
      cosine_[i] = dot3(frame + 3, at[point[i]].frame + 3);
      sine_[i] = -dot3(frame + 3, at[point[i]].frame + 6);
    }
    return true;
  }

  // Finds b, the least-squares fit to all points. Returns false if more than two lie on a line. The
  // rates of the points:
  //   h_n + (d_2 theta_1 - d_1 theta_2, - d_2 theta_n, d_1 theta_n)
  FAN_FN bool fit(const double* hdot, const double* required) {
    double own[max_touches][3], mean[3] = {}, turn = 0.0, first = 0.0, second = 0.0;
    double s11 = 0.0, s12 = 0.0, s22 = 0.0;
    for (int i = 0; i < n; ++i) {
      const double *w = hdot + 3 * point[i], *d = d_[i];
      own[i][0] = w[0] + required[point[i]];
      own[i][1] = cosine_[i] * w[1] - sine_[i] * w[2];
      own[i][2] = sine_[i] * w[1] + cosine_[i] * w[2];
      for (int k = 0; k < 3; ++k) mean[k] += own[i][k] * (1.0 / n);
      turn += d[0] * own[i][2] - d[1] * own[i][1];
      first += d[1] * own[i][0];
      second -= d[0] * own[i][0];
      s11 += d[0] * d[0];
      s12 += d[0] * d[1];
      s22 += d[1] * d[1];
    }
    double theta[3] = {turn / (s11 + s22), first / s22, 0.0};
    rank = 5;
    if (n > 2) {
      const double det = s11 * s22 - s12 * s12;
      if (!(det > Tolerance::line * (s11 + s22) * (s11 + s22))) return false;
      theta[1] = (s11 * first + s12 * second) / det;
      theta[2] = (s12 * first + s22 * second) / det;
      rank = 6;
    }
    for (int k = 0; k < 3; ++k) {
      b[k] = mean[k];
      b[3 + k] = size * theta[k];
    }
    for (int i = 0; i < n; ++i) {
      const double* d = d_[i];
      const double off[3] = {d[1] * theta[1] - d[0] * theta[2], -d[1] * theta[0], d[0] * theta[0]};
      for (int k = 0; k < 3; ++k) {
        const double difference = fabs(own[i][k] - mean[k] - off[k]);
        misfit = difference > misfit ? difference : misfit;
      }
    }
    return true;
  }

  // Computes the points' shares of a normal impulse with its centre at c. Returns false if c lies
  // outside.
  FAN_FN bool find_weights(const double* c, double* weight) const {
    if (n == 1) {
      weight[0] = 1.0;
      return true;
    }
    if (n == 2) {
      weight[0] = 0.5 + 0.5 * c[1] / d_[0][1];
      weight[1] = 1.0 - weight[0];
      return weight[0] >= 0.0 && weight[1] >= 0.0;
    }
    int round[max_touches];
    sort_around(round);
    // Vectors from c; twice the areas of the triangles of c and an edge.
    double e[max_touches + 2][2], area[max_touches + 1], sum = 0.0;
    for (int j = 0; j < n; ++j)
      for (int k = 0; k < 2; ++k) e[j + 1][k] = d_[round[j]][k] - c[k];
    for (int k = 0; k < 2; ++k) {
      e[0][k] = e[n][k];
      e[n + 1][k] = e[1][k];
    }
    const auto double_area = [&](int i, int j) { return e[i][0] * e[j][1] - e[i][1] * e[j][0]; };
    for (int j = 0; j <= n; ++j) {
      area[j] = double_area(j, j + 1);
      if (!(area[j] > 0.0)) return false;
    }
    for (int j = 1; j <= n; ++j) {
      // Area of a point and its neighbours over those with c: negative where not convex.
      const double own =
          (area[j - 1] + area[j] - double_area(j - 1, j + 1)) / (area[j - 1] * area[j]);
      if (!(own >= 0.0)) return false;
      weight[round[j - 1]] = own;
      sum += own;
    }
    for (int i = 0; i < n; ++i) weight[i] *= 1.0 / sum;
    return true;
  }

  // Order of the points around the middle.
  FAN_FN void sort_around(int* round) const {
    const auto is_upper = [&](int i) {
      return d_[i][1] > 0.0 || (d_[i][1] == 0.0 && d_[i][0] > 0.0);
    };
    const auto comes_first = [&](int i, int j) {
      if (is_upper(i) != is_upper(j)) return is_upper(i);
      return d_[i][0] * d_[j][1] - d_[i][1] * d_[j][0] > 0.0;
    };
    for (int i = 0; i < n; ++i) {
      int place = i;
      for (; place > 0 && comes_first(i, round[place - 1]); --place)
        round[place] = round[place - 1];
      round[place] = i;
    }
  }

  double d_[max_touches][2];  // m: positions from the middle, along the tangents
  // Rotation of the tangents relative to the points', which may differ by rounding.
  double cosine_[max_touches], sine_[max_touches];
};

}  // namespace fan

FAN_LOOPS_END
