// What a variational step stands on and what it finds. Written for any Real.
#pragma once

#include "evaluation.hpp"

namespace fan {

// A factor of the mass matrix at a node, the rows there, and the momenta in its terms.
template <class Model, class Real>
struct Footing {
  Evaluation<Model, Real> eval;
  RowSystem<Model, Real> rows;
  Real y[room(Model::n_vD)];

  // F^-T x.
  FAN_FN void forth(const Real* x, Real* out) const {
    const Real* arg[] = {eval.L, x};
    Real* res[] = {out};
    Model::forth(arg, res);
  }
};

// A step that was looked for.
template <class Model, class Real>
struct Found {
  static constexpr int NQ = Model::n_qD, N = Model::n_vD, S = Model::n_strings;
  static constexpr int M = Model::n_rows;
  using Mask = typename Traits<Real>::Mask;

  Real xi[room(N)];         // the tangent vector
  Real after[room(N)];      // p_k+1
  Real q_next[room(NQ)];    // q_k+1
  Real h[room(M)];          // there
  Real lambda[room(M)];     // impulses
  Real slip_next[room(S)];  // of winches, there
  Mask slips[room(S)];      // winches that have given way

  // Takes over another's in some lanes.
  FAN_FN void keep(const Found& other, const Mask& lanes) {
    for (int k = 0; k < N; ++k) {
      xi[k] = select(lanes, other.xi[k], xi[k]);
      after[k] = select(lanes, other.after[k], after[k]);
    }
    for (int i = 0; i < NQ; ++i) q_next[i] = select(lanes, other.q_next[i], q_next[i]);
    for (int i = 0; i < S; ++i) {
      slip_next[i] = select(lanes, other.slip_next[i], slip_next[i]);
      slips[i] = (lanes && other.slips[i]) || (!lanes && slips[i]);
    }
    for (int r = 0; r < M; ++r) {
      h[r] = select(lanes, other.h[r], h[r]);
      lambda[r] = select(lanes, other.lambda[r], lambda[r]);
    }
  }
};

}  // namespace fan
