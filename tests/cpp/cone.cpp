// The solver of strings and contacts: problems from stdin, solutions to stdout.
//
// stdin: number of problems; then for each n_single, n_contacts, mu (n_contacts), for every contact
// whether its direction of sliding is given, and the direction (3 n_contacts), and for its n rows
// lower, upper, b, the guess of x, and G (n * n). stdout, one line per problem: solved (1 or 0),
// residual, iterations, rounds, x (n), s (n).
#include <cmath>
#include <cstdio>
#include <initializer_list>

#include "fantoccini/solvers/cone.hpp"

namespace {

constexpr int kCapacity = 64;
fan::ConeProblem<kCapacity> problem;

double take() {
  double x = 0.0;
  return std::scanf("%lf", &x) == 1 ? x : std::nan("");
}

void take(double* x, int n) {
  for (int i = 0; i < n; ++i) x[i] = take();
}

}  // namespace

int main() {
  const int n_problems = int(take());
  for (int k = 0; k < n_problems; ++k) {
    const int n_single = int(take()), n_contacts = int(take());
    const int n = n_single + 3 * n_contacts;
    if (n > kCapacity) return 1;
    problem.resize(n_single, n_contacts);
    take(problem.mu, problem.n_contacts);
    bool slides[kCapacity], any_slides = false;
    double along[2 * kCapacity];
    for (int c = 0; c < n_contacts; ++c) {
      slides[c] = take() != 0.0;
      any_slides = any_slides || slides[c];
      take(along + 2 * c, 2);
    }
    problem.slides = any_slides ? slides : nullptr;
    problem.along = along;
    for (double* part : {problem.lower, problem.upper, problem.b, problem.x}) take(part, n);
    for (int i = 0; i < n; ++i) take(problem.G + i * problem.stride, n);
    const bool solved = problem.solve();
    std::printf("%d %.17g %d %d", solved, problem.residual, problem.iterations, problem.rounds);
    for (const double* part : {problem.x, problem.s})
      for (int i = 0; i < n; ++i) std::printf(" %.17g", part[i]);
    std::printf("\n");
    problem.slides = nullptr;
  }
  return 0;
}
