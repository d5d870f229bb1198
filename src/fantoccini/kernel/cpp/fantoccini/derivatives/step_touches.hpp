// First time steps from many states, with their contacts (step_modes.hpp).
#pragma once

#include <new>

#include "fantoccini/derivatives/step_modes.hpp"
#include "fantoccini/runs/shared.hpp"
#include "fantoccini/runs/stepping.hpp"

namespace fan {

template <class Model>
class StepTouches {
 public:
  static constexpr int NQ = Model::n_qD, N = Model::n_vD, NQK = Model::n_qK, K = Model::n_vK;
  static constexpr int P = Model::n_p, S = Model::n_strings, M = Model::n_rows;
  static constexpr int C = Model::n_contacts, L = Model::n_links, E = N + K;

  // Computes node i of the arrays.
  void find(const TouchingStepArrays& in, long long i) {
    step(in, i);
    begin(in, i, trajectory_.at.touching.delay);
    int edges = 0, n = 0;
    modes_.pair_edges = in.pair_edges + i * in.n_pairs;
    if (Status(int(trajectory_.status)) == RUNNING) {
      n = modes_.find(trajectory_, in.reference_force, contacts_);
      edges = modes_.edges;
      if (n > in.capacity) edges = TOO_MANY_POINTS, n = 0;
    }
    for (int k = 0; k < n; ++k) in.points[i * in.capacity + k] = contacts_[k];
    in.n_points[i] = n;
    in.edges[i] = edges;
    write(in, i);
  }

 private:
  void begin(const TouchingStepArrays& in, long long i, double delay) {
    modes_.begin(
        in.q_D + i * NQ, in.v_D + i * N, in.q_K + i * NQK, in.rate + i * K, of(in.p, i), delay);
    in.delay[i] = delay;
  }

  // Inputs at the start and at the end of a step.
  struct Ends {
    using Inputs = typename TimeSteppingTrajectory<Model, double>::Inputs;
    Inputs now, then;

    void start(double, Inputs& in) const { in = now; }
    void fill(double, Inputs& in) const { in = then; }
  };

  void step(const TouchingStepArrays& in, long long i) {
    auto& run = trajectory_;
    const double dt = in.options.dt, *p = of(in.p, i);
    const double *q_D = in.q_D + i * NQ, *v_D = in.v_D + i * N, *q_K = in.q_K + i * NQK;
    const double* rate = in.rate + i * K;
    run.set(0.0, in.options, in.winches);
    put_lane(p, P, 0, run.p());
    put_lane(q_D, NQ, 0, run.q_D());
    put_lane(v_D, N, 0, run.v_D());
    put_lane(in.slip + i * S, S, 0, run.slip());
    Ends ends;
    auto &now = ends.now, &then = ends.then;
    const double *v_K = in.v_K + i * K, *acc_K = of(in.acc_K, i), *mean = in.mean + i * K;
    const double* force = of(in.u_D, i);
    for (int k = 0; k < NQK; ++k) now.q_K[k] = q_K[k];
    retract<typename Model::Driven>(q_K, rate, dt, then.q_K);
    for (int k = 0; k < K; ++k) {
      now.v_K[k] = v_K[k];
      now.acc_K[k] = then.acc_K[k] = acc_K[k];
      then.v_K[k] = v_K[k] + dt * mean[k];
    }
    for (int k = 0; k < N; ++k) now.u_D[k] = then.u_D[k] = force ? force[k] : 0.0;
    run.begin(ends);
    make_steps(run, ends, EvenSteps{dt, 1});
  }

  void write(const TouchingStepArrays& in, long long i) {
    auto& run = trajectory_;
    for (int k = 0; k < NQ; ++k) in.q_D_next[i * NQ + k] = run.state().q_D[k];
    for (int k = 0; k < N; ++k) in.v_D_next[i * N + k] = run.state().v_D[k];
    for (int k = 0; k < NQK; ++k) in.q_K_next[i * NQK + k] = run.inputs().q_K[k];
    for (int k = 0; k < K; ++k) in.v_K_next[i * K + k] = run.inputs().v_K[k];
    for (int k = 0; k < S; ++k) in.slip[i * S + k] = run.at.slip[k];
    for (int r = 0; r < M; ++r) {
      in.tension[i * M + r] = run.at.tension[r];
      in.taut[i * M + r] = run.at.taut[r];
    }
    in.status[i] = verdict(run, 0);
    modes_.screws(in.screws + i * 6 * E, P > 0 ? in.by_p + i * (L + E) * 6 * P : nullptr);
  }

  TimeSteppingTrajectory<Model, double> trajectory_;
  StepModes<Model> modes_;
  StepContact contacts_[array_size(C)];
};

// The C interface of StepTouches: the nodes [first, last) of the arrays; returns 1 if memory is
// exhausted, else 0.
template <class Model>
int find_step_touches(const TouchingStepArrays& in, long long first, long long last) {
  if constexpr (Model::n_contacts > 0) {
    auto* touches = new (std::nothrow) StepTouches<Model>();
    if (!touches) return 1;
    for (long long i = first; i < last; ++i) touches->find(in, i);
    delete touches;
  }
  return 0;
}

}  // namespace fan
