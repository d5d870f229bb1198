// The poses of a search for places: written in order, and read by later ones.
#pragma once

#include <cmath>
#include <cstring>

#include "fantoccini/search/hanging.hpp"

namespace fan {

template <class Model>
struct ReachPoses {
  using Hang = Hanging<Model>;
  static constexpr int NQ = Hang::NQ, KQ = Hang::KQ, P = Hang::P, M = Hang::M;

  static constexpr long long max_searched = 2000;

  const ReachArrays* in = nullptr;

  // The nearest of the last places before the i-th that have a pose, the latest of equals; -1 if
  // there is none.
  long long nearest(long long i) const {
    const int size = 3 * in->n_targets;
    long long best = -1;
    double least = INFINITY;
    for (long long k = i - 1; k >= 0 && k >= i - max_searched; --k) {
      if (in->status[k] != int(ReachEnd::REACHED) && in->status[k] != int(ReachEnd::NEAREST))
        continue;
      double sum = 0.0;
      for (int c = 0; c < size; ++c) {
        const double off = in->places[i * size + c] - in->places[k * size + c];
        if (!std::isnan(off)) sum += off * off;
      }
      if (sum < least) least = sum, best = k;
    }
    return best;
  }

  void read(long long i, typename Hang::Pose& at) const {
    std::memcpy(at.q_D, in->out_q_D + i * NQ, NQ * sizeof(double));
    std::memcpy(at.q_K, in->out_q_K + i * KQ, KQ * sizeof(double));
    std::memcpy(at.p, in->out_p + i * P, P * sizeof(double));
    std::memcpy(at.tension, in->out_tension + i * M, M * sizeof(double));
    for (int j = 0; j < M; ++j) at.held[j] = in->out_held[i * M + j];
  }

  void write(long long i, const Hang& hang, int end, int count) const {
    const auto& at = hang.at;
    in->status[i] = end;
    in->iterations[i] = count;
    in->stable[i] = hang.stable;
    std::memcpy(in->out_q_D + i * NQ, at.q_D, NQ * sizeof(double));
    std::memcpy(in->out_q_K + i * KQ, at.q_K, KQ * sizeof(double));
    std::memcpy(in->out_p + i * P, at.p, P * sizeof(double));
    std::memcpy(in->out_tension + i * M, at.tension, M * sizeof(double));
    for (int j = 0; j < M; ++j) in->out_held[i * M + j] = at.held[j];
  }
};

}  // namespace fan
