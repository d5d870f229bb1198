// The hanging pose nearest to given places:
//
//   min over u of 1/2 sum_i w_i |place_i(q_D, q_K, p) - target_i|^2,
//   q_D and T hang by u (hanging.hpp),
//   low <= u <= high,   T_low <= T <= T_high where a row pulls,   h <= 0 where it does not,
//   low <= q_D <= high
//
// by Gauss-Newton steps within the linearised bounds (solvers/bounded_step.hpp), with
// Levenberg-Marquardt damping. After each step Newton's method restores equilibrium. Where a bound
// of a row stops the step, the row begins to pull or goes slack, if it may, and the search
// continues. If nothing helps, slack strings are wound in first: loose strings move nothing. Every
// pose starts from the earlier one whose place is nearest: on a path, the last.
#pragma once

#include <cmath>
#include <cstring>

#include "fantoccini/search/hanging.hpp"
#include "fantoccini/search/reach_cost.hpp"
#include "fantoccini/search/reach_poses.hpp"
#include "fantoccini/solvers/bounded_step.hpp"

namespace fan {

struct ReachTolerances {
  static constexpr double first_damping = 1e-8;  // of the steps, relative to the largest curvature
  static constexpr double least_damping = 1e-12;
  static constexpr double most_damping = 1e8;
  static constexpr double first_step = 0.1;  // first limit of steps of u [m or rad]
  static constexpr double little = 1e-3;     // relative decrease of the cost by a path's next step,
  static constexpr double hangs = 1e-3;      // and move towards equilibrium, at which it ends
  static constexpr double damping_ahead = 1e-4;  // of steps along paths
  static constexpr double max_turn = 0.5;        // of the pose [m or rad]
  static constexpr double least_gain = 1e-3;     // of a step, in tolerances: else it is nearest
  static constexpr double at_bound = 1e-7;       // relative tension, or gap, of a row on the edge
  static constexpr double passed = 1e-6;  // violation of bounds: relative tension, gap or joint
  static constexpr double push = 0.02;    // shortening of strings for a wider search [m]
  static constexpr int changes = 3;       // of one row during a search
  static constexpr int rounds = 30;       // of bounds that join
};

template <class Model>
class Reach {
 public:
  using Tolerance = ReachTolerances;
  using Hang = Hanging<Model>;
  static constexpr int N = Hang::N, K = Hang::K, P = Hang::P, M = Hang::M, U = Hang::U;
  static constexpr int NQ = Hang::NQ, KQ = Hang::KQ, NP = Hang::NP;

  void find(const ReachArrays& given) {
    in = poses_.in = cost_.in = &given;
    hang_.weight = in->weight;
    hang_.may_change = in->may_change;
    n_ = 0;
    for (int u = 0; u < U; ++u)
      if (in->moved[u]) chosen_[n_++] = u;
    begin();
    const bool hangs = hang_.balance();
    const auto first = hang_.at;
    for (long long i = 0; i < in->n; ++i) {
      if (!hangs) {
        write(i, int(ReachEnd::LOST), 0);
        continue;
      }
      const long long near = in->single_pass ? i - 1 : poses_.nearest(i);
      if (near >= 0 && near != i - 1) {
        poses_.read(near, hang_.at);
        if (!hang_.balance()) hang_at(first);
      }
      int count = 0;
      if (in->single_pass) {
        const int end = along(i, count);
        write(i, end, count);
        continue;
      }
      int end = search(i, count);
      if (end != int(ReachEnd::REACHED) && i > 0) {  // again from the start
        const auto kept = hang_.at;
        const double before = cost_.value;
        hang_at(first);
        end = search(i, count);
        if (cost_.value > before) end = again(kept, i, count);
      }
      if (end == int(ReachEnd::NEAREST)) end = pushed(i, end, count);
      write(i, end, count);
    }
  }

 private:
  bool hang_at(const typename Hang::Pose& pose) {
    hang_.at = pose;
    return hang_.balance();
  }

  // Continues from an equilibrium pose.
  int again(const typename Hang::Pose& from, long long i, int& count) {
    hang_at(from);
    return search(i, count);
  }

  // A limb that hangs straight first moves perpendicular to its string: the search is repeated with
  // all strings shorter, and the better pose kept.
  int pushed(long long i, int end, int& count) {
    const auto kept = hang_.at;
    const double before = cost_.value;
    bool any_shortened = false;
    for (int j = 0; j < M; ++j) {
      const int v = in->lengths[j];
      if (v < 0 || !in->moved[v]) continue;
      double& length = hang_.at.q_K[driven_q_[v]];
      const double shorter = length - Tolerance::push + (hang_.at.held[j] ? 0.0 : hang_.h[j]);
      if (shorter < in->low[v] || shorter > in->high[v]) continue;
      length = shorter;
      any_shortened = true;
    }
    if (!any_shortened) return end;
    if (hang_.balance()) {
      const int other = search(i, count);
      if (cost_.value < before && passed_ <= Tolerance::passed) return other;
    }
    return again(kept, i, count);
  }

  void begin() {
    auto& at = hang_.at;
    std::memcpy(at.q_D, in->q_D, NQ * sizeof(double));
    std::memcpy(at.q_K, in->q_K, KQ * sizeof(double));
    std::memcpy(at.p, in->p, P * sizeof(double));
    for (int j = 0; j < M; ++j) {
      at.held[j] = in->held[j];
      at.tension[j] = in->held[j] ? in->tension[j] : 0.0;
    }
    scalars<typename Model::Dynamic>(joint_q_, N);
    scalars<typename Model::Driven>(driven_q_, K);
    cost_.joint_q = joint_q_;
    cost_.driven_q = driven_q_;
  }

  // Indices in q of scalars, by velocity; -1 for rotations.
  template <class Space>
  static void scalars(int* place, int n) {
    for (int k = 0; k < n; ++k) place[k] = -1;
    for (int i = 0; i < Space::n_scalars; ++i) place[Space::scalar_v[i]] = Space::scalar_q[i];
  }

  // ReachEnd of the next pose of a path: full steps in which the puppet is in equilibrium only to
  // first order. Equilibrium is restored at the end; if that fails, by search().
  int along(long long i, int& count) {
    const auto kept = hang_.at;
    int changes[array_size(M)] = {}, end = int(ReachEnd::STALLED);
    longest_ = Tolerance::first_step;
    evaluate(i);
    const double before = cost_.value;
    ahead_ = true;
    for (int taken = 0; taken < in->max_iterations && end == int(ReachEnd::STALLED); ++taken) {
      if (!hang_.aim()) break;
      hang_.differentiate(chosen_, n_);
      cost_.evaluate(i, chosen_, n_, hang_.move);
      if (!step(Tolerance::damping_ahead)) break;
      ++count;
      double off = 0.0;
      for (int k = 0; k < N; ++k) off = maximum(fabs(hang_.move[k]), off);
      const bool little =
          predicted_decrease() < Tolerance::little * cost_.value && off < Tolerance::hangs;
      const double size = advance();
      if ((!flip(changes) && size < in->tolerance) || little) end = int(ReachEnd::NEAREST);
    }
    ahead_ = false;
    const bool hangs = hang_.balance();
    if (hangs) {
      evaluate(i);
      passed_ = passed();
    }
    if (!hangs || cost_.value > before) {  // the steps diverged
      if (hang_at(kept)) return search(i, count);
      hang_.at = kept;  // on the edge of equilibrium: the earlier pose is kept
      return int(ReachEnd::TIPS);
    }
    return is_there() ? int(ReachEnd::REACHED) : end;
  }

  // Whether the places are reached within the bounds.
  bool is_there() const {
    return cost_.apart <= in->tolerance * in->tolerance && passed_ <= Tolerance::passed;
  }

  // Makes the step, on paths together with the move towards equilibrium, or part of a long one.
  // Returns its length.
  double advance() {
    auto& at = hang_.at;
    double pose[NP], driven[array_size(K)] = {}, most = 0.0, turn = 0.0;
    for (int k = 0; k < NP; ++k) pose[k] = ahead_ && k < N ? hang_.move[k] : 0.0;
    for (int a = 0; a < n_; ++a) {
      most = maximum(fabs(qp_.d[a]), most);
      for (int k = 0; k < N; ++k) pose[k] += hang_.by_u[chosen_[a] * NP + k] * qp_.d[a];
    }
    for (int k = 0; k < N; ++k) turn = maximum(fabs(pose[k]), turn);
    const double share = 1.0 / maximum(1.0, maximum(most / longest_, turn / Tolerance::max_turn));
    at_longest_ = most >= longest_;
    for (int j = 0; j < M; ++j) {
      if (!at.held[j]) continue;
      double change = ahead_ ? hang_.row_move[j] : 0.0;
      for (int a = 0; a < n_; ++a) change += hang_.row_by_u[chosen_[a] * M + j] * qp_.d[a];
      at.tension[j] += share * change;
    }
    for (int a = 0; a < n_; ++a) {
      const int u = chosen_[a];
      if (u < K) driven[u] = qp_.d[a];
      else at.p[u - K] += share * qp_.d[a];
    }
    retract<typename Model::Dynamic>(at.q_D, pose, share, at.q_D);
    retract<typename Model::Driven>(at.q_K, driven, share, at.q_K);
    return maximum(most, turn);
  }

  // Makes the row whose bound stops the step most pull or go slack. Returns whether there is one.
  bool flip(int* changes) {
    int worst = -1;
    double most = 0.0;
    for (int j = 0; j < M; ++j) {
      const double x = price_[U + j];
      const bool held = hang_.at.held[j];
      if (!in->may_change[j] || changes[j] >= Tolerance::changes) continue;
      if (held ? !(x < 0.0 && in->tension_low[j] <= 0.0) : !(x > 0.0)) continue;
      const double size = held ? -x * in->weight : x;
      if (size > most) most = size, worst = j;
    }
    if (worst < 0) return false;
    ++changes[worst];
    hang_.at.held[worst] = !hang_.at.held[worst];
    hang_.at.tension[worst] = 0.0;
    return true;
  }

  // ReachEnd of one pose, starting from the end of the last, an equilibrium.
  int search(long long i, int& count) {
    double damping = Tolerance::first_damping;
    int changes[array_size(M)] = {}, end = int(ReachEnd::STALLED), taken = 0;
    bool fresh = true, tightened = false;
    longest_ = Tolerance::first_step;
    for (; taken < in->max_iterations; ++taken) {
      if (fresh) {
        evaluate(i);
        passed_ = passed();
      }
      fresh = false;
      if (is_there()) {
        end = int(ReachEnd::REACHED);
        for (double& x : price_) x = 0.0;
        break;
      }
      const bool feasible = step(damping);
      const double gain = predicted_decrease(), left = std::sqrt(2.0 * cost_.value);
      const double least = Tolerance::least_gain * in->tolerance * maximum(left, in->tolerance);
      if (!(gain > least) && passed_ <= Tolerance::passed && damping <= 1e-2) {
        if (change_row(changes)) {
          fresh = true;
          continue;
        }
        if (!tightened && tighten()) {
          tightened = fresh = true;
          continue;
        }
        if (feasible) end = int(ReachEnd::NEAREST);
        break;
      }
      const auto kept = hang_.at;
      const double cost = cost_.value, beyond = passed_;
      double price = 0.0;
      for (double x : price_) price = maximum(2.0 * fabs(x), price);
      const bool hangs = move();
      if (hangs) {
        evaluate(i);
        passed_ = passed();
      }
      if (hangs && cost_.value + price * passed_ < cost + price * beyond) {
        damping = maximum(0.1 * damping, Tolerance::least_damping);
        end = int(ReachEnd::STALLED);
        if (at_longest_) longest_ *= 2.0;
        change_row(changes);
        continue;
      }
      if (!hang_at(kept)) break;
      evaluate(i);
      passed_ = passed();
      end = hangs ? int(ReachEnd::STALLED) : int(ReachEnd::TIPS);
      damping = maximum(10.0 * damping, 1e-4);
      longest_ = maximum(0.5 * longest_, Tolerance::first_step);
      if (damping > Tolerance::most_damping) break;
    }
    count += taken;
    return end;
  }

  // The cost, and its derivatives by the chosen variables.
  void evaluate(long long i) {
    hang_.differentiate(chosen_, n_);
    cost_.evaluate(i, chosen_, n_);
  }

  // The step within the bounds. Returns false if they contradict one another.
  bool step(double damping) {
    const double raise = damping * maximum(cost_.top, 1e-12);
    qp_.n = n_;
    for (int a = 0; a < n_; ++a) {
      qp_.g[a] = cost_.g[a];
      for (int b = 0; b < n_; ++b) qp_.Q[a * n_ + b] = cost_.H[a * n_ + b] + (a == b ? raise : 0.0);
    }
    for (double& x : price_) x = 0.0;
    if (!qp_.begin()) return false;
    bool solved = true;
    for (int round = 0; round < Tolerance::rounds; ++round) {
      if (!bound()) break;
      solved = qp_.solve();
    }
    for (int c = 0; c < U + M + N; ++c) price_[c] = qp_.x[c];
    return solved;
  }

  // Adds the bounds that the step violates. Returns whether there are any.
  bool bound() {
    constexpr double unlimited = 1e299;
    bool any_added = false;
    double row[array_size(U)];
    for (int a = 0; a < n_; ++a) {
      const int u = chosen_[a];
      if (u < K && driven_q_[u] < 0) continue;
      for (int b = 0; b < n_; ++b) row[b] = a == b;
      const double now = u < K ? hang_.at.q_K[driven_q_[u]] : hang_.at.p[u - K];
      any_added |= qp_.add(u, row, in->low[u] - now, in->high[u] - now, 1e-12);
    }
    for (int j = 0; j < M; ++j) {
      for (int a = 0; a < n_; ++a) row[a] = hang_.row_by_u[chosen_[a] * M + j];
      const double moved = ahead_ ? hang_.row_move[j] : 0.0;
      const double T = hang_.at.tension[j] + moved;
      const bool held = hang_.at.held[j];
      const double low = held ? in->tension_low[j] - T : -unlimited;
      const double high = held ? in->tension_high[j] - T : -hang_.h[j] - moved;
      any_added |= qp_.add(U + j, row, low, high, held ? 1e-10 * in->weight : 1e-11);
    }
    for (int k = 0; k < N; ++k) {
      if (joint_q_[k] < 0 || (in->joint_low[k] < -unlimited && in->joint_high[k] > unlimited))
        continue;
      for (int a = 0; a < n_; ++a) row[a] = hang_.by_u[chosen_[a] * NP + k];
      const double q = hang_.at.q_D[joint_q_[k]] + (ahead_ ? hang_.move[k] : 0.0);
      any_added |= qp_.add(U + M + k, row, in->joint_low[k] - q, in->joint_high[k] - q, 1e-11);
    }
    return any_added;
  }

  // Decrease of the cost by the step in the linear model.
  double predicted_decrease() const {
    double gain = 0.0;
    for (int a = 0; a < n_; ++a) {
      double sum = cost_.g[a];
      for (int b = 0; b < n_; ++b) sum += 0.5 * cost_.H[a * n_ + b] * qp_.d[b];
      gain -= qp_.d[a] * sum;
    }
    return gain;
  }

  // Makes the step, or part of a long one, and restores equilibrium. Returns false if that fails.
  bool move() {
    advance();
    return hang_.balance();
  }

  // A row on its edge, whose own bound stops the step, begins to pull or goes slack.
  bool change_row(int* changes) {
    int worst = -1;
    double most = 0.0;
    for (int j = 0; j < M; ++j) {
      const double x = price_[U + j];
      const bool held = hang_.at.held[j];
      if (!in->may_change[j] || changes[j] >= Tolerance::changes) continue;
      const bool edge = held ? x < 0.0 && in->tension_low[j] <= 0.0 &&
                                   hang_.at.tension[j] < Tolerance::at_bound * in->weight
                             : x > 0.0 && hang_.h[j] > -Tolerance::at_bound;
      // Multipliers of tensions and of gaps are compared by the weight over a metre.
      const double size = held ? -x * in->weight : x;
      if (edge && size > most) most = size, worst = j;
    }
    if (worst < 0) return false;
    ++changes[worst];
    hang_.at.held[worst] = !hang_.at.held[worst];
    hang_.at.tension[worst] = 0.0;
    if (!hang_.factorise()) return false;
    hang_.differentiate(chosen_, n_);
    return true;
  }

  // Winds slack strings in until they are just taut: their lengths then move the pose.
  bool tighten() {
    bool any_wound = false;
    for (int j = 0; j < M; ++j) {
      const int v = in->lengths[j];
      if (v < 0 || hang_.at.held[j] || !in->may_change[j] || !in->moved[v]) continue;
      double& length = hang_.at.q_K[driven_q_[v]];
      if (length + hang_.h[j] < in->low[v]) continue;
      length += hang_.h[j];
      hang_.at.held[j] = any_wound = true;
      hang_.at.tension[j] = 0.0;
    }
    return any_wound && hang_.balance();
  }

  // Violation of the bounds of tensions (relative to the weight), joints and rows.
  double passed() const {
    double most = 0.0;
    const auto& at = hang_.at;
    for (int j = 0; j < M; ++j) {
      if (at.held[j]) {
        const double T = at.tension[j];
        const double over = maximum(in->tension_low[j] - T, T - in->tension_high[j]);
        most = maximum(over / in->weight, most);
      } else {
        most = maximum(hang_.h[j], most);
      }
    }
    for (int k = 0; k < N; ++k)
      if (joint_q_[k] >= 0) {
        const double q = at.q_D[joint_q_[k]];
        most = maximum(maximum(in->joint_low[k] - q, q - in->joint_high[k]), most);
      }
    return most;
  }

  void write(long long i, int end, int count) {
    poses_.write(i, hang_, end, count);
    if (end == int(ReachEnd::LOST)) return;
    std::memcpy(in->price + i * (U + M + N), price_, (U + M + N) * sizeof(double));
    for (int a = 0; a < n_; ++a)
      for (int k = 0; k < N; ++k)
        in->by[(i * U + chosen_[a]) * N + k] = hang_.by_u[chosen_[a] * NP + k];
  }

  const ReachArrays* in = nullptr;
  Hang hang_;
  ReachPoses<Model> poses_;
  int n_ = 0, chosen_[array_size(U)], joint_q_[array_size(N)], driven_q_[array_size(K)];
  bool at_longest_ = false;
  bool ahead_ = false;  // whether the step includes the move towards equilibrium
  double longest_ = 0.0, passed_ = 0.0, price_[array_size(U + M + N)] = {};
  ReachCost<Model> cost_{hang_};
  BoundedStep<U, U + M + N> qp_;
};

}  // namespace fan
