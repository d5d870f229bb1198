// The factor at a node of a variational run, and a trial step from it. Written for any Real.
#pragma once

#include "fantoccini/model/evaluation.hpp"

namespace fan {

// A factor F at a node, the rows there, and y = F^-T p.
template <class Model, class Real>
struct NodeFactor {
  Evaluation<Model, Real> eval;
  RowSystem<Model, Real> rows;
  Real y[array_size(Model::n_vD)];

  // F^-T x.
  FAN_FN void solve_factor_transposed(const Real* x, Real* out) const {
    Call<Model, Real>::solve_factor_transposed(eval.L, x, out);
  }
};

// Current iterate of a step.
template <class Model, class Real>
struct TrialStep {
  static constexpr int NQ = Model::n_qD, N = Model::n_vD, S = Model::n_strings;
  static constexpr int M = Model::n_rows;
  using Mask = typename Traits<Real>::Mask;

  Real xi[array_size(N)];         // the tangent vector
  Real before[array_size(N)];     // p_k(xi)
  Real after[array_size(N)];      // p_k+1
  Real q_next[array_size(NQ)];    // q_k+1
  Real h[array_size(M)];          // at the end
  Real work_M;                    // of the motors
  Real lambda[array_size(M)];     // impulses
  Real slip_next[array_size(S)];  // m: slips at the end
  Mask slips[array_size(S)];      // winches that slip in the step
};

}  // namespace fan
