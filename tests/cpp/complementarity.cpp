// The complementarity solver by itself: problems from stdin, solutions to stdout.
//
// stdin: how many problems; then of each n, whose settings (1: the event-driven run's, 0: the
// time-stepper's), a guess (1: all rows active, 0: none), two_sided (n), b (n), G (n x n).
// stdout, one line a problem: solved, apart, x (n), s (n). `apart` is how far the same problem's
// solution in a bundle is, whose other lanes hold the problem turned round; relative to max |x|.
#include <cmath>
#include <cstdio>
#include <vector>

#include "fantoccini/lanes.hpp"

#include "fantoccini/contact.hpp"
#include "fantoccini/timestepping.hpp"

namespace {

constexpr int kCapacity = 60, W = 4;
using Wide = fan::Lanes<W>;

double take() {
  double x = 0.0;
  return std::scanf("%lf", &x) == 1 ? x : std::nan("");
}

struct Problem {
  int n;
  bool event, guess;
  std::vector<double> two_sided, b, G;
};

Problem read() {
  Problem p;
  p.n = int(take());
  p.event = take() != 0.0;
  p.guess = take() != 0.0;
  for (int i = 0; i < p.n; ++i) p.two_sided.push_back(take());
  for (int i = 0; i < p.n; ++i) p.b.push_back(take());
  for (int i = 0; i < p.n * p.n; ++i) p.G.push_back(take());
  return p;
}

fan::Complementarity<double, kCapacity> scalar;
fan::Complementarity<Wide, kCapacity> wide;

template <class System>
auto solve(System& system, bool event) {
  return event ? system.solve(fan::kEps, fan::kRefinements, 1e-12, fan::kPivots)
               : system.solve(fan::kStepEps, 1, 1e-11, 50);
}

// Lane 0 holds the problem, lane l another right side: b times cos(l).
double bundled(const Problem& p, const double* x) {
  constexpr int stride = fan::Complementarity<Wide, kCapacity>::N;
  wide.n = p.n;
  for (int i = 0; i < p.n; ++i) {
    for (int j = 0; j < p.n; ++j) wide.G[i * stride + j] = Wide(p.G[i * p.n + j]);
    for (int l = 0; l < W; ++l) wide.b[i][l] = p.b[i] * (l == 0 ? 1.0 : std::cos(l + i));
    wide.active[i] = p.guess ? Wide(1.0) > Wide(0.0) : Wide(0.0) > Wide(1.0);
    wide.two_sided[i] = p.two_sided[i] != 0.0;
  }
  solve(wide, p.event);
  double apart = 0.0, top = 1e-300;
  for (int i = 0; i < p.n; ++i) {
    const double off = std::fabs(wide.x[i][0] - x[i]);
    if (!(off <= apart)) apart = off;
    if (std::fabs(x[i]) > top) top = std::fabs(x[i]);
  }
  return apart / top;
}

}  // namespace

int main() {
  constexpr int stride = fan::Complementarity<double, kCapacity>::N;
  const int n_problems = int(take());
  for (int problem = 0; problem < n_problems; ++problem) {
    const Problem p = read();
    scalar.n = p.n;
    for (int i = 0; i < p.n; ++i) {
      for (int j = 0; j < p.n; ++j) scalar.G[i * stride + j] = p.G[i * p.n + j];
      scalar.b[i] = p.b[i];
      scalar.active[i] = p.guess;
      scalar.two_sided[i] = p.two_sided[i] != 0.0;
    }
    const bool solved = solve(scalar, p.event);
    std::printf("%d %.17g", int(solved), bundled(p, scalar.x));
    for (int i = 0; i < p.n; ++i) std::printf(" %.17g", scalar.x[i]);
    for (int i = 0; i < p.n; ++i) std::printf(" %.17g", scalar.s[i]);
    std::printf("\n");
  }
  return 0;
}
