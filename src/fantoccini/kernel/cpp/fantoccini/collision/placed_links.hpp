// The links of a puppet with their solids: the solids placed in the world, balls around them, and
// bounds of their speeds.
#pragma once

#include <type_traits>

#include "fantoccini/collision/near_pairs.hpp"
#include "fantoccini/collision/touch.hpp"
#include "fantoccini/math/lane_of.hpp"
#include "fantoccini/math/space.hpp"
#include "fantoccini/math/triple.hpp"
#include "fantoccini/model/evaluation.hpp"

FAN_LOOPS_BEGIN

namespace fan {

template <class Model, class Real>
class PlacedLinks {
 public:
  static constexpr int N = Model::n_vD, NK = Model::n_vK;
  static constexpr int L = Model::n_links, B = Model::n_solids;
  static constexpr int width = Traits<Real>::width;

  struct Ball {
    double at[3], radius;
  };

  // Twist about the world's origin, in registers of four.
  struct Twist {
    double linear[4], angular[4];
  };
  struct LaneTwist {
    Real linear[3], angular[3];
  };
  using RealTwist = std::conditional_t<width == 1, Twist, LaneTwist>;

  // Of all lanes.
  struct {
    Real poses[array_size(12 * L)], screw_D[6 * N + 1], screw_K[6 * NK + 1];  // one more is read
  } of_lanes;
  // Of the current lane.
  const double *poses, *screw_D, *screw_K, *v_D, *v_K;
  Twist twist[array_size(L)];
  double speed[array_size(L)];  // m/s: upper bound over all points of a link's solids
  Solid placed[array_size(B)];  // in the world, of links with is_placed
  Ball ball[array_size(B)],
      ball_of[array_size(L)];  // around solids, and around all solids of a link
  Ball around[array_size(L)];  // around all solids of a link, in its frame
  bool is_placed[array_size(L)];

  // Finds the solids of every link and the ball around all of them.
  FAN_FN void begin(const ContactArrays& in) {
    for (int i = 0; i < L; ++i) {
      begin_of_[i] = end_of_[i] = 0;
      reach_[i] = speed[i] = ball_of[i].radius = 0.0;
    }
    for (int first = 0, end = 0; first < B; first = end) {
      const int link = in.solids[first].link;
      Ball& all = around[link];
      for (int c = 0; c < 3; ++c) all.at[c] = 0.0;
      for (; end < B && in.solids[end].link == link; ++end) {
        const Solid& solid = in.solids[end];
        ball[end].radius = bounding_radius(solid);
        for (int c = 0; c < 3; ++c) all.at[c] += 0.5 * (solid.a[c] + solid.b[c]);
      }
      for (int c = 0; c < 3; ++c) all.at[c] /= end - first;
      all.radius = 0.0;
      for (int k = first; k < end; ++k) {
        double middle[3];
        for (int c = 0; c < 3; ++c) middle[c] = 0.5 * (in.solids[k].a[c] + in.solids[k].b[c]);
        const double reach = sqrt(square_apart(middle, all.at)) + ball[k].radius;
        if (reach > all.radius) all.radius = reach;
      }
      reach_[link] = sqrt(dot3(all.at, all.at)) + all.radius;
      begin_of_[link] = first;
      end_of_[link] = end;
    }
  }

  // Sets the poses of the links at a configuration, and the screws of the velocities.
  FAN_FN void locate(const Real* q_D, const Real* q_K, const Real* p) {
    Call<Model, Real>::screws(q_D, q_K, p, of_lanes);
  }

  FAN_FN bool has_solids(int link) const { return begin_of_[link] != end_of_[link]; }

  // Loads a lane's poses, screws and velocities.
  FAN_FN void load(int l, const Real* velocity_D, const Real* velocity_K) {
    if constexpr (width == 1) {
      poses = of_lanes.poses;
      screw_D = of_lanes.screw_D;
      screw_K = of_lanes.screw_K;
      v_D = velocity_D;
      v_K = velocity_K;
    } else {
      double* to = lane_;
      const auto copy = [&](const Real* from, int n) {
        for (int i = 0; i < n; ++i) to[i] = lane_of(from[i], l);
        to += n;
        return to - n;
      };
      poses = copy(of_lanes.poses, 12 * L);
      screw_D = copy(of_lanes.screw_D, 6 * N);
      screw_K = copy(of_lanes.screw_K, 6 * NK);
      v_D = copy(velocity_D, N);
      v_K = copy(velocity_K, NK);
    }
  }

  // Sets the twists of the links at the velocities of the lane.
  FAN_FN void move() {
    add_twists<true>(Model::moved_D_begin, Model::moved_D_entry, screw_D, v_D, twist);
    if (NK > 0) add_twists<false>(Model::moved_K_begin, Model::moved_K_entry, screw_K, v_K, twist);
  }

  // Places the balls around the solids of every link in the world and bounds their speeds. The
  // solids themselves are placed when they are needed.
  FAN_FN void place() {
    for (int link = 0; link < L; ++link) {
      is_placed[link] = false;
      if (!has_solids(link)) continue;
      const double* R = poses + 12 * link;
      Ball& all = ball_of[link];
      to_world(R, around[link].at, all.at);
      all.radius = around[link].radius;
      const Twist& t = twist[link];
      double v[3];
      cross(t.angular, all.at, v);
      for (int c = 0; c < 3; ++c) v[c] += t.linear[c];
      speed[link] = sqrt(dot3(v, v)) + sqrt(dot3(t.angular, t.angular)) * all.radius;
    }
  }

  // Places the solids of a link.
  FAN_FN void place_link(const ContactArrays& in, int link) {
    is_placed[link] = true;
    const double* R = poses + 12 * link;
    for (int k = begin_of_[link]; k < end_of_[link]; ++k) {
      place_solid(in.solids[k], R, R + 9, placed[k]);
      FAN_UNROLL for (int c = 0; c < 3; ++c) ball[k].at[c] =
          0.5 * (placed[k].a[c] + placed[k].b[c]);
    }
  }

  // Finds the points of pair k, whose solids are placed, with a gap below a margin. Returns their
  // number.
  FAN_FN int touch(const ContactArrays& in, int k, double margin, Touch* out_touches) {
    const int a = in.pairs[2 * k], b = in.pairs[2 * k + 1];
    const Solid &x = placed[a], &y = b < B ? placed[b] : in.solids[b];
    if (b < B ? is_far(ball[a], ball[b], margin) : is_far(ball[a], y, margin)) return 0;
    if (are_far(x, y, margin)) return 0;
    return touches(x, y, margin, out_touches);
  }

  // Lists the pairs that are nearer than the slack.
  template <class Near>
  FAN_FN void list_near(const ContactArrays& in, Near& near, double slack) {
    near.begin(poses, ball_of);
    for (int g = 0, k = 0; g < in.n_groups; ++g) {
      const int a = in.groups[3 * g], b = in.groups[3 * g + 1], end = in.groups[3 * g + 2];
      const bool distant = b < 0 ? is_far(ball_of[a], in.solids[-1 - b], slack)
                                 : is_far(ball_of[a], ball_of[b], slack);
      if (distant) {
        k = end;
        continue;
      }
      if (!is_placed[a]) place_link(in, a);
      if (b >= 0 && !is_placed[b]) place_link(in, b);
      for (; k < end; ++k) {
        Touch out_touches[max_touches];
        if (touch(in, k, slack, out_touches) > 0) near.add(k);
      }
    }
  }

  // Slack of lists of near pairs [m].
  FAN_FN double slack() const {
    double sum = 0.0, n_links = 0.0;
    for (int i = 0; i < L; ++i) {
      if (!has_solids(i)) continue;
      sum += around[i].radius;
      n_links += 1.0;
    }
    return n_links > 0.0 ? NearPairsTolerances::slack * sum / n_links : 0.0;
  }

  // Lanes in which a link may move farther than its margin allows: `margin` plus `travel` times the
  // distance that links travel at `speeds`, if the step dt changes the velocities by dv_D. Each
  // link may use half of the fixed part over the step, since the other link of a pair may too, and
  // its own part of the distance travelled.
  FAN_FN typename Traits<Real>::Mask outruns(
      const Real* dv_D, double dt, const Real* speeds, double margin, double travel) const {
    const double fixed = 0.5 * margin / dt;
    RealTwist twist[array_size(L)];
    add_real_twists(dv_D, twist);
    typename Traits<Real>::Mask out = Real(0.0) > Real(1.0);
    for (int i = 0; i < L; ++i) {
      if (reach_[i] == 0.0) continue;
      const Real *u = twist[i].linear, *w = twist[i].angular, *r = of_lanes.poses + 12 * i + 9;
      const Real v[3] = {
          u[0] + w[1] * r[2] - w[2] * r[1], u[1] + w[2] * r[0] - w[0] * r[2],
          u[2] + w[0] * r[1] - w[1] * r[0]};
      const Real spare = fixed + (travel - 1.0) * speeds[i];
      // (a + b)^2 <= 2 (a^2 + b^2)
      const Real square = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) +
                          (w[0] * w[0] + w[1] * w[1] + w[2] * w[2]) * (reach_[i] * reach_[i]);
      out = out || 2.0 * square > spare * spare;
    }
    return out;
  }

  // Distance of the balls around the two links of a group, or around a link and a standing solid.
  double separation(const ContactArrays& in, int g) const {
    const int a = in.groups[3 * g], b = in.groups[3 * g + 1];
    return b < 0 ? distance_of(ball_of[a], in.solids[-1 - b]) : distance_of(ball_of[a], ball_of[b]);
  }

  static double smallest_size(const Solid& x) {
    if (x.kind == HALF_SPACE) return unbounded;
    if (x.kind == HULL) return x.hull->inner + x.radius;
    if (x.kind != BOX && !is_ellipsoid(x)) return x.radius;
    const double half = fmin(x.half[0], fmin(x.half[1], x.half[2]));
    return x.kind == BOX ? half + x.radius : half;
  }

  // Whether two balls are at least `margin` apart.
  FAN_FN static bool is_far(const Ball& x, const Ball& y, double margin) {
    const double reach = x.radius + y.radius + margin;
    return square_apart(x.at, y.at) >= reach * reach;
  }

  // Whether a ball is at least `margin` away from a standing solid.
  FAN_FN static bool is_far(const Ball& x, const Solid& y, double margin) {
    if (y.kind == HALF_SPACE) {
      double height = -x.radius;
      for (int c = 0; c < 3; ++c) height += (x.at[c] - y.a[c]) * y.b[c];
      return height >= margin;
    }
    Ball other;
    other.radius = bounding_radius(y);
    for (int c = 0; c < 3; ++c) other.at[c] = 0.5 * (y.a[c] + y.b[c]);
    return is_far(x, other, margin);
  }

 private:
  // Adds the contribution of velocities v to the twists of the links: each link has its parent's
  // twist and that of its own joint. The fourth number of a register is unused: it is the next one
  // in memory.
  template <bool first>
  FAN_FN static void add_twists(
      const int* begin, const int* entry, const double* screw, const double* v, Twist* twist) {
    Twist own[array_size(L)];
    for (int i = 0; i < L; ++i) {
      const int parent = Model::link_parent[i];
      Quad linear{}, angular{};
      int j = begin[i];
      if (parent >= 0) {
        linear = quad(own[parent].linear);
        angular = quad(own[parent].angular);
        j += begin[parent + 1] - begin[parent];
      }
      for (; j < begin[i + 1]; ++j) {
        const double *of = screw + 6 * entry[j], rate = v[entry[j]];
        linear += rate * quad(of);
        angular += rate * quad(of + 3);
      }
      quad(own[i].linear) = linear;
      quad(own[i].angular) = angular;
      if (!first) {
        linear += quad(twist[i].linear);
        angular += quad(twist[i].angular);
      }
      quad(twist[i].linear) = linear;
      quad(twist[i].angular) = angular;
    }
  }

  // Sets the twists of the links at velocities v of all lanes.
  FAN_FN void add_real_twists(const Real* v, RealTwist* out) const {
    if constexpr (width == 1) {
      add_twists<true>(Model::moved_D_begin, Model::moved_D_entry, of_lanes.screw_D, v, out);
    } else {
      const int* begin = Model::moved_D_begin;
      for (int i = 0; i < L; ++i) {
        const int parent = Model::link_parent[i];
        for (int c = 0; c < 3; ++c) {
          out[i].linear[c] = parent < 0 ? Real(0.0) : out[parent].linear[c];
          out[i].angular[c] = parent < 0 ? Real(0.0) : out[parent].angular[c];
        }
        const int carried = parent < 0 ? 0 : begin[parent + 1] - begin[parent];
        for (int j = begin[i] + carried; j < begin[i + 1]; ++j) {
          const int k = Model::moved_D_entry[j];
          for (int c = 0; c < 3; ++c) {
            out[i].linear[c] += of_lanes.screw_D[6 * k + c] * v[k];
            out[i].angular[c] += of_lanes.screw_D[6 * k + 3 + c] * v[k];
          }
        }
      }
    }
  }

  // World position of a point of a link.
  FAN_FN static void to_world(const double* R, const double* local, double* out) {
    const double x = local[0], y = local[1], z = local[2];
    out[0] = R[9] + R[0] * x + R[3] * y + R[6] * z;
    out[1] = R[10] + R[1] * x + R[4] * y + R[7] * z;
    out[2] = R[11] + R[2] * x + R[5] * y + R[8] * z;
  }

  static double distance_of(const Ball& x, const Ball& y) {
    return sqrt(square_apart(x.at, y.at)) - x.radius - y.radius;
  }

  static double distance_of(const Ball& x, const Solid& y) {
    if (y.kind != HALF_SPACE) return distance_of(x, ball_around(y));
    double height = -x.radius;
    for (int c = 0; c < 3; ++c) height += (x.at[c] - y.a[c]) * y.b[c];
    return height;
  }

  static Ball ball_around(const Solid& y) {
    Ball out;
    out.radius = bounding_radius(y);
    for (int c = 0; c < 3; ++c) out.at[c] = 0.5 * (y.a[c] + y.b[c]);
    return out;
  }

  FAN_FN static double square_apart(const double* a, const double* b) {
    double sum = 0.0;
    FAN_UNROLL for (int c = 0; c < 3; ++c) sum += (a[c] - b[c]) * (a[c] - b[c]);
    return sum;
  }

  // Whether segments, or the capsules around ellipsoids, are at least `margin` apart.
  FAN_FN static bool are_far(const Solid& x, const Solid& y, double margin) {
    if (x.kind != SEGMENT || y.kind != SEGMENT) return false;
    return between_segments(x.a, x.b, y.a, y.b) >= x.radius + y.radius + margin;
  }

  double lane_[width == 1 ? 1 : 12 * L + 7 * (N + NK)];
  double reach_[array_size(L)];  // m: of a link's solids from its origin; 0 without solids
  int begin_of_[array_size(L)], end_of_[array_size(L)];  // of a link's solids
};

}  // namespace fan

FAN_LOOPS_END
