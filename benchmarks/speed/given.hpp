// Input of scalar.cpp and lanes.cpp on stdin: q_D, v_D, p, winches, dt, recovery speed, tension
// cap, the input (n_segments, breaks, coef, base). Included after the model.
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

// Begins fixed steps from the inputs read by take_all(); `contacts` may be null.
template <class Run>
void begin_steps(Run& run, const fan::ContactArrays* contacts, fan::Record<fan::Model>& out) {
  static const std::vector<double> no_slip(fan::array_size(fan::Model::n_strings), 0.0);
  fan::StartArrays from{};
  from.q_D = q_D.data(), from.v_D = v_D.data(), from.slip = no_slip.data(), from.p = p.data();
  from.winches = table.data();
  from.input = {n_segments, breaks.data(), coef.data(), base.data(), nullptr};
  from.options.dt = number[0], from.options.recovery_speed = number[1];
  from.options.tension_cap = number[2], from.options.max_steps = 1LL << 60;
  from.options.extrapolate = 1, from.options.contacts = contacts;
  from.save_every = 1 << 30;
  run.start(from, out);
}

inline void take_all() {
  using fan::Model;
  q_D = take(Model::n_qD), v_D = take(Model::n_vD), p = take(Model::n_p);
  table = take(3 * Model::n_strings), number = take(3);
  n_segments = int(take(1)[0]);
  breaks = take(n_segments + 1), coef = take(n_segments * Model::n_vK * 6);
  base = take(n_segments * Model::n_qK);
}
