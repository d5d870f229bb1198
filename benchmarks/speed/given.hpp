// What scalar.cpp and lanes.cpp are given on stdin: q_D, v_D, p, winches, dt, recovery speed,
// tension cap, the input (n_segments, breaks, coef, base). Included after the model.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <vector>

inline std::vector<double> take(int n) {
  std::vector<double> out(static_cast<size_t>(n));
  for (double& x : out)
    if (std::scanf("%lf", &x) != 1) std::exit(2);
  return out;
}

static std::vector<double> q_D, v_D, p, table, number, breaks, coef, base;
static int n_segments;

inline void take_all() {
  using fan::Model;
  q_D = take(Model::n_qD), v_D = take(Model::n_vD), p = take(Model::n_p);
  table = take(3 * Model::n_strings), number = take(3);
  n_segments = int(take(1)[0]);
  breaks = take(n_segments + 1), coef = take(n_segments * Model::n_vK * 6);
  base = take(n_segments * Model::n_qK);
}
