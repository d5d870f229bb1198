// The linear equations of ground_lanes.hpp: G x = b over strings and limits and F and T of feet, in
// all lanes at once. Unknowns that take no part in a lane have a row of the unit matrix there.
#pragma once

#include "fantoccini/contact/ground_matrix.hpp"
#include "fantoccini/contact/ground_patch.hpp"
#include "fantoccini/contact/groups.hpp"
#include "fantoccini/contact/patches.hpp"

FAN_LOOPS_BEGIN

namespace fan {

template <class Model, class Real>
class GroundSystem {
 public:
  static constexpr int N = Model::n_vD, M = Model::n_rows, width = Traits<Real>::width;
  using Mask = typename Traits<Real>::Mask;
  using Feet = GroundFeet<Model, Real>;
  using Foot = typename Feet::Foot;
  using Point = typename Feet::Point;
  using Tolerance = ContactPatchesTolerances;
  using StepTolerance = ContactStepTolerances;

  using Patch = GroundPatch<Model, Real>;
  using Matrix = GroundMatrix<Real>;
  static constexpr int P = Matrix::capacity / 3;

  double dt = 0.0;  // s: of the step
  // Listed: rows, those that pull in some lane, feet.
  int n_rows = 0, n_single = 0, n_feet = 0;
  int row[array_size(M)], single[array_size(M)], first[P];
  Mask pulls[array_size(M)];
  // Lanes in which a row has left or joined the pulling rows in this step.
  Mask leaves[array_size(M)], joins[array_size(M)];
  Patch patch[P];
  Real at_start[P][6],
      by_forces[P][6];         // hdot of their rows; changes by the forces of the step
  Mask has[Matrix::capacity];  // lanes that have an unknown
  Real y[Matrix::capacity];
  Real taken[array_size(N)],
      speed[array_size(M)];  // - W y of the feet; hdot at the end of all gathered rows

  FAN_FN int trees() const { return groups_.trees(); }

  FAN_FN void begin(const Feet& feet) {
    groups_.begin();
    for (int i = 0; i < Feet::B; ++i)
      if (feet.foot[i].pair >= 0) tree_[i] = groups_.joined(feet.foot[i].link, -1);
    for (int r = 0; r < M; ++r) row_tree_[r] = groups_.of_row(r);
  }

  // Lists the rows and feet of a tree that take part in these lanes. Returns whether they fit.
  FAN_FN bool list(
      int tree, const Mask& selected, Feet& feet, const RowSystem<Model, Real>& rows,
      const Mask* near, const Real* guess) {
    n_rows = n_single = n_feet = 0;
    for (int a = 0; a < rows.n; ++a) {
      const int r = rows.row[a];
      if (row_tree_[r] != tree) continue;
      const Mask takes_part = near[r] && selected;
      const Mask pulled = (guess[r] > Real(0.0) && !leaves[r]) || joins[r];
      const Mask pulling = rows.two_sided[a] ? takes_part : takes_part && pulled;
      row[n_rows++] = a;
      pulls[a] = pulling;
      if (any(pulling)) {
        if (n_single == Matrix::capacity) return false;
        single[n_single++] = a;
      }
    }
    size_ = n_single;
    for (int j = 0; j < feet.n; ++j) {
      const int which = feet.with_points[j];
      if (tree_[which] != tree) continue;
      Foot& own = feet.foot[which];
      Mask takes_part = Real(0.0) > Real(1.0);
      for (int i = 0; i < own.n; ++i) takes_part = takes_part || own.point[own.listed[i]].joins;
      if (!any(takes_part && selected)) continue;
      if (size_ + 6 > Matrix::capacity) return false;
      first[n_feet] = size_;
      flat_[n_feet] = patch[n_feet].load(own, feet.frame);
      size_ += patch[n_feet++].rank;
    }
    return true;
  }

  // Solves for the listed rows and feet in these lanes. Returns those in which there is a solution,
  // and in `share` the residual relative to the largest |b|.
  template <class Links>
  FAN_FN Mask solve_listed(
      const Mask& selected, const Links& links, const Evaluation<Model, Real>& eval,
      const RowSystem<Model, Real>& rows, const Mask* near, const Real* guess, Real& share) {
    using std::abs;
    Mask good = selected;
    const auto& problem = rows.problem;
    for (int i = 0; i < n_rows; ++i) {
      const int a = row[i];
      const Real most = problem.upper[a] * (1.0 - StepTolerance::at_bound);
      good = good && !(near[rows.row[a]] && guess[rows.row[a]] >= most);
    }
    Real scale = Real(0.0), worst = Real(0.0);
    for (int i = 0; i < n_single; ++i) {
      has[i] = pulls[single[i]];
      b_[i] = problem.b[single[i]];
    }
    for (int p = 0; p < n_feet; ++p) {
      push(p, links, eval);
      good = good && flat_[p];
      worst = maximum(select(patch[p].here, patch[p].misfit, Real(0.0)), worst);
    }
    for (int i = 0; i < size_; ++i) {
      has[i] = has[i] && selected;
      b_[i] = select(has[i], b_[i], Real(0.0));
      scale = maximum(Real(abs(b_[i])), scale);
    }
    good = good && worst <= Tolerance::residual * scale;
    share = Real(0.0);
    if (!any(good)) return good;
    write(rows);
    const Mask redundant = matrix_.factorise(size_, Tolerance::least_pivot);
    recall(redundant, rows, guess);
    Real left = Real(unbounded);
    for (int i = 0; i < size_; ++i) y[i] = Real(0.0);
    for (int k = 0; k < Tolerance::rounds; ++k) {
      const Mask rough = good && left > Tolerance::no_refinement * scale;
      if (!any(rough)) break;
      if (k == 0) matrix_.take_column(left_, given_);
      else matrix_.substitute(left_);
      for (int i = 0; i < size_; ++i) y[i] += select(rough, left_[i], Real(0.0));
      find_left(rows);
      left = Real(0.0);
      for (int i = 0; i < size_; ++i)
        left = maximum(select(matrix_.is_left_out(i), Real(0.0), Real(abs(left_[i]))), left);
    }
    for (int i = 0; i < size_; ++i) worst = maximum(Real(abs(left_[i])), worst);
    good = good && worst <= Tolerance::residual * scale && left < Real(unbounded);
    share = worst / select(scale > Real(0.0), scale, Real(1.0));
    return good;
  }

  // Half of the energy taken by the impulses of the feet: each acts at the mean of the velocities
  // before and after the step, at which points have their required rates.
  FAN_FN Real half_exchanged() const {
    Real sum = Real(0.0);
    for (int p = 0; p < n_feet; ++p)
      for (int k = 0; k < patch[p].rank; ++k)
        sum += y[first[p] + k] * (at_start[p][k] - patch[p].required[k]);
    return 0.5 * sum;
  }

 private:
  // W of a foot's rows, their b, and the effect of the step's forces on them.
  template <class Links>
  FAN_FN void push(int p, const Links& links, const Evaluation<Model, Real>& eval) {
    const Patch& own = patch[p];
    const int link = own.foot->link, parts = own.rank > 3 ? 2 : 1;
    const int* entry = Model::moved_D_entry + Model::moved_D_begin[link];
    const int n = Model::moved_D_begin[link + 1] - Model::moved_D_begin[link];
    const Real* twist = links.twist(link);
    Real moment[9], *start = at_start[p];
    for (int d = 0; d < 9; d += 3) cross(own.middle, own.frame + d, moment + d);
    for (int d = 0; d < 3; ++d) {
      const Real* e = own.frame + 3 * d;
      start[d] = -(dot3(e, twist) + dot3(moment + 3 * d, twist + 3));
      start[3 + d] = -own.size * dot3(e, twist + 3);
    }
    for (int part = 0; part < parts; ++part) {
      Triple<Real> row_of[array_size(N)];
      for (int j = 0; j < n; ++j) {
        const Real* s = links.screw(entry[j]);
        for (int d = 0; d < 3; ++d) {
          const Real* e = own.frame + 3 * d;
          row_of[entry[j]].of[d] =
              part == 0 ? -(dot3(e, s) + dot3(moment + 3 * d, s + 3)) : -own.size * dot3(e, s + 3);
        }
      }
      Model::push(link, eval.L, row_of, W_[p][part]);
      for (int d = 0; d < 3; ++d) {
        Real sum = Real(0.0);
        for (int j = 0; j < n; ++j) sum += W_[p][part][entry[j]].of[d] * eval.w0[entry[j]];
        by_forces[p][3 * part + d] = dt * sum;
      }
    }
    for (int k = 0; k < own.rank; ++k) {
      has[first[p] + k] = own.has_row(k);
      b_[first[p] + k] = start[k] + by_forces[p][k] + own.required[k];
    }
    for (int k = own.rank; k < 6; ++k) by_forces[p][k] = Real(0.0);
  }

  // G on its diagonal and to the right of it, with b beside it.
  FAN_FN void write(const RowSystem<Model, Real>& rows) {
    constexpr int from = Complementarity<Real, M>::N;
    matrix_.resize(size_);
    for (int i = 0; i < n_single; ++i) {
      const Real* G = rows.problem.G + single[i] * from;
      for (int j = i; j < n_single; ++j) put(i, j, G[single[j]]);
    }
    for (int p = 0; p < n_feet; ++p) {
      const int link = patch[p].foot->link, rank = patch[p].rank;
      const int* begin = Model::moved_D_entry + Model::moved_D_begin[link];
      const int* end = Model::moved_D_entry + Model::moved_D_begin[link + 1];
      for (int k = 0; k < rank; k += 3) {
        const Triple<Real>* own = W_[p][k / 3];
        const int column = first[p] + k, height = rank - k < 3 ? rank - k : 3;
        for (int i = 0; i < n_single; ++i) {
          Triple<Real> sum;
          sum.clear();
          const Real* w = rows.column[single[i]];
          for (const int* e = begin; e < end; ++e) sum.add(w[*e], own[*e]);
          for (int d = 0; d < height; ++d) put(i, column + d, sum.of[d]);
        }
        for (int q = 0; q <= p; ++q)
          for (int m = 0; m < patch[q].rank && (q < p || m <= k); m += 3)
            block(q, m, own, begin, end, column, height);
      }
    }
    for (int i = 0; i < size_; ++i) matrix_.at(i, size_) = b_[i];
  }

  // Products of part m of foot q and three columns.
  FAN_FN void block(
      int q, int m, const Triple<Real>* own, const int* begin, const int* end, int column,
      int height) {
    const Triple<Real>* other = W_[q][m / 3];
    const int link = patch[q].foot->link, rank = patch[q].rank;
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
    const int top = first[q] + m, rows = rank - m < 3 ? rank - m : 3;
    for (int d = 0; d < rows; ++d)
      for (int e = 0; e < height; ++e)
        if (top + d <= column + e) put(top + d, column + e, sum[d].of[e]);
  }

  FAN_FN void put(int i, int j, const Real& value) {
    matrix_.at(i, j) = select(has[i] && has[j], value, Real(i == j ? 1.0 : 0.0));
  }

  // Redundant rows keep their impulses of the previous step.
  FAN_FN void recall(const Mask& redundant, const RowSystem<Model, Real>& rows, const Real* guess) {
    for (int i = 0; i < size_; ++i) given_[i] = Real(0.0);
    if (!any(redundant)) return;
    for (int i = 0; i < n_single; ++i)
      given_[i] = select(has[i], guess[rows.row[single[i]]], Real(0.0));
    for (int p = 0; p < n_feet; ++p) {
      Real x[6];
      patch[p].sum_impulses(x);
      for (int k = 0; k < patch[p].rank; ++k) {
        const int i = first[p] + k;
        given_[i] = select(has[i], x[k], Real(0.0));
      }
    }
  }

  // left = b - G y, and the residual speeds of the tree's rows.
  FAN_FN void find_left(const RowSystem<Model, Real>& rows) {
    Real w[array_size(N)];
    for (int k = 0; k < N; ++k) taken[k] = Real(0.0);
    for (int p = 0; p < n_feet; ++p) {
      const int link = patch[p].foot->link;
      for (int k = 0; k < patch[p].rank; k += 3) {
        const Triple<Real>* own = W_[p][k / 3];
        const Real* x = y + first[p] + k;
        const Real third = k + 2 < patch[p].rank ? x[2] : Real(0.0);
        for (int j = Model::moved_D_begin[link]; j < Model::moved_D_begin[link + 1]; ++j) {
          const int e = Model::moved_D_entry[j];
          taken[e] -= own[e].of[0] * x[0] + own[e].of[1] * x[1] + own[e].of[2] * third;
        }
      }
    }
    for (int k = 0; k < N; ++k) w[k] = taken[k];
    Real pull[array_size(M)];
    for (int a = 0; a < rows.n; ++a) pull[a] = Real(0.0);
    for (int i = 0; i < n_single; ++i) pull[single[i]] = -y[i];
    rows.add(pull, w);
    rows.along(w, speed);
    for (int i = 0; i < n_rows; ++i) speed[row[i]] += rows.problem.b[row[i]];
    for (int i = 0; i < n_single; ++i) left_[i] = speed[single[i]];
    for (int p = 0; p < n_feet; ++p) {
      const int link = patch[p].foot->link;
      for (int k = 0; k < patch[p].rank; k += 3) {
        const Triple<Real>* own = W_[p][k / 3];
        Triple<Real> sum;
        sum.clear();
        for (int j = Model::moved_D_begin[link]; j < Model::moved_D_begin[link + 1]; ++j)
          sum.add(w[Model::moved_D_entry[j]], own[Model::moved_D_entry[j]]);
        for (int d = 0; d < 3 && k + d < patch[p].rank; ++d)
          left_[first[p] + k + d] = b_[first[p] + k + d] + sum.of[d];
      }
    }
    for (int i = 0; i < size_; ++i) left_[i] = select(has[i], left_[i], Real(0.0));
  }

  ContactGroups<Model> groups_;
  int tree_[Feet::B], row_tree_[array_size(M)];  // of feet and rows
  int size_ = 0;
  Mask flat_[P];
  Triple<Real> W_[P][2][array_size(N)];
  Real b_[Matrix::capacity], left_[Matrix::capacity], given_[Matrix::capacity];  // left: b - G y
  Matrix matrix_;
};

}  // namespace fan

FAN_LOOPS_END
