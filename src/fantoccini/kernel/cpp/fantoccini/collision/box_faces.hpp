// Points that faces of two boxes share, numbered by the features that touch in them (box_pair.hpp).
#pragma once

#include "fantoccini/collision/box_capsule.hpp"

namespace fan {

// A face of a box: its middle, outward normal, half lengths and directions of its edges.
struct BoxFace {
  int axis, upward;
  const double *u, *v;
  double hu, hv, centre[3], normal[3];

  // The face of the axis k on the side towards a direction.
  FAN_FN BoxFace(const PlacedSolid& box, int k, const double* direction)
      : axis(k),
        u(box.R + 3 * ((k + 1) % 3)),
        v(box.R + 3 * ((k + 2) % 3)),
        hu(box.half[(k + 1) % 3]),
        hv(box.half[(k + 2) % 3]) {
    const double side = side_of(dot3(box.R + 3 * k, direction));
    upward = side > 0.0 ? 1 : 0;
    for (int c = 0; c < 3; ++c) normal[c] = side * box.R[3 * k + c];
    along3(box.a, box.half[k], normal, centre);
  }

  FAN_FN int number() const { return 2 * axis + upward; }

  // The corner of the box on a side of u and a side of v: bit k is the side of axis k.
  FAN_FN int corner(double u_side, double v_side) const {
    return upward << axis | (u_side > 0.0 ? 1 : 0) << (axis + 1) % 3 |
           (v_side > 0.0 ? 1 : 0) << (axis + 2) % 3;
  }
};

// Number of a box's edge along axis k, from the bits of a corner on the other axes: 4 k to 4 k + 3.
FAN_FN int edge_number(int k, int corner) {
  return 4 * k | (corner >> (k + 1) % 3 & 1) | (corner >> (k + 2) % 3 & 1) << 1;
}

// Feature numbers of two boxes: a corner of one with a face of the other, two edges, or nearest
// points of other kinds. A face is 2 k, or 2 k + 1 on the upper side of its axis k.
struct BoxFeatures {
  static constexpr int corners = 8, of_y = 6 * corners, edges = 2 * of_y, nearest = edges + 12 * 12;

  FAN_FN static int corner(bool of_x, int corner, int face) {
    return (of_x ? 0 : of_y) + corners * face + corner;
  }

  FAN_FN static int crossing(int x_edge, int y_edge) { return edges + 12 * x_edge + y_edge; }
};

// A vertex of the polygon that two faces share, in the axes of the lower one; the unit normal
// there, upwards; its region.
struct Spot {
  double at[2], height, normal[3];
  int number;
  CrossingRegion region;
};

// The polygon of the points of a face, the upper, above another, the lower: corners of both, and
// crossings of edges of the upper with sides of the lower. Where faces lie flat, corners just
// outside the other face count as on it, and points near one another are merged, so that equal
// faces share four points in spite of jitter. A corner from which the box continues through the
// other's plane does not carry load at the end of the face, but the crossings beside it do: it
// comes after them.
class SharedPolygon {
 public:
  Spot spots[max_touches];
  int n = 0;
  double tolerance;  // m: points nearer than this are merged

  FAN_FN SharedPolygon(const BoxFace& lower, const BoxFace& upper, bool lower_is_x)
      : lower_(lower), upper_(upper), lower_is_x_(lower_is_x), half_{lower.hu, lower.hv} {
    double from[3];
    difference3(upper.centre, lower.centre, from);
    into(from, 1.0, middle_);
    into(upper.u, upper.hu, U_);
    into(upper.v, upper.hv, V_);
    into(upper.normal, -1.0, up_);
    double across[3];
    cross(lower.normal, upper.normal, across);
    const bool flat = length3(across) < TouchTolerances::lying;
    const double size = fmax(fmax(lower.hu, lower.hv), fmax(upper.hu, upper.hv));
    tolerance = (flat ? BoxTolerances::same_face : BoxTolerances::rounding) * size;
    rounding_ = BoxTolerances::rounding * size;
    slope_ = flat ? BoxTolerances::same_slope : BoxTolerances::rounding;
    for (int i = 0; i < 4; ++i)
      for (int c = 0; c < 3; ++c)
        corners_[i][c] = middle_[c] + turns_[i][0] * U_[c] + turns_[i][1] * V_[c];
    add_corners(true);
    for (int i = 0; i < 4; ++i) add_crossings(i);
    add_corners(false);
  }

 private:
  // Corners of a rectangle in order, and outward directions of the sides after them.
  static constexpr double turns_[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
  static constexpr double outward_[4][2] = {{0, -1}, {1, 0}, {0, 1}, {-1, 0}};

  // A vector in the axes of the lower face.
  FAN_FN void into(const double* x, double scale, double* out) const {
    out[0] = scale * dot3(x, lower_.u);
    out[1] = scale * dot3(x, lower_.v);
    out[2] = scale * dot3(x, lower_.normal);
  }

  FAN_FN void add(
      double x, double y, double height, const double* normal, int number,
      CrossingRegion region = CROSSING) {
    if (n == max_touches) return;
    const double near = 3.0 * tolerance;
    for (int i = 0; i < n; ++i)
      if (fabs(spots[i].at[0] - x) < near && fabs(spots[i].at[1] - y) < near) return;
    Spot& to = spots[n++];
    to = Spot{{x, y}, height, {}, number, region};
    for (int c = 0; c < 3; ++c)
      to.normal[c] =
          normal[0] * lower_.u[c] + normal[1] * lower_.v[c] + normal[2] * lower_.normal[c];
  }

  // The upper face's height above a point of the lower.
  FAN_FN double height(double x, double y) const {
    return middle_[2] - (up_[0] * (x - middle_[0]) + up_[1] * (y - middle_[1])) / up_[2];
  }

  // Adds the corners of the first box, then of the second, that carry load at the other's edge, or
  // those that do not.
  FAN_FN void add_corners(bool that_carry) {
    for (const bool of_upper : {!lower_is_x_, lower_is_x_})
      for (int i = 0; i < 4; ++i) {
        if (of_upper && carries_upper(i) == that_carry) add_upper(i);
        if (!of_upper && carries_lower(i) == that_carry) add_lower(i);
      }
  }

  // Whether no edge of the upper face goes down from its corner i.
  FAN_FN bool carries_upper(int i) const {
    return turns_[i][0] * U_[2] <= slope_ * upper_.hu && turns_[i][1] * V_[2] <= slope_ * upper_.hv;
  }

  // Whether no edge of the lower face goes up from its corner i, as the upper face sees it.
  FAN_FN bool carries_lower(int i) const {
    return -turns_[i][0] * up_[0] <= slope_ && -turns_[i][1] * up_[1] <= slope_;
  }

  // Distance outside the other face up to which a corner counts as on it.
  FAN_FN double reach(bool carries) const { return carries ? tolerance : -rounding_; }

  FAN_FN void add_upper(int i) {
    const double *p = corners_[i], normal[3] = {0.0, 0.0, 1.0}, more = reach(carries_upper(i));
    if (fabs(p[0]) > half_[0] + more || fabs(p[1]) > half_[1] + more) return;
    const double x = clamped(p[0], -half_[0], half_[0]), y = clamped(p[1], -half_[1], half_[1]);
    const int corner = upper_.corner(turns_[i][0], turns_[i][1]);
    const bool on = (x == p[0] && y == p[1]) || !(up_[2] > DistanceTolerances::min_length);
    add(x, y, on ? p[2] : height(x, y), normal,
        BoxFeatures::corner(!lower_is_x_, corner, lower_.number()));
  }

  FAN_FN void add_lower(int i) {
    const double x = turns_[i][0] * half_[0] - middle_[0];
    const double y = turns_[i][1] * half_[1] - middle_[1];
    const double area = U_[0] * V_[1] - U_[1] * V_[0];
    if (!(fabs(area) > DistanceTolerances::min_determinant * upper_.hu * upper_.hv)) return;
    const double s = (x * V_[1] - y * V_[0]) / area, t = (U_[0] * y - U_[1] * x) / area;
    const double more = reach(carries_lower(i));
    if (fabs(s) > 1.0 + more / upper_.hu || fabs(t) > 1.0 + more / upper_.hv) return;
    const int corner = lower_.corner(turns_[i][0], turns_[i][1]);
    add(middle_[0] + x, middle_[1] + y, middle_[2] + s * U_[2] + t * V_[2], up_,
        BoxFeatures::corner(lower_is_x_, corner, upper_.number()));
  }

  // Adds the crossings of the edge from corner i with the sides of the lower face.
  FAN_FN void add_crossings(int i) {
    const double *p = corners_[i], *q = corners_[(i + 1) % 4];
    const int corner = upper_.corner(turns_[i][0], turns_[i][1]);
    const int edge = edge_number((upper_.axis + 1 + i % 2) % 3, corner);
    const double p_more = reach(carries_upper(i)), q_more = reach(carries_upper((i + 1) % 4));
    for (int side = 0; side < 4; ++side) {
      const int c = side / 2, other = 1 - c;
      const double outward = side % 2 == 0 ? -1.0 : 1.0, bound = outward * half_[c];
      if ((outward * p[c] > half_[c] + p_more) == (outward * q[c] > half_[c] + q_more)) continue;
      if (p[c] == q[c]) continue;
      // By rounding, a corner on this side of the lower face's side may count as beyond it. The
      // crossing of an edge along that side is at the corner all the same.
      double d[3];
      difference3(q, p, d);
      const double more = 2.0 * tolerance / length3(d);
      const double t = clamped((bound - p[c]) / d[c], -more, 1.0 + more);
      const double along = p[other] + t * (q[other] - p[other]);
      if (fabs(along) > half_[other] + 2.0 * rounding_) continue;
      const int lower_corner = c == 0 ? lower_.corner(bound, 1.0) : lower_.corner(1.0, bound);
      const int lower_edge = edge_number((lower_.axis + 2 - c) % 3, lower_corner);
      double normal[3];
      const CrossingRegion region = crossing_normal(i, c, side_of(bound), normal);
      add(c == 0 ? bound : along, c == 0 ? along : bound, p[2] + t * (q[2] - p[2]), normal,
          lower_is_x_ ? BoxFeatures::crossing(lower_edge, edge)
                      : BoxFeatures::crossing(edge, lower_edge),
          region);
    }
  }

  // Normal of the upper edge from corner i and a side of the lower face, across its axis c: their
  // product if it lies between the normals of the faces at both edges, else the lower face's, as
  // for edges that are nearly parallel.
  FAN_FN CrossingRegion crossing_normal(int i, int c, double side, double* out) const {
    const double *p = corners_[i], *q = corners_[(i + 1) % 4];
    double d[3];
    difference3(q, p, d);
    out[0] = out[1] = 0.0;
    out[2] = 1.0;
    const double across = side_of(d[c]), size = sqrt(d[c] * d[c] + d[2] * d[2]);
    if (!(fabs(d[c]) > TouchTolerances::lying * length3(d))) return ALONG;
    double n[3] = {0.0, 0.0, fabs(d[c]) / size};
    n[c] = -across * d[2] / size;
    const double least = -BoxTolerances::rounding;
    double outward[3];
    for (int k = 0; k < 3; ++k) outward[k] = outward_[i][0] * U_[k] + outward_[i][1] * V_[k];
    if (side * n[c] < least || -dot3(n, outward) < least * length3(outward)) return BEYOND;
    copy3(n, out);
    return CROSSING;
  }

  const BoxFace &lower_, &upper_;
  bool lower_is_x_;
  double half_[2], middle_[3], U_[3], V_[3], corners_[4][3];
  double up_[3];  // the upper face's normal, reversed
  double rounding_, slope_;
};

}  // namespace fan
