// Steps of a scene, compared with steps without patches, in which pushing points are inactive at
// first, so that the law is solved point by point. Reads the input of benchmarks/contact/stage.cpp.
//
// argv: number of steps. stdout: for each step the largest difference of the velocities of both
// from one state, the largest velocity, whether patches were used, the number of pushing points,
// and the residual of the law with and without patches.
#define main timed
#include "stage.cpp"
#undef main

namespace {

Run alone;

void step_both() {
  alone = run;
  auto out = record();
  if (run.run(1e9, 1, out) != fan::RUNNING) std::exit(3);
  auto& contacts = alone.trajectory().at.contacts;
  for (int i = 0; i < contacts.n[0]; ++i) contacts.push[0][i].wait = 2;
  out = record();
  if (alone.run(1e9, 1, out) != fan::RUNNING) std::exit(4);
  if (contacts.has_patches()) std::exit(5);
  double apart = 0.0, most = 0.0;
  for (int k = 0; k < N; ++k) {
    const double v = run.trajectory().state().v_D[k];
    apart = std::fmax(apart, std::fabs(v - alone.trajectory().state().v_D[k]));
    most = std::fmax(most, std::fabs(v));
  }
  const auto& own = run.trajectory().at.contacts;
  std::printf(
      "%.3g %.3g %d %d %.3g %.3g\n", apart, most, int(own.has_patches()), own.n[0], own.residual,
      contacts.residual);
}

}  // namespace

int main(int, char** argv) {
  take_all();
  take_contacts();
  begin();
  for (int n = std::atoi(argv[1]); n > 0; --n) step_both();
  return 0;
}
