// Our contact solver on one problem.
//
// stdin: n_contacts, mu (n_contacts), b (n), G (n * n), n = 3 n_contacts.
// stdout: processor time [s], solved (1 or 0), iterations, rounds; then x (n).
#include <cstdio>
#include <cstdlib>
#include <ctime>

#include "fantoccini/solvers/cone.hpp"

#ifndef CAPACITY
#define CAPACITY 900
#endif

static fan::ConeProblem<CAPACITY> problem;

static double take() {
  double x = 0.0;
  if (std::scanf("%lf", &x) != 1) std::exit(2);
  return x;
}

int main() {
  const int n_contacts = int(take()), n = 3 * n_contacts;
  if (n > CAPACITY) return 1;
  problem.resize(0, n_contacts);
  for (int c = 0; c < problem.n_contacts; ++c) problem.mu[c] = take();
  for (int i = 0; i < n; ++i) {
    problem.b[i] = take();
    problem.x[i] = 0.0;
    problem.lower[i] = i % 3 ? -1e90 : 0.0;
    problem.upper[i] = 1e90;
  }
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) problem.G[i * problem.stride + j] = take();
  const std::clock_t start = std::clock();
  const bool solved = problem.solve();
  const double took = double(std::clock() - start) / CLOCKS_PER_SEC;
  std::printf("%.9g %d %d %d\n", took, solved, problem.iterations, problem.rounds);
  for (int i = 0; i < n; ++i) std::printf("%.17g\n", problem.x[i]);
  return 0;
}
