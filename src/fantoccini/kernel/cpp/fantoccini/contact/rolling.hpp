// Required rates of points of ellipsoids that keep pushing: hdot must vanish in the middle of the
// step, not at its start,
//
//   J(q) v+ + (J(q + dt/2 v) - J(q)) v = 0
//
// because the impulses, along the rows J(q), act between the middles of two steps. With hdot at the
// start, rolling without slip would gain or lose energy at the order of the step, indefinitely.
// Half of it is required of normals: the gap provides the other half. For one trajectory.
#pragma once

#include "fantoccini/collision/solids.hpp"
#include "fantoccini/contact/points.hpp"
#include "fantoccini/math/manifold.hpp"

FAN_LOOPS_BEGIN

namespace fan {

template <class Model, class Real>
class RollingPoints {
 public:
  static constexpr double ahead = 0.5;       // of a step
  static constexpr double of_normals = 0.5;  // of the required rate

  bool any_rolls = false;  // whether anything rolls in the step

  FAN_FN void begin(const ContactArrays& in) {
    middle_.begin(in);
    may_ = false;
    for (int k = 0; k < in.n_pairs; ++k) may_ = may_ || rolls(in, k);
  }

  // Changes the required rates of the points of a step dt from (q_D, v_D, q_K, v_K).
  template <class State>
  FAN_FN void require(
      State& state, const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K,
      const Real* p, double dt) {
    const auto& points = state.points;
    int pairs[array_size(Model::n_contacts)], n_pairs = 0;
    for (int i = 0; i < points.n[0] && may_; ++i) {
      const int pair = points.point[0][i].pair;  // the points of a pair follow one another
      if (is_rolling(state, i) && (n_pairs == 0 || pairs[n_pairs - 1] != pair))
        pairs[n_pairs++] = pair;
    }
    any_rolls = n_pairs > 0;
    if (may_)
      for (Real& drift : state.drift) drift = Real(0.0);
    if (!any_rolls) return;
    Real q[array_size(Model::n_qD)], q_in[array_size(Model::n_qK)];
    retract<typename Model::Dynamic>(q_D, v_D, ahead * dt, q);
    retract<typename Model::Driven>(q_K, v_K, ahead * dt, q_in);
    middle_.find_of_pairs(*state.in, pairs, n_pairs, q, v_D, q_in, v_K, p);
    for (int i = 0; i < points.n[0]; ++i) {
      if (!is_rolling(state, i)) continue;
      const auto& own = points.point[0][i];
      for (int j = 0; j < middle_.n[0]; ++j) {
        const auto& then = middle_.point[0][j];
        if (then.pair != own.pair || then.feature != own.feature) continue;
        const Triple<Real> rate = middle_.rate(j, v_D);
        double u[3] = {};  // in the world: tangents may have turned
        for (int d = 0; d < 3; ++d)
          for (int c = 0; c < 3; ++c) u[c] += rate[d] * then.frame[3 * d + c];
        for (int d = 1; d < 3; ++d)
          state.drift[3 * i + d] = dot3(u, own.frame + 3 * d) - state.hdot[3 * i + d];
        state.required[i] += of_normals * (rate[0] - state.hdot[3 * i]);
      }
    }
  }

 private:
  template <class State>
  FAN_FN static bool is_rolling(const State& state, int i) {
    return state.steps[0][i] > 0 && rolls(*state.in, state.points.point[0][i].pair);
  }

  FAN_FN static bool rolls(const ContactArrays& in, int pair) {
    const int* of = in.pairs + 2 * pair;
    return is_ellipsoid(in.solids[of[0]]) || is_ellipsoid(in.solids[of[1]]);
  }

  ContactPoints<Model, Real> middle_;
  bool may_ = false;  // whether any pair may roll
};

}  // namespace fan

FAN_LOOPS_END
