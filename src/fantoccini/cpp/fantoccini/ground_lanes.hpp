// Bundles of lanes that stand: where all that touches are feet on the ground (ground_feet.hpp) that
// stand still and stick, the law of contact_patches.hpp is solved in all lanes at once,
//
//   G x = b
//
// over the strings and limits that pulled in the step before and F and T of every foot. Lanes in which
// the solution is not that of the law are left to ContactLanes. Of the matrix what takes no part in a
// lane is a row of the unit matrix there, so that no lane's result depends on its neighbours.
#pragma once

#include "contact_groups.hpp"
#include "contact_patches.hpp"
#include "ground_matrix.hpp"
#include "ground_patch.hpp"

FAN_LOOPS_BEGIN

namespace fan {

template <class Model, class Real>
class GroundLanes {
 public:
  static constexpr int N = Model::n_vD, M = Model::n_rows, width = Traits<Real>::width;
  using Mask = typename Traits<Real>::Mask;
  using Feet = GroundFeet<Model, Real>;
  using Foot = typename Feet::Foot;
  using Point = typename Feet::Point;
  using Tolerance = ContactPatchesTolerances;
  using StepTolerance = ContactStepTolerances;

  Feet feet;
  Mask lanes = Real(0.0) > Real(1.0);  // that are here in this step
  Mask stands = lanes;                 // those of them in which points take part
  Real depth, residual;                // m: of the deepest overlap; of the law

  FAN_FN void begin(const ContactArrays& in) {
    feet.begin(in);
    groups_.begin();
    for (int i = 0; i < Feet::B; ++i)
      if (feet.foot[i].pair >= 0) tree_[i] = groups_.joined(feet.foot[i].link, -1);
    for (int r = 0; r < M; ++r) row_tree_[r] = groups_.of_row(r);
    lanes = stands = Real(0.0) > Real(1.0);
  }

  // Takes the points of feet.found at the start of a step in these lanes; those that are not for here
  // are left out of `lanes`.
  template <class Links>
  FAN_FN void start(
      const Links& links, const Mask& some, double dt, double whole, double recovery_speed) {
    lanes = some;
    stands = Real(0.0) > Real(1.0);
    depth = residual = exchanged_ = Real(0.0);
    struck_ = stands;
    is_solved_ = false;
    for (int r = 0; r < M; ++r) joins_[r] = leaves_[r] = Real(0.0) > Real(1.0);
    dt_ = dt;
    for (int j = 0; j < feet.n; ++j) {
      Foot& own = feet.foot[feet.found[j]];
      const Real* twist = links.twist(own.link);
      Mask takes_part = Real(0.0) > Real(1.0);
      for (int i = 0; i < own.n; ++i) {
        Point& p = own.point[own.listed[i]];
        p.joins = p.here && p.pushes;
        takes_part = takes_part || p.joins;
        depth = select(p.here && lanes, maximum(Real(-p.gap), depth), depth);
        const Real h = -p.gap, hdot = rate(twist, p.at);
        const Real back = h / select(h > Real(0.0), Real(whole > dt ? whole : dt), Real(dt));
        p.asked = minimum(back, Real(recovery_speed));
        const Mask may_bounce = hdot > Real(own.restitution > 0.0 ? 0.0 : unbounded);
        lanes = lanes && (!p.here || p.joins || !may_bounce);
      }
      if (!(own.friction > 0.0)) lanes = lanes && !takes_part;
      stands = stands || takes_part;
    }
    stands = stands && lanes;
  }

  // Leaves these lanes.
  FAN_FN void leave(const Mask& failed) {
    lanes = lanes && !failed;
    stands = stands && !failed;
  }

  // Solves the law in the lanes that stand, for impulses and s of the gathered rows. Returns the lanes
  // in which that is none of its solutions.
  template <class Links>
  FAN_FN Mask settle(
      const Links& links, const Evaluation<Model, Real>& eval, const RowSystem<Model, Real>& rows,
      const Mask* near, const Real* guess, double cap) {
    Real n_near = Real(0.0);
    for (int a = 0; a < rows.n; ++a) n_near += select(near[rows.row[a]], Real(1.0), Real(0.0));
    if (is_solved_ && !any(stands && n_near != solved_near_)) return Real(0.0) > Real(1.0);
    is_solved_ = true;
    solved_near_ = n_near;
    Mask held;
    int tries = 0;
    do held = solve_trees(links, eval, rows, near, guess, cap);
    while (++tries < most_tries && change_modes(stands && !held));
    return stands && !held;
  }

  // What was found for row r: its impulse and its s.
  FAN_FN const Real& impulse(int r) const { return found_[r]; }
  FAN_FN const Real& s(int r) const { return s_[r]; }

  // w <- w - W x over the feet.
  FAN_FN void add(Real* w) const {
    if (!any(stands)) return;
    for (int k = 0; k < N; ++k) w[k] += select(stands, taken_[k], Real(0.0));
  }

  // What the feet take from hdot of gathered row a.
  FAN_FN Real rate_by_impulses(const RowSystem<Model, Real>& rows, int a) const {
    if (!any(stands)) return Real(0.0);
    Real rate[room(M)];
    rows.along(taken_, rate);
    return select(stands, Real(-rate[a]), Real(0.0));
  }

  // Adds the points that would be passed at the velocity v; whether there are any. `failed` takes the
  // lanes in which one closes that would have had to pull.
  template <class Links>
  FAN_FN bool watch(const Links& links, const Real* v, Mask& failed) {
    bool more = false;
    for (int j = 0; j < feet.n; ++j) {
      Foot& own = feet.foot[feet.found[j]];
      Mask rest = Real(0.0) > Real(1.0);
      for (int i = 0; i < own.n; ++i) {
        const Point& p = own.point[own.listed[i]];
        rest = rest || (p.here && !p.joins && lanes);
      }
      if (!any(rest)) continue;
      Real twist[6];
      links.twist_at(own.link, v, twist);
      for (int i = 0; i < own.n; ++i) {
        Point& p = own.point[own.listed[i]];
        const Mask closes = p.here && !p.joins && lanes &&
                            rate(twist, p.at) + p.asked > Real(StepTolerance::passing_speed);
        if (!any(closes)) continue;
        more = true;
        failed = failed || (closes && (p.dropped || Mask(!(Real(own.friction) > Real(0.0)))));
        p.joins = p.joins || (closes && !p.dropped);
        stands = stands || (closes && !p.dropped);
        is_solved_ = false;
      }
    }
    return more;
  }

  // Remembers what pushes at the end of the step, by what was found, and books impacts. Returns the
  // lanes in which there are any.
  FAN_FN Mask keep(Real& impact) {
    impact = select(struck_ && stands, exchanged_, Real(0.0));
    feet.keep(lanes);
    return struck_ && stands;
  }

 private:
  using Patch = GroundPatch<Model, Real>;
  using Matrix = GroundMatrix<Real>;
  static constexpr int P = Matrix::most / 3;
  static constexpr int most_tries = 4;  // of modes; more are for the other solver

  // Solves the problem of all lanes that stand in the modes at hand; returns those in which the law
  // holds.
  template <class Links>
  FAN_FN Mask solve_trees(
      const Links& links, const Evaluation<Model, Real>& eval, const RowSystem<Model, Real>& rows,
      const Mask* near, const Real* guess, double cap) {
    for (int k = 0; k < N; ++k) taken_[k] = Real(0.0);
    for (int a = 0; a < rows.n; ++a) {
      const int r = rows.row[a];
      found_[r] = Real(0.0);
      s_[r] = -rows.problem.b[a];
      would_push_[r] = closes_[r] = Real(0.0) > Real(1.0);
    }
    residual = exchanged_ = Real(0.0);
    struck_ = Real(0.0) > Real(1.0);
    for (int j = 0; j < feet.n; ++j) {
      Foot& own = feet.foot[feet.found[j]];
      for (int i = 0; i < own.n; ++i) own.point[own.listed[i]].would_pull = Real(0.0) > Real(1.0);
    }
    Mask held = stands;
    for (int tree = 0; tree < groups_.trees(); ++tree)
      held = held && solve_some(tree, held, links, eval, rows, near, guess, cap);
    return held;
  }

  // In these lanes points that would have to pull and rows that would have to push take part no
  // longer, and rows that close do; whether there are any.
  FAN_FN bool change_modes(const Mask& some) {
    bool more = false;
    if (!any(some)) return more;
    for (int j = 0; j < feet.n; ++j) {
      Foot& own = feet.foot[feet.found[j]];
      for (int i = 0; i < own.n; ++i) {
        Point& p = own.point[own.listed[i]];
        const Mask leaves = p.would_pull && p.joins && some;
        p.joins = p.joins && !leaves;
        p.dropped = p.dropped || leaves;
        more = more || any(leaves);
      }
    }
    for (int r = 0; r < M; ++r) {
      const Mask leaves = would_push_[r] && some && !leaves_[r], joins = closes_[r] && some && !joins_[r] && !leaves_[r];
      leaves_[r] = leaves_[r] || leaves;
      joins_[r] = joins_[r] || joins;
      more = more || any(leaves || joins);
    }
    return more;
  }

  // hdot of the normal of a point of a link with this twist.
  FAN_FN Real rate(const Real* twist, const Real* at) const {
    Real v[3];
    cross(twist + 3, at, v);
    const double* n = feet.frame;
    return -((twist[0] + v[0]) * n[0] + (twist[1] + v[1]) * n[1] + (twist[2] + v[2]) * n[2]);
  }

  // Solves a tree's part of the problem in these lanes, all at once or, where what takes part in them
  // is too much, one after the other. Returns those in which the law holds.
  template <class Links>
  FAN_FN Mask solve_some(
      int tree, const Mask& some, const Links& links, const Evaluation<Model, Real>& eval,
      const RowSystem<Model, Real>& rows, const Mask* near, const Real* guess, double cap) {
    if (!any(some)) return some;
    if (list(tree, some, rows, near, guess)) {
      if (n_rows_ == 0 && n_feet_ == 0) return some;
      return solve(some, links, eval, rows, near, guess, cap);
    }
    Mask held = Real(0.0) > Real(1.0);
    for (int l = 0; l < width; ++l) {
      if (!lane_of(some, l)) continue;
      Mask own = Real(0.0) > Real(1.0);
      own.set(l, true);
      if (list(tree, own, rows, near, guess))
        held = held || solve(own, links, eval, rows, near, guess, cap);
    }
    return held;
  }

  // Lists the rows and feet of a tree that take part in these lanes; whether there is room for them.
  FAN_FN bool list(
      int tree, const Mask& some, const RowSystem<Model, Real>& rows, const Mask* near,
      const Real* guess) {
    n_rows_ = n_single_ = n_feet_ = 0;
    for (int a = 0; a < rows.n; ++a) {
      const int r = rows.row[a];
      if (row_tree_[r] != tree) continue;
      const Mask takes_part = near[r] && some;
      const Mask pulled = (guess[r] > Real(0.0) && !leaves_[r]) || joins_[r];
      const Mask pulls = rows.two_sided[a] ? takes_part : takes_part && pulled;
      row_[n_rows_++] = a;
      pulls_[a] = pulls;
      if (any(pulls)) {
        if (n_single_ == Matrix::most) return false;
        single_[n_single_++] = a;
      }
    }
    size_ = n_single_;
    for (int j = 0; j < feet.n; ++j) {
      const int which = feet.found[j];
      if (tree_[which] != tree) continue;
      Foot& own = feet.foot[which];
      Mask takes_part = Real(0.0) > Real(1.0);
      for (int i = 0; i < own.n; ++i) takes_part = takes_part || own.point[own.listed[i]].joins;
      if (!any(takes_part && some)) continue;
      if (size_ + 6 > Matrix::most) return false;
      first_[n_feet_] = size_;
      flat_[n_feet_] = patch_[n_feet_].make(own, feet.frame);
      size_ += patch_[n_feet_++].rank;
    }
    return true;
  }

  template <class Links>
  FAN_FN Mask solve(
      const Mask& some, const Links& links, const Evaluation<Model, Real>& eval,
      const RowSystem<Model, Real>& rows, const Mask* near, const Real* guess, double cap) {
    using std::abs;
    Mask good = some;
    const auto& problem = rows.problem;
    for (int i = 0; i < n_rows_; ++i) {
      const int a = row_[i];
      const Real most = problem.upper[a] * (1.0 - StepTolerance::at_bound);
      good = good && !(near[rows.row[a]] && guess[rows.row[a]] >= most);
    }
    Real scale = Real(0.0), worst = Real(0.0);
    for (int i = 0; i < n_single_; ++i) {
      has_[i] = pulls_[single_[i]];
      b_[i] = problem.b[single_[i]];
    }
    for (int p = 0; p < n_feet_; ++p) {
      push(p, links, eval);
      good = good && flat_[p];
      worst = maximum(select(patch_[p].here, patch_[p].misfit, Real(0.0)), worst);
    }
    for (int i = 0; i < size_; ++i) {
      has_[i] = has_[i] && some;
      b_[i] = select(has_[i], b_[i], Real(0.0));
      scale = maximum(Real(abs(b_[i])), scale);
    }
    good = good && worst <= Tolerance::residual * scale;
    if (!any(good)) return good;
    write(rows);
    const Mask redundant = matrix_.factorise(size_, Tolerance::least_pivot);
    recall(redundant, rows, guess);
    Real left = Real(unbounded);
    for (int i = 0; i < size_; ++i) y_[i] = Real(0.0);
    for (int k = 0; k < Tolerance::rounds; ++k) {
      const Mask rough = good && left > Tolerance::rough * scale;
      if (!any(rough)) break;
      if (k == 0) matrix_.take_column(left_, given_);
      else matrix_.substitute(left_);
      for (int i = 0; i < size_; ++i) y_[i] += select(rough, left_[i], Real(0.0));
      find_left(rows);
      left = Real(0.0);
      for (int i = 0; i < size_; ++i)
        left = maximum(select(matrix_.is_left_out(i), Real(0.0), Real(abs(left_[i]))), left);
    }
    for (int i = 0; i < size_; ++i) worst = maximum(Real(abs(left_[i])), worst);
    good = good && worst <= Tolerance::residual * scale && left < Real(unbounded);
    const Real share = worst / select(scale > Real(0.0), scale, Real(1.0));
    residual = select(good, maximum(share, residual), residual);
    check(rows, near, cap, good);
    take(good, rows);
    return good;
  }

  // W of a foot's rows, their b and what the forces of the step do to them.
  template <class Links>
  FAN_FN void push(int p, const Links& links, const Evaluation<Model, Real>& eval) {
    const Patch& own = patch_[p];
    const int link = own.foot->link, parts = own.rank > 3 ? 2 : 1;
    const int *entry = Model::moved_D_entry + Model::moved_D_begin[link];
    const int n = Model::moved_D_begin[link + 1] - Model::moved_D_begin[link];
    const Real* twist = links.twist(link);
    Real moment[9], *at_start = at_start_[p];
    for (int d = 0; d < 9; d += 3) cross(own.middle, own.frame + d, moment + d);
    for (int d = 0; d < 3; ++d) {
      const Real* e = own.frame + 3 * d;
      at_start[d] = -(dot3(e, twist) + dot3(moment + 3 * d, twist + 3));
      at_start[3 + d] = -own.size * dot3(e, twist + 3);
    }
    for (int part = 0; part < parts; ++part) {
      Triple<Real> row[room(N)];
      for (int j = 0; j < n; ++j) {
        const Real* s = links.screw(entry[j]);
        for (int d = 0; d < 3; ++d) {
          const Real* e = own.frame + 3 * d;
          row[entry[j]].of[d] = part == 0 ? -(dot3(e, s) + dot3(moment + 3 * d, s + 3))
                                          : -own.size * dot3(e, s + 3);
        }
      }
      Model::push(link, eval.L, row, W_[p][part]);
      for (int d = 0; d < 3; ++d) {
        Real sum = Real(0.0);
        for (int j = 0; j < n; ++j) sum += W_[p][part][entry[j]].of[d] * eval.w0[entry[j]];
        by_forces_[p][3 * part + d] = dt_ * sum;
      }
    }
    for (int k = 0; k < own.rank; ++k) {
      has_[first_[p] + k] = own.has(k);
      b_[first_[p] + k] = at_start[k] + by_forces_[p][k] + own.asked[k];
    }
    for (int k = own.rank; k < 6; ++k) by_forces_[p][k] = Real(0.0);
  }

  // G on its diagonal and to the right of it, and b beside it.
  FAN_FN void write(const RowSystem<Model, Real>& rows) {
    constexpr int from = Complementarity<Real, M>::N;
    matrix_.resize(size_);
    for (int i = 0; i < n_single_; ++i) {
      const Real* row = rows.problem.G + single_[i] * from;
      for (int j = i; j < n_single_; ++j) put(i, j, row[single_[j]]);
    }
    for (int p = 0; p < n_feet_; ++p) {
      const int link = patch_[p].foot->link, rank = patch_[p].rank;
      const int *begin = Model::moved_D_entry + Model::moved_D_begin[link];
      const int *end = Model::moved_D_entry + Model::moved_D_begin[link + 1];
      for (int k = 0; k < rank; k += 3) {
        const Triple<Real>* own = W_[p][k / 3];
        const int column = first_[p] + k, height = rank - k < 3 ? rank - k : 3;
        for (int i = 0; i < n_single_; ++i) {
          Triple<Real> sum;
          sum.clear();
          const Real* w = rows.column[single_[i]];
          for (const int* e = begin; e < end; ++e) sum.add(w[*e], own[*e]);
          for (int d = 0; d < height; ++d) put(i, column + d, sum.of[d]);
        }
        for (int q = 0; q <= p; ++q)
          for (int m = 0; m < patch_[q].rank && (q < p || m <= k); m += 3)
            block(q, m, own, begin, end, column, height);
      }
    }
    for (int i = 0; i < size_; ++i) matrix_.at(i, size_) = b_[i];
  }

  // The products of part m of foot q and three columns.
  FAN_FN void block(
      int q, int m, const Triple<Real>* own, const int* begin, const int* end, int column,
      int height) {
    const Triple<Real>* other = W_[q][m / 3];
    const int link = patch_[q].foot->link, rank = patch_[q].rank;
    const int* its = Model::moved_D_entry + Model::moved_D_begin[link];
    const int* its_end = Model::moved_D_entry + Model::moved_D_begin[link + 1];
    Triple<Real> sum[3];
    for (int d = 0; d < 3; ++d) sum[d].clear();
    while (begin < end && its < its_end) {
      if (*begin == *its) {
        for (int d = 0; d < 3; ++d) sum[d].add(other[*its].of[d], own[*its]);
        ++begin;
        ++its;
      } else if (*begin < *its) {
        ++begin;
      } else {
        ++its;
      }
    }
    const int first = first_[q] + m, rows = rank - m < 3 ? rank - m : 3;
    for (int d = 0; d < rows; ++d)
      for (int e = 0; e < height; ++e)
        if (first + d <= column + e) put(first + d, column + e, sum[d].of[e]);
  }

  FAN_FN void put(int i, int j, const Real& value) {
    matrix_.at(i, j) = select(has_[i] && has_[j], value, Real(i == j ? 1.0 : 0.0));
  }

  // What redundant rows keep: what they had in the step before.
  FAN_FN void recall(const Mask& redundant, const RowSystem<Model, Real>& rows, const Real* guess) {
    for (int i = 0; i < size_; ++i) given_[i] = Real(0.0);
    if (!any(redundant)) return;
    for (int i = 0; i < n_single_; ++i) given_[i] = select(has_[i], guess[rows.row[single_[i]]], Real(0.0));
    for (int p = 0; p < n_feet_; ++p) {
      Real x[6];
      patch_[p].add_up(x);
      for (int k = 0; k < patch_[p].rank; ++k) {
        const int i = first_[p] + k;
        given_[i] = select(has_[i], x[k], Real(0.0));
      }
    }
  }

  // left = b - G y, and the speeds that are left of the tree's rows.
  FAN_FN void find_left(const RowSystem<Model, Real>& rows) {
    Real w[room(N)];
    for (int k = 0; k < N; ++k) w_[k] = Real(0.0);
    for (int p = 0; p < n_feet_; ++p) {
      const int link = patch_[p].foot->link;
      for (int k = 0; k < patch_[p].rank; k += 3) {
        const Triple<Real>* own = W_[p][k / 3];
        const Real* y = y_ + first_[p] + k;
        const Real third = k + 2 < patch_[p].rank ? y[2] : Real(0.0);
        for (int j = Model::moved_D_begin[link]; j < Model::moved_D_begin[link + 1]; ++j) {
          const int e = Model::moved_D_entry[j];
          w_[e] -= own[e].of[0] * y[0] + own[e].of[1] * y[1] + own[e].of[2] * third;
        }
      }
    }
    for (int k = 0; k < N; ++k) w[k] = w_[k];
    Real pull[room(M)];
    for (int a = 0; a < rows.n; ++a) pull[a] = Real(0.0);
    for (int i = 0; i < n_single_; ++i) pull[single_[i]] = -y_[i];
    rows.add(pull, w);
    rows.along(w, speed_);
    for (int i = 0; i < n_rows_; ++i) speed_[row_[i]] += rows.problem.b[row_[i]];
    for (int i = 0; i < n_single_; ++i) left_[i] = speed_[single_[i]];
    for (int p = 0; p < n_feet_; ++p) {
      const int link = patch_[p].foot->link;
      for (int k = 0; k < patch_[p].rank; k += 3) {
        const Triple<Real>* own = W_[p][k / 3];
        Triple<Real> sum;
        sum.clear();
        for (int j = Model::moved_D_begin[link]; j < Model::moved_D_begin[link + 1]; ++j)
          sum.add(w[Model::moved_D_entry[j]], own[Model::moved_D_entry[j]]);
        for (int d = 0; d < 3 && k + d < patch_[p].rank; ++d)
          left_[first_[p] + k + d] = b_[first_[p] + k + d] + sum.of[d];
      }
    }
    for (int i = 0; i < size_; ++i) left_[i] = select(has_[i], left_[i], Real(0.0));
  }

  // Narrows `good` to the lanes in which what was found obeys the law.
  FAN_FN void check(const RowSystem<Model, Real>& rows, const Mask* near, double cap, Mask& good) {
    const Mask solved = good;
    Mask struck = Real(0.0) > Real(1.0);
    for (int i = 0; i < n_single_; ++i) {
      const int a = single_[i];
      const Mask within = y_[i] >= rows.problem.lower[a] && y_[i] <= rows.problem.upper[a];
      would_push_[rows.row[a]] = solved && has_[i] && y_[i] < rows.problem.lower[a];
      good = good && (!has_[i] || within);
    }
    for (int i = 0; i < n_rows_; ++i) {
      const int a = row_[i];
      const Mask closes = near[rows.row[a]] && !pulls_[a] && !(speed_[a] <= Real(0.0));
      closes_[rows.row[a]] = closes && solved;
      good = good && !closes;
    }
    for (int p = 0; p < n_feet_; ++p) {
      Patch& own = patch_[p];
      const Real* x = y_ + first_[p];
      Real all[6];
      for (int k = 0; k < 6; ++k) all[k] = k < own.rank ? x[k] : Real(0.0);
      good = good && (!own.here || (own.share(all, feet.frame) && x[0] <= Real(cap)));
      for (int j = 0; j < own.n(); ++j) {
        Point& point = own.point(j);
        point.would_pull = point.would_pull && solved;
        const Real by_forces = own.normal_rate(j, by_forces_[p]);
        const Real most = maximum(by_forces, Real(StepTolerance::passing_speed));
        point.rests = own.normal_rate(j, at_start_[p]) <= most;
        const Mask is_new = !point.pushes || point.steps < Real(StepTolerance::steps_of_impact);
        const Mask strikes = (is_new && !point.rests) || Feet::closes(point);
        struck = struck || (point.joins && strikes);
      }
    }
    struck_ = struck_ || (good && struck);
  }

  // Half of what the impulses of the feet take: each acts at the mean of the velocities before and
  // after the step, where points end as fast as they are asked to.
  FAN_FN Real half_exchanged() const {
    Real sum = Real(0.0);
    for (int p = 0; p < n_feet_; ++p)
      for (int k = 0; k < patch_[p].rank; ++k)
        sum += y_[first_[p] + k] * (at_start_[p][k] - patch_[p].asked[k]);
    return 0.5 * sum;
  }

  // Takes the solution in these lanes.
  FAN_FN void take(const Mask& good, const RowSystem<Model, Real>& rows) {
    for (int k = 0; k < N; ++k) taken_[k] += select(good, w_[k], Real(0.0));
    exchanged_ += select(good, half_exchanged(), Real(0.0));
    for (int i = 0; i < n_rows_; ++i) {
      const int a = row_[i], r = rows.row[a];
      s_[r] = select(good, select(pulls_[a], Real(0.0), Real(-speed_[a])), s_[r]);
    }
    for (int i = 0; i < n_single_; ++i) {
      Real& to = found_[rows.row[single_[i]]];
      to = select(good && has_[i], y_[i], to);
    }
    for (int p = 0; p < n_feet_; ++p)
      for (int j = 0; j < patch_[p].n(); ++j) {
        Point& to = patch_[p].point(j);
        for (int c = 0; c < 3; ++c)
          to.found[c] = select(good && to.joins, patch_[p].impulse(j)[c], to.found[c]);
      }
  }

  double dt_ = 0.0;
  bool is_solved_ = false;
  Real solved_near_;                     // rows that took part in the last solve
  ContactGroups<Model> groups_;
  int tree_[Feet::B], row_tree_[room(M)];  // of feet and rows
  Real taken_[room(N)], exchanged_;      // of the feet: - W x, and half_exchanged()
  Mask struck_;                          // lanes with an impact
  Real found_[room(M)], s_[room(M)];     // of the rows
  // Of the part that is solved: its rows, those that pull in some lane, its feet.
  int n_rows_ = 0, n_single_ = 0, n_feet_ = 0, size_ = 0;
  int row_[room(M)], single_[room(M)], first_[P];
  Mask pulls_[room(M)], flat_[P];
  // By row: lanes in which it would have to push, or closes, in the last solution, and in which it has
  // left or joined those that pull in this step for that.
  Mask would_push_[room(M)], closes_[room(M)], leaves_[room(M)], joins_[room(M)];
  Patch patch_[P];
  Triple<Real> W_[P][2][room(N)];
  Real at_start_[P][6], by_forces_[P][6];  // hdot of their rows, and what the forces of the step change
  Mask has_[Matrix::most];               // lanes in which an unknown is one
  Real b_[Matrix::most], y_[Matrix::most], left_[Matrix::most], given_[Matrix::most];
  Real w_[room(N)], speed_[room(M)];     // - W y of the feet; of all gathered rows
  Matrix matrix_;
};

}  // namespace fan

FAN_LOOPS_END
