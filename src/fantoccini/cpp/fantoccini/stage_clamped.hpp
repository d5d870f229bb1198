// Programs of stages whose driven coordinates have bounds, for feedback in real time:
//
//   min sum_i 1/2 x_i^T (J_i^T J_i + diag) x_i + g_i . x_i - c u_{i-1} . u_i + 1/2 |C_i (z_i, u_i)|_W^2 + prices
//   z_{i+1} = A_i z_i + B_u u_i,   z_0 = 0,   lowest(z_i) <= u_i <= highest(z_i)
//
// by an active set: inputs in bounds are bound to laws of the state, the others are the best ones by
// Riccati's recursion (stage_riccati.hpp). Motions are made stage by stage with inputs cut off at their
// bounds, so that each keeps them, as in Tassa, Mansard and Todorov, ICRA 2014. Inputs that are cut off
// are bound in the next iteration, those that pull away from their bound are freed (Hintermueller, Ito
// and Kunisch, SIAM J. Optim. 13, 2002). Only stages up to the last that changes are factorised again,
// within a given number in all: bounds late in the horizon are the first to be left out.
#pragma once

#include <cstring>

#include "stage_dynamics.hpp"
#include "stage_limits.hpp"
#include "stage_riccati.hpp"

namespace fan {

class ClampedStages {
 public:
  StageDynamics dynamics;

  // The best motion found. May throw std::bad_alloc.
  void solve(StageClampArrays& in) {
    in_ = &in;
    read();
    begin_modes();
    in.iterations = in.stages = in.solved = 0;
    in.decrease = 0.0;
    int last = N_ - 1;
    while (true) {
      set_elastic(last);
      set_laws(last);
      ++in.iterations, in.stages += last + 1;
      if (!riccati_.factorise(last)) break;
      riccati_.pull_back(gradient_.data());
      last = std::max(move_on(), last_elastic_change());
      const double cost = cost_of(next_);
      if (cost < -in.decrease) in.decrease = -cost, best_ = next_;
      in.solved = last < 0;
      if (in.solved || in.stages >= in.most_stages) break;
      x_ = next_;
      // What would change later than the work that is left allows stays as it is.
      last = std::min(last, in.most_stages - in.stages - 1);
      std::copy_n(wanted_.begin(), size_t(last + 1) * k_, modes_.begin());
    }
    for (int i = 0; i < N_; ++i) {
      double* u = in.u + size_t(i) * in.n_inputs;
      for (int j = 0; j < in.n_inputs; ++j) u[j] = 0.0;
      for (int j = 0; j < k_; ++j) u[in.inputs[j]] = row_of(best_, i)[n_z_ + j];
    }
  }

 private:
  enum Mode : signed char { kFree, kHigh, kLow };

  // The cost of passing a bound by s rises to its price over a short way.
  static constexpr double ramp = 1e-3;

  // sign value <= limit, value of x_i, less that of x_{i-1} if it is a jump.
  struct Elastic {
    int stage, place;
    bool jumps;
    double sign, limit, stiffness;
  };

  StageClampArrays* in_ = nullptr;
  StageRiccati riccati_;
  int N_ = 0, n_z_ = 0, n_d_ = 0, k_ = 0;
  std::vector<double> g_, gradient_, x_, next_, best_, diagonal_;
  std::vector<Mode> modes_, wanted_;  // (N, k) in force, and as the last motion asks for
  std::vector<StageLaw> later_;
  std::vector<Elastic> elastic_;

  double* row_of(std::vector<double>& a, int i) { return a.data() + size_t(i) * riccati_.ld; }

  // Place of a number of the state in the arrays, which have all inputs.
  int from_z(int a) const {
    const int all = in_->n_inputs, j = a - n_d_;
    if (j < 0) return a;
    return j < k_ ? n_d_ + in_->inputs[j] : n_d_ + all + in_->inputs[j - k_];
  }

  void read() {
    const StageClampArrays& in = *in_;
    StageRiccati& r = riccati_;
    const int all = in.n_inputs, m = in.n_pulls, width = in.n_d + 2 * all;
    if (int(in.N) != N_ || in.k != k_ || in.n_d != n_d_) wanted_.clear();
    N_ = int(in.N), n_d_ = in.n_d, k_ = in.k, n_z_ = n_d_ + 2 * k_;
    r.resize(N_, n_z_, k_, m, in.jerk > 0.0 || in.bounds_jerk, in.n_squares, true);
    const size_t size = size_t(N_) * r.ld;
    for (auto* a : {&g_, &gradient_, &x_, &next_, &best_, &diagonal_}) a->assign(size, 0.0);
    std::vector<int> from(n_z_);
    for (int a = 0; a < n_z_; ++a) from[a] = from_z(a);
    for (int i = 0; i < N_; ++i) {
      const double *g = in.g + size_t(i) * (all + width), *d = in.diagonal + size_t(i) * (all + width);
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
    r.find_bands();
    read_elastic();
  }

  void read_elastic() {
    const StageClampArrays& in = *in_;
    elastic_.clear();
    for (int i = 0; i < N_; ++i) {
      for (int q = 0; q < in.n_joints; ++q) {
        const double value = in.joint[size_t(i) * in.n_joints + q];
        elastic_.push_back({i, in.joint_places[q], false, 1.0, in.joint_high[q] - value, 0.0});
        elastic_.push_back({i, in.joint_places[q], false, -1.0, value - in.joint_low[q], 0.0});
      }
      for (int j = 0; j < k_ && in.bounds_jerk; ++j) {
        const int c = in.inputs[j];
        const double *acc = in.acc + size_t(i) * in.n_inputs + c, most = in.jerk_most[c];
        const double jump = *acc - (i ? acc[-in.n_inputs] : 0.0);
        if (!(most < 1e30)) continue;
        elastic_.push_back({i, n_z_ + j, true, 1.0, most - jump, 0.0});
        elastic_.push_back({i, n_z_ + j, true, -1.0, most + jump, 0.0});
      }
    }
  }

  // The modes of the motion before, as far as there was one.
  void begin_modes() {
    modes_.assign(size_t(N_) * k_, kFree);
    const size_t gone = size_t(std::max(in_->shift, 0)) * k_;
    if (in_->shift >= 0 && gone < wanted_.size()) {
      std::copy(wanted_.begin() + gone, wanted_.end(), modes_.begin());
    }
    wanted_ = modes_;
  }

  // Number and velocity of input j before an interval of a motion.
  void driven_at(int i, int j, const double* before, double& q, double& v) const {
    const int c = in_->inputs[j];
    q = in_->q[size_t(i) * in_->n_inputs + c] + (before ? before[n_d_ + j] : 0.0);
    v = in_->v[size_t(i) * in_->n_inputs + c] + (before ? before[n_d_ + k_ + j] : 0.0);
  }

  // The bounds of the change of input j in interval i.
  void limits(int i, int j, const double* before, DrivenLimit& low, DrivenLimit& high) const {
    const int c = in_->inputs[j];
    double q, v;
    driven_at(i, j, before, q, v);
    const double most = i == N_ - 1 ? in_->last_most[c] : in_->most[c];
    const DrivenBounds bounds{most, in_->speed[c], in_->low[c], in_->high[c]};
    low = bounds.lowest(q, v, in_->h), high = bounds.highest(q, v, in_->h);
    const double acc = in_->acc[size_t(i) * in_->n_inputs + c];
    low.value -= acc, high.value -= acc;
    if (low.value > high.value) low = high;
  }

  // The laws of stages up to `last`; later ones stay.
  void set_laws(int last) {
    const std::vector<int>& first = riccati_.first_law;
    const int begin = last + 1 < N_ ? first[last + 1] : int(riccati_.laws.size());
    later_.assign(riccati_.laws.begin() + begin, riccati_.laws.end());
    riccati_.laws.clear();
    for (int i = 0; i <= last; ++i) {
      riccati_.first_law[i] = int(riccati_.laws.size());
      const double* before = i ? row_of(x_, i - 1) : nullptr;
      for (int j = 0; j < k_; ++j) {
        const Mode mode = modes_[size_t(i) * k_ + j];
        if (mode == kFree) continue;
        DrivenLimit low, high;
        limits(i, j, before, low, high);
        const DrivenLimit& to = mode == kHigh ? high : low;
        const int q = n_d_ + j, v = q + k_;
        const double now = before ? to.by_q * before[q] + to.by_v * before[v] : 0.0;
        riccati_.laws.push_back({j, {q, v}, {to.by_q, to.by_v}, to.value - now});
      }
    }
    const int moved = int(riccati_.laws.size()) - begin;
    riccati_.laws.insert(riccati_.laws.end(), later_.begin(), later_.end());
    for (int i = last + 1; i <= N_; ++i) riccati_.first_law[i] += moved;
  }

  // The next motion and the modes that it asks for; the last stage whose modes change, or -1.
  int move_on() {
    int changes = -1;
    for (int i = 0; i < N_; ++i) {
      double *x = row_of(next_, i), *before = i ? x - riccati_.ld : nullptr;
      riccati_.best_inputs(i, before, x);
      for (int j = 0; j < k_; ++j) {
        DrivenLimit low, high;
        limits(i, j, before, low, high);
        double& u = x[n_z_ + j];
        const double room = 1e-9 * (1.0 + std::fabs(u));
        const Mode was = modes_[size_t(i) * k_ + j];
        Mode& then = wanted_[size_t(i) * k_ + j];
        then = was;
        if (was == kFree) {
          if (u > high.value + room) then = kHigh;
          else if (u < low.value - room) then = kLow;
        } else if (std::fabs(u - (was == kHigh ? high : low).value) > room) {
          changes = i;  // another bound of the same side is in force
        }
        if (then != was) changes = i;
        u = std::min(std::max(u, low.value), high.value);
      }
      for (int l = riccati_.first_law[i]; l < riccati_.first_law[i + 1]; ++l) {
        const size_t at = size_t(i) * k_ + riccati_.laws[l].input;
        const double slope = riccati_.slope(i, l, before, x);
        if ((modes_[at] == kHigh ? slope : -slope) > 1e-9 * in_->unit) wanted_[at] = kFree, changes = i;
      }
      riccati_.moved_on(i, before, x);
    }
    return changes;
  }

  // How far a bound that may be passed is passed by a motion.
  double passed(const Elastic& e, std::vector<double>& x) {
    const double* own = row_of(x, e.stage);
    const double before = e.jumps && e.stage ? own[e.place - riccati_.ld] : 0.0;
    return e.sign * (own[e.place] - before) - e.limit;
  }

  void law_of(double s, double& force, double& stiffness) const {
    const double price = in_->price;
    stiffness = s <= 0.0 ? 0.0 : s < ramp ? price / ramp : price;
    force = s <= 0.0 ? 0.0 : s < ramp ? price * s / ramp : price * (1.0 + s - ramp);
  }

  // Up to where factors change with the stiffness of a bound that may be passed.
  int reach_of(const Elastic& e) const { return std::min(e.stage + 1, N_ - 1); }

  int last_elastic_change() {
    int last = -1;
    for (const Elastic& e : elastic_) {
      double force, stiffness;
      law_of(passed(e, next_), force, stiffness);
      if (stiffness != e.stiffness) last = std::max(last, reach_of(e));
    }
    return last;
  }

  // Gradient and Hessian of what passes bounds, at the motion at hand; the Hessian up to `last`.
  void set_elastic(int last) {
    StageRiccati& r = riccati_;
    gradient_ = g_;
    std::copy(diagonal_.begin(), diagonal_.end(), r.diagonal.begin());
    for (int i = 1; i < N_ && r.coupled; ++i) {
      for (int j = 0; j < k_; ++j) r.D_of(i)[j * r.ld + n_z_ + j] = -in_->jerk;
    }
    for (Elastic& e : elastic_) {
      const double s = passed(e, x_);
      double force, stiffness;
      law_of(s, force, stiffness);
      if (reach_of(e) <= last) e.stiffness = stiffness;
      if (force == 0.0 && e.stiffness == 0.0) continue;
      const double slope = e.sign * (force - e.stiffness * (s + e.limit));
      row_of(gradient_, e.stage)[e.place] += slope;
      row_of(r.diagonal, e.stage)[e.place] += e.stiffness;
      if (!e.jumps || e.stage == 0) continue;
      row_of(gradient_, e.stage - 1)[e.place] -= slope;
      row_of(r.diagonal, e.stage - 1)[e.place] += e.stiffness;
      r.D_of(e.stage)[(e.place - n_z_) * r.ld + e.place] -= e.stiffness;
    }
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
