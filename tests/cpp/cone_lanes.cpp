// The law of contact in a bundle of lanes (cone_lanes.hpp) on random problems, beside the measure of
// the scalar solver (cone_island.hpp).
//
// Every lane has a problem of its own: G = J J^T with fewer columns than rows, so that impulses are
// redundant, some rows at a bound, some contacts left out. The guess is what the scalar solver finds
// for other right sides, as that of a time step is the solution of the step before.
//
// stdout, one number a line with its name: what the Python side asserts.
#include <cstdio>
#include <random>

#include "fantoccini/cone_island.hpp"
#include "fantoccini/cone_lanes.hpp"

namespace {

constexpr int W = 8, S = 4, C = 5, N = S + 3 * C;
using Real = fan::Lanes<W>;
using Cone = fan::ConeLanes<Real, S, C>;
using Mask = Cone::Mask;

struct Problem {
  double G[N][N], b[N], lower[S], upper[S], mu[C], guess[N];
  bool has_single[S], has_contact[C];
};

std::mt19937 generator(7);

double uniform(double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(generator);
}

fan::ConeIsland<N> island;
int row[N];  // of the problem, for each of the island

// Gives the island what takes part of a problem; returns how many rows. `clean`: whether the rest of x
// is 0.
int write(const Problem& p, const double* x, bool& clean) {
  int n = 0, contacts = 0, of[C];
  for (int a = 0; a < S; ++a)
    if (p.has_single[a]) row[n++] = a;
    else clean = clean && x[a] == 0.0;
  const int n_single = n;
  for (int c = 0; c < C; ++c)
    for (int d = 0; d < 3; ++d)
      if (p.has_contact[c]) {
        row[n++] = S + 3 * c + d;
        if (d == 0) of[contacts++] = c;
      } else {
        clean = clean && x[S + 3 * c + d] == 0.0;
      }
  if (n == 0) return 0;
  island.resize(n_single, contacts);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) island.G[i * island.stride + j] = p.G[row[i]][row[j]];
    island.b[i] = p.b[row[i]];
    island.lower[i] = row[i] < S ? p.lower[row[i]] : 0.0;
    island.upper[i] = row[i] < S ? p.upper[row[i]] : 1e3;
    island.x[i] = 0.0;
  }
  for (int c = 0; c < contacts; ++c) island.mu[c] = p.mu[of[c]];
  return n;
}

// The residual by the scalar solver's measure, and whether what takes no part is 0.
double residual(const Problem& p, const double* x, bool& clean) {
  const int n = write(p, x, clean);
  if (n == 0) return 0.0;
  island.solve();  // sets its weights
  for (int i = 0; i < n; ++i) island.x[i] = x[row[i]];
  island.measure();
  return island.residual;
}

void take_guess(Problem& out) {
  const double nothing[N] = {};
  bool clean = true;
  const int n = write(out, nothing, clean);
  for (int i = 0; i < n; ++i) island.b[i] *= 1.0 + 0.02 * uniform(-1, 1);
  if (n > 0) island.solve();
  for (int i = 0; i < n; ++i) out.guess[row[i]] = island.x[i];
}

Problem made(int kind) {
  Problem out{};
  const int columns = 4 + int(uniform(0, N));
  double J[N][2 * N];
  for (int i = 0; i < N; ++i)
    for (int k = 0; k < columns; ++k) J[i][k] = uniform(-1, 1);
  // Contacts of one body: the next one's rows are like this one's.
  for (int i = S + 3; i < N && kind % 3 == 0; ++i)
    for (int k = 0; k < columns; ++k) J[i][k] = J[i - 3][k] + 0.2 * J[i][k] * (i % 3 == 0);
  for (int i = 0; i < N; ++i)
    for (int j = 0; j < N; ++j)
      for (int k = 0; k < columns; ++k) out.G[i][j] += J[i][k] * J[j][k];
  double v[2 * N];
  for (double& x : v) x = uniform(-1, 1);
  // What velocities cause, so that the gaps can close.
  for (int i = 0; i < N; ++i)
    for (int k = 0; k < columns; ++k) out.b[i] += J[i][k] * v[k];
  for (int i = 0; i < S; ++i) {
    out.lower[i] = kind % 4 == 1 && i == 0 ? -1e3 : 0.0;
    out.upper[i] = kind % 2 == 1 && i == 1 ? 0.02 : 1e3;
    out.has_single[i] = uniform(0, 1) < 0.7;
  }
  for (int c = 0; c < C; ++c) {
    out.mu[c] = kind % 5 == 4 ? 0.0 : uniform(0.1, 0.5);
    out.has_contact[c] = uniform(0, 1) < 0.7;
  }
  take_guess(out);
  return out;
}

struct Found {
  bool solved[W];
  double x[W][N], residual[W];
};

Cone cone;
Real singles[S * S];
fan::Triple<Real> across[C][S], blocks[C][C][3];

// Lane l has problem who[l].
Found solved(const Problem* problems, const int* who) {
  for (int l = 0; l < W; ++l) {
    const Problem& p = problems[who[l]];
    for (int a = 0; a < S; ++a)
      for (int b = 0; b < S; ++b) singles[a * S + b][l] = p.G[a][b];
    for (int i = 0; i < C; ++i)
      for (int d = 0; d < 3; ++d) {
        for (int a = 0; a < S; ++a) across[i][a].of[d][l] = p.G[S + 3 * i + d][a];
        for (int j = 0; j <= i; ++j)
          for (int e = 0; e < 3; ++e)
            blocks[i][j][d].of[e][l] = p.G[S + 3 * i + d][S + 3 * j + e];
      }
    for (int a = 0; a < S; ++a) {
      cone.b_single[a][l] = p.b[a];
      cone.lower[a][l] = p.lower[a];
      cone.upper[a][l] = p.upper[a];
      cone.x_single[a][l] = p.guess[a];
    }
    for (int i = 0; i < C; ++i) {
      cone.mu[i][l] = p.mu[i];
      for (int d = 0; d < 3; ++d) {
        cone.b[3 * i + d][l] = p.b[S + 3 * i + d];
        cone.x[3 * i + d][l] = p.guess[S + 3 * i + d];
      }
    }
  }
  const auto mask = [&](auto has) {
    Real out = Real(0.0);
    for (int l = 0; l < W; ++l) out[l] = has(problems[who[l]]) ? 1.0 : 0.0;
    return out > Real(0.5);
  };
  cone.n_single = S;
  cone.n_contacts = C;
  cone.most = Real(1e3);
  for (int a = 0; a < S; ++a) {
    cone.single[a] = a;
    cone.has_single[a] = mask([&](const Problem& p) { return p.has_single[a]; });
  }
  for (int i = 0; i < C; ++i) {
    cone.contact[i] = i;
    cone.has_contact[i] = mask([&](const Problem& p) { return p.has_contact[i]; });
  }
  const fan::LaneMatrix<Real, S, C> G{singles, S, across, blocks};
  const Mask done = cone.solve(G, mask([](const Problem&) { return true; }));
  Found out;
  for (int l = 0; l < W; ++l) {
    out.solved[l] = done[l];
    out.residual[l] = cone.residual[l];
    for (int a = 0; a < S; ++a) out.x[l][a] = cone.x_single[a][l];
    for (int i = 0; i < 3 * C; ++i) out.x[l][S + i] = cone.x[i][l];
  }
  return out;
}

}  // namespace

int main() {
  int n_solved = 0, n_all = 0, bits_apart = 0, unclean = 0, slid = 0;
  double worst = 0.0;
  for (int bundle = 0; bundle < 300; ++bundle) {
    Problem problems[2 * W];
    for (int l = 0; l < 2 * W; ++l) problems[l] = made(bundle * W + l);
    int in_order[W], turned[W], with_others[W], alike[W];
    for (int l = 0; l < W; ++l) {
      in_order[l] = l;
      turned[l] = (3 * l + 5) % W;
      with_others[l] = l % 2 == 0 ? l : W + l;
      alike[l] = bundle % W;
    }
    const Found found = solved(problems, in_order);
    for (const int* who : {turned, with_others, alike}) {
      const Found other = solved(problems, who);
      for (int l = 0; l < W; ++l) {
        if (who[l] >= W) continue;
        const int own = who[l];
        bits_apart += found.solved[own] != other.solved[l];
        if (found.solved[own])
          for (int i = 0; i < N; ++i) bits_apart += found.x[own][i] != other.x[l][i];
      }
    }
    for (int l = 0; l < W; ++l) {
      ++n_all;
      if (!found.solved[l]) continue;
      ++n_solved;
      bool clean = true;
      const double of = residual(problems[l], found.x[l], clean);
      if (!(of <= worst)) worst = of;
      unclean += !clean;
      for (int c = 0; c < C; ++c) {
        const double* x = found.x[l] + S + 3 * c;
        const double size = sqrt(x[1] * x[1] + x[2] * x[2]), most = problems[l].mu[c] * x[0];
        slid += size > 0.0 && size > most * (1.0 - 1e-9);
      }
    }
  }
  std::printf("share_solved %g\nresidual %.3e\n", double(n_solved) / n_all, worst);
  std::printf("bits_apart %d\nunclean %d\nslid %d\n", bits_apart, unclean, slid);
  return 0;
}
