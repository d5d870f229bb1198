// Separate tests of parts of the runtime.
//
// stdin: nothing. stdout: the statuses of corrections that converge in 12 and in 13 rounds, and the
// acceleration of a feedback without reach, at its equilibrium and away from it.
#include <cstdio>

#include "fantoccini/model/correct.hpp"
#include "fantoccini/search/feedback.hpp"

namespace {

// Corrects an error that shrinks in each of `rounds` moves; the last one removes it.
fan::Status corrected_in(int rounds) {
  double q[1] = {0.0}, error = 1e-3;
  return fan::correct<1>(
      q, [&] { return error; },
      [&] {
        error = --rounds == 0 ? 0.0 : 0.4 * error;
        return fan::RUNNING;
      });
}

struct Line {
  static constexpr int n_scalars = 1, n_quaternions = 0;
  static constexpr int scalar_q[] = {0}, scalar_v[] = {0}, quaternion_q[] = {0},
                       quaternion_v[] = {0};
};

struct Pair {
  static constexpr int n_vD = 1, n_vK = 1;
  using Dynamic = Line;
  using Driven = Line;
};

double led(double q_K) {
  const double none[] = {0.0}, most[] = {1.0}, gains[] = {1.0, 1.0, 1.0, 1.0}, v_D[] = {0.1};
  const fan::LqrLawArrays to{none, none, gains};
  const fan::BoundArrays bounds{most, most, nullptr, nullptr};
  double acc_K[1];
  fan::equilibrium_feedback<Pair>(to, bounds, 0.0, 0.5, none, v_D, &q_K, none, acc_K);
  return acc_K[0];
}

}  // namespace

int main() {
  std::printf("rounds12 %d\nrounds13 %d\n", corrected_in(12), corrected_in(13));
  std::printf("at_equilibrium %g\noff_it %g\n", led(0.0), led(0.2));
  return 0;
}
