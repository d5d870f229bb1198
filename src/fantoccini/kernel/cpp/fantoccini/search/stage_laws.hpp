// Data of single inputs and states in programs of stages: driven coordinates, and inputs on laws.
#pragma once

namespace fan {

// Entries (row + j, column + j), j < length, of (A B) of all stages.
struct Band {
  int row, column, length;
};

// u_input = value + sum over t of by[t] z_i[at[t]].
struct StageLaw {
  int input, at[2];
  double by[2], value;
};

}  // namespace fan
