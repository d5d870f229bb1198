// The columns of a step's derivatives in bundles, one column per lane:
//
//   by q_D, v_D, q_K | v_K | acc_K | u_D if requested, p
//
// Every group begins with a new bundle: columns by v_K and acc_K then lie in the same lanes. Lanes
// without a column hold zeros.
#pragma once

#include <cstring>

#include "fantoccini/math/lane_of.hpp"
#include "fantoccini/math/wide.hpp"

namespace fan {

template <class Model>
class StepColumns {
 public:
  static constexpr int N = Model::n_vD, K = Model::n_vK, P = Model::n_p;
  static constexpr int width = Traits<Wide>::width;

  static constexpr int bundles_of(int n) { return (n + width - 1) / width; }

  // First column and first bundle of each group.
  static constexpr int first[] = {0, 2 * N + K, 2 * N + 2 * K, 2 * N + 3 * K};
  static constexpr int bundle[] = {
      0, bundles_of(2 * N + K), bundles_of(2 * N + K) + bundles_of(K),
      bundles_of(2 * N + K) + 2 * bundles_of(K)};
  static constexpr int most = bundle[3] + bundles_of(N + P);  // bundles
  enum Group { BY_STATE, BY_V_K, BY_ACC_K, BY_REST };

  int n = 0, n_forces = 0, n_bundles = 0;  // columns, those by u_D, and bundles
  int begin[array_size(most)],
      count[array_size(most)];  // of every bundle: first column and number of columns

  void set(bool forces) {
    n_forces = forces ? N : 0;
    n = first[BY_REST] + n_forces + P;
    n_bundles = 0;
    for (int group = 0; group < 4; ++group) {
      const int end = group == BY_REST ? n : first[group + 1];
      for (int c = first[group]; c < end; c += width) {
        begin[n_bundles] = c;
        count[n_bundles++] = end - c < width ? end - c : width;
      }
    }
  }

  // Whether columns of a bundle act: where driven coordinates move no mass and no drive follows
  // them, dv_K/dt has no effect on a step.
  static constexpr bool acts(int b) {
    return Model::accelerated || b < bundle[BY_ACC_K] || b >= bundle[BY_REST];
  }

  // Entry k of column c, in bundles of `height` numbers.
  static double& at(Wide* bundles, int height, int c, int k) {
    const int group = (c >= first[1]) + (c >= first[2]) + (c >= first[3]), j = c - first[group];
    return lane_of(bundles[(bundle[group] + j / width) * height + k], j % width);
  }

  // Writes the n numbers of a row; of(b) is its part in bundle b.
  template <class Of>
  FAN_ALWAYS_INLINE void write(double* out, const Of& of) const {
    for (int b = 0; b < n_bundles; ++b) {
      const Wide x = of(b);
      double* to = out + begin[b];
      // The next bundle overwrites lanes without a column.
      if (begin[b] + width <= n) {
        std::memcpy(to, &x, sizeof(Wide));
      } else {
        FAN_UNROLL for (int l = 0; l < width; ++l) if (l < count[b]) to[l] = lane_of(x, l);
      }
    }
  }
};

}  // namespace fan
