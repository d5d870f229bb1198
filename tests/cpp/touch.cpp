// The narrow phase: pairs of solids from stdin, contact points to stdout.
//
// stdin: the margin; number of hulls; for each the numbers of vertices, facets, edges and corners,
// its radii and arrays; number of pairs; for each the solids x and y: kind, a (3), b (3), R (9),
// half (3), radius and the number of its hull. stdout, one line per pair: bounding radius of x,
// whether they are certainly apart, number of points; for each point its place (3), normal (3),
// gap, feature and region; then, computed from feature and region alone: whether it is defined,
// whether it is within its features, its normal (3) and gap.
#include <cmath>
#include <cstdio>
#include <iterator>
#include <list>
#include <vector>

#include "fantoccini/collision/touch.hpp"

namespace {

double read_number() {
  double x = 0.0;
  return std::scanf("%lf", &x) == 1 ? x : std::nan("");
}

void read_numbers(double* to, int n) {
  for (int i = 0; i < n; ++i) to[i] = read_number();
}

int read_integer() { return int(read_number()); }

struct ReadHull {
  std::vector<double> vertices, planes;
  std::vector<int> begins, corners, sides, edges, around_begins, around;
  fan::Hull hull;

  ReadHull() {
    const int n_vertices = read_integer(), n_facets = read_integer(), n_edges = read_integer(),
              n_corners = read_integer();
    const double inner = read_number(), outer = read_number();
    const auto numbers = [](std::vector<double>& to, int n) {
      for (int i = 0; i < n; ++i) to.push_back(read_number());
      return to.data();
    };
    const auto indices = [](std::vector<int>& to, int n) {
      for (int i = 0; i < n; ++i) to.push_back(read_integer());
      return to.data();
    };
    hull.n_vertices = n_vertices;
    hull.n_facets = n_facets;
    hull.n_edges = n_edges;
    hull.inner = inner;
    hull.outer = outer;
    hull.vertices = numbers(vertices, 3 * n_vertices);
    hull.planes = numbers(planes, 4 * n_facets);
    hull.begins = indices(begins, n_facets + 1);
    hull.corners = indices(corners, n_corners);
    hull.sides = indices(sides, n_corners);
    hull.edges = indices(edges, 4 * n_edges);
    hull.around_begins = indices(around_begins, n_vertices + 1);
    hull.around = indices(around, n_corners);
  }

  ReadHull(const ReadHull&) = delete;
};

fan::PlacedSolid read(const std::list<ReadHull>& hulls) {
  fan::PlacedSolid x;
  x.kind = int(read_number());
  read_numbers(x.a, 3);
  read_numbers(x.b, 3);
  read_numbers(x.R, 9);
  read_numbers(x.half, 3);
  x.radius = read_number();
  x.mesh = read_integer();
  x.hull = x.mesh < 0 ? nullptr : &std::next(hulls.begin(), x.mesh)->hull;
  return x;
}

void print(const fan::Touch& touch) {
  for (double x : touch.point) std::printf(" %.17g", x);
  for (double x : touch.normal) std::printf(" %.17g", x);
  std::printf(" %.17g %d %d", touch.gap, touch.feature, touch.region);
}

void print_followed(const fan::PlacedSolid& x, const fan::PlacedSolid& y, const fan::Touch& touch) {
  fan::Touch alone = touch;
  bool holds = false;
  const bool known = fan::follow_touch(x, y, touch.feature, touch.region, &alone, &holds);
  std::printf(" %d %d", known, holds);
  for (double c : alone.normal) std::printf(" %.17g", c);
  std::printf(" %.17g", alone.gap);
}

}  // namespace

int main() {
  const double margin = read_number();
  std::list<ReadHull> hulls;
  for (int n = read_integer(); n > 0; --n) hulls.emplace_back();
  const int pairs = read_integer();
  std::vector<fan::PlacedSolid> solids;
  for (int i = 0; i < 2 * pairs; ++i) solids.push_back(read(hulls));
  for (int i = 0; i < pairs; ++i) {
    const fan::PlacedSolid &x = solids[2 * i], &y = solids[2 * i + 1];
    fan::Touch found[fan::max_touches];
    const int n = fan::touches(x, y, margin, found);
    std::printf("%.17g %d %d", fan::bounding_radius(x), fan::certainly_apart(x, y, margin), n);
    for (int k = 0; k < n; ++k) {
      print(found[k]);
      print_followed(x, y, found[k]);
    }
    std::printf("\n");
  }
  return 0;
}
