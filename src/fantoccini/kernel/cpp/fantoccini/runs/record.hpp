// Rows and events of a run, written into the caller's arrays.
#pragma once

#include "fantoccini/model/evaluation.hpp"

namespace fan {

template <class Model>
struct Record : RecordArrays {
  using Layout = SampleLayout<Model>;

  bool room_for(long long more_rows, long long more_events) const {
    return n_samples + more_rows <= sample_capacity && n_events + more_events <= event_capacity &&
           n_contacts + more_rows * Model::n_contacts <= contact_capacity;
  }

  // Contact points at the last written sample, and the residual of their laws.
  template <class Push>
  void touching(const Push* push, int n, double dt, double residual) {
    samples[Layout::width * (n_samples - 1) + Layout::contact_residual] = residual;
    for (int i = 0; i < n; ++i) {
      double* out = contacts + ContactLayout::width * n_contacts++;
      out[ContactLayout::sample] = double(n_samples - 1);
      out[ContactLayout::pair] = push[i].pair;
      out[ContactLayout::gap] = push[i].gap;
      put(out + ContactLayout::point, push[i].at, 3);
      put(out + ContactLayout::normal, push[i].normal, 3);
      put(out + ContactLayout::velocity, push[i].velocity, 3);
      for (int c = 0; c < 3; ++c) out[ContactLayout::force + c] = push[i].impulse[c] / dt;
    }
  }

  void event(double t, int kind, int row, double impulse, double speed) {
    double* out = events + EventLayout::width * n_events++;
    out[EventLayout::t] = t;
    out[EventLayout::kind] = kind;
    out[EventLayout::row] = row;
    out[EventLayout::impulse] = impulse;
    out[EventLayout::speed] = speed;
  }

  // `energy_terms`: work, damping, impact, slip loss and friction [J].
  void row(
      double t, const double* q_D, const double* v_D, const double* acc_D, const double* q_K,
      const double* v_K, const double* acc_K, const double* tension, const bool* taut,
      const double* p, const double* energy_terms, const double* slip) {
    double* out = samples + Layout::width * n_samples++;
    constexpr int N = Model::n_vD, M = Model::n_rows;
    out[Layout::t] = t;
    put(out + Layout::q_D, q_D, Model::n_qD);
    put(out + Layout::v_D, v_D, N);
    put(out + Layout::acc_D, acc_D, N);
    put(out + Layout::q_K, q_K, Model::n_qK);
    put(out + Layout::v_K, v_K, Model::n_vK);
    put(out + Layout::acc_K, acc_K, Model::n_vK);
    put(out + Layout::tension, tension, M);
    for (int r = 0; r < M; ++r) out[Layout::taut + r] = taut[r] ? 1.0 : 0.0;
    struct {
      double *T, *V;
    } energy{out + Layout::kinetic, out + Layout::potential};
    Call<Model, double>::energy(q_D, v_D, q_K, v_K, p, energy);
    out[Layout::work] = energy_terms[0];
    out[Layout::damping] = energy_terms[1];
    out[Layout::impact] = energy_terms[2];
    out[Layout::slip_loss] = energy_terms[3];
    out[Layout::friction] = energy_terms[4];
    put(out + Layout::slip, slip, Model::n_strings);
    out[Layout::contact_residual] = 0.0;
  }

 private:
  static void put(double* out, const double* from, int n) {
    for (int i = 0; i < n; ++i) out[i] = from[i];
  }
};

}  // namespace fan
