// Contact points of a step: where solids touch or may touch before its end, and the rows of A_D
// there.
//
//   u = e . (v_A + w_A x P - v_B - w_B x P),   e the normal and two tangents at the point P
//
// with (v, w) a link's twist about the world's origin, the sum of the screws of the velocities that
// move it. Rows have the sign of h, like those of strings: hdot = -u, so that h = -gap <= 0 where
// solids do not overlap, and a force x >= 0 pushes A along +e and B along -e.
#pragma once

#include <new>

#include "evaluation.hpp"
#include "lane_of.hpp"
#include "moved_by.hpp"
#include "space.hpp"
#include "touch.hpp"

namespace fan {

struct ContactPointTolerances {
  // m: gap up to which a pair is looked at, whatever its speed.
  static constexpr double margin = 1e-3;
  // The same, in what the two solids travel towards each other in a step at most.
  static constexpr double travel = 2.0;
};

template <class Model, class Real>
class ContactPoints {
 public:
  static constexpr int C = Model::n_contacts, N = Model::n_vD, NK = Model::n_vK;
  static constexpr int width = Traits<Real>::width;
  using Tolerance = ContactPointTolerances;
  using Mask = typename Traits<Real>::Mask;

  struct Point {
    int pair, feature;       // of ContactArrays; which of the pair's points
    double gap, at[3];       // m
    double frame[9];         // normal, tangent, tangent
  };

  int n[width], most;        // points of each lane, and of the one that has most
  Point point[width][room(C)];
  bool too_many[width] = {};  // whether a lane has had more points than there is room for
  Real row[room(3 * C)][room(N)];  // of A_D: every point's normal and tangents
  Real rate_K[room(3 * C)];        // A_K v_K of these rows
  MovedBy<N> moved[room(C)];       // where a point's rows may differ from zero

  // The least gap of every pair at a configuration of lane 0; pairs farther apart than the margin
  // keep what is in `gaps`.
  void measure(
      const ContactArrays& in, const Real* q_D, const Real* q_K, const Real* p, double* gaps) {
    Real v_D[room(N)] = {}, v_K[room(NK)] = {};
    Call<Model, Real>::screws(q_D, q_K, p, links_);
    begin(in);
    load(0, v_D, v_K);
    move();
    place();
    for (int k = 0; k < in.n_pairs; ++k) {
      n[0] = 0;
      look(in, k, Tolerance::margin, 0);
      for (int i = 0; i < n[0]; ++i)
        if (i == 0 || point[0][i].gap < gaps[k]) gaps[k] = point[0][i].gap;
    }
  }

  // Takes the solids of every link and the ball around all of them.
  FAN_FN void begin(const ContactArrays& in) {
    for (int i = 0; i < L; ++i) begin_of_[i] = end_of_[i] = 0;
    for (int first = 0, end = 0; first < B; first = end) {
      const int link = in.solids[first].link;
      Ball& all = around_[link];
      for (int c = 0; c < 3; ++c) all.at[c] = 0.0;
      for (; end < B && in.solids[end].link == link; ++end) {
        const Solid& own = in.solids[end];
        ball_[end].radius = bounding_radius(own);
        for (int c = 0; c < 3; ++c) all.at[c] += 0.5 * (own.a[c] + own.b[c]);
      }
      for (int c = 0; c < 3; ++c) all.at[c] /= end - first;
      all.radius = 0.0;
      for (int k = first; k < end; ++k) {
        double middle[3];
        for (int c = 0; c < 3; ++c) middle[c] = 0.5 * (in.solids[k].a[c] + in.solids[k].b[c]);
        const double reach = sqrt(square_apart(middle, all.at)) + ball_[k].radius;
        if (reach > all.radius) all.radius = reach;
      }
      begin_of_[link] = first;
      end_of_[link] = end;
    }
  }

  // The points at (q_D, q_K) over a step dt, in the lanes that are not idle.
  FAN_FN void find(
      const ContactArrays& in, const Real* q_D, const Real* v_D, const Real* q_K, const Real* v_K,
      const Real* p, double dt, const Mask& idle) {
    Call<Model, Real>::screws(q_D, q_K, p, links_);
    most = 0;
    for (int l = 0; l < width; ++l) {
      n[l] = 0;
      if (lane_of(idle, l)) continue;
      load(l, v_D, v_K);
      move();
      place();
      look_at_all(in, dt, l);
      if (n[l] > most) most = n[l];
    }
    for (int i = 0; i < 3 * most; ++i) {
      rate_K[i] = Real(0.0);
      for (int k = 0; k < N; ++k) row[i][k] = Real(0.0);
      moved[i / 3].n = 0;
    }
    for (int l = 0; l < width; ++l) {
      if (n[l] > 0 && width > 1) load(l, v_D, v_K);
      for (int i = 0; i < n[l]; ++i) fill(in, l, i);
    }
  }

 private:
  static constexpr int L = Model::n_links, B = Model::n_solids;

  struct Ball {
    double at[3], radius;
  };

  // Takes a lane's poses, screws and velocities.
  FAN_FN void load(int l, const Real* v_D, const Real* v_K) {
    if constexpr (width == 1) {
      poses_ = links_.poses;
      screw_D_ = links_.screw_D;
      screw_K_ = links_.screw_K;
      v_D_ = v_D;
      v_K_ = v_K;
    } else {
      double* to = lane_;
      const auto take = [&](const Real* from, int n) {
        for (int i = 0; i < n; ++i) to[i] = lane_of(from[i], l);
        to += n;
        return to - n;
      };
      poses_ = take(links_.poses, 12 * L);
      screw_D_ = take(links_.screw_D, 6 * N);
      screw_K_ = take(links_.screw_K, 6 * NK);
      v_D_ = take(v_D, N);
      v_K_ = take(v_K, NK);
    }
  }

  // The twists of the links: each has its parent's and what its own joint adds.
  FAN_FN void move() {
    for (int i = 0; i < L; ++i) {
      const int up = Model::link_parent[i];
      double* to = twist_ + 6 * i;
      const double still[6] = {}, *from = up < 0 ? still : twist_ + 6 * up;
      double a = from[0], b = from[1], c = from[2], d = from[3], e = from[4], f = from[5];
      const auto add = [&](const int* begin, const int* entry, const double* screw, const double* v) {
        const int carried = up < 0 ? 0 : begin[up + 1] - begin[up];
        for (int j = begin[i] + carried; j < begin[i + 1]; ++j) {
          const int k = entry[j];
          const double *of = screw + 6 * k, speed = v[k];
          a += of[0] * speed;
          b += of[1] * speed;
          c += of[2] * speed;
          d += of[3] * speed;
          e += of[4] * speed;
          f += of[5] * speed;
        }
      };
      add(Model::moved_D_begin, Model::moved_D_entry, screw_D_, v_D_);
      add(Model::moved_K_begin, Model::moved_K_entry, screw_K_, v_K_);
      to[0] = a, to[1] = b, to[2] = c, to[3] = d, to[4] = e, to[5] = f;
    }
  }

  // The balls around the solids of every link in the world, and how fast they are. The solids
  // themselves are placed when they are looked at.
  FAN_FN void place() {
    for (int link = 0; link < L; ++link) {
      is_placed_[link] = false;
      if (begin_of_[link] == end_of_[link]) continue;
      const double* R = poses_ + 12 * link;
      Ball& all = ball_of_[link];
      carry(R, around_[link].at, all.at);
      all.radius = around_[link].radius;
      const double* t = twist_ + 6 * link;
      double v[3];
      cross(t + 3, all.at, v);
      for (int c = 0; c < 3; ++c) v[c] += t[c];
      speed_[link] = sqrt(dot3(v, v)) + sqrt(dot3(t + 3, t + 3)) * all.radius;
    }
  }

  // Places the solids of a link.
  FAN_FN void place_link(const ContactArrays& in, int link) {
    is_placed_[link] = true;
    const double* R = poses_ + 12 * link;
    for (int k = begin_of_[link]; k < end_of_[link]; ++k) {
      placed(in.solids[k], R, R + 9, placed_[k]);
      FAN_UNROLL for (int c = 0; c < 3; ++c) ball_[k].at[c] = 0.5 * (placed_[k].a[c] + placed_[k].b[c]);
    }
  }

  // A point of a link in the world.
  FAN_FN static void carry(const double* R, const double* own, double* out) {
    const double x = own[0], y = own[1], z = own[2];
    out[0] = R[9] + R[0] * x + R[3] * y + R[6] * z;
    out[1] = R[10] + R[1] * x + R[4] * y + R[7] * z;
    out[2] = R[11] + R[2] * x + R[5] * y + R[8] * z;
  }

  FAN_FN static void placed(const Solid& from, const double* R, const double* r, Solid& to) {
    to.kind = from.kind;
    to.link = from.link;
    to.mesh = from.mesh;
    to.radius = from.radius;
    FAN_UNROLL for (int c = 0; c < 3; ++c) {
      to.half[c] = from.half[c];
      to.a[c] = r[c] + R[c] * from.a[0] + R[3 + c] * from.a[1] + R[6 + c] * from.a[2];
      to.b[c] = r[c] + R[c] * from.b[0] + R[3 + c] * from.b[1] + R[6 + c] * from.b[2];
    }
    if (from.kind == SEGMENT && !is_ellipsoid(from)) return;
    FAN_UNROLL for (int c = 0; c < 3; ++c)
      FAN_UNROLL for (int j = 0; j < 3; ++j)
        to.R[3 * j + c] = R[c] * from.R[3 * j] + R[3 + c] * from.R[3 * j + 1] +
                          R[6 + c] * from.R[3 * j + 2];
  }

  // Finds the points of lane l.
  FAN_FN void look_at_all(const ContactArrays& in, double dt, int l) {
    for (int g = 0, k = 0; g < in.n_groups; ++g) {
      const int a = in.groups[3 * g], b = in.groups[3 * g + 1], end = in.groups[3 * g + 2];
      const double speed = speed_[a] + (b < 0 ? 0.0 : speed_[b]);
      const double margin = Tolerance::margin + Tolerance::travel * dt * speed;
      const bool far = b < 0 ? is_far(ball_of_[a], in.solids[-1 - b], margin)
                             : is_far(ball_of_[a], ball_of_[b], margin);
      if (far) {
        k = end;
        continue;
      }
      if (!is_placed_[a]) place_link(in, a);
      if (b >= 0 && !is_placed_[b]) place_link(in, b);
      for (; k < end; ++k) look_at_placed(in, k, margin, l);
    }
  }

  FAN_FN static double square_apart(const double* a, const double* b) {
    double sum = 0.0;
    FAN_UNROLL for (int c = 0; c < 3; ++c) sum += (a[c] - b[c]) * (a[c] - b[c]);
    return sum;
  }

  FAN_FN static bool is_far(const Ball& x, const Ball& y, double margin) {
    const double reach = x.radius + y.radius + margin;
    return square_apart(x.at, y.at) >= reach * reach;
  }

  // The same of a solid that stands.
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

  // Whether segments or ellipsoids are apart because they, or the capsules around them, are.
  FAN_FN static bool are_far(const Solid& x, const Solid& y, double margin) {
    if (x.kind != SEGMENT || y.kind != SEGMENT) return false;
    return between_segments(x.a, x.b, y.a, y.b) >= x.radius + y.radius + margin;
  }

  // Adds the points of pair k to those of lane l.
  FAN_FN void look(const ContactArrays& in, int k, double margin, int l) {
    for (int side = 0; side < 2; ++side) {
      const int link = in.solids[in.pairs[2 * k + side]].link;
      if (link >= 0 && !is_placed_[link]) place_link(in, link);
    }
    look_at_placed(in, k, margin, l);
  }

  // The same where the solids of both links are placed.
  FAN_FN void look_at_placed(const ContactArrays& in, int k, double margin, int l) {
    const int a = in.pairs[2 * k], b = in.pairs[2 * k + 1];
    const Solid &x = placed_[a], &y = b < B ? placed_[b] : in.solids[b];
    if (b < B ? is_far(ball_[a], ball_[b], margin) : is_far(ball_[a], y, margin)) return;
    if (are_far(x, y, margin)) return;
    Touch found[max_touches];
    const int n_found = touches(x, y, margin, found);
    for (int i = 0; i < n_found; ++i) {
      if (n[l] == C) {
        too_many[l] = true;
        return;
      }
      Point& to = point[l][n[l]++];
      to.pair = k;
      to.feature = found[i].feature;
      to.gap = found[i].gap;
      for (int c = 0; c < 3; ++c) {
        to.at[c] = found[i].point[c];
        to.frame[c] = found[i].normal[c];
      }
      tangents(to.frame);
    }
  }

  // Two unit vectors across the normal and each other, from the axis that it is farthest from.
  FAN_FN static void tangents(double* frame) {
    int axis = 0;
    for (int c = 1; c < 3; ++c)
      if (fabs(frame[c]) < fabs(frame[axis])) axis = c;
    const double e[3] = {double(axis == 0), double(axis == 1), double(axis == 2)};
    cross(e, frame, frame + 3);
    const double size = sqrt(dot3(frame + 3, frame + 3));
    for (int c = 3; c < 6; ++c) frame[c] /= size;
    cross(frame, frame + 3, frame + 6);
  }

  // The rows of lane l's point i.
  FAN_FN void fill(const ContactArrays& in, int l, int i) {
    const Point& from = point[l][i];
    const int a = in.pairs[2 * from.pair], b = in.pairs[2 * from.pair + 1];
    for (const int solid : {a, b}) {
      const int link = in.solids[solid].link;
      if (link >= 0)
        moved[i].add(
            Model::moved_D_entry + Model::moved_D_begin[link],
            Model::moved_D_entry + Model::moved_D_begin[link + 1]);
    }
    for (int d = 0; d < 3; ++d) {
      const double* e = from.frame + 3 * d;
      double moment[3];
      cross(from.at, e, moment);
      Real* out = row[3 * i + d];
      double driven = 0.0;
      for (int side = 0; side < 2; ++side) {
        const int link = in.solids[side ? b : a].link;
        if (link < 0) continue;
        const double sign = side ? 1.0 : -1.0;
        for (int j = Model::moved_D_begin[link]; j < Model::moved_D_begin[link + 1]; ++j) {
          const int k = Model::moved_D_entry[j];
          const double* s = screw_D_ + 6 * k;
          lane_of(out[k], l) += sign * (dot3(e, s) + dot3(moment, s + 3));
        }
        for (int j = Model::moved_K_begin[link]; j < Model::moved_K_begin[link + 1]; ++j) {
          const int k = Model::moved_K_entry[j];
          const double* s = screw_K_ + 6 * k;
          driven += sign * (dot3(e, s) + dot3(moment, s + 3)) * v_K_[k];
        }
      }
      lane_of(rate_K[3 * i + d], l) = driven;
    }
  }

  struct {
    Real poses[room(12 * L)], screw_D[room(6 * N)], screw_K[room(6 * NK)];
  } links_;
  const double *poses_, *screw_D_, *screw_K_, *v_D_, *v_K_;  // of the lane that is looked at
  double lane_[width == 1 ? 1 : 12 * L + 7 * (N + NK)];
  double twist_[room(6 * L)], speed_[room(L)];
  Solid placed_[room(B)];
  Ball ball_[room(B)], ball_of_[room(L)];  // around solids, and around all of a link
  Ball around_[room(L)];                   // likewise, in the link's frame
  int begin_of_[room(L)], end_of_[room(L)];  // of a link's solids
  bool is_placed_[room(L)];
};

// The C interface of ContactPoints::measure; 1 where there was no memory, else 0.
template <class Model>
int measure_gaps(
    const ContactArrays& in, const double* q_D, const double* q_K, const double* p, double* gaps) {
  if constexpr (Model::n_contacts > 0) {
    auto* points = new (std::nothrow) ContactPoints<Model, double>();
    if (!points) return 1;
    points->measure(in, q_D, q_K, p, gaps);
    delete points;
  }
  return 0;
}

}  // namespace fan
