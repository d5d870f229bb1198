// Clearance of a puppet from obstacles and from itself, one configuration per lane.
#pragma once

#include "fantoccini/collision/catenary.hpp"
#include "fantoccini/collision/distance.hpp"
#include "fantoccini/contract.hpp"
#include "fantoccini/math/lane_of.hpp"
#include "fantoccini/model/joint_paths.hpp"

namespace fan {

struct ClearanceTolerances {
  static constexpr double rounding = 1e-9;  // m: margin of bounds; depth of solids that touch
  static constexpr double min_slack = 1.0 + 1e-6;  // length over span above which a string sags
  static constexpr double max_distance = 1e30;     // m: no distance measured
};

// Loads lanes first, first + 1, ... of rows (n, width). Lanes beyond the last row repeat it.
template <class Real>
FAN_FN void load_lanes(const double* rows, int width, long long first, long long n, Real* to) {
  for (int l = 0; l < Traits<Real>::width; ++l) {
    const long long i = first + l < n ? first + l : n - 1;
    for (int k = 0; k < width; ++k) lane_of(to[k], l) = rows[i * width + k];
  }
}

// A solid placed in the world.
template <class Real>
struct Placed {
  int kind;
  long long mesh;
  Real a[3], b[3], R[9];
  const double* half;
  double radius;
  Real moved;  // upper bound of the path of its points
};

template <class Model, class Real>
class Clearance {
 public:
  using Tol = ClearanceTolerances;
  static constexpr int S = Model::n_strings;
  using Mask = typename Traits<Real>::Mask;

  Real q_D[array_size(Model::n_qD)], q_K[array_size(Model::n_qK)], p[array_size(Model::n_p)];
  JointPaths<Model, Real> moves;  // about the configuration; see `measure`
  Real least, pair;               // clearance, and index of its pair: see `measure`
  Real lower;                     // lower bound of all distances on the path given by `moves`

  // A link's pose at the last measurement: R by columns, then r.
  FAN_FN const Real* pose(int link) const { return poses_ + 12 * link; }

  // Extends the range of the strings' excess lengths (length less span) by a configuration.
  // moves.clear() empties the range.
  FAN_FN void include_excess(const Real* D, const Real* K) {
    Call<Model, Real>::points(D, K, p, points_);
    int at = 0;
    for (int i = 0; i < S; at += Model::string_points[i++]) {
      Real excess = string_length<Model, Real>(i, D, K);
      for (int k = 1; k < Model::string_points[i]; ++k)
        excess -= distance_of(points_ + 3 * (at + k - 1), points_ + 3 * (at + k));
      moves.least_excess[i] = moves.known ? minimum(excess, moves.least_excess[i]) : excess;
      moves.most_excess[i] = moves.known ? maximum(excess, moves.most_excess[i]) : excess;
    }
    moves.known = true;
  }

  // Finds the least distance over all pairs, numbered in this order: moving (outer) by standing
  // (inner); pairs; string segments (outer) by standing. Distances certainly above `enough`, and
  // those of meshes in lanes that are not selected, are lower bounds. With motion (`moving`),
  // `lower` is the least distance less the paths of both solids.
  FAN_FN void measure(
      const ClearanceArrays& in, Placed<Real>* placed, const Mask& selected,
      double enough = Tol::max_distance, bool moving = false) {
    enough_ = enough + Tol::rounding;
    exact_ = in.exact;
    Call<Model, Real>::poses(q_D, q_K, p, poses_);
    for (long long m = 0; m < in.n_moving; ++m) {
      place(in.moving[m], placed[m]);
      placed[m].moved = moving ? path(in, in.moving[m], placed[m]) : Real(0.0);
    }
    least = lower = Real(Tol::max_distance);
    pair = Real(-1.0);
    double number = 0.0;
    const auto add = [&](const Real& distance) {
      const auto nearer = distance < least;
      least = select(nearer, distance, least);
      lower = minimum(distance - pair_path_, lower);
      pair = select(nearer, Real(number), pair);
      number += 1.0;
    };
    for (long long m = 0; m < in.n_moving; ++m) {
      pair_path_ = placed[m].moved;
      for (long long o = 0; o < in.n_standing; ++o)
        add(in.left_out[m * in.n_standing + o]
                ? Real(Tol::max_distance)
                : measured(placed[m], in.standing[o], selected, needed_distance()));
    }
    for (long long k = 0; k < in.n_pairs; ++k) {
      const Placed<Real>&a = placed[in.pairs[2 * k]], &b = placed[in.pairs[2 * k + 1]];
      pair_path_ = a.moved + b.moved;
      add(measured(a, b, selected, needed_distance()));
    }
    static constexpr double no_box[3] = {};
    bool strings = false;
    for (int i = 0; i < S; ++i) strings = strings || in.string_radius[i] >= 0.0;
    if (!strings) return;
    Call<Model, Real>::points(q_D, q_K, p, points_);
    int at = 0;
    for (int i = 0; i < S; at += Model::string_points[i++]) {
      const int pieces = Model::string_points[i] - 1;
      Real span[array_size(Model::n_points)], total_span = Real(0.0);
      for (int k = 0; k < pieces; ++k) {
        span[k] = distance_of(points_ + 3 * (at + k), points_ + 3 * (at + k + 1));
        total_span += span[k];
      }
      const Real length = string_length<Model, Real>(i, q_D, q_K);
      Real point_path[array_size(Model::n_points)], x = moving ? moves.wound[i] : Real(0.0);
      for (int k = 0; k <= pieces; ++k) {
        point_path[k] = moving ? moves.path(in, poses_, in.carriers[at + k], points_ + 3 * (at + k))
                               : Real(0.0);
        x += (pieces > 1 ? 2.0 : 1.0) * point_path[k];  // length moves between pieces
      }
      if (moving && moves.known) {
        const Real excess = length - total_span;
        x = maximum(moves.most_excess[i] - excess, excess - moves.least_excess[i]);
        x = maximum(x, Real(0.0));
      }
      for (int k = 0; k < pieces; ++k) {
        Placed<Real> segment;
        segment.kind = SEGMENT;
        segment.mesh = -1;
        segment.radius = in.string_radius[i];
        segment.half = no_box;
        for (int c = 0; c < 3; ++c) {
          segment.a[c] = points_[3 * (at + k) + c];
          segment.b[c] = points_[3 * (at + k + 1) + c];
        }
        // The excess length is shared in proportion to the spans.
        const Real piece_length =
            length * (span[k] / select(total_span > Real(0.0), total_span, Real(1.0)));
        Curve curve;
        curve.straight = segment;
        curve.span = span[k];
        curve.length = piece_length;
        // Wires also push, and stay straight.
        curve.slack = piece_length >
                      (Model::wire[i] ? Real(Tol::max_distance) : Real(span[k] * Tol::min_slack));
        pair_path_ = maximum(point_path[k], point_path[k + 1]);
        const Mask sags = curve.slack || (moving ? moves.loose[i] : Real(0.0)) > Real(0.5);
        if (moving && any(sags))
          pair_path_ += select(sags, moves.sag(piece_length, span[k], x), Real(0.0));
        for (long long o = 0; o < in.n_standing; ++o)
          add(segment.radius < 0.0 ? Real(Tol::max_distance)
                                   : string_distance(curve, in.standing[o], selected));
      }
    }
  }

 private:
  // A string between two points of its path: its chord, and the curve in which it hangs when slack.
  struct Curve {
    Placed<Real> straight;
    Real span, length;
    Mask slack;
    bool known = false;
    Real points[3 * (n_chords + 1)];
  };

  // Distance of a string from an obstacle. Slack strings sag, but may lie on half-spaces.
  FAN_FN Real string_distance(Curve& curve, const Solid& other, const Mask& selected) {
    const Real chord = measured(curve.straight, other, selected && !curve.slack, needed_distance());
    if (other.kind == HALF_SPACE || !any(curve.slack)) return chord;
    using std::sqrt;
    // In any shape, the string lies within an ellipsoid with its ends as foci.
    const Real spare = curve.length * curve.length - curve.span * curve.span;
    const Real bound = chord - Real(0.5) * sqrt(select(curve.slack, spare, Real(0.0)));
    const auto needed = curve.slack && bound < needed_distance();
    if (!any(needed)) return chord;
    if (!curve.known) set_catenary(curve);
    Placed<Real> piece = curve.straight;
    Real nearest = Real(Tol::max_distance);
    for (int k = 0; k < n_chords; ++k) {
      const Real limit = select(nearest < needed_distance(), nearest, needed_distance());
      for (int c = 0; c < 3; ++c) {
        piece.a[c] = curve.points[3 * k + c];
        piece.b[c] = curve.points[3 * (k + 1) + c];
      }
      const Real distance = measured(piece, other, selected && needed, limit);
      nearest = select(distance < nearest, distance, nearest);
    }
    return select(needed, nearest, chord);
  }

  // Sets the points of a slack string's curve.
  FAN_FN static void set_catenary(Curve& curve) {
    curve.known = true;
    for (int l = 0; l < Traits<Real>::width; ++l) {
      double a[3], b[3], points[3 * (n_chords + 1)];
      for (int c = 0; c < 3; ++c) {
        a[c] = lane_of(curve.straight.a[c], l);
        b[c] = lane_of(curve.straight.b[c], l);
      }
      if (lane_of(curve.slack, l)) catenary(a, b, lane_of(curve.length, l), points);
      for (int k = 0; k < 3 * (n_chords + 1); ++k)
        lane_of(curve.points[k], l) = lane_of(curve.slack, l) ? points[k] : a[k % 3];
    }
  }

  // Distance of two points.
  FAN_FN static Real distance_of(const Real* a, const Real* b) {
    using std::sqrt;
    Real sum = Real(0.0);
    for (int c = 0; c < 3; ++c) sum += (b[c] - a[c]) * (b[c] - a[c]);
    return sqrt(sum);
  }

  // Sets a solid's pose in the world.
  FAN_FN void place(const Solid& solid, Placed<Real>& out) const {
    out.kind = solid.kind;
    out.mesh = solid.mesh;
    out.radius = solid.radius;
    out.half = solid.half;
    if (solid.link < 0) {
      for (int c = 0; c < 3; ++c) {
        out.a[c] = Real(solid.a[c]);
        out.b[c] = Real(solid.b[c]);
      }
      for (int c = 0; c < 9; ++c) out.R[c] = Real(solid.R[c]);
      return;
    }
    const Real* R = poses_ + 12 * solid.link;
    const Real* r = R + 9;
    for (int c = 0; c < 3; ++c) {
      out.a[c] = r[c] + R[c] * solid.a[0] + R[3 + c] * solid.a[1] + R[6 + c] * solid.a[2];
      out.b[c] = r[c] + R[c] * solid.b[0] + R[3 + c] * solid.b[1] + R[6 + c] * solid.b[2];
    }
    if (solid.kind != BOX && !(solid.half[0] > 0.0)) return;
    for (int j = 0; j < 3; ++j)
      for (int c = 0; c < 3; ++c)
        out.R[3 * j + c] =
            R[c] * solid.R[3 * j] + R[3 + c] * solid.R[3 * j + 1] + R[6 + c] * solid.R[3 * j + 2];
  }

  // A point x in a box's frame.
  template <class Number>
  FAN_FN static void into_box(const Number* R, const Number* centre, const Real* x, Real* out) {
    Real from[3];
    for (int c = 0; c < 3; ++c) from[c] = x[c] - Real(centre[c]);
    turn(R, from, out);
  }

  template <class Number>
  FAN_FN static void turn(const Number* R, const Real* x, Real* out) {
    for (int j = 0; j < 3; ++j)
      out[j] = Real(R[3 * j]) * x[0] + Real(R[3 * j + 1]) * x[1] + Real(R[3 * j + 2]) * x[2];
  }

  // Distance above which a lower bound is enough.
  FAN_FN Real needed_distance() const {
    return minimum(maximum(least, lower + pair_path_), Real(enough_) + pair_path_);
  }

  // Longest path of a placed solid's points.
  FAN_FN Real path(const ClearanceArrays& in, const Solid& solid, const Placed<Real>& at) const {
    const double* half = solid.half;
    if (solid.kind == SEGMENT && !(half[0] > 0.0))
      return maximum(
          moves.path(in, poses_, solid.link, at.a), moves.path(in, poses_, solid.link, at.b));
    Real centre[3];
    for (int c = 0; c < 3; ++c) centre[c] = 0.5 * (at.a[c] + at.b[c]);
    const double beyond = std::sqrt(half[0] * half[0] + half[1] * half[1] + half[2] * half[2]);
    return moves.path(in, poses_, solid.link, centre, beyond);
  }

  // Result of distance_between(); for meshes, in selected lanes where it is below `limit`, the
  // exact distance.
  template <class Other>
  FAN_FN Real
  measured(const Placed<Real>& x, const Other& y, const Mask& selected, const Real& limit) const {
    Real distance = distance_between(x, y);
    if (x.mesh < 0 && y.mesh < 0) return distance;
    const auto needed = selected && distance < limit;
    if (!any(needed)) return distance;
    for (int l = 0; l < Traits<Real>::width; ++l) {
      if (!lane_of(needed, l)) continue;
      Solid first{}, second{};
      lane_of(distance, l) =
          exact_(in_lane(x, l, first), in_lane(y, l, second)) - x.radius - y.radius;
    }
    return distance;
  }

  FAN_FN static const Solid* in_lane(const Solid& standing, int, Solid&) { return &standing; }

  FAN_FN static const Solid* in_lane(const Placed<Real>& x, int lane, Solid& out) {
    out.kind = x.kind;
    out.link = -1;
    out.mesh = x.mesh;
    out.radius = x.radius;
    for (int c = 0; c < 3; ++c) {
      out.a[c] = lane_of(x.a[c], lane);
      out.b[c] = lane_of(x.b[c], lane);
      out.half[c] = x.half[c];
    }
    if (x.kind == BOX)
      for (int c = 0; c < 9; ++c) out.R[c] = lane_of(x.R[c], lane);
    return &out;
  }

  // Distance of a moving solid from a moving or standing one; a mesh counts as the box around it.
  template <class Other>
  FAN_FN Real distance_between(const Placed<Real>& x, const Other& y) const {
    const double total_radius = x.radius + y.radius;
    if (y.kind == HALF_SPACE) return height_above(x, y) - Real(total_radius);
    if (x.kind == SEGMENT && y.kind == SEGMENT) {
      Real a[3], b[3];
      for (int c = 0; c < 3; ++c) {
        a[c] = Real(y.a[c]);
        b[c] = Real(y.b[c]);
      }
      return between_segments(x.a, x.b, a, b) - Real(total_radius);
    }
    Real a[3], b[3];
    if (x.kind == SEGMENT) {
      into_box(y.R, y.a, x.a, a);
      into_box(y.R, y.a, x.b, b);
      const Real bound = segment_box_bound(a, b, y.half) - Real(total_radius);
      if (!any(!(bound > Real(enough_) + pair_path_))) return bound;
      return without_touch(segment_to_box(a, b, y.half)) - Real(total_radius);
    }
    if (y.kind == SEGMENT) {
      Real from[3], to[3];
      for (int c = 0; c < 3; ++c) {
        from[c] = Real(y.a[c]);
        to[c] = Real(y.b[c]);
      }
      into_box(x.R, x.a, from, a);
      into_box(x.R, x.a, to, b);
      return without_touch(segment_to_box(a, b, x.half)) - Real(total_radius);
    }
    Real axes[9];
    into_box(y.R, y.a, x.a, a);
    for (int j = 0; j < 3; ++j) turn(y.R, x.R + 3 * j, axes + 3 * j);
    const Real bound = box_to_box(a, axes, x.half, y.half);
    const auto needed = bound > Real(0.0) && bound - Real(total_radius) < needed_distance();
    if (!any(needed)) return bound - Real(total_radius);
    return select(needed, between_boxes(a, axes, x.half, y.half), bound) - Real(total_radius);
  }

  // The distance; negative for solids that touch.
  FAN_FN static Real without_touch(const Real& distance) {
    return select(distance > Real(0.0), distance, Real(-Tol::rounding));
  }

  // A lower bound of a segment's distance from a box about the origin: the distance of its middle
  // less half its length.
  FAN_FN static Real segment_box_bound(const Real* a, const Real* b, const double* half) {
    using std::sqrt;
    Real off = Real(0.0), length = Real(0.0);
    for (int k = 0; k < 3; ++k) {
      const Real middle = Real(0.5) * (a[k] + b[k]);
      const Real out = middle - clamped(middle, Real(-half[k]), Real(half[k]));
      off += out * out;
      length += (b[k] - a[k]) * (b[k] - a[k]);
    }
    return sqrt(off) - Real(0.5) * sqrt(length);
  }

  // Height of the lowest point above a half-space, before the radius is subtracted.
  template <class Other>
  FAN_FN static Real height_above(const Placed<Real>& x, const Other& y) {
    using std::abs;
    const auto height = [&](const Real* point) {
      Real sum = Real(0.0);
      for (int c = 0; c < 3; ++c) sum += (point[c] - Real(y.a[c])) * Real(y.b[c]);
      return sum;
    };
    const auto along = [&](int j) {
      Real sum = Real(0.0);
      for (int c = 0; c < 3; ++c) sum += x.R[3 * j + c] * Real(y.b[c]);
      return sum;
    };
    const Real first = height(x.a);
    if (x.kind == SEGMENT) {
      const Real second = height(x.b);
      if (x.half[0] > 0.0) {
        using std::sqrt;
        Real reach = Real(0.0);
        for (int j = 0; j < 3; ++j) reach += along(j) * along(j) * Real(x.half[j] * x.half[j]);
        return Real(0.5) * (first + second) - sqrt(reach) + Real(x.radius);
      }
      return select(second < first, second, first);
    }
    Real reach = Real(0.0);
    for (int j = 0; j < 3; ++j) reach += abs(along(j)) * x.half[j];
    return first - reach;
  }

  double enough_ = Tol::max_distance;
  Real pair_path_ = Real(0.0);  // path of both solids of the current pair
  double (*exact_)(const Solid*, const Solid*) = nullptr;
  Real poses_[array_size(12 * Model::n_links)], points_[array_size(3 * Model::n_points)];
};

}  // namespace fan
