// The narrow phase by itself: pairs of solids from stdin, contact points to stdout.
//
// stdin: the margin, how many pairs; of each the solids x and y: kind, a (3), b (3), R (9),
// half (3) and radius.
// stdout, one line a pair: bounding radius of x, whether certainly apart, how many points; of each
// point its place (3), normal (3), gap and feature.
#include <cmath>
#include <cstdio>
#include <vector>

#include "fantoccini/touch.hpp"

namespace {

double take() {
  double x = 0.0;
  return std::scanf("%lf", &x) == 1 ? x : std::nan("");
}

void take(double* to, int n) {
  for (int i = 0; i < n; ++i) to[i] = take();
}

fan::PlacedSolid read() {
  fan::PlacedSolid x;
  x.kind = int(take());
  take(x.a, 3);
  take(x.b, 3);
  take(x.R, 9);
  take(x.half, 3);
  x.radius = take();
  return x;
}

void print(const fan::Touch& touch) {
  for (double x : touch.point) std::printf(" %.17g", x);
  for (double x : touch.normal) std::printf(" %.17g", x);
  std::printf(" %.17g %d", touch.gap, touch.feature);
}

}  // namespace

int main() {
  const double margin = take();
  const int pairs = int(take());
  std::vector<fan::PlacedSolid> solids;
  for (int i = 0; i < 2 * pairs; ++i) solids.push_back(read());
  for (int i = 0; i < pairs; ++i) {
    const fan::PlacedSolid &x = solids[2 * i], &y = solids[2 * i + 1];
    fan::Touch found[fan::max_touches];
    const int n = fan::touches(x, y, margin, found);
    std::printf("%.17g %d %d", fan::bounding_radius(x), fan::certainly_apart(x, y, margin), n);
    for (int k = 0; k < n; ++k) print(found[k]);
    std::printf("\n");
  }
  return 0;
}
