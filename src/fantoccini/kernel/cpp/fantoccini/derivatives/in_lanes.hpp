// Derivatives of the equations of motion at several states at once, one in each lane.
#pragma once

#include <cstring>

#include "fantoccini/contract.hpp"
#include "fantoccini/math/lane_of.hpp"
#include "fantoccini/math/unpack.hpp"
#include "fantoccini/math/wide.hpp"

namespace fan {

// A bundle of numbers from any address.
inline Wide loaded(const double* from) {
  Wide x;
  std::memcpy(&x, from, sizeof(Wide));
  return x;
}

// The states. Lanes never assigned hold zeros.
template <class Model>
struct StatesInLanes {
  static constexpr int N = Model::n_vD, K = Model::n_vK;

  Wide q_D[array_size(Model::n_qD)] = {}, v_D[array_size(N)] = {}, acc[array_size(N)] = {};
  Wide q_K[array_size(Model::n_qK)] = {}, v_K[array_size(K)] = {}, acc_K[array_size(K)] = {};
  Wide tension[array_size(Model::n_rows)] = {}, p[array_size(Model::n_p)] = {};
};

// Derivatives of r of Eq. 10 by q_D, v_D, q_K, v_K, acc_K and p, column by column.
template <class Model>
class ForcesInLanes {
 public:
  static constexpr int N = Model::n_vD, K = Model::n_vK, P = Model::n_p;
  static constexpr int before_p = N * (2 * N + 3 * K);

  void find(const StatesInLanes<Model>& at, double dt) {
    struct {
      Wide *r_qK, *r_vK, *M_DK, *r_p;
    } r;
    Wide *by_v = columns_ + N * N, *by_K = by_v + N * N;
    r.r_qK = by_K, r.r_vK = by_K + N * K, r.M_DK = by_K + 2 * N * K, r.r_p = by_K + 3 * N * K;
    const Wide step = Wide(dt);
    using Of = Call<Model, Wide>;
    Of::force_by_q(
        at.q_D, at.v_D, at.acc, at.q_K, at.v_K, at.acc_K, at.tension, step, at.p, columns_, fresh_);
    Of::force_by_v(
        at.q_D, at.v_D, at.acc, at.q_K, at.v_K, at.acc_K, at.tension, step, at.p, by_v, fresh_);
    Of::force_by_K(
        at.q_D, at.v_D, at.acc, at.q_K, at.v_K, at.acc_K, at.tension, step, at.p, r, fresh_);
    fresh_ = false;
  }

  // Writes the first n lanes, each to a separate array.
  void write(double* const* to, int n) const { unpack(columns_, before_p + N * P, to, n); }

  // The column by the k-th of all these quantities, N numbers.
  const Wide* column(int k) const { return columns_ + N * k; }

 private:
  bool fresh_ = true;  // constant entries are not written yet
  Wide columns_[array_size(before_p + N * P)];
};

}  // namespace fan
