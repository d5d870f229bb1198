// Bundles of lanes that stand: where all contacts are sticking feet on the ground
// (ground_feet.hpp), the law of patches.hpp is solved in all lanes at once, by the equations of
// ground_system.hpp over the feet and the strings and limits that pulled in the previous step.
//
// Where a foot's force would have to act beyond an edge, only the points on that edge take part
// further; rows that would push leave, and rows and points that close join. Lanes without a
// solution of the law after that make their steps on their own. No lane's result depends on its
// neighbours.
#pragma once

#include "fantoccini/contact/ground_system.hpp"
#include "fantoccini/contact/rolling.hpp"

FAN_LOOPS_BEGIN

namespace fan {

template <class Model, class Real>
class GroundLanes {
  using System = GroundSystem<Model, Real>;
  using Rolling = RollingPoints<Model, double>;

 public:
  static constexpr int N = System::N, M = System::M, width = System::width;
  using Mask = typename System::Mask;
  using Feet = typename System::Feet;
  using Foot = typename System::Foot;
  using Point = typename System::Point;
  using StepTolerance = typename System::StepTolerance;

  Feet feet;
  Mask lanes = Real(0.0) > Real(1.0);  // lanes solved here in this step
  Mask stands = lanes;                 // of these, lanes in which points take part
  Real depth, residual;                // m: of the deepest overlap; of the law

  FAN_FN void begin(const ContactArrays& in) {
    feet.begin(in);
    system_.begin(feet);
    lanes = stands = Real(0.0) > Real(1.0);
  }

  // Loads the points of feet.found at the start of a step in these lanes; removes from `lanes`
  // those that cannot be solved here.
  template <class Links>
  FAN_FN void start(
      const Links& links, const Mask& selected, double dt, double whole, double recovery_speed) {
    lanes = selected;
    stands = Real(0.0) > Real(1.0);
    depth = residual = exchanged_ = Real(0.0);
    struck_ = stands;
    is_solved_ = false;
    for (int r = 0; r < M; ++r) system_.joins[r] = system_.leaves[r] = Real(0.0) > Real(1.0);
    system_.dt = dt;
    for (int j = 0; j < feet.n; ++j) {
      Foot& own = feet.foot[feet.with_points[j]];
      const Real* twist = links.twist(own.link);
      Mask takes_part = Real(0.0) > Real(1.0);
      for (int i = 0; i < own.n; ++i) {
        Point& p = own.point[own.listed[i]];
        p.joins = p.here && p.pushes;
        takes_part = takes_part || p.joins;
        depth = select(p.here && lanes, maximum(Real(-p.gap), depth), depth);
        const Real h = -p.gap, hdot = rate(twist, p.at);
        const Real back = h / select(h > Real(0.0), Real(whole > dt ? whole : dt), Real(dt));
        p.required = minimum(back, Real(recovery_speed));
        const Mask may_bounce = hdot > Real(own.restitution > 0.0 ? 0.0 : unbounded);
        lanes = lanes && (!p.here || p.joins || !may_bounce);
      }
      if (!(own.friction > 0.0)) lanes = lanes && !takes_part;
      stands = stands || takes_part;
    }
    stands = stands && lanes;
  }

  // Whether an ellipsoid that pushed in the previous step is still near in any of the lanes.
  FAN_FN bool rolls() const {
    Mask rolling = Real(0.0) > Real(1.0);
    for (int j = 0; j < feet.n; ++j) {
      const Foot& own = feet.foot[feet.with_points[j]];
      if (own.is_round && own.n > 0) rolling = rolling || (own.point[0].joins && lanes);
    }
    return any(rolling);
  }

  // Sets `drift` so that the rates of rolling ellipsoids vanish in the middle of the step: see
  // rolling.hpp. After links.look_ahead().
  template <class Links>
  FAN_FN void require_in_middle(const ContactArrays& in, const Links& links) {
    for (int j = 0; j < feet.n; ++j) {
      const int solid = feet.with_points[j];
      Foot& own = feet.foot[solid];
      if (!own.is_round || own.n == 0) continue;
      Point& p = own.point[0];
      const Solid& plane = in.solids[in.pairs[2 * own.pair + 1]];
      const Real *start = links.twist(own.link), *middle = links.twist_in_middle(own.link);
      touch_plane_lanes(
          in.solids[solid], links.pose_in_middle(own.link), plane, Real(unbounded), p.joins,
          [&](int, const Real* at, const Real&, const Mask& where) {
            for (int d = 0; d < 3; ++d) {
              const double share = d == 0 ? Rolling::of_normals : 1.0;
              const double* e = feet.frame + 3 * d;
              const Real change = rate(e, middle, at) - rate(e, start, p.at);
              p.drift[d] = select(where, Real(share * change), Real(0.0));
            }
          });
    }
  }

  // Gives up these lanes.
  FAN_FN void leave(const Mask& failed) {
    lanes = lanes && !failed;
    stands = stands && !failed;
  }

  // Solves the law in the lanes that stand, for impulses and s of the gathered rows. Returns the
  // lanes in which the result does not satisfy the law.
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

  // Impulse and s of row r in the solution.
  FAN_FN const Real& impulse(int r) const { return impulse_[r]; }
  FAN_FN const Real& s(int r) const { return s_[r]; }

  // w <- w - W x over the feet.
  FAN_FN void add(Real* w) const {
    if (!any(stands)) return;
    for (int k = 0; k < N; ++k) w[k] += select(stands, taken_[k], Real(0.0));
  }

  // Reduction of hdot of gathered row a by the feet.
  FAN_FN Real rate_by_impulses(const RowSystem<Model, Real>& rows, int a) const {
    if (!any(stands)) return Real(0.0);
    Real rate[array_size(M)];
    rows.along(taken_, rate);
    return select(stands, Real(-rate[a]), Real(0.0));
  }

  // Adds the points that would be passed at the velocity v. Returns whether there are any. Adds to
  // `failed` the lanes in which one closes that would have had to pull.
  template <class Links>
  FAN_FN bool watch(const Links& links, const Real* v, Mask& failed) {
    bool more = false;
    for (int j = 0; j < feet.n; ++j) {
      Foot& own = feet.foot[feet.with_points[j]];
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
                            rate(twist, p.at) + p.required > Real(StepTolerance::passing_speed);
        if (!any(closes)) continue;
        more = true;
        // A point that may rebound is struck at a time of its own.
        const bool is_other = !(own.friction > 0.0) || own.restitution > 0.0;
        failed = failed || (closes && (p.dropped || Real(is_other ? 1.0 : 0.0) > Real(0.5)));
        p.joins = p.joins || (closes && !p.dropped);
        stands = stands || (closes && !p.dropped);
        is_solved_ = false;
      }
    }
    return more;
  }

  // Stores the points that push at the end of the step, and the energies of impacts. Returns the
  // lanes with impacts.
  FAN_FN Mask keep(Real& impact) {
    impact = select(struck_ && stands, exchanged_, Real(0.0));
    feet.keep(lanes);
    return struck_ && stands;
  }

 private:
  static constexpr int most_tries = 4;  // of modes; harder steps are made lane by lane

  // Solves the problem of all lanes that stand in the current modes. Returns those in which the law
  // holds.
  template <class Links>
  FAN_FN Mask solve_trees(
      const Links& links, const Evaluation<Model, Real>& eval, const RowSystem<Model, Real>& rows,
      const Mask* near, const Real* guess, double cap) {
    for (int k = 0; k < N; ++k) taken_[k] = Real(0.0);
    for (int a = 0; a < rows.n; ++a) {
      const int r = rows.row[a];
      impulse_[r] = Real(0.0);
      s_[r] = -rows.problem.b[a];
      would_push_[r] = closes_[r] = Real(0.0) > Real(1.0);
    }
    residual = exchanged_ = Real(0.0);
    struck_ = Real(0.0) > Real(1.0);
    for (int j = 0; j < feet.n; ++j) {
      Foot& own = feet.foot[feet.with_points[j]];
      for (int i = 0; i < own.n; ++i) own.point[own.listed[i]].would_pull = Real(0.0) > Real(1.0);
    }
    Mask held = stands;
    for (int tree = 0; tree < system_.trees(); ++tree)
      held = held && solve_tree(tree, held, links, eval, rows, near, guess, cap);
    return held;
  }

  // Removes points that would have to pull and rows that would have to push in these lanes, and
  // adds rows that close. Returns whether there are any.
  FAN_FN bool change_modes(const Mask& selected) {
    bool more = false;
    if (!any(selected)) return more;
    for (int j = 0; j < feet.n; ++j) {
      Foot& own = feet.foot[feet.with_points[j]];
      for (int i = 0; i < own.n; ++i) {
        Point& p = own.point[own.listed[i]];
        const Mask leaves = p.would_pull && p.joins && selected;
        p.joins = p.joins && !leaves;
        p.dropped = p.dropped || leaves;
        more = more || any(leaves);
      }
    }
    for (int r = 0; r < M; ++r) {
      Mask &left = system_.leaves[r], &joined = system_.joins[r];
      const Mask leaves = would_push_[r] && selected && !left;
      const Mask joins = closes_[r] && selected && !joined && !left;
      left = left || leaves;
      joined = joined || joins;
      more = more || any(leaves || joins);
    }
    return more;
  }

  // hdot of the normal of a point of a link with this twist.
  FAN_FN Real rate(const Real* twist, const Real* at) const { return rate(feet.frame, twist, at); }

  // The same along a direction n of the frame.
  FAN_FN static Real rate(const double* n, const Real* twist, const Real* at) {
    Real v[3];
    cross(twist + 3, at, v);
    return -((twist[0] + v[0]) * n[0] + (twist[1] + v[1]) * n[1] + (twist[2] + v[2]) * n[2]);
  }

  // Solves a tree's part of the problem in these lanes: all at once or, where that exceeds the
  // capacity, one after the other. Returns those in which the law holds.
  template <class Links>
  FAN_FN Mask solve_tree(
      int tree, const Mask& selected, const Links& links, const Evaluation<Model, Real>& eval,
      const RowSystem<Model, Real>& rows, const Mask* near, const Real* guess, double cap) {
    if (!any(selected)) return selected;
    if (system_.list(tree, selected, feet, rows, near, guess)) {
      if (system_.n_rows == 0 && system_.n_feet == 0) return selected;
      return solve(selected, links, eval, rows, near, guess, cap);
    }
    Mask held = Real(0.0) > Real(1.0);
    for (int l = 0; l < width; ++l) {
      if (!lane_of(selected, l)) continue;
      Mask own = Real(0.0) > Real(1.0);
      own.set(l, true);
      if (system_.list(tree, own, feet, rows, near, guess))
        held = held || solve(own, links, eval, rows, near, guess, cap);
    }
    return held;
  }

  // Solves for the listed rows and feet in these lanes. Returns those in which the law holds.
  template <class Links>
  FAN_FN Mask solve(
      const Mask& selected, const Links& links, const Evaluation<Model, Real>& eval,
      const RowSystem<Model, Real>& rows, const Mask* near, const Real* guess, double cap) {
    Real share;
    Mask good = system_.solve_listed(selected, links, eval, rows, near, guess, share);
    if (!any(good)) return good;
    residual = select(good, maximum(share, residual), residual);
    check(rows, near, cap, good);
    take(good, rows);
    return good;
  }

  // Removes from `good` the lanes in which the solution violates the law.
  FAN_FN void check(const RowSystem<Model, Real>& rows, const Mask* near, double cap, Mask& good) {
    const Mask solved = good;
    Mask struck = Real(0.0) > Real(1.0);
    for (int i = 0; i < system_.n_single; ++i) {
      const int a = system_.single[i];
      const Real& y = system_.y[i];
      const Mask within = y >= rows.problem.lower[a] && y <= rows.problem.upper[a];
      would_push_[rows.row[a]] = solved && system_.has[i] && system_.y[i] < rows.problem.lower[a];
      good = good && (!system_.has[i] || within);
    }
    for (int i = 0; i < system_.n_rows; ++i) {
      const int a = system_.row[i];
      const Mask closes =
          near[rows.row[a]] && !system_.pulls[a] && !(system_.speed[a] <= Real(0.0));
      closes_[rows.row[a]] = closes && solved;
      good = good && !closes;
    }
    for (int p = 0; p < system_.n_feet; ++p) {
      auto& own = system_.patch[p];
      const Real* x = system_.y + system_.first[p];
      Real all[6];
      for (int k = 0; k < 6; ++k) all[k] = k < own.rank ? x[k] : Real(0.0);
      good = good && (!own.here || (own.share(all, feet.frame) && x[0] <= Real(cap)));
      for (int j = 0; j < own.n(); ++j) {
        Point& point = own.point(j);
        point.would_pull = point.would_pull && solved;
        const Real by_forces = own.normal_rate(j, system_.by_forces[p]);
        const Real most = maximum(by_forces, Real(StepTolerance::passing_speed));
        point.rests = own.normal_rate(j, system_.at_start[p]) <= most;
        const Mask is_new = !point.pushes || point.steps < Real(StepTolerance::steps_of_impact);
        const Mask strikes = (is_new && !point.rests) || Feet::closes(point);
        struck = struck || (point.joins && strikes);
      }
    }
    struck_ = struck_ || (good && struck);
  }

  // Stores the solution in these lanes.
  FAN_FN void take(const Mask& good, const RowSystem<Model, Real>& rows) {
    for (int k = 0; k < N; ++k) taken_[k] += select(good, system_.taken[k], Real(0.0));
    exchanged_ += select(good, system_.half_exchanged(), Real(0.0));
    for (int i = 0; i < system_.n_rows; ++i) {
      const int a = system_.row[i], r = rows.row[a];
      s_[r] = select(good, select(system_.pulls[a], Real(0.0), Real(-system_.speed[a])), s_[r]);
    }
    for (int i = 0; i < system_.n_single; ++i) {
      Real& to = impulse_[rows.row[system_.single[i]]];
      to = select(good && system_.has[i], system_.y[i], to);
    }
    for (int p = 0; p < system_.n_feet; ++p)
      for (int j = 0; j < system_.patch[p].n(); ++j) {
        Point& to = system_.patch[p].point(j);
        for (int c = 0; c < 3; ++c)
          to.next_impulse[c] =
              select(good && to.joins, system_.patch[p].impulse(j)[c], to.next_impulse[c]);
      }
  }

  System system_;
  bool is_solved_ = false;
  Real solved_near_;                                // rows that took part in the last solve
  Real taken_[array_size(N)], exchanged_;           // of the feet: - W x, and half_exchanged()
  Mask struck_;                                     // lanes with an impact
  Real impulse_[array_size(M)], s_[array_size(M)];  // of the rows
  Mask would_push_[array_size(M)],
      closes_[array_size(M)];  // lanes in which a row does so in the last solution
};

}  // namespace fan

FAN_LOOPS_END
