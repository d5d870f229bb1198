// The flow with frozen active set: between two events the same rows are taut, as equalities, and
// the puppet follows a smooth ordinary differential equation
//
//   y = (q_D, v_D, work, loss, slip loss[, friction])
//   ydot = (N(q) v, acc_D, power of inputs and forces, dissipation, tension . rate of slip,
//           friction's power)
//
// advanced by dop853 and projected back on the taut rows (h = 0, hdot = 0) in the metric of M_DD.
// Touching contact points are rows likewise (held_contacts.hpp).
#pragma once

#include "fantoccini/contract.hpp"
#include "fantoccini/event/held_contacts.hpp"
#include "fantoccini/event/tableau.hpp"
#include "fantoccini/model/correct.hpp"
#include "fantoccini/model/evaluation.hpp"
#include "fantoccini/model/motor_watch.hpp"
#include "fantoccini/model/winch.hpp"
#include "fantoccini/runs/drive.hpp"

namespace fan {

struct FlowTolerances {
  // -h up to which a row counts as closed, relative to its scale (row_scale). Smaller overlaps of
  // rows that are not held remain: closing nearly dependent rows, such as strings along one
  // another, would move the puppet many times as far.
  static constexpr double closed_gap = Constants::closed_gap;
  // |hddot| above which a redundant row no longer follows from the held ones, relative to
  // hddot_scale.
  static constexpr double parting_acceleration = 1e-8;
  // Pivot of a held row, relative to the largest diagonal entry of G, below which the held rows are
  // chosen again among the redundant ones.
  static constexpr double dependent_pivot = 1e-4;
  // m: scale of shorter strings.
  static constexpr double min_row_scale = Constants::min_scale_length;
  // Largest number of refinements of the held rows' tensions: nearly dependent rows lose digits.
  static constexpr int refinements = 2;
};

template <class Model>
struct Flow {
  static constexpr int NQ = Model::n_qD, N = Model::n_vD, S = Model::n_strings, M = Model::n_rows;
  static constexpr int D = Model::n_watched, ALL = M + D;
  static constexpr int C = Model::n_contacts;
  static constexpr bool touches = C > 0;
  static constexpr int GUARDS = ALL + (touches ? 1 + C : 0);  // overlap, contact points
  static constexpr int NY = NQ + N + 3 + touches;
  static constexpr int WORK = NQ + N, LOSS = WORK + 1, SLIP_LOSS = WORK + 2, FRICTION = WORK + 3;
  using Tolerance = FlowTolerances;
  using Eval = Evaluation<Model, double>;
  using System = RowSystem<Model, double>;

  Drive<typename Model::Driven, N> drive;
  Options opt;
  double p[array_size(Model::n_p)];

  double t = 0.0;
  double y[NY];
  Hold row_state[array_size(M)];  // frozen between events
  Winches<S> winches;
  double slip[array_size(S)];  // m, at slip_time
  double slip_time = 0.0;

  MotorWatch<Model, double> motors;
  HeldContacts<Model> contacts;

  // The latest evaluation: its inputs and results.
  double q_K[array_size(Model::n_qK)], v_K[array_size(Model::n_vK)], acc_K[array_size(Model::n_vK)],
      u_D[array_size(N)];
  Eval eval;
  System rows;
  double acc[array_size(N)], tension[array_size(M)];
  double slip_now[array_size(S)], slip_rate[array_size(S)];
  double apart[array_size(M)];  // |hddot| of idle and pinned rows, relative to hddot_scale

  bool taut(int r) const { return row_state[r] != SLACK; }

  // Evaluates the flow at (at, state) with the active set frozen.
  void evaluate(double at, const double* state, double* rate) {
    drive.evaluate(at, q_K, v_K, acc_K, u_D);
    eval.at(state, state + NQ, q_K, v_K, acc_K, u_D, p);
    motors.measure(state, q_K, p);
    add_slips(at);
    int list[array_size(M)], n = 0;
    for (int r = 0; r < M; ++r) {
      tension[r] = apart[r] = 0.0;
      if (taut(r)) list[n++] = r;
    }
    rows.gather(eval, state + NQ, list, n);
    double w[array_size(N)];
    for (int k = 0; k < N; ++k) w[k] = eval.w0[k];
    double power = eval.power0, slip_power = 0.0, friction = 0.0;
    if (contacts.look_near(*this, state, state + NQ)) {
      contacts.push(*this, state, state + NQ, w, tension, &power);
      friction = contacts.friction;
      for (int a = 0; a < n; ++a) {
        rows.problem.active[a] = false;
        const int r = list[a];
        if (winches.slips(r)) slip_power += tension[r] * slip_rate[r];
        if (row_state[r] == IDLE || row_state[r] == PINNED)
          apart[r] = fabs(contacts.after_of_row(a)) / hddot_scale();
      }
    } else {
      pull_strings(list, w, &power, &slip_power);
    }
    eval.solve_factor(w, acc);
    configuration_rate<typename Model::Dynamic>(state, state + NQ, rate);
    for (int k = 0; k < N; ++k) {
      rate[NQ + k] = acc[k];
      power += eval.M_DK_v_K[k] * acc[k] + u_D[k] * state[NQ + k];
    }
    rate[WORK] = power;
    rate[LOSS] = eval.loss;
    rate[SLIP_LOSS] = slip_power;
    if constexpr (touches) rate[FRICTION] = friction;
  }

  // Violation of a taut row's condition at the latest evaluation: a held row's tension relative to
  // the weight, a slipping row's speed in m/s, a redundant row's hddot relative to hddot_scale.
  // Undefined for slack rows, whose condition is on the height.
  double violation(int r) const {
    if (r < S && Model::wire[r]) return -1.0;
    if (row_state[r] == HELD) {
      const double below = -tension[r];
      if (!winches.slips(r)) return below / weight();
      const double over = tension[r] - winches.max_tension[r];
      return (below > over ? below : over) / weight();
    }
    if (row_state[r] == SLIPPING) return winches.winding(r, slip_now[r]) - slip_rate[r];
    return apart[r] - Tolerance::parting_acceleration;
  }

  // Largest magnitude of terms of the gathered rows' hddot, at least 1 m/s^2.
  double hddot_scale() const {
    double largest = 1.0;
    for (int a = 0; a < rows.n; ++a)
      largest = larger_of(largest, fabs(rows.hddot[a]) + fabs(rows.free_acc[a]));
    return largest;
  }

  // N: magnitude of forces.
  double weight() const { return (1.0 / Constants::tension_cap) * opt.tension_cap; }

  // Whether the held rows are so nearly dependent that a redundant row should replace one of them.
  bool nearly_dependent() const {
    if (contacts.active()) return false;
    constexpr int stride = Complementarity<double, M>::N;
    bool redundant = false;
    double least = unbounded, largest = 0.0;
    for (int a = 0; a < rows.n; ++a) {
      const double diagonal = rows.problem.G[a * stride + a];
      if (diagonal > largest) largest = diagonal;
      if (row_state[rows.row[a]] != HELD) {
        redundant = redundant || row_state[rows.row[a]] != SLIPPING;
        continue;
      }
      const double pivot = rows.problem.pivot(a);
      if (pivot < least) least = pivot;
    }
    return redundant && least < Tolerance::dependent_pivot * largest;
  }

  // Acceleration with which row r's winch brakes while it rewinds, at the latest evaluation.
  double braking(int r) const { return r < S ? slip_acc_[r] : 0.0; }

  // Stores the slips of the latest evaluation, at the time `at`, from which winches rewind them.
  void settle_slip(double at) {
    for (int i = 0; i < S; ++i) slip[i] = winches.resolved(i, slip_now[i], at);
    slip_time = at;
  }

  // Makes all winches grip in the latest evaluation, which must be that of the present state: the
  // next modes are chosen from there.
  void grip() {
    if (!winches.some_slip) return;
    settle_slip(t);
    for (int i = 0; i < S; ++i) {
      eval.h[i] += slip_now[i];
      eval.hdot[i] += slip_rate[i];
      eval.gamma[i] += slip_acc_[i];
      lengthen(i, winches.wound(i, slip[i], 0.0));
    }
  }

  // Time at which the first rewinding winch begins to brake or stops; `none` if none rewinds.
  double rewound(double none) const {
    double first = none;
    for (int i = 0; i < S; ++i) {
      const double stretch = winches.stretch(i, slip[i]);
      if (row_state[i] != SLIPPING && stretch > 0.0 && slip_time + stretch < first)
        first = slip_time + stretch;
    }
    return first;
  }

  // Time at which the first driven length runs out in the inputs' present piece, and the row of its
  // string; `none` if not before the piece ends.
  double emptied(double none, int* row) const {
    double first = none;
    const double start = drive.segment_start(), end = drive.segment_end();
    if (!(t >= start && t < end)) return none;
    for (int i = 0; i < S; ++i) {
      if (Model::length_v[i] < 0) continue;
      double points[n_powers];
      control_points(
          drive.segment_coef() + n_powers * Model::length_v[i], t - start, end - t, points);
      const double at = falls_to(points, LengthTolerances::min_length, t, end - t, none);
      if (!(at < first)) continue;
      first = at;
      *row = i;
    }
    return first;
  }

  // --- the step -------------------------------------------------------------------------------

  double k[dop853::all_stages][NY];
  double end[NY], end_rate[NY];  // state at the end of the trial step, and its rate
  double stage_violation[dop853::stages]
                        [array_size(GUARDS)];  // from stage 1 on; of slack rows the height

  // Trial step of length s from (t, y) with k[0] known. Leaves the end state in `end`.
  void stages(double s) {
    double at[NY];
    for (int i = 1; i < dop853::stages; ++i) {
      combine(dop853::A[i], i, s, at);
      evaluate(t + dop853::C[i] * s, at, k[i]);
      for (int r = 0; r < M; ++r) {
        stage_violation[i][r] = taut(r) ? violation(r) : eval.height(r);
      }
      for (int d = 0; d < D; ++d) stage_violation[i][M + d] = motors.excess(d);
      for (int g = ALL; g < GUARDS; ++g) stage_violation[i][g] = contacts.guard_of(*this, g - ALL);
    }
    combine(dop853::B, dop853::stages, s, end);
    normalise_all<typename Model::Dynamic>(end);
  }

  // Ends the trial step of length s: the rate at its end, for the dense output, then projects `end`
  // and evaluates there.
  Status finish(double s) {
    evaluate(t + s, end, k[dop853::stages]);
    for (int j = 0; j < NY; ++j) end_rate[j] = k[dop853::stages][j];
    if (rows.n == 0 && !contacts.holds()) return RUNNING;
    const Status status = project(t + s, end);
    evaluate(t + s, end, end_rate);
    return status;
  }

  // Size of the local error against the tolerances (accept when <= 1), Hairer's estimate.
  double error(double s) const {
    double fifth = 0.0, third = 0.0;
    for (int j = 0; j < NY; ++j) {
      double e5 = 0.0, e3 = 0.0;
      for (int i = 0; i < dop853::stages; ++i) {
        e5 += dop853::E5[i] * k[i][j];
        e3 += dop853::E3[i] * k[i][j];
      }
      const double floor = j < WORK ? opt.atol : opt.atol * opt.energy_scale;
      const double scale = floor + opt.rtol * larger_of(fabs(y[j]), fabs(end[j]));
      fifth += (e5 / scale) * (e5 / scale);
      third += (e3 / scale) * (e3 / scale);
    }
    if (fifth == 0.0 && third == 0.0) return 0.0;
    return fabs(s) * fifth / sqrt((fifth + 0.01 * third) * NY);
  }

  // Polynomials of the dense output over the step s just tried; k[12] is the rate at its end. The
  // latest evaluation is then at a stage.
  void prepare_dense(double s) {
    double at[NY];
    for (int i = dop853::stages + 1; i < dop853::all_stages; ++i) {
      combine(dop853::A[i], i, s, at);
      evaluate(t + dop853::C[i] * s, at, k[i]);
    }
    for (int j = 0; j < NY; ++j) {
      const double delta = end[j] - y[j];
      dense_[0][j] = delta;
      dense_[1][j] = s * k[0][j] - delta;
      dense_[2][j] = 2 * delta - s * (k[dop853::stages][j] + k[0][j]);
      for (int i = 0; i < 4; ++i) {
        double sum = 0.0;
        for (int l = 0; l < dop853::all_stages; ++l) sum += dop853::D[i][l] * k[l][j];
        dense_[3 + i][j] = s * sum;
      }
    }
  }

  // State at t + x s on the dense output, 0 <= x <= 1.
  void dense(double x, double* out) const {
    for (int j = 0; j < NY; ++j) {
      double sum = 0.0;
      for (int i = 6; i >= 0; --i) sum = (sum + dense_[i][j]) * (i % 2 == 0 ? x : 1 - x);
      out[j] = y[j] + sum;
    }
    normalise_all<typename Model::Dynamic>(out);
  }

  // --- projection -----------------------------------------------------------------------------

  // Projects the held rows of `state` at time `at` onto h = 0 and hdot = 0 with the smallest change
  // in the metric of M_DD. The evaluation must be that of (at, state).
  Status project(double at, double* state) {
    if (rows.n == 0 && !contacts.holds()) return RUNNING;
    if (contacts.holds()) return contacts.project(*this, at, state);
    const Status status = project_configuration(state);
    if (status != RUNNING) return status;
    double rate[NY];
    evaluate(at, state, rate);
    double move[array_size(N)];
    correction(rows.hdot, move);
    for (int j = 0; j < N; ++j) state[NQ + j] += move[j];
    return RUNNING;
  }

  // Projects the configuration onto h = 0 of the held rows.
  Status project_configuration(double* state) {
    double h[array_size(M)];
    for (int a = 0; a < rows.n; ++a) h[a] = eval.height(rows.row[a]);
    return correct<NQ>(
        state, [&] { return largest_relative(h); },
        [&] {
          double move[array_size(N)], all[array_size(M)];
          correction(h, move);
          retract<typename Model::Dynamic>(state, move, state);
          heights(state, all);
          for (int a = 0; a < rows.n; ++a) h[a] = all[rows.row[a]];
          return RUNNING;
        });
  }

  // h of all rows at the configuration of `state` and the inputs of the latest evaluation. For
  // strings that slip it is 0 or, with `slipped`, the distance of the slip below its lower bound.
  void heights(const double* state, double* h, bool slipped = false) const {
    Call<Model, double>::rows(state, q_K, p, h);
    for (int i = 0; i < S; ++i) {
      if (row_state[i] == SLIPPING)
        h[i] = slipped ? -WinchTolerances::max_length_error - h[i] : 0.0;
      else h[i] -= slip_now[i];
    }
  }

  // Sets `move` to -M^-1 A^T (A M^-1 A^T)^-1 h over the held rows.
  void correction(const double* h, double* move) {
    auto& problem = rows.problem;
    double w[array_size(N)], pull[array_size(M)];
    for (int a = 0; a < rows.n; ++a) {
      problem.b[a] = h[a];
      problem.upper[a] = 0.0;
      problem.active[a] = row_state[rows.row[a]] == HELD;
    }
    // Regularised and not refined: a contradiction of two nearly dependent rows would otherwise
    // move the puppet by many times its size.
    problem.solve_active(ComplementarityTolerances::raise, 0);
    for (int j = 0; j < N; ++j) w[j] = 0.0;
    for (int a = 0; a < rows.n; ++a) pull[a] = problem.active[a] ? -problem.x[a] : 0.0;
    rows.add(pull, w);
    eval.solve_factor(w, move);
  }

  // hdot of a row at the latest evaluation, whose velocity must be v_D.
  double rate_of(int r, const double* v_D) const {
    return r < S ? eval.hdot[r] : eval.limit_rate(r - S, v_D);
  }

  // T + V at (t, y); the evaluation must be that of (t, y).
  double total_energy() const {
    struct {
      double T, V;
    } energy;
    Call<Model, double>::energy(y, y + NQ, q_K, v_K, p, energy);
    return energy.T + energy.V;
  }

  // Scale of a row's h: its string's length at (y, latest inputs), 1 rad or 1 m for a limit.
  double row_scale(int r) const {
    if (r >= S) return 1.0;
    const double length = string_length<Model, double>(r, y, q_K);
    return length > Tolerance::min_row_scale ? length : Tolerance::min_row_scale;
  }

 private:
  // Applies the tensions of the gathered rows, `list`, without contact.
  void pull_strings(const int* list, double* w, double* power, double* slip_power) {
    auto& problem = rows.problem;
    for (int a = 0; a < rows.n; ++a) {
      problem.b[a] = rows.hddot[a];
      problem.lower[a] = 0.0;
      problem.upper[a] = winches.largest(list[a]);
      problem.active[a] = row_state[list[a]] == HELD;
      problem.high[a] = row_state[list[a]] == PINNED || row_state[list[a]] == SLIPPING;
    }
    problem.solve_active(0.0, Tolerance::refinements);
    double pull[array_size(M)] = {};
    for (int a = 0; a < rows.n; ++a) {
      const int r = list[a];
      tension[r] = problem.x[a];
      pull[a] = -problem.x[a];
      *power += problem.x[a] * rows.hdot_K[a];
      if (winches.slips(r)) *slip_power += problem.x[a] * slip_rate[r];
      if (row_state[r] == IDLE || row_state[r] == PINNED)
        apart[r] = fabs(problem.s[a]) / hddot_scale();
    }
    rows.add(pull, w);
  }

  // Converts the strings' h, hdot and gamma to the length L + slip.
  void add_slips(double at) {
    for (int i = 0; i < S; ++i) {
      if (row_state[i] == SLIPPING) {
        slip_now[i] = eval.h[i];
        slip_rate[i] = eval.hdot[i];
        slip_acc_[i] = 0.0;
        eval.h[i] = eval.hdot[i] = 0.0;
        continue;
      }
      lengthen(i, winches.wound(i, slip[i], at - slip_time));
    }
  }

  // Lengthens string i by the slip on its winch.
  void lengthen(int i, const Wound& wound) {
    slip_now[i] = wound.slip;
    slip_rate[i] = wound.rate;
    slip_acc_[i] = wound.acc;
    eval.h[i] -= wound.slip;
    eval.hdot[i] -= wound.rate;
    eval.gamma[i] -= wound.acc;
  }

  // NaN if either is.
  static double larger_of(double a, double b) { return a > b || a != a ? a : b; }

  // Largest |h| of the held rows, relative to their scales.
  double largest_relative(const double* h) const {
    double worst = 0.0;
    for (int a = 0; a < rows.n; ++a)
      if (row_state[rows.row[a]] == HELD)
        worst = larger_of(worst, fabs(h[a]) / row_scale(rows.row[a]));
    return worst;
  }

  // out = y + s sum of weights times stages' rates.
  void combine(const double* weights, int n, double s, double* out) const {
    for (int j = 0; j < NY; ++j) {
      double sum = 0.0;
      for (int i = 0; i < n; ++i) sum += weights[i] * k[i][j];
      out[j] = y[j] + s * sum;
    }
  }

  double dense_[7][NY];
  double slip_acc_[array_size(S)];
};

}  // namespace fan
