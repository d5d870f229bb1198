// Sticking contacts, solved as patches (patch.hpp) before the law is solved point by point: where
// every point of a group is at rest and its strings keep pulling, the velocities after the step
// follow from one equation for each held row,
//
//   G x = b
//
// over the pulling strings and each patch's F and T. They satisfy the law if these strings pull,
// the other ones do not close, and each patch's F and T lie within its points' cones. Otherwise the
// cone solver solves the group. This is for one trajectory; for bundles of lanes see
// ground_lanes.hpp.
#pragma once

#include "fantoccini/contact/columns.hpp"
#include "fantoccini/contact/groups.hpp"
#include "fantoccini/contact/patch.hpp"
#include "fantoccini/contact/state.hpp"
#include "fantoccini/math/dense_ldl.hpp"

FAN_LOOPS_BEGIN

namespace fan {

struct ContactPatchesTolerances {
  // Pivot, relative to the diagonal entry, at which a row is redundant.
  static constexpr double least_pivot = 1e-11;
  static constexpr int rounds = 3;  // of refinement, the first solution included
  // Largest |s| relative to the largest |b| of a solution that needs no refinement, and of one that
  // is accepted.
  static constexpr double no_refinement = 1e-13;
  static constexpr double residual = 1e-11;
  // Steps without an attempt after one that failed.
  static constexpr int wait = 1;
};

template <class Model, class Real>
class ContactPatches {
 public:
  static constexpr int C = Model::n_contacts, N = Model::n_vD, M = Model::n_rows;
  using Mask = typename Traits<Real>::Mask;
  using State = ContactState<Model, Real>;
  using Tolerance = ContactPatchesTolerances;

  // Whether patches hold in the last step.
  bool holds_some() const { return any_held_; }

  // Removes all patches.
  FAN_FN void remove_all(State& state) {
    any_held_ = false;
    state.held_residual = 0.0;
    for (int i = 0; i < state.points.n_max; ++i) state.held[i] = false;
    for (int r = 0; r < M; ++r) state.row_held[r] = false;
  }

  // Solves the groups that stick. Returns whether nothing else takes part.
  FAN_FN bool hold(
      State& state, const Evaluation<Model, Real>& eval, const RowSystem<Model, Real>& rows,
      const Mask* near, const Real* guess, double cap, Real* row_impulses, Real* s) {
    remove_all(state);
    if (state.bounces[0]) return false;
    for (int a = 0; a < rows.n; ++a) {
      row_impulses[a] = Real(0.0);
      s[a] = -rows.problem.b[a];
    }
    sort_all(state, rows, near);
    bool all = true;
    for (int g = 0; g < groups_.n; ++g)
      all = sticks_[g] && hold_group(state, g, eval, rows, guess, cap, row_impulses, s) && all;
    return all;
  }

  // w <- w - W x over the patches.
  FAN_FN void add(Real* w) const {
    for (int k = 0; k < N && any_held_; ++k) w[k] += exchange_[k];
  }

  // Reduction of hdot of gathered row a by the patches.
  FAN_FN Real rate_by_impulses(const RowSystem<Model, Real>& rows, int a) const {
    if (!any_held_) return Real(0.0);
    Real rate[array_size(M)];
    rows.along(exchange_, rate);
    return -rate[a];
  }

 private:
  using Columns = ContactColumns<Model, Real>;

  // Finds the group of each point and row that takes part, and the groups to try.
  FAN_FN void sort_all(const State& state, const RowSystem<Model, Real>& rows, const Mask* near) {
    groups_.begin();
    for (int i = 0; i < state.points.n[0]; ++i) {
      if (!state.near[0][i]) continue;
      tree_[i] = groups_.joined(state.points.links(i)[0], state.points.links(i)[1]);
    }
    for (int a = 0; a < rows.n; ++a)
      if (near[rows.row[a]]) row_tree_[a] = groups_.of_row(rows.row[a]);
      else row_tree_[a] = -1;
    groups_.count();
    bool has_points[array_size(N)];
    for (int g = 0; g < groups_.n; ++g) {
      sticks_[g] = true;
      has_points[g] = false;
    }
    for (int i = 0; i < state.points.n[0]; ++i) {
      if (!state.near[0][i]) continue;
      const int g = groups_.at(tree_[i]);
      has_points[g] = true;
      sticks_[g] = sticks_[g] && is_stuck(state, i);
    }
    for (int g = 0; g < groups_.n; ++g) sticks_[g] = sticks_[g] && has_points[g];
  }

  // Whether the points of point i's pair that pushed in the previous step were at rest.
  FAN_FN bool is_stuck(const State& state, int i) const {
    const auto& point = state.points.point[0][i];
    return state.is_carried[0][i] && state.wait[0][i] == 0 &&
           state.in->friction[point.pair] > 0.0 && !point.slid;
  }

  FAN_FN bool hold_group(
      State& state, int group, const Evaluation<Model, Real>& eval,
      const RowSystem<Model, Real>& rows, const Real* guess, double cap, Real* row_impulses,
      Real* s) {
    const bool holds = list_points(state, group) && list_rows(group, rows, guess) &&
                       solve_held(state, eval, rows, guess) && distribute(state, cap);
    for (int p = 0; p < n_; ++p)
      for (int k = 0; k < patch_[p].n; ++k) {
        const int i = patch_[p].point[k];
        state.held[i] = holds;
        if (!holds) state.wait[0][i] = Tolerance::wait;
      }
    if (holds) store(state, rows, row_impulses, s);
    return holds;
  }

  // Forms the patches of a group. Returns false if its points do not form patches.
  FAN_FN bool list_points(const State& state, int group) {
    n_ = 0;
    for (int i = 0; i < state.points.n[0]; ++i) {
      if (!state.near[0][i] || groups_.at(tree_[i]) != group) continue;
      const int pair = state.points.point[0][i].pair;
      int p = n_ - 1;
      while (p >= 0 && patch_[p].pair != pair) --p;
      if (p < 0) {
        p = n_++;
        patch_[p].pair = pair;
        patch_[p].n = 0;
      }
      if (patch_[p].n == max_touches) return false;
      patch_[p].point[patch_[p].n++] = i;
    }
    bool all = true;
    for (int p = 0; p < n_ && all; ++p)
      all = patch_[p].make(state.points.point[0], state.hdot, state.required);
    return all;
  }

  // Lists the rows of a group that pulled in the previous step, and the others. Returns false if
  // one was at its bound.
  FAN_FN bool list_rows(int group, const RowSystem<Model, Real>& rows, const Real* guess) {
    n_single_ = n_rest_ = 0;
    const auto& from = rows.problem;
    for (int a = 0; a < rows.n; ++a) {
      if (row_tree_[a] < 0 || groups_.at(row_tree_[a]) != group) continue;
      const double x = guess[rows.row[a]];
      if (x >= from.upper[a] * (1.0 - ContactStepTolerances::at_bound)) return false;
      if (rows.two_sided[a] || x > 0.0) single_[n_single_++] = a;
      else rest_[n_rest_++] = a;
    }
    return true;
  }

  // Solves for y of the rows and patches. Returns false if it cannot hold them all.
  FAN_FN bool solve_held(
      State& state, const Evaluation<Model, Real>& eval, const RowSystem<Model, Real>& rows,
      const Real* guess) {
    double scale = 0.0, worst = 0.0;
    size_ = n_single_;
    for (int i = 0; i < size_; ++i) b_held_[i] = rows.problem.b[single_[i]];
    for (int p = 0; p < n_; ++p) {
      first_[p] = size_;
      size_ += patch_[p].rank;
      worst = larger(worst, patch_[p].misfit);
      push_patch(state, p, eval);
    }
    for (int i = 0; i < size_; ++i) scale = larger(scale, b_held_[i]);
    if (!(worst <= Tolerance::residual * scale)) return false;
    write_held(state, rows);
    if (!ldl_.factorise(Tolerance::least_pivot)) return false;
    double residual = unbounded;  // of the rows that were not left out
    for (int i = 0; i < size_; ++i) y_[i] = 0.0;
    if (ldl_.n_left_out > 0) set_given(state, rows, guess);
    for (int k = 0; k < Tolerance::rounds && residual > Tolerance::no_refinement * scale; ++k) {
      if (k == 0) ldl_.take_column(residual_, given_);
      else ldl_.substitute(residual_);
      for (int i = 0; i < size_; ++i) y_[i] += residual_[i];
      find_residual(state, rows);
      residual = 0.0;
      for (int i = 0; i < size_; ++i)
        if (!ldl_.is_left_out(i)) residual = larger(residual, residual_[i]);
    }
    for (int i = 0; i < size_; ++i) worst = larger(worst, residual_[i]);
    if (!(worst <= Tolerance::residual * scale)) return false;
    if (worst > state.held_residual * scale) state.held_residual = worst / scale;
    for (int i = 0; i < n_single_; ++i) {
      const int a = single_[i];
      if (!(y_[i] >= rows.problem.lower[a] && y_[i] <= rows.problem.upper[a])) return false;
    }
    return true;
  }

  FAN_FN static double larger(double bound, double x) { return fabs(x) > bound ? fabs(x) : bound; }

  // Sets the impulses of redundant rows: those of the previous step.
  FAN_FN void set_given(const State& state, const RowSystem<Model, Real>& rows, const Real* guess) {
    for (int i = 0; i < n_single_; ++i) given_[i] = guess[rows.row[single_[i]]];
    for (int p = 0; p < n_; ++p) patch_[p].add_up(state.x, given_ + first_[p]);
  }

  // Sets the residual b - G y, and the residual speeds of all gathered rows.
  FAN_FN void find_residual(const State& state, const RowSystem<Model, Real>& rows) {
    Real w[array_size(N)], pull[array_size(M)];
    for (int k = 0; k < N; ++k) w_[k] = Real(0.0);
    for (int p = 0; p < n_; ++p)
      for (int part = 0; part < patch_[p].parts(); ++part) {
        const double* y = y_ + first_[p] + 3 * part;
        const double own[3] = {y[0], y[1], 3 * part + 2 < patch_[p].rank ? y[2] : 0.0};
        Columns::take(W_[p][part], own, moved_of(state, p), w_);
      }
    for (int k = 0; k < N; ++k) w[k] = w_[k];
    for (int a = 0; a < rows.n; ++a) pull[a] = Real(0.0);
    for (int i = 0; i < n_single_; ++i) pull[single_[i]] = -y_[i];
    rows.add(pull, w);
    rows.along(w, speed_);
    for (int a = 0; a < rows.n; ++a) speed_[a] += rows.problem.b[a];
    for (int i = 0; i < n_single_; ++i) residual_[i] = speed_[single_[i]];
    for (int p = 0; p < n_; ++p)
      for (int k = 0; k < patch_[p].rank; k += 3) {
        const Triple<Real> taken = moved_of(state, p).along(W_[p][k / 3], w);
        for (int i = first_[p] + k, d = 0; d < 3 && k + d < patch_[p].rank; ++i, ++d)
          residual_[i] = b_held_[i] + taken[d];
      }
  }

  FAN_FN const MovedBy<N>& moved_of(const State& state, int p) const {
    return state.points.moved[patch_[p].point[0]];
  }

  // Computes W of a patch, three columns of F and three of T, and the effect of the step's forces
  // on its rows.
  FAN_FN void push_patch(const State& state, int p, const Evaluation<Model, Real>& eval) {
    const ContactPatch& own = patch_[p];
    const auto& moved = moved_of(state, p);
    for (int part = 0; part < own.parts(); ++part) {
      Triple<Real> row[array_size(N)];
      if (part == 0)
        state.points.write_rows(*state.in, own.pair, own.middle, own.frame, moved, row);
      else state.points.write_turns(*state.in, own.pair, own.frame, own.size, moved, row);
      Columns::push(eval.L, row, moved, W_[p][part]);
      const Triple<Real> rate = moved.along(W_[p][part], eval.w0);
      for (int k = 3 * part; k < own.rank && k < 3 * part + 3; ++k) {
        by_forces_[p][k] = state.dt * rate[k % 3];
        b_held_[first_[p] + k] = own.b[k] + by_forces_[p][k];
      }
    }
  }

  // Writes G, on its diagonal and to the right of it, and b in the column after it. Three numbers
  // are written as a register of four: its last entry, and those beyond a patch's rank, are 0 and
  // overwritten by the next ones.
  FAN_FN void write_held(const State& state, const RowSystem<Model, Real>& rows) {
    constexpr int from = Complementarity<Real, M>::N;
    ldl_.resize(size_, true);
    const int stride = ldl_.stride;
    double* G = ldl_.A;
    for (int i = 0; i < n_single_; ++i) {
      const double* row = rows.problem.G + single_[i] * from;
      for (int j = i; j < n_single_; ++j) G[i * stride + j] = row[single_[j]];
    }
    for (int p = 0; p < n_; ++p) {
      const auto& moved = moved_of(state, p);
      const int parts = patch_[p].parts(), rank = patch_[p].rank, column = first_[p];
      for (int i = 0; i < n_single_; ++i) {
        const bool apart = rows.is_apart(single_[i], moved);
        for (int part = 0; part < parts; ++part) {
          Triple<Real> by;
          by.clear();
          if (!apart) by = moved.along(W_[p][part], rows.column[single_[i]]);
          put(by, rank - 3 * part, G + i * stride + column + 3 * part);
        }
      }
      for (int q = 0; q <= p; ++q) {
        const auto& other = moved_of(state, q);
        const int common = other.common(moved), others = patch_[q].parts();
        for (int part = 0; part < parts; ++part)
          for (int half = 0; half < (q < p ? others : part + 1); ++half) {
            Triple<Real> block[3];
            other.products(W_[q][half], W_[p][part], block, common);
            double* to = G + (first_[q] + 3 * half) * stride + column + 3 * part;
            put(block[0], rank - 3 * part, to);
            put(block[1], rank - 3 * part, to + stride);
            if (patch_[q].rank - 3 * half > 2) put(block[2], rank - 3 * part, to + 2 * stride);
          }
      }
    }
    for (int i = 0; i < size_; ++i) {
      G[i * stride + size_] = b_held_[i];
      for (int j = size_ + 1; j < stride; ++j) G[i * stride + j] = 0.0;
    }
  }

  FAN_FN static void put(const Triple<Real>& from, int height, double* to) {
    Quad all = from.of;
    if (height == 2) all[2] = 0.0;
    quad(to) = all;
  }

  // Distributes the patches' impulses over their points, and checks the rows that do not pull.
  // Returns false if the law does not hold.
  FAN_FN bool distribute(const State& state, double cap) {
    for (int p = 0; p < n_; ++p) {
      const double* x = y_ + first_[p];
      if (!(x[0] <= cap) || !patch_[p].share(x, state.in->friction[patch_[p].pair], impulse_[p]))
        return false;
    }
    for (int i = 0; i < n_rest_; ++i)
      if (!(speed_[rest_[i]] <= 0.0)) return false;
    return true;
  }

  // Stores the solution.
  FAN_FN void store(State& state, const RowSystem<Model, Real>& rows, Real* row_impulses, Real* s) {
    for (int k = 0; k < N; ++k) exchange_[k] = any_held_ ? exchange_[k] + w_[k] : w_[k];
    any_held_ = true;
    for (int i = 0; i < n_single_; ++i) {
      const int a = single_[i], r = rows.row[a];
      row_impulses[a] = y_[i];
      s[a] = Real(0.0);
      state.row_held[r] = state.pulls[0][r] = true;
    }
    for (int i = 0; i < n_rest_; ++i) {
      const int a = rest_[i];
      row_impulses[a] = Real(0.0);
      s[a] = -speed_[a];
      state.row_held[rows.row[a]] = true;
    }
    for (int p = 0; p < n_; ++p)
      for (int k = 0; k < patch_[p].n; ++k) {
        const int first = 3 * patch_[p].point[k];
        state.before[first] = state.hdot[first] + patch_[p].normal_rate(k, by_forces_[p]);
        for (int d = 0; d < 3; ++d) {
          state.x[first + d] = impulse_[p][3 * k + d];
          state.s[first + d] = Real(0.0);
        }
      }
  }

  bool any_held_ = false;
  Real exchange_[array_size(N)];  // -W x of the patches
  ContactGroups<Model> groups_;
  int tree_[array_size(C)], row_tree_[array_size(M)];  // of points and gathered rows that take part
  bool sticks_[array_size(N)];                         // whether to try a group
  // Of the current group: pulling rows, and others.
  int n_ = 0, n_single_ = 0, n_rest_ = 0;
  int single_[array_size(M)], rest_[array_size(M)];
  ContactPatch patch_[array_size(C)];
  int first_[array_size(C)];  // row of each patch
  Triple<Real> W_[array_size(C)][2][array_size(N)];
  double impulse_[array_size(C)][3 * max_touches];
  // Of the pulling rows, then of the patches.
  int size_ = 0;
  double y_[padded(array_size(M + 3 * C) + 1)], b_held_[padded(array_size(M + 3 * C) + 1)];
  double given_[padded(array_size(M + 3 * C) + 1)];     // of redundant rows
  double by_forces_[array_size(C)][6];                  // by patch
  double residual_[padded(array_size(M + 3 * C) + 1)];  // b - G y
  Real w_[array_size(N)], speed_[array_size(M)];  // - W y of the patches; of all gathered rows
  DenseLdl<M + 3 * C> ldl_;
};

}  // namespace fan

FAN_LOOPS_END
