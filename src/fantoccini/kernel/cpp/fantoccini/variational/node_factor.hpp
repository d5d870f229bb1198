// The factor at a node of a variational run, and a trial step from it. Written for any Real.
#pragma once

#include "fantoccini/model/evaluation.hpp"

namespace fan {

// A factor F at a node, the rows there, and y = F^-T p.
template <class Model, class Real>
struct NodeFactor {
  Evaluation<Model, Real> eval;
  RowSystem<Model, Real> rows;
  Real y[room(Model::n_vD)];

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

  Real xi[room(N)];         // the tangent vector
  Real before[room(N)];     // p_k(xi)
  Real after[room(N)];      // p_k+1
  Real q_next[room(NQ)];    // q_k+1
  Real h[room(M)];          // at the end
  Real work_M;              // of the motors
  Real lambda[room(M)];     // impulses
  Real slip_next[room(S)];  // m: slips at the end
  Mask slips[room(S)];      // winches that slip in the step
};

}  // namespace fan
