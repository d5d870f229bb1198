// Numbers that steer a run; fantoccini.runtime fills them in.
#pragma once

namespace fan {

struct Options {
  double rtol, atol;
  double first_step, max_step;
  double tension_cap;   // N; also N s for impulses
  double energy_scale;  // J: size of the work and loss integrals for the error norm
  double force_scale;   // kg^1/2 m/s^2: size of the forces that may balance, weight / sqrt(mass)
  double recovery_speed;  // m/s: time-stepping's cap on how fast a violation is taken back
  double dt;              // s: step of the methods with a fixed one
  long long max_steps, max_events;
  int save_steps;   // write every accepted step
  int extrapolate;  // time-stepping: velocity products half a step on, from the steps before
};

}  // namespace fan
