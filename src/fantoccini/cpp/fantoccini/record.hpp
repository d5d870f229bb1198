// Rows and events as a run writes them into the caller's arrays.
#pragma once

#include "evaluation.hpp"

namespace fan {

// One row of a trajectory, in doubles:
//   t, q_D, v_D, acc_D, q_K, v_K, acc_K, tension (strings), force (limits), taut (strings, limits),
//   T, V, work, damping, impact, slip loss, slip (strings)
// One event: t, kind, row (-1 for none), impulse, speed.
template <class Model>
struct Record {
  static constexpr int N = Model::n_vD, M = Model::n_rows, S = Model::n_strings;
  static constexpr int row_width =
      1 + Model::n_qD + 2 * N + Model::n_qK + 2 * Model::n_vK + 2 * M + 6 + S;
  static constexpr int event_width = 5;

  double* rows;
  long long row_capacity, n_rows;
  double* events;
  long long event_capacity, n_events;

  bool room_for(long long more_rows, long long more_events) const {
    return n_rows + more_rows <= row_capacity && n_events + more_events <= event_capacity;
  }

  void event(double t, int kind, int row, double impulse, double speed) {
    double* out = events + event_width * n_events++;
    out[0] = t;
    out[1] = kind;
    out[2] = row;
    out[3] = impulse;
    out[4] = speed;
  }

  void row(
      double t, const double* q_D, const double* v_D, const double* acc_D, const double* q_K,
      const double* v_K, const double* acc_K, const double* tension, const bool* taut,
      const double* p, double work, double damping, double impact, double slip_loss,
      const double* slip) {
    double* out = rows + row_width * n_rows++;
    *out++ = t;
    put(out, q_D, Model::n_qD);
    put(out, v_D, N);
    put(out, acc_D, N);
    put(out, q_K, Model::n_qK);
    put(out, v_K, Model::n_vK);
    put(out, acc_K, Model::n_vK);
    put(out, tension, M);
    for (int r = 0; r < M; ++r) *out++ = taut[r] ? 1.0 : 0.0;
    struct {
      double T, V;
    } energy;
    Call<Model, double>::energy(q_D, v_D, q_K, v_K, p, energy);
    *out++ = energy.T;
    *out++ = energy.V;
    *out++ = work;
    *out++ = damping;
    *out++ = impact;
    *out++ = slip_loss;
    put(out, slip, S);
  }

 private:
  static void put(double*& out, const double* from, int n) {
    for (int i = 0; i < n; ++i) *out++ = from[i];
  }
};

}  // namespace fan
