// The complementarity problem of a time step's contacts, lane by lane: the rows of contacts and of
// the strings and limits that take part, their bounds, and restitutions that add no energy.
#pragma once

#include "fantoccini/contact/columns.hpp"
#include "fantoccini/contact/groups.hpp"
#include "fantoccini/contact/state.hpp"
#include "fantoccini/solvers/cone.hpp"

FAN_LOOPS_BEGIN

namespace fan {

template <class Model, class Real>
class ContactProblem {
 public:
  static constexpr int C = Model::n_contacts, N = Model::n_vD, S = Model::n_strings;
  static constexpr int M = Model::n_rows, width = Traits<Real>::width;
  using Mask = typename Traits<Real>::Mask;
  using State = ContactState<Model, Real>;
  using Tolerance = ContactStepTolerances;

  Real residual = Real(0.0);  // of the law, in the last step

  // Discards the columns of all points.
  FAN_FN void begin() { columns_.begin(); }

  // Discards the columns of point i, which is another one in some lane.
  FAN_FN void renew(int i) { columns_.renew(i); }

  FAN_FN const ContactColumns<Model, Real>& columns() const { return columns_; }

  // Computes the columns of the points that take part in some lane, and their products with the
  // rows that may pull: those that pulled before, or close without impulses. Other rows take part
  // if the impulses would close them.
  FAN_FN void make_columns(
      State& state, const Evaluation<Model, Real>& eval, const RowSystem<Model, Real>& rows,
      const Mask* near, const Real* guess) {
    bool needed[array_size(C)];
    for (int i = 0; i < state.points.n_max; ++i) {
      needed[i] = false;
      for (int l = 0; l < width; ++l)
        needed[i] = needed[i] || (i < state.points.n[l] && state.takes_part(l, i));
    }
    for (int i = 0; i < state.points.n_max; ++i)
      if (needed[i]) state.points.need_row(*state.in, i);
    columns_.make(eval, state.points.row, state.points.moved, needed, state.points.n_max);
    const auto& problem = rows.problem;
    for (int a = 0; a < rows.n; ++a) {
      const int r = rows.row[a];
      if (state.row_held[r]) continue;
      const Mask can_pull =
          guess[r] > Real(0.0) || problem.lower[a] < Real(0.0) || problem.b[a] > Real(0.0);
      const Mask may_pull = near[r] && can_pull;
      bool some_pulls = false;
      for (int l = 0; l < width; ++l) {
        state.pulls[l][r] = state.pulls[l][r] || lane_of(may_pull, l);
        some_pulls = some_pulls || state.pulls[l][r];
      }
      if (some_pulls) columns_.cross(rows, a, state.points.moved);
    }
  }

  // Includes all points in lane 0, and the rows that took part, after the step is solved.
  FAN_FN void take_all(
      State& state, const Evaluation<Model, Real>& eval, const RowSystem<Model, Real>& rows) {
    Mask none[array_size(M)];
    Real zero[array_size(M)];
    for (int r = 0; r < M; ++r) {
      none[r] = Real(0.0) > Real(1.0);
      zero[r] = Real(0.0);
    }
    for (int i = 0; i < state.points.n[0]; ++i) state.near[0][i] = true;
    make_columns(state, eval, rows, none, zero);
    for (int a = 0; a < rows.n; ++a) none[rows.row[a]] = state.pulls[0][rows.row[a]];
    sort(state, 0, rows, none);
  }

  // Number of sorted groups; points of the current group.
  FAN_FN int groups() const { return groups_.n; }
  FAN_FN int points() const { return n_triple_; }
  FAN_FN int point(int k) const { return triple_[k]; }

  // Restores the problem of a group of lane 0, with its impulses. Returns false if it has no
  // points.
  FAN_FN bool restore(const State& state, int group, const RowSystem<Model, Real>& rows) {
    choose_group(group);
    if (n_triple_ == 0) return false;
    write(state, 0, rows);
    for (int i = 0; i < n_single_; ++i) cone_.x[i] = lane_of(rows.problem.x[single_[i]], 0);
    for (int k = 0; k < n_triple_; ++k)
      for (int d = 0; d < 3; ++d)
        cone_.x[n_single_ + 3 * k + d] = lane_of(state.x[3 * triple_[k] + d], 0);
    cone_.find_s();
    return true;
  }

  // The problem that was last solved or restored.
  FAN_FN const ConeProblem<M + 3 * C>& cone() const { return cone_; }

  // Solves lane l with the restitutions, times the largest common factor with which they add no
  // energy.
  FAN_FN bool bounce(
      State& state, int l, const RowSystem<Model, Real>& rows, const Mask* near, const Real* guess,
      const Real* before, double cap, Real* row_impulses, Real* s) {
    cone_.quick = true;
    const auto adds_energy_with = [&](double factor) {
      state.scale[l] = factor;
      state.set_rebounds(l);
      return !solve(state, l, rows, near, guess, cap, row_impulses, s) ||
             adds_energy(state, l, rows, before, row_impulses);
    };
    const bool solved = solve(state, l, rows, near, guess, cap, row_impulses, s);
    if (!state.bounces[l] || !adds_energy(state, l, rows, before, row_impulses)) return solved;
    double least = 0.0, most = state.scale[l];
    for (int k = 0; k < Tolerance::halvings; ++k) {
      const double factor = 0.5 * (least + most);
      (adds_energy_with(factor) ? most : least) = factor;
    }
    state.scale[l] = least;
    state.set_rebounds(l);
    return solve(state, l, rows, near, guess, cap, row_impulses, s);
  }

 private:
  struct Member {
    int index, group;
  };

  // Chooses the rows and points of one group.
  FAN_FN void choose_group(int group) {
    n_single_ = n_triple_ = 0;
    for (int i = 0; i < n_row_members_; ++i)
      if (groups_.at(row_members_[i].group) == group) single_[n_single_++] = row_members_[i].index;
    for (int i = 0; i < n_members_; ++i)
      if (groups_.at(members_[i].group) == group) triple_[n_triple_++] = members_[i].index;
  }

  // Writes G, b and mu of lane l's problem. Three numbers are written as a register of four, whose
  // last entry the next ones overwrite.
  FAN_FN void write(const State& state, int l, const RowSystem<Model, Real>& rows) {
    cone_.resize(n_single_, n_triple_);
    for (int i = 0; i < n_single_; ++i) cone_.b[i] = lane_of(rows.problem.b[single_[i]], l);
    for (int i = 0; i < n_triple_; ++i) {
      cone_.mu[i] = state.in->friction[state.points.point[l][triple_[i]].pair];
      for (int d = 0; d < 3; ++d)
        cone_.b[n_single_ + 3 * i + d] = lane_of(state.b[3 * triple_[i] + d], l);
    }
    constexpr int stride = Complementarity<Real, M>::N;
    const Real* from = rows.problem.G;
    double* next = cone_.G;
    for (int i = 0; i < n_single_; ++i, next += cone_.stride) {
      double* out = next;
      const Real* row = from + single_[i] * stride;
      for (int j = 0; j < n_single_; ++j) *out++ = lane_of(row[single_[j]], l);
      for (int j = 0; j < n_triple_; ++j, out += 3)
        columns_.across[triple_[j]][single_[i]].put(l, quad(out));
    }
    for (int i = 0; i < n_triple_; ++i)
      for (int d = 0; d < 3; ++d, next += cone_.stride) {
        const int own = triple_[i];
        double* out = next;
        for (int j = 0; j < n_single_; ++j)
          *out++ = lane_of(columns_.across[own][single_[j]][d], l);
        for (int j = 0; j <= i; ++j, out += 3)
          columns_.row_of_block(own, triple_[j], d).put(l, quad(out));
        for (int j = i + 1; j < n_triple_; ++j)
          for (int e = 0; e < 3; ++e)
            *out++ = lane_of(columns_.row_of_block(triple_[j], own, e)[d], l);
      }
  }

  // Whether the impulses of lane l add energy, apart from the work of driven solids:
  //   sum of x . (before - G x / 2) < 0,   G x the change of hdot
  // by more than the residual of the law allows.
  FAN_FN bool adds_energy(
      const State& state, int l, const RowSystem<Model, Real>& rows, const Real* before,
      const Real* row_impulses) const {
    constexpr int stride = Complementarity<Real, M>::N;
    double lost = 0.0, exchanged = 0.0, impulse = 0.0, fastest = 0.0;
    const auto add = [&](double x, double own, double required) {
      lost += x * own;
      exchanged += fabs(x * own);
      impulse += fabs(x);
      fastest = fabs(required) > fastest ? fabs(required) : fastest;
    };
    for (int a = 0; a < rows.n; ++a) {
      if (lane_of(row_impulses[a], l) == 0.0) continue;
      double change = 0.0;
      for (int b = 0; b < rows.n; ++b)
        change += lane_of(rows.problem.G[a * stride + b], l) * lane_of(row_impulses[b], l);
      for (int d = 0; d < 3 * state.points.n[l]; ++d)
        if (state.takes_part(l, d / 3))
          change += 2.0 * lane_of(columns_.across[d / 3][a][d % 3], l) * lane_of(state.x[d], l);
      add(lane_of(row_impulses[a], l), lane_of(before[a], l) - 0.5 * change,
          lane_of(rows.problem.b[a], l));
    }
    for (int d = 0; d < 3 * state.points.n[l]; ++d) {
      if (!state.takes_part(l, d / 3)) continue;
      double change = 0.0;
      for (int e = 0; e < 3 * state.points.n[l]; ++e)
        if (state.takes_part(l, e / 3))
          change += lane_of(columns_.G(d, e), l) * lane_of(state.x[e], l);
      add(lane_of(state.x[d], l), lane_of(state.before[d], l) - 0.5 * change,
          lane_of(state.b[d], l));
    }
    const double rounding = Tolerance::rounding * exchanged;
    const double unsolved = lane_of(residual, l) * impulse * fastest;
    return lost < -(unsolved > rounding ? unsolved : rounding);
  }

  // Solves lane l, until the impulses close no further row.
  FAN_FN bool solve(
      State& state, int l, const RowSystem<Model, Real>& rows, const Mask* near, const Real* guess,
      double cap, Real* row_impulses, Real* s) {
    bool solved = solve_groups(state, l, rows, near, guess, cap, row_impulses, s);
    while (closes_more(state, l, rows, near, row_impulses, s))
      solved = solve_groups(state, l, rows, near, guess, cap, row_impulses, s);
    return solved;
  }

  // Sets s of the rows that take part in lane l and may not pull; those that would close may pull
  // from now on. Returns whether there are any.
  FAN_FN bool closes_more(
      State& state, int l, const RowSystem<Model, Real>& rows, const Mask* near,
      const Real* row_impulses, Real* s) {
    int rest[array_size(M)], n_rest = 0;
    for (int a = 0; a < rows.n; ++a)
      if (lane_of(near[rows.row[a]], l) && !state.pulls[l][rows.row[a]] &&
          !state.row_held[rows.row[a]])
        rest[n_rest++] = a;
    if (n_rest == 0) return false;
    Real w[array_size(N)], exchange[array_size(M)];  // - W x
    for (int k = 0; k < N; ++k) w[k] = Real(0.0);
    for (int a = 0; a < rows.n; ++a) exchange[a] = -row_impulses[a];
    rows.add(exchange, w);
    for (int i = 0; i < state.points.n[l]; ++i)
      if (state.takes_part(l, i)) columns_.take(i, state.x + 3 * i, state.points.moved[i], w);
    rows.along(w, exchange);
    bool more = false;
    for (int i = 0; i < n_rest; ++i) {
      const int a = rest[i];
      lane_of(s[a], l) = -lane_of(exchange[a], l) - lane_of(rows.problem.b[a], l);
      if (!(lane_of(s[a], l) < 0.0)) continue;
      state.pulls[l][rows.row[a]] = more = true;
      columns_.cross(rows, a, state.points.moved);
    }
    return more;
  }

  // Solves lane l, group by group.
  FAN_FN bool solve_groups(
      State& state, int l, const RowSystem<Model, Real>& rows, const Mask* near, const Real* guess,
      double cap, Real* row_impulses, Real* s) {
    for (int a = 0; a < rows.n; ++a) {
      if (state.row_held[rows.row[a]]) continue;
      lane_of(row_impulses[a], l) = 0.0;
      lane_of(s[a], l) = -lane_of(rows.problem.b[a], l);
    }
    sort(state, l, rows, near);
    double worst = state.held_residual;
    bool solved = true;
    for (int g = 0; g < groups_.n; ++g) {
      choose_group(g);
      solved = solve_group(state, l, rows, guess, cap, row_impulses, s) && solved;
      if (!(cone_.residual <= worst)) worst = cone_.residual;
    }
    lane_of(residual, l) = worst;
    return solved;
  }

  // Largest impulse of a point: `cap`, that of the largest force over the step, or more where the
  // chosen points close fast.
  FAN_FN double largest_impulse(const State& state, int l, double cap) const {
    double closing = 0.0;
    for (int i = 0; i < n_triple_; ++i)
      closing = fmax(closing, lane_of(state.hdot[3 * triple_[i]], l));
    return cap * fmax(1.0, closing * Tolerance::impact_time / state.dt);
  }

  // Solves for the chosen rows and points. Friction may hold wedged bodies in place, so that gaps
  // cannot close and overlaps cannot part within the step: points then only have to stop.
  FAN_FN bool solve_group(
      State& state, int l, const RowSystem<Model, Real>& rows, const Real* guess, double cap,
      Real* row_impulses, Real* s) {
    auto& problem = cone_;
    const auto& from = rows.problem;
    for (int i = 0; i < n_single_; ++i) {
      const int a = single_[i];
      problem.lower[i] = lane_of(from.lower[a], l);
      problem.upper[i] = lane_of(from.upper[a], l);
      problem.x[i] = lane_of(guess[rows.row[a]], l);
    }
    const double most = largest_impulse(state, l, cap);
    for (int i = 0; i < n_triple_; ++i)
      for (int d = 0; d < 3; ++d) {
        const int to = n_single_ + 3 * i + d;
        problem.x[to] = lane_of(state.x[3 * triple_[i] + d], l);
        problem.lower[to] = d == 0 ? 0.0 : -most;
        problem.upper[to] = most;
      }
    write(state, l, rows);
    bool solved = has_solution();
    if (!solved) {
      for (int i = 0; i < n_triple_; ++i) {
        const int own = 3 * triple_[i], to = n_single_ + 3 * i;
        lane_of(state.b[own], l) = problem.b[to] = lane_of(state.before[own], l);
        lane_of(state.required[triple_[i]], l) = 0.0;
      }
      for (int i = 0; i < n_single_ + 3 * n_triple_; ++i) problem.x[i] = 0.0;
      solved = has_solution();
    }
    for (int i = 0; i < n_single_; ++i) {
      lane_of(row_impulses[single_[i]], l) = problem.x[i];
      lane_of(s[single_[i]], l) = problem.s[i];
    }
    for (int i = 0; i < n_triple_; ++i)
      for (int d = 0; d < 3; ++d) {
        lane_of(state.x[3 * triple_[i] + d], l) = problem.x[n_single_ + 3 * i + d];
        lane_of(state.s[3 * triple_[i] + d], l) = problem.s[n_single_ + 3 * i + d];
      }
    return solved;
  }

  // Sorts the points that take part in lane l, and the rows that may pull, by group.
  FAN_FN void sort(
      const State& state, int l, const RowSystem<Model, Real>& rows, const Mask* near) {
    groups_.begin();
    n_members_ = 0;
    for (int i = 0; i < state.points.n[l]; ++i) {
      if (!state.takes_part(l, i)) continue;
      const int* pair = state.in->pairs + 2 * state.points.point[l][i].pair;
      const int a = state.in->solids[pair[0]].link, b = state.in->solids[pair[1]].link;
      members_[n_members_++] = {i, groups_.joined(a, b)};
    }
    n_row_members_ = 0;
    for (int a = 0; a < rows.n; ++a)
      if (lane_of(near[rows.row[a]], l) && state.pulls[l][rows.row[a]] &&
          !state.row_held[rows.row[a]])
        row_members_[n_row_members_++] = {a, groups_.of_row(rows.row[a])};
    groups_.count();
  }

  // Solves the group. Returns whether a solution is accepted; if the law has none, one with
  // compliant rows.
  FAN_FN bool has_solution() {
    bool solved = cone_.solve() || cone_.residual <= Tolerance::accepted_residual;
    for (const double share : Tolerance::softness)
      solved =
          solved || (cone_.solve_softly(share) && cone_.residual <= Tolerance::accepted_residual);
    return solved;
  }

  ContactColumns<Model, Real> columns_;
  ConeProblem<M + 3 * C> cone_;               // of one group
  int single_[array_size(M)], n_single_ = 0;  // its gathered rows
  int triple_[array_size(C)], n_triple_ = 0;  // its points
  ContactGroups<Model> groups_;               // of the lane that was solved last
  int n_members_ = 0, n_row_members_ = 0;     // points and rows that take part
  Member members_[array_size(C)], row_members_[array_size(M)];
};

}  // namespace fan

FAN_LOOPS_END
