// Contact points of one pair at many poses of its first solid's link, for differences of contact.
#pragma once

#include "fantoccini/collision/touch.hpp"

namespace fan {

template <class Model>
struct TouchPoses {
  static constexpr int width = 8;  // numbers of a point: feature, gap, point, normal

  // Points (n, max_touches, width) with a gap below `margin` at poses (n, 12) of the first solid's
  // link and one (12,) of the second's, in the order of their features; missing points have the
  // feature -1. A pose is R column by column, then the origin.
  static void find(
      const ContactArrays& in, int pair, int n, const double* poses, const double* other,
      double margin, double* out) {
    if constexpr (Model::n_contacts > 0) {
      const Solid &a = in.solids[in.pairs[2 * pair]], &b = in.solids[in.pairs[2 * pair + 1]];
      Solid first, second = b;
      if (b.link >= 0) place_solid(b, other, other + 9, second);
      for (int i = 0; i < n; ++i, poses += 12) {
        place_solid(a, poses, poses + 9, first);
        Touch touch[max_touches];
        const int n_touches = touches(first, second, margin, touch);
        for (int k = 0; k < max_touches; ++k, out += width) {
          out[0] = k < n_touches ? touch[k].feature : -1.0;
          if (k >= n_touches) continue;
          out[1] = touch[k].gap;
          copy3(touch[k].point, out + 2);
          copy3(touch[k].normal, out + 5);
        }
      }
    }
  }
};

}  // namespace fan
