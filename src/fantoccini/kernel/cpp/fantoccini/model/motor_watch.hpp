// Checks after every step whether motors are too weak for their commands:
//
//   a stepper loses a step when it lags by more than half a period of its torque behind its tooth:
//   then the torque turns it to the next one;
//   a drive runs away when it is more than runaway_distance outside the range of all commands since
//   the start, with its motor out of step or at its bound; more than gone_distance outside, it runs
//   away in any case, and the run ends.
#pragma once

#include "fantoccini/contract.hpp"
#include "fantoccini/math/elementary.hpp"
#include "fantoccini/math/lane_of.hpp"

namespace fan {

struct MotorTolerances {
  // Distances outside the range of commands: for prismatic joints (m), and for turning joints (rad,
  // a quarter and a whole turn).
  static constexpr double runaway_distance[] = {0.1, 1.5707963267948966};
  static constexpr double gone_distance[] = {1.0, 6.283185307179586};
  // Share of the controller's demand below which the motor is at its bound: just above rounding.
  static constexpr double saturated_share = 1.0 - 1e-9;
};

template <class Model, class Real>
struct MotorWatch {
  using Tolerance = MotorTolerances;
  static constexpr int D = Model::n_watched;
  using Mask = typename Traits<Real>::Mask;

  // Drives that lost steps, or began to run away, in the last step.
  Mask loses[array_size(D)], strays[array_size(D)];

  // Sets the state at the start of a run.
  FAN_FN void begin(const Real* q_D, const Real* q_K, const Real* p) {
    const Mask no = Real(0.0) > Real(1.0);
    measure(q_D, q_K, p);
    gone = no;
    for (int d = 0; d < D; ++d) {
      loses[d] = strays[d] = lost_[d] = astray_[d] = passed_[d] = no;
      tooth_[d] = whole(drives_.lag[d]);
      low_[d] = select(drives_.at[d] < drives_.command[d], drives_.at[d], drives_.command[d]);
      high_[d] = select(drives_.at[d] < drives_.command[d], drives_.command[d], drives_.at[d]);
    }
  }

  // Measures the positions and lags of the drives.
  FAN_FN void measure(const Real* q_D, const Real* q_K, const Real* p) {
    if constexpr (D > 0) {
      Call<Model, Real>::motor_lags(q_D, q_K, p, drives_);
    }
  }

  // Guard of a drive at the last measurement, in periods, m or rad: for a stepper its lag minus
  // half a period; for others their distance minus runaway_distance, or -1 after it was positive.
  FAN_FN Real excess(int d) const {
    if (Model::watched_steps[d]) return lag_beyond(d);
    return select(passed_[d], Real(-1.0), Real(outside(d) - Real(astray_from(d))));
  }

  // Checks the drives after a step of the lanes in `lanes`.
  FAN_FN void observe(
      const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K, const Real* acc_K,
      const Real* p, const Mask& lanes) {
    if (D == 0) return;
    Real beyond[array_size(D)], share[array_size(D)];
    Mask out = Real(0.0) > Real(1.0);
    measure(q_D, q_K, p);
    for (int d = 0; d < D; ++d) {
      if (Model::watched_steps[d]) loses[d] = lanes && lag_beyond(d) > Real(0.0);
      tooth_[d] = select(loses[d], whole(drives_.lag[d]), tooth_[d]);
      lost_[d] = lost_[d] || loses[d];
      low_[d] = select(lanes && drives_.command[d] < low_[d], drives_.command[d], low_[d]);
      high_[d] = select(lanes && drives_.command[d] > high_[d], drives_.command[d], high_[d]);
      beyond[d] = outside(d);
      strays[d] = lanes && beyond[d] > Real(astray_from(d));
      passed_[d] = strays[d] || (!lanes && passed_[d]);
      out = out || strays[d];
    }
    if (!any(out)) return;
    if constexpr (D > 0) {
      Call<Model, Real>::motor_shares(q_D, v_D, q_K, v_K, acc_K, p, share);
    }
    for (int d = 0; d < D; ++d) {
      const Mask weak =
          Model::watched_steps[d] ? lost_[d] : share[d] < Real(Tolerance::saturated_share);
      const Mask beyond_range = beyond[d] > Real(Tolerance::gone_distance[Model::watched_turns[d]]);
      const Mask away = strays[d] && (weak || beyond_range);
      gone = gone || (away && beyond_range);
      strays[d] = away && !astray_[d];
      astray_[d] = astray_[d] || away;
    }
  }

  template <class Memory>
  FAN_FN void remember(Memory& memory) {
    memory.keep(gone, low_, high_, tooth_, lost_, astray_, passed_);
  }

  Mask gone = Real(0.0) > Real(1.0);  // lanes with a drive beyond gone_distance: the run ends

  // Status of a run that has reached its end, in a lane.
  Status verdict(int lane) const {
    Status status = DONE;
    for (int d = 0; d < D; ++d) {
      if (lane_of(astray_[d], lane)) return RUNAWAY;
      if (lane_of(lost_[d], lane)) status = LOST_STEPS;
    }
    return status;
  }

  // Attribution of a status in a lane: shares of the rows, then 1 for every drive that caused it,
  // else 0.
  void attribute(Status status, int lane, const double* rows, double* out) const {
    for (int r = 0; r < Model::n_rows; ++r) *out++ = rows[r];
    for (int d = 0; d < D; ++d) {
      const bool its = status == RUNAWAY      ? lane_of(astray_[d], lane)
                       : status == LOST_STEPS ? lane_of(lost_[d], lane)
                                              : false;
      out[d] = its ? 1.0 : 0.0;
    }
  }

  // Writes the events of the last step of a single run.
  template <class Record>
  void tell(double t, Record& out) const {
    for (int d = 0; d < D; ++d) {
      if (loses[d]) out.event(t, LOST_STEP, Model::n_rows + d, 0.0, 0.0);
      if (strays[d]) out.event(t, RAN_AWAY, Model::n_rows + d, 0.0, 0.0);
    }
  }

 private:
  static constexpr double astray_from(int d) {
    return Tolerance::runaway_distance[Model::watched_turns[d]];
  }

  // Lag of a stepper minus half a period, in periods.
  FAN_FN Real lag_beyond(int d) const {
    using std::abs;
    return abs(drives_.lag[d] - tooth_[d]) - Real(0.5);
  }

  // Distance of a drive outside the range of its commands.
  FAN_FN Real outside(int d) const {
    const Real above = drives_.at[d] - high_[d], below = low_[d] - drives_.at[d];
    return select(above > below, above, below);
  }

  struct {
    Real at[array_size(D)], command[array_size(D)], lag[array_size(D)];
  } drives_;                                       // measured last
  Real low_[array_size(D)], high_[array_size(D)];  // range of the commands so far and of the start
  Real tooth_[array_size(D)];                      // period of the torque that a stepper is in
  Mask lost_[array_size(D)], astray_[array_size(D)];  // since the run began
  Mask passed_[array_size(D)];  // outside by more than runaway_distance at the last check
};

}  // namespace fan
