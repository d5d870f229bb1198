// Programs of stages with bounds of the driven coordinates, for feedback in real time:
//
//   min sum_i 1/2 x_i^T (J_i^T J_i + diag) x_i + g_i . x_i - c u_{i-1} . u_i + 1/2 |C_i (z_i,
//   u_i)|_W^2 + prices z_{i+1} = A_i z_i + B_u u_i,   z_0 = 0,   lowest(z_i) <= u_i <= highest(z_i)
//
// by Newton's method with an active set, as in Tassa, Mansard and Todorov, ICRA 2014: Riccati's
// recursion (stage_riccati.hpp) decides at every stage which inputs are at bounds there and binds
// them to laws of the state; the motion is then computed stage by stage, with inputs clipped to
// their bounds. Every motion thus keeps them, and the search may end after any. Later iterations
// factorise from the last stage on whose inputs at bounds change, within a given total number of
// stages: bounds late in the horizon are the first to be left out.
#pragma once

#include <cstring>

#include "fantoccini/search/stage_dynamics.hpp"
#include "fantoccini/search/stage_limits.hpp"
#include "fantoccini/search/stage_riccati.hpp"

namespace fan {

class ClampedStages {
 public:
  StageDynamics dynamics;

  // Finds the best motion. May throw std::bad_alloc.
  void solve(StageClampArrays& in) {
    in_ = &in;
    read();
    begin_modes();
    in.iterations = in.stages = in.solved = 0;
    in.decrease = 0.0;
    bool careful = false;
    while (in.stages < in.most_stages) {
      if (!pull_back(careful)) break;
      find_steps();
      const double before = in.decrease;
      double share = 1.0;
      for (; share > least_share && in.decrease == before && !in.solved; share *= 0.3) {
        in.solved = move_on(share);
        const double cost = cost_of(next_);
        if (cost < -in.decrease) in.decrease = -cost, best_ = next_;
      }
      if (in.solved || (careful && in.decrease - before <= enough * in.decrease)) break;
      careful = share < 0.3;  // a full step has not decreased the cost
      x_ = best_;
    }
    for (int i = 0; i < N_; ++i) {
      double* u = in.u + size_t(i) * in.n_inputs;
      for (int j = 0; j < in.n_inputs; ++j) u[j] = 0.0;
      for (int j = 0; j < k_; ++j) u[in.inputs[j]] = row_of(best_, i)[n_z_ + j];
    }
  }

 private:
  enum Mode : signed char { kFree, kHigh, kLow };

  // The price of violating a joint's bound is reached slightly beyond it [rad or m].
  static constexpr double ramp = 1e-3;

  static constexpr double least_share = 1e-3;

  // Relative decrease of the cost that ends the search.
  static constexpr double enough = 1e-7;

  // sign x_i[place] <= limit, and the active piece of its price's law.
  struct Elastic {
    int stage, place;
    double sign, limit;
    int piece, wanted;
  };

  StageClampArrays* in_ = nullptr;
  StageRiccati riccati_;
  int N_ = 0, n_z_ = 0, n_d_ = 0, k_ = 0;
  std::vector<double> g_, gradient_, x_, next_, best_, steps_, diagonal_, pulled_;
  std::vector<double> slope_, u_, root_, half_;
  std::vector<int> free_;
  std::vector<DrivenLimit> low_, high_;  // (k,) of the current stage
  std::vector<Mode> modes_, wanted_;     // (N, k) bounds that inputs are at, and are to be at
  std::vector<char> wrong_;              // (N,) whether they differ
  std::vector<Elastic> elastic_;

  double* row_of(std::vector<double>& a, int i) { return a.data() + size_t(i) * riccati_.ld; }

  // Index of a number of the state in the arrays, which have all inputs.
  int from_z(int a) const {
    const int all = in_->n_inputs, j = a - n_d_;
    if (j < 0) return a;
    return j < k_ ? n_d_ + in_->inputs[j] : n_d_ + all + in_->inputs[j - k_];
  }

  void read() {
    const StageClampArrays& in = *in_;
    StageRiccati& r = riccati_;
    const int all = in.n_inputs, m = in.n_pulls, width = in.n_d + 2 * all;
    if (int(in.N) != N_ || in.k != k_ || in.n_d != n_d_) modes_.clear();
    N_ = int(in.N), n_d_ = in.n_d, k_ = in.k, n_z_ = n_d_ + 2 * k_;
    r.resize(N_, n_z_, k_, m, in.jerk > 0.0, in.n_squares, true);
    const size_t size = size_t(N_) * r.ld;
    for (auto* a : {&g_, &gradient_, &x_, &next_, &best_, &steps_, &diagonal_})
      a->assign(size, 0.0);
    for (auto* a : {&slope_, &u_, &half_}) a->assign(k_, 0.0);
    root_.assign(size_t(k_) * k_, 0.0), free_.assign(k_, 0);
    low_.resize(k_), high_.resize(k_);
    std::vector<int> from(n_z_);
    for (int a = 0; a < n_z_; ++a) from[a] = from_z(a);
    for (int i = 0; i < N_; ++i) {
      const double *g = in.g + size_t(i) * (all + width),
                   *d = in.diagonal + size_t(i) * (all + width);
      for (int a = 0; a < n_z_; ++a) {
        row_of(g_, i)[a] = g[all + from[a]], row_of(diagonal_, i)[a] = d[all + from[a]];
      }
      for (int j = 0; j < k_; ++j) {
        row_of(g_, i)[n_z_ + j] = g[in.inputs[j]], row_of(diagonal_, i)[n_z_ + j] = d[in.inputs[j]];
      }
      for (int q = 0; q < in.n_squares; ++q) {
        const double* J = in.squares + (size_t(i) * in.n_squares + q) * width;
        double* to = r.squares_of(i) + size_t(q) * r.ld;
        for (int a = 0; a < n_z_; ++a) to[a] = J[from[a]];
      }
      for (int q = 0; q < m; ++q) {
        const double* C = in.pulls + (size_t(i) * m + q) * (width + all);
        for (int a = 0; a < n_z_ && i; ++a) r.C_of(i)[q * r.ld + a] = C[from[a]];
        for (int j = 0; j < k_; ++j) r.Cu_of(i)[q * r.ld_k + j] = C[width + in.inputs[j]];
        r.weight[size_t(i) * m + q] = in.pull_weight[size_t(i) * m + q];
      }
      const double* K = in.driven.first + i * in.driven.stride;
      for (int a = 0; a < n_z_; ++a) {
        const double* row = a < n_d_ ? dynamics.row(i, a) : K + (from[a] - n_d_) * 3 * all - n_d_;
        double* to = r.M_of(i) + a * r.ld;
        for (int b = a < n_d_ ? 0 : n_d_; b < n_z_; ++b) to[b] = row[from[b]];
        for (int j = 0; j < k_; ++j) to[n_z_ + j] = row[width + in.inputs[j]];
      }
    }
    for (int i = 1; i < N_ && r.coupled; ++i) {
      for (int j = 0; j < k_; ++j) r.D_of(i)[j * r.ld + n_z_ + j] = -in.jerk;
    }
    r.find_bands();
    read_elastic();
  }

  void read_elastic() {
    const StageClampArrays& in = *in_;
    elastic_.clear();
    for (int i = 0; i < N_; ++i) {
      for (int q = 0; q < in.n_joints; ++q) {
        const double value = in.joint[size_t(i) * in.n_joints + q];
        elastic_.push_back({i, in.joint_places[q], 1.0, in.joint_high[q] - value, 0, 0});
        elastic_.push_back({i, in.joint_places[q], -1.0, value - in.joint_low[q], 0, 0});
      }
    }
  }

  // The modes of the previous motion, as far as there is one.
  void begin_modes() {
    const size_t all = size_t(N_) * k_, gone = std::min(all, size_t(std::max(in_->shift, 0)) * k_);
    if (in_->shift < 0 || modes_.size() != all) modes_.assign(all, kFree);
    modes_.erase(modes_.begin(), modes_.begin() + gone);
    modes_.resize(all, kFree);
    wanted_ = modes_, wrong_.assign(N_, 0);
  }

  // The bounds of changes of the inputs in interval i.
  void limits(int i, const double* before) {
    const size_t row = size_t(i) * in_->n_inputs;
    for (int j = 0; j < k_; ++j) {
      const int c = in_->inputs[j];
      const double q = in_->q[row + c] + (before ? before[n_d_ + j] : 0.0);
      const double v = in_->v[row + c] + (before ? before[n_d_ + k_ + j] : 0.0);
      const double most = i == N_ - 1 ? in_->last_most[c] : in_->most[c];
      const DrivenBounds bounds{most, in_->speed[c], in_->low[c], in_->high[c]};
      low_[j] = bounds.lowest(q, v, in_->h), high_[j] = bounds.highest(q, v, in_->h);
      low_[j].value -= in_->acc[row + c], high_[j].value -= in_->acc[row + c];
      if (low_[j].value > high_[j].value) low_[j] = high_[j];
    }
  }

  // Computes the laws of stages up to `last`; later ones are unchanged. They are feedback laws
  // around the current motion. Inputs at bounds are those required by the previous motion or, if
  // `careful`, the best at every stage of this one. Returns false if there are no laws.
  bool pull_back(bool careful) {
    StageRiccati& r = riccati_;
    StageClampArrays& in = *in_;
    const bool first = in.iterations == 0;
    const int n_stages = in.most_stages - in.stages,
              last = set_elastic(careful || first, first ? N_ : n_stages);
    bool anew = false;
    ++in.iterations, in.stages += N_ / 10;
    for (int i = N_ - 1; i >= 0; --i) {
      const double *x = row_of(x_, i), *before = i ? x - r.ld : nullptr;
      limits(i, before);
      anew = anew || first || i <= last;
      if (!anew) {
        pulled_ = r.from_later;
        r.stage_gradient(i, gradient_.data());
        r.state_gradient(i);
        if (i >= n_stages || (careful ? holds(i, before) : keeps(i))) continue;
        anew = true;
        r.from_later = pulled_;
      }
      ++in.stages;
      if (i == N_ - 1) r.begin();
      r.stage_gradient(i, gradient_.data());
      r.gather(i);
      if (careful) choose(i, before, x);
      else std::copy_n(wanted_.begin() + size_t(i) * k_, k_, modes_.begin() + size_t(i) * k_);
      bind(i, before);
      if (!r.eliminate(i)) return false;
      r.state_gradient(i);
    }
    return true;
  }

  // Whether the inputs at bounds are the right ones at a state.
  bool holds(int i, const double* before) {
    double* u = next_.data();
    riccati_.best_inputs(i, before, u);
    return is_right(i, before, u);
  }

  // The same for inputs in x; requests the right ones.
  bool is_right(int i, const double* before, const double* x) {
    const Mode* modes = modes_.data() + size_t(i) * k_;
    Mode* wanted = wanted_.data() + size_t(i) * k_;
    bool right = true;
    for (int j = 0; j < k_; ++j) {
      const double u = x[n_z_ + j], rounding = 1e-9 * (1.0 + std::fabs(u));
      wanted[j] = modes[j];
      if (modes[j] == kFree) {
        if (u > high_[j].value + rounding) wanted[j] = kHigh;
        else if (u < low_[j].value - rounding) wanted[j] = kLow;
        right = right && wanted[j] == kFree;
      } else {
        right = right && std::fabs(u - (modes[j] == kHigh ? high_ : low_)[j].value) <= rounding;
      }
    }
    for (int l = 0; l < riccati_.n_laws[i]; ++l) {
      const int j = riccati_.laws[size_t(i) * k_ + l].input;
      const double slope = riccati_.slope(i, l, before, x);
      if ((modes[j] == kHigh ? slope : -slope) > 1e-9 * in_->unit) wanted[j] = kFree, right = false;
    }
    wrong_[i] = !right;
    return right;
  }

  // Whether the last motion requests no other inputs at bounds.
  bool keeps(int i) const { return !wrong_[i]; }

  // The best inputs at bounds at a state if later ones are: min 1/2 u^T L u + slope . u.
  void choose(int i, const double* before, const double* x) {
    StageRiccati& r = riccati_;
    const double *L = r.hessian_of(i), *Y = r.gain_root(i), *y = r.y_of(i);
    Mode* modes = modes_.data() + size_t(i) * k_;
    for (int j = 0; j < k_; ++j) {
      slope_[j] = y[j] + (before ? dot(Y + j * r.ld, before, r.ld) : 0.0);
      u_[j] = x[n_z_ + j];
    }
    for (int turn = 0; turn < 40; ++turn) {
      solve_free(L, modes);
      bool changes = false;
      for (int j = k_ - 1; j >= 0; --j) {
        double slope = slope_[j];
        for (int b = 0; b < k_; ++b) slope += r.entry(L, j, b) * u_[b];
        const Mode was = modes[j];
        if (was == kFree) {
          if (u_[j] > high_[j].value) modes[j] = kHigh;
          else if (u_[j] < low_[j].value) modes[j] = kLow;
        } else if ((was == kHigh ? slope : -slope) > 0.0) {
          modes[j] = kFree;
        }
        changes = changes || modes[j] != was;
        // Changing one at a time terminates (Murty, Math. Program. 7, 1974).
        if (changes && turn > 8) break;
      }
      if (!changes) break;
    }
  }

  // The laws of the inputs at bounds.
  void bind(int i, const double* before) {
    StageRiccati& r = riccati_;
    const Mode* modes = modes_.data() + size_t(i) * k_;
    int n = 0;
    for (int j = 0; j < k_; ++j) {
      if (modes[j] == kFree) continue;
      const DrivenLimit& to = modes[j] == kHigh ? high_[j] : low_[j];
      const int q = n_d_ + j, v = q + k_;
      const double now = before ? to.by_q * before[q] + to.by_v * before[v] : 0.0;
      r.laws[size_t(i) * k_ + n++] = {j, {q, v}, {to.by_q, to.by_v}, to.value - now};
    }
    r.n_laws[i] = n;
  }

  // Sets u_: inputs at bounds to their bounds, the others to the best.
  void solve_free(const double* L, const Mode* modes) {
    int n = 0;
    for (int j = 0; j < k_; ++j) {
      if (modes[j] == kFree) free_[n++] = j;
      else u_[j] = (modes[j] == kHigh ? high_[j] : low_[j]).value;
    }
    for (int a = 0; a < n; ++a) {
      double* row = root_.data() + size_t(a) * k_;
      double sum = -slope_[free_[a]];
      for (int j = 0; j < k_; ++j) {
        if (modes[j] != kFree) sum -= riccati_.entry(L, free_[a], j) * u_[j];
      }
      for (int b = 0; b <= a; ++b) {
        double value = riccati_.entry(L, free_[a], free_[b]);
        const double* other = root_.data() + size_t(b) * k_;
        for (int c = 0; c < b; ++c) value -= row[c] * other[c];
        row[b] = b < a ? value / other[b] : std::sqrt(value);
        if (b < a) sum -= row[b] * half_[b];
      }
      half_[a] = sum / row[a];
    }
    for (int a = n - 1; a >= 0; --a) {
      double sum = half_[a];
      for (int b = a + 1; b < n; ++b) sum -= root_[size_t(b) * k_ + a] * u_[free_[b]];
      u_[free_[a]] = sum / root_[size_t(a) * (k_ + 1)];
    }
  }

  // Inputs by the laws at the current motion, less its own.
  void find_steps() {
    for (int i = 0; i < N_; ++i) {
      const double *x = row_of(x_, i), *before = i ? x - riccati_.ld : nullptr;
      double* step = row_of(steps_, i);
      riccati_.best_inputs(i, before, step);
      for (int j = n_z_; j < n_z_ + k_; ++j) step[j] -= x[j];
    }
  }

  // Computes the next motion, by a share of the steps. Returns whether no bound acts except those
  // of the laws.
  bool move_on(double share) {
    bool right = true;
    for (int i = 0; i < N_; ++i) {
      double *x = row_of(next_, i), *before = i ? x - riccati_.ld : nullptr;
      riccati_.best_inputs(i, before, x);
      limits(i, before);
      right = (share < 1.0 || is_right(i, before, x)) && right;
      for (int j = 0; j < k_; ++j) {
        const double u = x[n_z_ + j] - (1.0 - share) * row_of(steps_, i)[n_z_ + j];
        x[n_z_ + j] = std::min(std::max(u, low_[j].value), high_[j].value);
      }
      riccati_.propagate(i, before, x);
    }
    return share == 1.0 && !elastic_changes() && right;
  }

  // Violation of a soft bound by a motion.
  double passed(const Elastic& e, std::vector<double>& x) {
    return e.sign * row_of(x, e.stage)[e.place] - e.limit;
  }

  // Active piece of the price's law: none, the ramp, or beyond it.
  static int piece_of(double s) { return s <= 0.0 ? 0 : s < ramp ? 1 : 2; }

  bool elastic_changes() {
    bool changes = false;
    for (Elastic& e : elastic_) {
      e.wanted = piece_of(passed(e, next_));
      changes = changes || e.wanted != e.piece;
    }
    return changes;
  }

  // Gradient and Hessian of soft bounds: with the pieces active at the current motion if `careful`,
  // else those next to the previous ones in the direction of the last full step; up to the stage
  // where factors change.
  int set_elastic(bool careful, int n_stages) {
    StageRiccati& r = riccati_;
    int last = -1;
    gradient_ = g_;
    std::copy(diagonal_.begin(), diagonal_.end(), r.diagonal.begin());
    const double price = in_->price;
    for (Elastic& e : elastic_) {
      const int to = e.piece < e.wanted ? e.piece + 1 : e.piece > e.wanted ? e.piece - 1 : e.piece;
      const int piece = careful ? piece_of(passed(e, x_)) : to;
      const int reach = std::min(e.stage + 1, N_ - 1);
      if (piece != e.piece && reach < n_stages) e.piece = piece, last = std::max(last, reach);
      if (e.piece == 0) continue;
      const double stiffness = e.piece == 1 ? price / ramp : price;
      const double at_zero = e.piece == 1 ? 0.0 : price * (1.0 - ramp);
      const double slope = e.sign * (at_zero - stiffness * e.limit);
      row_of(gradient_, e.stage)[e.place] += slope;
      row_of(r.diagonal, e.stage)[e.place] += stiffness;
    }
    return last;
  }

  // The cost of a motion less that of no change.
  double cost_of(std::vector<double>& x) {
    StageRiccati& r = riccati_;
    double sum = 0.0;
    for (int i = 0; i < N_; ++i) {
      const double *own = row_of(x, i), *d = row_of(diagonal_, i), *g = row_of(g_, i);
      for (int a = 0; a < r.n_x; ++a) sum += own[a] * (g[a] + 0.5 * d[a] * own[a]);
      for (int q = 0; q < r.n_squares; ++q) {
        const double value = dot(r.squares_of(i) + size_t(q) * r.ld, own, r.ld);
        sum += 0.5 * value * value;
      }
      for (int j = n_z_; j < r.n_x && i; ++j) sum -= in_->jerk * own[j] * own[j - r.ld];
      for (int q = 0; q < r.m; ++q) {
        double value = i ? dot(r.C_of(i) + q * r.ld, own - r.ld, r.ld) : 0.0;
        for (int j = 0; j < k_; ++j) value += r.Cu_of(i)[q * r.ld_k + j] * own[n_z_ + j];
        sum += 0.5 * r.weight[size_t(i) * r.m + q] * value * value;
      }
    }
    for (const Elastic& e : elastic_) {
      sum += price_of(passed(e, x)) - price_of(-e.limit);
    }
    return sum;
  }

  double price_of(double s) const {
    if (s <= 0.0) return 0.0;
    if (s < ramp) return 0.5 * in_->price * s * s / ramp;
    const double more = s - ramp;
    return in_->price * (0.5 * ramp + more + 0.5 * more * more);
  }
};

}  // namespace fan
