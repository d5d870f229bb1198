// Derivatives of time steps at several nodes at once: the derivatives of the equations in lanes, one
// node in each, and what is solved for node by node.
#pragma once

#include "step_derivatives.hpp"

namespace fan {

template <class Model>
class StepBundles {
 public:
  static constexpr int width = Traits<Wide>::width;

  // The nodes [first, first + n), n <= width.
  void find(const StepDerivativeArrays& in, long long first, int n) {
    double* to[width];
    int by_p = 0;
    bool hold = false;
    for (int l = 0; l < n; ++l) {
      nodes_[l].begin(in, first + l, l, &states_);
      to[l] = nodes_[l].force(&by_p);
      hold = hold || nodes_[l].holds();
    }
    forces_.find(states_, in.dt);
    forces_.write(to, n, by_p);
    if (hold) {
      for (int l = 0; l < n; ++l) states_.place(l, nodes_[l].v_next(), states_.v_D, N);
      Call<Model, Wide>::row_rates_by(
          states_.q_D, states_.v_D, states_.q_K, states_.v_K, states_.p, by_, fresh_);
      fresh_ = false;
    }
    for (int l = 0; l < n; ++l) nodes_[l].end(in, first + l, l, by_);
  }

 private:
  static constexpr int N = Model::n_vD, K = Model::n_vK, P = Model::n_p, M = Model::n_rows;

  bool fresh_ = true;  // constant entries of the rows' derivatives are yet to be written
  StatesInLanes<Model> states_;
  ForcesInLanes<Model> forces_;
  struct {
    Wide A_D[room(M * N)], A_K[room(M * K)], h_p[room(M * P)], hdot_q[room(M * N)];
    Wide hdot_qK[room(M * K)], hdot_p[room(M * P)];
  } by_;
  StepDerivatives<Model> nodes_[width];
};

}  // namespace fan
