// Links with random motions, each with a small sphere at the rim of its ball: whether pairs outside
// of a list ever come within the margin while it is valid. stdin: speed of the links [m/step], turn
// [rad/step]. stdout: number of lists, steps of their validity, near pairs, missed pairs.
#include <cmath>
#include <cstdio>
#include <random>

#include "fantoccini/collision/near_pairs.hpp"

namespace {

constexpr int n_links = 12, n_steps = 4000;
constexpr double ball_radius = 0.1, radius = 0.02, slack = 0.03, margin = 1e-3;

struct Ball {
  double at[3], radius;
};

double poses[12 * n_links];
Ball ball[n_links];

double gap(int a, int b) {
  double square = 0.0;
  for (int c = 0; c < 3; ++c) {
    const double x = ball[a].at[c] + (ball_radius - radius) * poses[12 * a + c];
    const double y = ball[b].at[c] + (ball_radius - radius) * poses[12 * b + c];
    square += (x - y) * (x - y);
  }
  return std::sqrt(square) - 2.0 * radius;
}

}  // namespace

int main() {
  double speed, turn;
  if (std::scanf("%lf %lf", &speed, &turn) != 2) return 1;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  for (int i = 0; i < n_links; ++i) {
    ball[i].radius = i == 0 ? 0.0 : ball_radius;  // the first has no solids
    for (int c = 0; c < 3; ++c) ball[i].at[c] = 0.15 * any(random);
    for (int k = 0; k < 9; ++k) poses[12 * i + k] = k % 4 == 0;
  }
  double margins[n_links];
  for (double& x : margins) x = 0.5 * margin;
  fan::NearPairs<n_links, n_links * n_links> near;
  near.forget();
  int n_lists = 0, n_valid = 0, n_near = 0, n_missed = 0;
  for (int step = 0; step < n_steps; ++step) {
    for (int i = 1; i < n_links; ++i) {
      for (int c = 0; c < 3; ++c) ball[i].at[c] = 0.999 * ball[i].at[c] + speed * any(random);
      // Rotation about z, from the left: every column turns.
      const double angle = turn * any(random), c = std::cos(angle), s = std::sin(angle);
      for (int k = 0; k < 9; k += 3) {
        double* column = poses + 12 * i + k;
        const double x = column[0], y = column[1];
        column[0] = c * x - s * y;
        column[1] = s * x + c * y;
      }
    }
    if (!near.holds(poses, ball, margins, slack)) {
      if (!near.is_due()) continue;
      near.begin(poses, ball);
      ++n_lists;
      for (int a = 1, k = 0; a < n_links; ++a)
        for (int b = 1; b < a; ++b, ++k)
          if (gap(a, b) < slack) near.add(k);
      if (!near.holds(poses, ball, margins, slack)) continue;
    }
    ++n_valid;
    for (int a = 1, k = 0; a < n_links; ++a)
      for (int b = 1; b < a; ++b, ++k) {
        if (gap(a, b) >= margin) continue;
        ++n_near;
        bool listed = false;
        for (int j = 0; j < near.n; ++j) listed = listed || near.pair[j] == k;
        n_missed += !listed;
      }
  }
  std::printf("%d %d %d %d\n", n_lists, n_valid, n_near, n_missed);
  return 0;
}
