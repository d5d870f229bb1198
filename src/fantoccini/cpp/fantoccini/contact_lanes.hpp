// The contacts of a bundle of lanes: an attempt at the problems of all lanes at once (cone_lanes.hpp)
// before each is solved by itself. Lanes whose groups differ take part in what belongs to the same
// first tree.
#pragma once

#include <type_traits>

#include "cone_lanes.hpp"
#include "contact_problem.hpp"

namespace fan {

template <class Model, class Real>
class ContactLanes : public ContactProblem<Model, Real> {
  using Problem = ContactProblem<Model, Real>;

 public:
  using Problem::C, Problem::M, Problem::width, Problem::residual;
  using typename Problem::Mask;

 protected:
  using Problem::groups_, Problem::points_, Problem::columns_, Problem::in_, Problem::near_;
  using Problem::x_, Problem::s_, Problem::b_;

  // Solves the problems of these lanes; returns those that were solved. The others' impulses, those of
  // the rows in `guess`, are a better guess than before.
  FAN_FN Mask solve_together(
      const Mask& lanes, const RowSystem<Model, Real>& rows, const Mask* near, Real* guess, double cap,
      Real* found, Real* s) {
    name_groups(lanes, rows, near);
    const LaneMatrix<Real, M, C> G{
        rows.problem.G, Complementarity<Real, M>::N, columns_.across, columns_.blocks()};
    Mask solved = lanes;
    Real worst = Real(0.0);
    for (int a = 0; a < rows.n; ++a) {
      found[a] = select(lanes, Real(0.0), found[a]);
      s[a] = select(lanes, Real(-rows.problem.b[a]), s[a]);
    }
    for (int group = 0; group < groups_.trees(); ++group) {
      const Mask here = choose_in_lanes(group, solved, rows, guess, cap);
      if (!any(here)) continue;
      const Mask done = cone_lanes_.solve(G, here);
      solved = solved && (done || !here);
      const auto& of = cone_lanes_;
      worst = select(here && of.residual > worst, of.residual, worst);
      for (int k = 0; k < of.n_single; ++k) {
        const Mask own = done && of.has_single[k];
        found[of.single[k]] = select(own, of.x_single[k], found[of.single[k]]);
        s[of.single[k]] = select(own, of.s_single[k], s[of.single[k]]);
        Real& next = guess[rows.row[of.single[k]]];
        next = select(here && of.has_single[k], of.x_single[k], next);
      }
      for (int k = 0; k < of.n_contacts; ++k) {
        const Mask own = here && of.has_contact[k];
        for (int d = 0; d < 3; ++d) {
          Real &x = x_[3 * of.contact[k] + d], &u = s_[3 * of.contact[k] + d];
          x = select(own, of.x[3 * k + d], x);
          u = select(own, of.s[3 * k + d], u);
        }
      }
    }
    residual = select(solved, worst, residual);
    return solved;
  }

 private:
  // Names the groups of the points and rows that take part in these lanes; -1 for others.
  FAN_FN void name_groups(
      const Mask& lanes, const RowSystem<Model, Real>& rows, const Mask* near) {
    for (int l = 0; l < width; ++l) {
      const bool here = lane_of(lanes, l);
      groups_.begin();
      for (int i = 0; i < points_.most; ++i) {
        point_group_[i][l] = -1;
        if (!here || i >= points_.n[l] || !near_[l][i]) continue;
        const int pair = points_.point[l][i].pair, *solids = in_->pairs + 2 * pair;
        lane_of(mu_[i], l) = in_->friction[pair];
        point_group_[i][l] =
            groups_.joined(in_->solids[solids[0]].link, in_->solids[solids[1]].link);
      }
      for (int a = 0; a < rows.n; ++a)
        row_group_[a][l] =
            here && lane_of(near[rows.row[a]], l) ? groups_.named(groups_.of_row(rows.row[a])) : -1;
      for (int i = 0; i < points_.most; ++i)
        if (point_group_[i][l] >= 0) point_group_[i][l] = groups_.named(point_group_[i][l]);
    }
  }

  FAN_FN static Mask are(const int* names, int group, const Mask& lanes) {
    Real out = Real(0.0);
    for (int l = 0; l < width; ++l) lane_of(out, l) = names[l] == group ? 1.0 : 0.0;
    return lanes && out > Real(0.5);
  }

  // Gives cone_lanes_ the rows and points of one group; returns the lanes that have any.
  FAN_FN Mask choose_in_lanes(
      int group, const Mask& lanes, const RowSystem<Model, Real>& rows, const Real* guess,
      double cap) {
    auto& to = cone_lanes_;
    Mask some = Real(0.0) > Real(1.0);
    to.n_single = to.n_contacts = 0;
    to.most = Real(cap);
    for (int a = 0; a < rows.n; ++a) {
      const Mask own = are(row_group_[a], group, lanes);
      if (!any(own)) continue;
      some = some || own;
      const int k = to.n_single++;
      to.single[k] = a;
      to.has_single[k] = own;
      to.b_single[k] = rows.problem.b[a];
      to.lower[k] = rows.problem.lower[a];
      to.upper[k] = rows.problem.upper[a];
      to.x_single[k] = guess[rows.row[a]];
    }
    for (int i = 0; i < points_.most; ++i) {
      const Mask own = are(point_group_[i], group, lanes);
      if (!any(own)) continue;
      some = some || own;
      const int k = to.n_contacts++;
      to.contact[k] = i;
      to.has_contact[k] = own;
      to.mu[k] = select(own, mu_[i], Real(0.0));
      for (int d = 0; d < 3; ++d) {
        to.b[3 * k + d] = b_[3 * i + d];
        to.x[3 * k + d] = x_[3 * i + d];
      }
    }
    return some;
  }

  struct Alone {};
  std::conditional_t<(width > 1), ConeLanes<Real, M, C>, Alone> cone_lanes_;
  // By point and row, and lane.
  int point_group_[room(C)][width], row_group_[room(M)][width];
  Real mu_[room(C)];
};

}  // namespace fan
