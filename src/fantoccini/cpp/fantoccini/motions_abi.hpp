// The C interface of a puppet's library of a planner's motions, as fantoccini.runtime loads it. The
// translation unit that includes this defines `fan::Model` over `fan::Wide` first.
#pragma once

#include <new>
#include <vector>

#include "export.hpp"
#include "sweep.hpp"

// Makes motions until none is left, on as many threads as call it with the same arguments; 0, or 1
// where there was no memory.
FAN_EXPORT int fan_sweep(const fan::SweepArrays* in, fan::SweepProgress* progress) {
  try {
    std::vector<fan::Sweep<fan::Model, fan::Wide>> worker(1);
    worker[0].work(*in, *progress);
  } catch (const std::bad_alloc&) {
    return 1;
  }
  return 0;
}

// Distances (n,) of states (n, n_qD), (n, n_vD), (n, n_qK), (n, n_vK) from a goal.
FAN_EXPORT void fan_goal_distances(
    long long n, const double* q_D, const double* v_D, const double* q_K,
    const double* v_K, const double* p, const fan::GoalArrays* goal, double* distance) {
  using fan::Model;
  using fan::Wide;
  constexpr int width = fan::Traits<Wide>::width;
  Wide at_D[fan::room(Model::n_qD)], at_K[fan::room(Model::n_qK)], at_p[fan::room(Model::n_p)];
  Wide poses[fan::room(12 * Model::n_links)];
  for (int i = 0; i < Model::n_p; ++i) at_p[i] = Wide(p[i]);
  for (long long first = 0; first < n; first += width) {
    if (goal->kind == fan::POINT) {
      for (int l = 0; l < width; ++l) {
        const long long who = first + l < n ? first + l : n - 1;
        for (int i = 0; i < Model::n_qD; ++i)
          fan::lane_of(at_D[i], l) = q_D[who * Model::n_qD + i];
        for (int i = 0; i < Model::n_qK; ++i)
          fan::lane_of(at_K[i], l) = q_K[who * Model::n_qK + i];
      }
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
