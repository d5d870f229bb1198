// The C interface of a puppet's rollout library, as fantoccini.kernel.runtime loads it. The
// translation unit that includes this defines `fan::Model` over `fan::Wide` first.
#pragma once

#include <new>
#include <vector>

#include "fantoccini/interface/export.hpp"
#include "fantoccini/search/rollouts.hpp"

// Simulates rollouts until all are done; several threads may call it with the same arguments.
// Returns 0, or 1 if there is not enough memory.
FAN_EXPORT int fan_rollouts(const fan::RolloutArrays* in, fan::RolloutProgress* progress) {
  try {
    std::vector<fan::Rollouts<fan::Model, fan::Wide>> worker(1);
    worker[0].work(*in, *progress);
  } catch (const std::bad_alloc&) {
    return 1;
  }
  return 0;
}

// Distances (n,) of states (n, n_qD), (n, n_vD), (n, n_qK), (n, n_vK) from a goal.
FAN_EXPORT void fan_goal_distances(
    long long n, const double* q_D, const double* v_D, const double* q_K, const double* v_K,
    const double* p, const fan::GoalArrays* goal, double* distance) {
  using fan::Model;
  using fan::Wide;
  constexpr int width = fan::Traits<Wide>::width;
  Wide at_D[fan::array_size(Model::n_qD)], at_K[fan::array_size(Model::n_qK)],
      at_p[fan::array_size(Model::n_p)];
  Wide poses[fan::array_size(12 * Model::n_links)];
  for (int i = 0; i < Model::n_p; ++i) at_p[i] = Wide(p[i]);
  for (long long first = 0; first < n; first += width) {
    if (goal->kind == fan::POINT) {
      fan::load_lanes(q_D, Model::n_qD, first, n, at_D);
      fan::load_lanes(q_K, Model::n_qK, first, n, at_K);
      fan::Call<Model, Wide>::poses(at_D, at_K, at_p, poses);
    }
    for (int l = 0; l < width && first + l < n; ++l) {
      double pose[12] = {};
      if (goal->kind == fan::POINT)
        for (int k = 0; k < 12; ++k) pose[k] = fan::lane_of(poses[12 * goal->link + k], l);
      distance[first + l] = fan::goal_distance<Model>(
          *goal, q_D + (first + l) * Model::n_qD, v_D + (first + l) * Model::n_vD,
          v_K + (first + l) * Model::n_vK, pose);
    }
  }
}
