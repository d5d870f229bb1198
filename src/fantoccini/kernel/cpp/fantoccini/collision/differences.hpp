// Derivatives of the contact points of a pair: sixth-order central differences of the narrow phase
// at fixed features.
//
// Gap, point and normal are functions of the poses of both links and move with a common motion of
// both, so the derivatives by a twist of the first link are sufficient. The step is the largest
// whose result agrees with that of a smaller one: points of solids that lie flat are smooth only
// over a small tilt. Lengths are in units of the pair's size.
#pragma once

#include "fantoccini/collision/poses.hpp"
#include "fantoccini/math/space.hpp"

namespace fan {

struct TouchDifferenceTolerances {
  static constexpr int n_steps = 6;
  static constexpr double steps[n_steps] = {1e-2, 2e-3, 4e-4, 8e-5, 1.6e-5, 3e-6};
  // Agreement of derivatives at two steps; above the rounding error of the smallest step.
  static constexpr double agreement = 1e-7;
  // m: lower bound of a pair's size; size of planes and meshes, which have none.
  static constexpr double least_size = 1e-4, flat_size = 0.1;
  // Steps by which a pair may part during differencing.
  static constexpr double reach = 20.0;
};

template <class Model>
class TouchDifferences {
 public:
  // Finds the points of a pair with a gap below `margin`, at the poses (n_links, 12) of all links.
  void take(const ContactArrays& in, int pair, const double* poses, double margin) {
    in_ = &in;
    pair_ = pair;
    margin_ = margin;
    const Solid &a = in.solids[in.pairs[2 * pair]], &b = in.solids[in.pairs[2 * pair + 1]];
    first_ = poses + 12 * a.link;
    second_ = b.link >= 0 ? poses + 12 * b.link : poses;
    size_ = size_of(a) + size_of(b);
    if (size_ < Tolerance::least_size) size_ = Tolerance::least_size;
    Poses::find(in, pair, 1, first_, second_, margin, base_);
    int n = 0;
    for (int c = 0; c < 3; ++c) about_[c] = 0.0;
    for (; n < max_touches && base_[n * width] >= 0.0; ++n)
      for (int c = 0; c < 3; ++c) about_[c] += base_[n * width + 2 + c];
    for (int c = 0; c < 3; ++c) about_[c] /= n > 0 ? n : 1;
    for (int s = 0; s < Tolerance::n_steps; ++s) computed_[s] = false;
  }

  // Gap, point and normal of a feature (7,); null if the pair has no such point.
  const double* at(int feature) const {
    for (int k = 0; k < max_touches; ++k)
      if (base_[k * width] == feature) return base_ + k * width + 1;
    return nullptr;
  }

  // Derivatives (7, 6) of these by a twist of the first link about the world's origin, linear
  // before angular. Returns whether they exist.
  bool find(int feature, double* by) {
    const double none[42] = {}, *last = nullptr;
    bool smooth = false;
    int k = 0;
    while (k < max_touches && base_[k * width] != feature) ++k;
    for (int s = 0; s < Tolerance::n_steps && k < max_touches && !smooth; ++s) {
      make(s);
      if (!agrees_[s][k]) continue;
      const double* own = differences_[s][k];
      if (last) {
        double apart = 0.0, most = 1.0;
        for (int i = 0; i < 42; ++i) {
          apart = maximum(fabs(own[i] - last[i]), apart);
          most = maximum(fabs(last[i]), most);
        }
        smooth = apart <= Tolerance::agreement * most;
      }
      if (!smooth) last = own;
    }
    to_origin(last ? last : none, by);
    return smooth;
  }

 private:
  using Tolerance = TouchDifferenceTolerances;
  using Poses = TouchPoses<Model>;
  static constexpr int width = Poses::width, n_offsets = 6;
  static constexpr double offsets[n_offsets] = {-3.0, -2.0, -1.0, 1.0, 2.0, 3.0};
  static constexpr double weights[n_offsets] = {-1.0 / 60, 9.0 / 60,  -45.0 / 60,
                                                45.0 / 60, -9.0 / 60, 1.0 / 60};

  // The smallest radius or half edge of a solid.
  static double size_of(const Solid& x) {
    if (x.kind == HALF_SPACE || x.kind == HULL) return Tolerance::flat_size;
    const double half = fmin(x.half[0], fmin(x.half[1], x.half[2]));
    return half > 0.0 ? half : x.radius;
  }

  // Computes the differences of all points at step s.
  void make(int s) {
    if (computed_[s]) return;
    computed_[s] = true;
    const double h = Tolerance::steps[s];
    for (int o = 0; o < n_offsets; ++o)
      for (int j = 0; j < 6; ++j) moved(h * offsets[o], j, poses_ + 12 * (6 * o + j));
    Poses::find(
        *in_, pair_, 6 * n_offsets, poses_, second_, margin_ + Tolerance::reach * h * size_,
        touches_);
    for (int k = 0; k < max_touches; ++k) {
      double* out = differences_[s][k];
      for (int i = 0; i < 42; ++i) out[i] = 0.0;
      agrees_[s][k] = base_[k * width] >= 0.0;
      for (int p = 0; p < 6 * n_offsets && agrees_[s][k]; ++p) {
        const double* own = touches_ + p * max_touches * width;
        int m = 0;
        while (m < max_touches && own[m * width] != base_[k * width]) ++m;
        agrees_[s][k] = m < max_touches;
        for (int c = 0; c < 7 && agrees_[s][k]; ++c) {
          const double unit = c < 4 ? 1.0 / size_ : 1.0;
          const double change = own[m * width + 1 + c] - base_[k * width + 1 + c];
          out[6 * c + p % 6] += weights[p / 6] / h * unit * change;
        }
      }
    }
  }

  // The first link's pose after a twist of size x about `about_`: along an axis for j < 3, else
  // around it.
  void moved(double x, int j, double* out) const {
    for (int i = 0; i < 12; ++i) out[i] = first_[i];
    if (j < 3) {
      out[9 + j] += size_ * x;
      return;
    }
    const int a = (j + 1) % 3, b = (j + 2) % 3;
    const double c = cos(x), s = sin(x), ra = out[9 + a] - about_[a], rb = out[9 + b] - about_[b];
    for (int i = 0; i < 3; ++i) {
      const double u = out[3 * i + a], v = out[3 * i + b];
      out[3 * i + a] = c * u - s * v;
      out[3 * i + b] = s * u + c * v;
    }
    out[9 + a] = about_[a] + (c * ra - s * rb);
    out[9 + b] = about_[b] + (s * ra + c * rb);
  }

  // Converts from units of the size, about `about_`.
  void to_origin(const double* local, double* by) const {
    for (int c = 0; c < 7; ++c) {
      const double unit = c < 4 ? size_ : 1.0;
      double linear[3], turn[3];
      for (int j = 0; j < 3; ++j) linear[j] = by[6 * c + j] = unit * local[6 * c + j] / size_;
      // A rotation about the origin moves the point `about_` by w x about_.
      cross(about_, linear, turn);
      for (int j = 0; j < 3; ++j) by[6 * c + 3 + j] = unit * local[6 * c + 3 + j] + turn[j];
    }
  }

  const ContactArrays* in_ = nullptr;
  int pair_ = 0;
  double margin_ = 0.0, size_ = 1.0, about_[3];
  const double *first_ = nullptr, *second_ = nullptr;
  double base_[max_touches * width], poses_[12 * 6 * n_offsets];
  double touches_[6 * n_offsets * max_touches * width];
  bool computed_[Tolerance::n_steps], agrees_[Tolerance::n_steps][max_touches];
  double differences_[Tolerance::n_steps][max_touches][42];
};

}  // namespace fan
