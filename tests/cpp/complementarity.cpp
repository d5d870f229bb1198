// The two complementarity solvers: problems from stdin, solutions to stdout.
//
// stdin: number of problems; then for each n, the length of a column, its solver (1: the
// event-driven run's, exact; 0: the time-stepper's), a guess (1: all rows active, 0: none),
// two_sided (n), upper (n), b (n), and the columns of A (n of them); G = A^T A.
// stdout, one line per problem: status (0: solved, 1: no solution, 2: not settled), apart, x (n), s
// (n), ray (n). `apart` is relative to max
//
// x
//
// : for the exact solver the difference of the motion A x from that with the other guess, for the
// time-stepper's the difference of x from that of the same problem in a bundle whose other lanes
// have other right sides, without and with straight-line code for the first rows.
#include <cmath>
#include <cstdio>
#include <vector>

#include "fantoccini/math/lanes.hpp"

#include "fantoccini/event/closed_rows.hpp"
#include "fantoccini/timestepping/step.hpp"

namespace {

constexpr int kCapacity = 60, kLongest = 130, W = 4;
constexpr double kFree = 1e30;  // bound of a two-sided row, never active
using Wide = fan::Lanes<W>;
using Set = fan::ActiveSet<kCapacity, kLongest>;
constexpr int stride = fan::Complementarity<double, kCapacity>::N;

double take() {
  double x = 0.0;
  return std::scanf("%lf", &x) == 1 ? x : std::nan("");
}

std::vector<double> take(int n) {
  std::vector<double> out;
  for (int i = 0; i < n; ++i) out.push_back(take());
  return out;
}

struct Problem {
  int n, length;
  bool event, guess;
  std::vector<double> two_sided, upper, b, A;

  double G(int i, int j) const {
    double sum = 0.0;
    for (int k = 0; k < length; ++k) sum += A[i * length + k] * A[j * length + k];
    return sum;
  }
};

Problem read() {
  Problem p;
  p.n = int(take());
  p.length = int(take());
  p.event = take() != 0.0;
  p.guess = take() != 0.0;
  p.two_sided = take(p.n);
  p.upper = take(p.n);
  p.b = take(p.n);
  p.A = take(p.n * p.length);
  return p;
}

struct Answer {
  int status = 0;
  double apart = 0.0;
  std::vector<double> x, s, ray;
};

Set exact;
fan::LeastNorm<Set> least;
fan::Complementarity<double, kCapacity> scalar;
fan::Complementarity<Wide, kCapacity> wide;
constexpr int kLeading = 3;
fan::Complementarity<Wide, kCapacity, kLeading> led;

double largest(const std::vector<double>& x) {
  double top = 1e-300;
  for (double value : x) top = std::fabs(value) > top ? std::fabs(value) : top;
  return top;
}

Answer solve_exactly(const Problem& p, bool guess) {
  exact.n = p.n;
  exact.dim = p.length;
  exact.noise = 0.0;
  bool stays[kCapacity];
  for (int i = 0; i < p.n; ++i) {
    exact.column[i] = p.A.data() + i * p.length;
    exact.b[i] = p.b[i];
    exact.upper[i] = p.upper[i];
    exact.two_sided[i] = p.two_sided[i] != 0.0;
    exact.place[i] = guess ? Set::BASIC : Set::LOW;
    stays[i] = true;
  }
  const fan::Solved solved = exact.solve();
  Answer out;
  out.status = int(solved);
  out.ray.assign(p.n, 0.0);
  if (solved == fan::Solved::INFEASIBLE) out.ray.assign(exact.ray, exact.ray + p.n);
  if (solved == fan::Solved::YES) {
    exact.complete(stays);
    least.apply(exact);
  }
  out.x.assign(exact.x, exact.x + p.n);
  out.s.assign(exact.s, exact.s + p.n);
  return out;
}

// The largest entry of A (x - y).
double motion_between(
    const Problem& p, const std::vector<double>& x, const std::vector<double>& y) {
  double most = 0.0;
  for (int k = 0; k < p.length; ++k) {
    double sum = 0.0;
    for (int i = 0; i < p.n; ++i) sum += p.A[i * p.length + k] * (x[i] - y[i]);
    if (!(std::fabs(sum) <= most)) most = std::fabs(sum);
  }
  return most;
}

// Settings and bounds of the time-stepper; in lane l of a bundle, b is multiplied by cos(l + i).
template <class Real>
Real b_of(const Problem& p, int i);
template <>
double b_of<double>(const Problem& p, int i) {
  return p.b[i];
}
template <>
Wide b_of<Wide>(const Problem& p, int i) {
  Wide b;
  for (int l = 0; l < W; ++l) b[l] = p.b[i] * (l == 0 ? 1.0 : std::cos(l + i));
  return b;
}

template <class Real, int leading>
auto step(fan::Complementarity<Real, kCapacity, leading>& system, const Problem& p) {
  const auto never = Real(0.0) > Real(1.0);
  system.n = p.n;
  for (int i = 0; i < p.n; ++i) {
    const bool free = p.two_sided[i] != 0.0;
    for (int j = 0; j < p.n; ++j) system.G[i * stride + j] = Real(p.G(i, j));
    system.b[i] = b_of<Real>(p, i);
    system.lower[i] = free ? Real(-kFree) : Real(0.0);
    system.upper[i] = Real(free || p.upper[i] > kFree ? kFree : p.upper[i]);
    system.active[i] = p.guess || free ? !never : never;
    system.high[i] = never;
  }
  return system.solve(
      fan::ComplementarityTolerances::raise, 1, fan::ComplementarityTolerances::pivoting,
      50 + 4 * p.n);
}

// Largest difference of x in lane 0; NaN if it contains one.
double farthest(const Wide* x, const std::vector<double>& y) {
  double most = 0.0;
  for (size_t i = 0; i < y.size(); ++i) {
    const double off = std::fabs(x[i][0] - y[i]);
    if (!(off <= most)) most = off;
  }
  return most;
}

Answer solve(const Problem& p) {
  if (p.event) {
    Answer out = solve_exactly(p, p.guess);
    const Answer other = solve_exactly(p, !p.guess);
    out.apart = other.status == out.status ? motion_between(p, out.x, other.x) : 1e300;
    if (out.status == 0) out.apart /= largest(out.x);
    return out;
  }
  Answer out;
  out.status = step(scalar, p) ? 0 : 2;
  out.x.assign(scalar.x, scalar.x + p.n);
  out.s.assign(scalar.s, scalar.s + p.n);
  out.ray.assign(p.n, 0.0);
  step(wide, p);
  out.apart = farthest(wide.x, out.x);
  if (p.n >= kLeading) {
    led.use(led.G, stride);
    step(led, p);
    const double off = farthest(led.x, out.x);
    if (!(off <= out.apart)) out.apart = off;
  }
  out.apart /= largest(out.x);
  return out;
}

}  // namespace

int main() {
  const int n_problems = int(take());
  for (int problem = 0; problem < n_problems; ++problem) {
    const Answer a = solve(read());
    std::printf("%d %.17g", a.status, a.apart);
    for (const auto* part : {&a.x, &a.s, &a.ray})
      for (double value : *part) std::printf(" %.17g", value);
    std::printf("\n");
  }
  return 0;
}
