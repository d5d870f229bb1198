// Derivatives of time steps at several nodes at once: the derivatives of the equations in lanes,
// one node in each, and the solutions node by node, their columns in lanes.
#pragma once

#include "fantoccini/derivatives/step_derivatives.hpp"

namespace fan {

template <class Model>
class StepBundles {
 public:
  static constexpr int width = Traits<Wide>::width;

  // The nodes [first, first + n), n <= width.
  void find(const StepDerivativeArrays& in, long long first, int n) {
    for (int l = 0; l < n; ++l) nodes_[l].begin(in, first + l, l, &states_);
    forces_.find(states_, in.dt);
    take_forces(n);
    bool hold = false;
    for (int r = 0; r < M; ++r) hold = hold || holds(r, n) || slips(in, r, n);
    if (hold) {
      for (int l = 0; l < n; ++l) put_lane(nodes_[l].v_next(), N, l, states_.v_D);
      Call<Model, Wide>::row_rates_by(
          states_.q_D, states_.v_D, states_.q_K, states_.v_K, states_.p, by_, fresh_);
      fresh_ = false;
      for (int r = 0; r < M; ++r)
        if (holds(r, n)) take_rates(in, r, n);
      for (int r = 0; r < M; ++r)
        if (slips(in, r, n)) take_caps(in, r, n);
    }
    for (int l = 0; l < n; ++l) nodes_[l].end(in, first + l);
  }

 private:
  static constexpr int N = Model::n_vD, K = Model::n_vK, P = Model::n_p, M = Model::n_rows;
  using Columns = StepColumns<Model>;

  // Whether one of n nodes holds a row.
  bool holds(int row, int n) const {
    for (int l = 0; l < n; ++l)
      if (nodes_[l].place(row) >= 0) return true;
    return false;
  }

  // Whether a row slips in one of n nodes, at a tension that is a parameter.
  bool slips(const StepDerivativeArrays& in, int row, int n) const {
    for (int l = 0; l < n; ++l)
      if (nodes_[l].slips_by(in, row) >= 0) return true;
    return false;
  }

  // Copies that tension's derivatives of r, A_D^T, to the nodes where the row slips.
  void take_caps(const StepDerivativeArrays& in, int row, int n) {
    const Columns& columns = nodes_[0].columns;
    for (int l = 0; l < n; ++l) {
      const int j = nodes_[l].slips_by(in, row);
      for (int k = 0; j >= 0 && k < N; ++k)
        Columns::at(nodes_[l].force(), N, columns.n - P + j, k) += lane_of(by_.A_D[M * k + row], l);
    }
  }

  // Copies the derivatives of r to n nodes, bundle by bundle.
  void take_forces(int n) {
    const Columns& columns = nodes_[0].columns;
    Wide* to[width];
    for (int l = 0; l < n; ++l) to[l] = nodes_[l].force();
    each_bundle(
        [&](int c) { return forces_.column(c); }, none_,
        [&](int b, const Wide* const* from) {
          Wide* own[width];
          for (int l = 0; l < n; ++l) own[l] = to[l] + b * N;
          turn(from, N, own, n);
        });
    for (int l = 0; l < n; ++l)
      for (int k = 0; k < columns.n_forces; ++k)
        columns.at(to[l], N, Columns::first[Columns::BY_REST] + k, k) = -1.0;
  }

  // Copies (A_D v+ + A_K rate + min(h/dt, recovery speed))_d / dt of a row to those of n nodes that
  // hold it.
  void take_rates(const StepDerivativeArrays& in, int row, int n) {
    const double per_step = 1.0 / in.dt;
    Wide gap = Wide(0.0), *to[width];
    for (int l = 0; l < n; ++l) {
      const int place = nodes_[l].place(row);
      to[l] = place < 0 ? unused_ : nodes_[l].rate() + place;
      if (place >= 0) lane_of(gap, l) = nodes_[l].gap(row, per_step, in.recovery_speed);
    }
    Wide *by_q = rates_, *by_v = by_q + N, *by_qK = by_v + N, *by_vK = by_qK + K;
    Wide* by_p = by_vK + 2 * K;
    const auto own = [&](const Wide* all, int k) FAN_INLINE { return all[M * k + row]; };
    for (int k = 0; k < N; ++k) {
      by_q[k] = (own(by_.hdot_q, k) + gap * own(by_.A_D, k)) * per_step;
      by_v[k] = own(by_.A_D, k) * per_step;
    }
    for (int k = 0; k < K; ++k) {
      by_qK[k] = (own(by_.hdot_qK, k) + gap * own(by_.A_K, k)) * per_step;
      by_vK[k] = own(by_.A_K, k) * per_step;
    }
    for (int k = 0; k < P; ++k) by_p[k] = (own(by_.hdot_p, k) + gap * own(by_.h_p, k)) * per_step;
    each_bundle(
        [&](int c) { return rates_ + c; }, none_,
        [&](int b, const Wide* const* from) {
          Wide* own[width];
          for (int l = 0; l < n; ++l) own[l] = to[l] + b * M;
          turn(from, 1, own, n);
        });
  }

  // Calls done(b, from) for the bundles that act. `from` holds of(c) of their columns, c not
  // counting those by u_D, and `none` for columns by u_D and lanes without a column.
  template <class Of, class Done>
  void each_bundle(const Of& of, const Wide* none, const Done& done) const {
    const Columns& columns = nodes_[0].columns;
    for (int b = 0; b < columns.n_bundles; ++b) {
      if (!columns.acts(b)) continue;
      const Wide* from[width];
      for (int i = 0; i < width; ++i) {
        const int c = columns.begin[b] + i, other = c - Columns::first[Columns::BY_REST];
        const bool has = i < columns.count[b] && (other < 0 || other >= columns.n_forces);
        from[i] = has ? of(other < 0 ? c : c - columns.n_forces) : none;
      }
      done(b, from);
    }
  }

  bool fresh_ = true;  // constant entries of the rows' derivatives are not written yet
  StatesInLanes<Model> states_;
  ForcesInLanes<Model> forces_;
  struct {
    Wide A_D[array_size(M * N)], A_K[array_size(M * K)], h_p[array_size(M * P)],
        hdot_q[array_size(M * N)];
    Wide hdot_qK[array_size(M * K)], hdot_p[array_size(M * P)];
  } by_;
  Wide none_[array_size(N)] = {}, rates_[array_size(2 * N + 3 * K + P)] = {};
  Wide unused_[array_size(Columns::most * M)];  // of nodes that do not hold a row
  StepDerivatives<Model> nodes_[width];
};

}  // namespace fan
