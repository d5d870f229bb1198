// Contact points of two boxes.
//
// The axis with the widest gap, or the least depth, of the separating axes decides (Gottschalk, Lin
// and Manocha, "OBBTree", SIGGRAPH 1996): the normal of a face, or the product of two edges. A face
// has the points of the other box's opposite face that lie above it, which is clipped to a polygon.
// Two edges have one point, or two where they are nearly parallel (touch_segments.hpp). Boxes apart
// whose faces do not see one another touch at their nearest points.
//
// Faces are preferred to edges, and the second box's to the first's, by more than rounding and the
// jitter of a body at rest, so that the points stay the same from step to step.
#pragma once

#include "touch_boxes.hpp"

namespace fan {

// A separating axis: the unit normal from the second box to the first, and the gap along it.
struct BoxAxis {
  double normal[3], gap = -DistanceTolerances::far;
  int x_axis = -1, y_axis = -1;  // of a face, or of both edges

  FAN_FN void take(const double* n, double centre, double reach, double scale, int i, int j) {
    const double found = (fabs(centre) - reach) * scale;
    if (!(found > gap)) return;
    gap = found;
    x_axis = i;
    y_axis = j;
    for (int k = 0; k < 3; ++k) normal[k] = side_of(centre) * scale * n[k];
  }
};

// The separating axes of two boxes.
struct BoxAxes {
  BoxAxis of_x, of_y, of_edges;

  FAN_FN BoxAxes(const PlacedSolid& x, const PlacedSolid& y) {
    double apart[3], x_at[3], y_at[3], turn[9], size[9];
    difference3(x.a, y.a, apart);
    into_axes(x.R, apart, x_at);
    into_axes(y.R, apart, y_at);
    for (int i = 0; i < 3; ++i) {
      into_axes(y.R, x.R + 3 * i, turn + 3 * i);
      for (int j = 0; j < 3; ++j) size[3 * i + j] = fabs(turn[3 * i + j]);
    }
    for (int j = 0; j < 3; ++j) {
      const double reach =
          x.half[0] * size[j] + x.half[1] * size[3 + j] + x.half[2] * size[6 + j];
      of_y.take(y.R + 3 * j, y_at[j], reach + y.half[j], 1.0, -1, j);
    }
    for (int i = 0; i < 3; ++i)
      of_x.take(x.R + 3 * i, x_at[i], x.half[i] + dot3(y.half, size + 3 * i), 1.0, i, -1);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
        double n[3];
        cross3(x.R + 3 * i, y.R + 3 * j, n);
        const double square = dot3(n, n);
        if (!(square > DistanceTolerances::min_axis_square)) continue;
        const double reach = x.half[i1] * size[3 * i2 + j] + x.half[i2] * size[3 * i1 + j] +
                             y.half[j1] * size[3 * i + j2] + y.half[j2] * size[3 * i + j1];
        of_edges.take(n, dot3(apart, n), reach, 1.0 / sqrt(square), i, j);
      }
  }
};

// A face of a box: its middle, outward normal, and the half edges and their directions.
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

  // The corner of the box on a side of u and a side of v: bit k is the side of axis k.
  FAN_FN int corner(double u_side, double v_side) const {
    return upward << axis | (u_side > 0.0 ? 1 : 0) << (axis + 1) % 3 |
           (v_side > 0.0 ? 1 : 0) << (axis + 2) % 3;
  }
};

// What the features of two boxes tell apart: of each face of one, the other's corners, its own, and
// crossings of its sides with the other's edges; pairs of edges; nearest points.
struct BoxFeatures {
  static constexpr int lower = 8, crossings = lower + 8, of_face = crossings + 4 * 24;
  static constexpr int edges = 6 * of_face, nearest = edges + 9;

  // Of a point of a face, which is the second box's or the first's.
  FAN_FN static int face(int axis, bool of_x, int number) {
    return of_face * (axis + (of_x ? 3 : 0)) + number;
  }

  // Of the crossings of an edge from one corner to another with the four sides of a face.
  FAN_FN static int crossing(int from, int to) {
    const int axis = (from ^ to) >> 1;
    return crossings + 4 * (8 * axis + (from & to));
  }
};

// A point of the polygon that two faces share, in the axes of the lower one.
struct Spot {
  double at[2], height;
  int number;
};

// The polygon of the points of a face, the upper, above another, the lower: corners of the upper,
// corners of the lower, and where edges of the upper cross sides of the lower. Where faces lie
// flat, corners just off the other count as on it, and near points are one, so that equal faces
// share four points however they jitter.
class SharedPolygon {
 public:
  Spot spots[max_touches];
  int n = 0;
  double tolerance;  // m: points this near are one

  FAN_FN SharedPolygon(const BoxFace& lower, const BoxFace& upper) : half_{lower.hu, lower.hv} {
    double from[3];
    difference3(upper.centre, lower.centre, from);
    into(lower, from, 1.0, middle_);
    into(lower, upper.u, upper.hu, U_);
    into(lower, upper.v, upper.hv, V_);
    double across[3];
    cross3(lower.normal, upper.normal, across);
    const double share = length3(across) < TouchTolerances::lying ? BoxTolerances::same_face
                                                                  : BoxTolerances::rounding;
    tolerance = share * fmax(fmax(lower.hu, lower.hv), fmax(upper.hu, upper.hv));
    for (int i = 0; i < 4; ++i)
      for (int c = 0; c < 3; ++c)
        corners_[i][c] = middle_[c] + turns_[i][0] * U_[c] + turns_[i][1] * V_[c];
    for (int i = 0; i < 4; ++i) add_upper(i, upper);
    for (int i = 0; i < 4; ++i) add_lower(i, lower, upper);
    for (int i = 0; i < 4; ++i) add_crossings(i, upper);
  }

 private:
  // The corners of a rectangle in turn.
  static constexpr double turns_[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};

  FAN_FN static void into(const BoxFace& face, const double* x, double scale, double* out) {
    out[0] = scale * dot3(x, face.u);
    out[1] = scale * dot3(x, face.v);
    out[2] = scale * dot3(x, face.normal);
  }

  FAN_FN void add(double x, double y, double height, int number) {
    if (n == max_touches) return;
    const double near = 3.0 * tolerance;
    for (int i = 0; i < n; ++i)
      if (fabs(spots[i].at[0] - x) < near && fabs(spots[i].at[1] - y) < near) return;
    spots[n++] = Spot{{x, y}, height, number};
  }

  FAN_FN void add_upper(int i, const BoxFace& upper) {
    const double* p = corners_[i];
    if (fabs(p[0]) > half_[0] + tolerance || fabs(p[1]) > half_[1] + tolerance) return;
    const int number = upper.corner(turns_[i][0], turns_[i][1]);
    add(clamped(p[0], -half_[0], half_[0]), clamped(p[1], -half_[1], half_[1]), p[2], number);
  }

  FAN_FN void add_lower(int i, const BoxFace& lower, const BoxFace& upper) {
    const double x = turns_[i][0] * half_[0] - middle_[0];
    const double y = turns_[i][1] * half_[1] - middle_[1];
    const double area = U_[0] * V_[1] - U_[1] * V_[0];
    if (!(fabs(area) > DistanceTolerances::min_determinant * upper.hu * upper.hv)) return;
    const double s = (x * V_[1] - y * V_[0]) / area, t = (U_[0] * y - U_[1] * x) / area;
    if (fabs(s) > 1.0 + tolerance / upper.hu || fabs(t) > 1.0 + tolerance / upper.hv) return;
    const int number = BoxFeatures::lower + lower.corner(turns_[i][0], turns_[i][1]);
    add(middle_[0] + x, middle_[1] + y, middle_[2] + s * U_[2] + t * V_[2], number);
  }

  // Where the edge from corner i on crosses the sides of the lower face.
  FAN_FN void add_crossings(int i, const BoxFace& upper) {
    const double *from = turns_[i], *to = turns_[(i + 1) % 4];
    const double *p = corners_[i], *q = corners_[(i + 1) % 4];
    const int first = BoxFeatures::crossing(
        upper.corner(from[0], from[1]), upper.corner(to[0], to[1]));
    for (int side = 0; side < 4; ++side) {
      const int c = side / 2, other = 1 - c;
      const double bound = side % 2 == 0 ? -half_[c] : half_[c];
      const double reach = side % 2 == 0 ? bound - tolerance : bound + tolerance;
      if ((p[c] < reach) == (q[c] < reach)) continue;
      const double t = clamped((bound - p[c]) / (q[c] - p[c]), 0.0, 1.0);
      const double along = p[other] + t * (q[other] - p[other]);
      if (fabs(along) > half_[other]) continue;
      const double height = p[2] + t * (q[2] - p[2]);
      add(c == 0 ? bound : along, c == 0 ? along : bound, height, first + side);
    }
  }

  double half_[2], middle_[3], U_[3], V_[3], corners_[4][3];
};

// The nearest points of two boxes that are apart: on an edge of the first, or at a corner of the
// second. Boxes that meet keep the given normal.
class NearestOfBoxes {
 public:
  PointPair pair{};
  double normal[3];

  FAN_FN NearestOfBoxes(const PlacedSolid& x, const PlacedSolid& y, const double* given) {
    copy3(given, normal);
    for (int corner = 0; corner < 8; ++corner) {
      take_corner(x, y, corner);
      for (int k = 0; k < 3; ++k)
        if (((corner >> k) & 1) == 0) take_edge(x, y, corner, k);
    }
    aim(pair, normal);
  }

 private:
  FAN_FN static void corner_of(const PlacedSolid& box, int corner, double* out) {
    double local[3];
    for (int k = 0; k < 3; ++k) local[k] = (corner >> k) & 1 ? box.half[k] : -box.half[k];
    out_of_axes(box.R, local, out);
    along3(box.a, 1.0, out, out);
  }

  FAN_FN static void into(const PlacedSolid& box, const double* point, double* out) {
    double from[3];
    difference3(point, box.a, from);
    into_axes(box.R, from, out);
  }

  // Takes a point of the first, or the second, and the other's nearest to it.
  FAN_FN void take(const double* point, const PlacedSolid& other, bool of_second) {
    double local[3], p[3], apart[3];
    into(other, point, local);
    for (int k = 0; k < 3; ++k) local[k] = clamped(local[k], -other.half[k], other.half[k]);
    out_of_axes(other.R, local, p);
    along3(other.a, 1.0, p, p);
    difference3(point, p, apart);
    const double square = dot3(apart, apart);
    if (!(square < least_)) return;
    least_ = square;
    copy3(of_second ? p : point, pair.p);
    copy3(of_second ? point : p, pair.q);
  }

  FAN_FN void take_corner(const PlacedSolid& x, const PlacedSolid& y, int corner) {
    double point[3];
    corner_of(y, corner, point);
    take(point, x, true);
  }

  FAN_FN void take_edge(const PlacedSolid& x, const PlacedSolid& y, int corner, int k) {
    double a[3], b[3], from[3], to[3], point[3];
    corner_of(x, corner, a);
    along3(a, 2.0 * x.half[k], x.R + 3 * k, b);
    into(y, a, from);
    into(y, b, to);
    const double t = nearest_to_box(from, to, y.half);
    along3(a, 2.0 * x.half[k] * t, x.R + 3 * k, point);
    take(point, y, false);
  }

  double least_ = DistanceTolerances::far;
};

// The edge of a placed box along axis k that lies farthest in a direction, times `side`.
FAN_FN Core edge_of(const PlacedSolid& box, int k, const double* direction, double side) {
  double local[3], a[3], b[3];
  into_axes(box.R, direction, local);
  for (int c = 0; c < 3; ++c) local[c] *= side;
  const Core edge = edge_towards(local, box.half, k);
  out_of_axes(box.R, edge.a, a);
  out_of_axes(box.R, edge.b, b);
  along3(box.a, 1.0, a, a);
  along3(box.a, 1.0, b, b);
  return Core(a, b);
}

FAN_FN int most_across(const PlacedSolid& box, const double* direction) {
  double local[3];
  into_axes(box.R, direction, local);
  return smallest_of(local);
}

FAN_FN void touch_boxes_apart(
    const PlacedSolid& x, const PlacedSolid& y, const double* given, Touches& to) {
  const NearestOfBoxes nearest(x, y, given);
  const double* n = nearest.normal;
  const Overlap overlap(
      edge_of(x, most_across(x, n), n, -1.0), edge_of(y, most_across(y, n), n, 1.0));
  if (overlap.flat == 0.0)
    return to.add(nearest.pair.p, nearest.pair.q, n, BoxFeatures::nearest);
  for (int k = 0; k < 2; ++k) {
    const PointPair pair = between_pairs(nearest.pair, overlap.ends[k], overlap.flat);
    double normal[3];
    copy3(n, normal);
    aim(pair, normal);
    to.add(pair.p, pair.q, normal, BoxFeatures::nearest + k);
  }
}

FAN_FN void touch_edges(
    const PlacedSolid& x, const PlacedSolid& y, const BoxAxis& axis, Touches& to) {
  const PointPair pair = nearest_points(
      edge_of(x, axis.x_axis, axis.normal, -1.0), edge_of(y, axis.y_axis, axis.normal, 1.0));
  const int number = 3 * axis.x_axis + axis.y_axis;
  to.add(pair.p, pair.q, axis.normal, BoxFeatures::edges + number);
}

// The points of two faces that see one another, if the boxes, whose widest gap along an axis is
// `widest`, are apart by no less; whether they do.
FAN_FN bool touch_faces(
    const PlacedSolid& x, const PlacedSolid& y, const BoxAxis& axis, double widest, Touches& to) {
  const bool of_x = axis.x_axis >= 0;
  const int k = of_x ? axis.x_axis : axis.y_axis;
  const PlacedSolid &owner = of_x ? x : y, &other = of_x ? y : x;
  double outward[3], inward[3], local[3];
  for (int c = 0; c < 3; ++c) {
    outward[c] = of_x ? -axis.normal[c] : axis.normal[c];
    inward[c] = -outward[c];
  }
  into_axes(other.R, inward, local);
  const BoxFace lower(owner, k, outward), upper(other, largest_of(local), inward);
  const SharedPolygon shared(lower, upper);
  double least = DistanceTolerances::far;
  for (int i = 0; i < shared.n; ++i) least = fmin(least, shared.spots[i].height);
  if (shared.n == 0 || (widest > 0.0 && least > widest + shared.tolerance)) return false;
  for (int i = 0; i < shared.n; ++i) {
    const Spot& spot = shared.spots[i];
    double below[3], above[3];
    along3(lower.centre, spot.at[0], lower.u, below);
    along3(below, spot.at[1], lower.v, below);
    along3(below, spot.height, lower.normal, above);
    to.add(
        of_x ? below : above, of_x ? above : below, axis.normal,
        BoxFeatures::face(k, of_x, spot.number));
  }
  return true;
}

FAN_FN void touch_boxes(const PlacedSolid& x, const PlacedSolid& y, Touches& to) {
  using Tol = BoxTolerances;
  const BoxAxes axes(x, y);
  double across[3];
  cross3(axes.of_x.normal, axes.of_y.normal, across);
  const bool flat = length3(across) < TouchTolerances::lying;
  const double same = (flat ? Tol::same_face : Tol::rounding) *
                      fmin(fabs(x.half[largest_of(x.half)]), fabs(y.half[largest_of(y.half)]));
  const BoxAxis& face = axes.of_x.gap > axes.of_y.gap + same ? axes.of_x : axes.of_y;
  const double widest = fmax(face.gap, axes.of_edges.gap);
  if (widest - to.x_radius - to.y_radius >= to.margin) return;
  const double rival = fmax(Tol::edge_share * face.gap, face.gap + same);
  if (widest <= 0.0 && axes.of_edges.gap > rival) return touch_edges(x, y, axes.of_edges, to);
  if (!touch_faces(x, y, face, widest, to)) touch_boxes_apart(x, y, face.normal, to);
}

// How one box sees another, which orders boxes of one size: g . c, with c the other's centre in its
// own axes and g a direction that no construction uses.
FAN_FN double view_of(const PlacedSolid& x, const PlacedSolid& y) {
  const double g[] = {0.3, 0.53, 0.79};
  double apart[3], local[3];
  difference3(y.a, x.a, apart);
  into_axes(x.R, apart, local);
  return dot3(g, local);
}

}  // namespace fan
