// The loop of every run of fixed steps, for one trajectory or a bundle of lanes:
//
//   inputs at the end of the step -> step -> verdict -> record
//
// A trajectory (TimeSteppingTrajectory, VariationalTrajectory) begins at q_D(), v_D(), slip() and
// p(), makes the step and judges it: `status` in every lane. It takes its inputs from a drive
// (Drive, LaneDrive or HeldDrive), by `start(t, inputs)` at the start of a run and by `fill(t,
// inputs)`, or `at` and `force`, for a step. Before every step `ready(count)` of a recorder decides
// whether to continue; after it, `record(count, moved)` receives whether any lane has moved.
#pragma once

#include "fantoccini/contract.hpp"
#include "fantoccini/math/lane_of.hpp"
#include "fantoccini/math/real.hpp"
#include "fantoccini/runs/step_grid.hpp"

namespace fan {

// Makes steps until the grid ends, the recorder stops, or no lane runs.
template <class Trajectory, class Drive, class Grid, class Recorder>
FAN_FN void make_steps(
    Trajectory& trajectory, Drive& drive, const Grid& grid, StepCount& count, Recorder& recorder) {
  using Real = typename Trajectory::Real;
  while (any(trajectory.runs()) && !grid.over(count) && recorder.ready(count)) {
    const double next = grid.next(count);
    count.dt = grid.length(count);
    trajectory.advance(drive, next, count.dt);
    const bool moved = any(trajectory.t > Real(count.t));
    count.n_total += moved;
    count.n_grid += moved;
    if (any(trajectory.runs())) count.t = next;
    recorder.record(count, moved);
  }
}

// The same for a grid that begins at time 0, without a record.
template <class Trajectory, class Drive, class Grid>
FAN_FN void make_steps(Trajectory& trajectory, Drive& drive, const Grid& grid) {
  struct {
    bool ready(const StepCount&) const { return true; }
    void record(const StepCount&, bool) const {}
  } no_recorder;
  StepCount count{0.0, grid.dt};
  make_steps(trajectory, drive, grid, count, no_recorder);
}

// Sets the start of a lane of a trajectory.
template <class Trajectory>
void load_start(Trajectory& trajectory, int lane, const StartArrays& from) {
  using Model = typename Trajectory::Model;
  put_lane(from.q_D, Model::n_qD, lane, trajectory.q_D());
  put_lane(from.v_D, Model::n_vD, lane, trajectory.v_D());
  put_lane(from.slip, Model::n_strings, lane, trajectory.slip());
  put_lane(from.p, Model::n_p, lane, trajectory.p());
}

// End of a lane: its status if it was stopped, else `ended`; for complete runs (DONE) the motors
// are checked.
template <class Trajectory>
Status verdict(const Trajectory& trajectory, int lane, Status ended = DONE) {
  const Status status = Status(int(lane_of(trajectory.status, lane)));
  if (status != RUNNING) return status;
  return ended == DONE ? trajectory.motors.verdict(lane) : ended;
}

// By row and watched drive, its share in the cause of a lane's status (n_rows + n_watched,).
template <class Trajectory>
void write_attribution(const Trajectory& trajectory, Status status, int lane, double* out) {
  trajectory.motors.attribute(status, lane, trajectory.attribution[lane], out);
}

}  // namespace fan
