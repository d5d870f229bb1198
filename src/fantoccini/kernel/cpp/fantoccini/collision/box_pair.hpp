// Contact points of two boxes.
//
// The separating axis with the widest gap, or the least depth, decides (Gottschalk, Lin and
// Manocha, "OBBTree", SIGGRAPH 1996): the normal of a face, or the product of two edges. The points
// of a face are those of the other box's opposite face that lie above it, clipped to a polygon. Two
// edges have one point, or two where they are nearly parallel (capsules.hpp). Boxes apart whose
// faces do not face one another touch at their nearest points.
//
// Every point has the number and the normal of the features that touch there: the face's for a
// corner over a face, the product of both for two edges that cross. The face that decides therefore
// does not affect points that touch, only which points are sought.
//
// Faces are preferred to edges, and the second box's to the first's, by more than rounding and the
// jitter of a body at rest, so that the points stay the same from step to step.
#pragma once

#include "fantoccini/collision/box_faces.hpp"

namespace fan {

// A separating axis: the unit normal from the second box to the first, and the gap along it.
struct BoxAxis {
  double normal[3], gap = -DistanceTolerances::max_distance;
  int x_axis = -1, y_axis = -1;  // of a face, or of both edges

  FAN_FN void take(const double* n, double centre, double reach, double scale, int i, int j) {
    const double axis_gap = (fabs(centre) - reach) * scale;
    if (!(axis_gap > gap)) return;
    gap = axis_gap;
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
      const double reach = x.half[0] * size[j] + x.half[1] * size[3 + j] + x.half[2] * size[6 + j];
      of_y.take(y.R + 3 * j, y_at[j], reach + y.half[j], 1.0, -1, j);
    }
    for (int i = 0; i < 3; ++i)
      of_x.take(x.R + 3 * i, x_at[i], x.half[i] + dot3(y.half, size + 3 * i), 1.0, i, -1);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
        double n[3];
        cross(x.R + 3 * i, y.R + 3 * j, n);
        const double square = dot3(n, n);
        if (!(square > DistanceTolerances::min_axis_square)) continue;
        const double reach = x.half[i1] * size[3 * i2 + j] + x.half[i2] * size[3 * i1 + j] +
                             y.half[j1] * size[3 * i + j2] + y.half[j2] * size[3 * i + j1];
        of_edges.take(n, dot3(apart, n), reach, 1.0 / sqrt(square), i, j);
      }
  }
};

// The nearest points of two boxes that are apart: on an edge of the first, or at a corner of the
// second. Boxes that meet keep the normal they were given where no features define one.
class NearestOfBoxes {
 public:
  PointPair pair{};
  double normal[3];
  int number = BoxFeatures::nearest;

  FAN_FN NearestOfBoxes(const PlacedSolid& x, const PlacedSolid& y, const double* given) {
    copy3(given, normal);
    for (int corner = 0; corner < 8; ++corner) {
      take_corner(x, y, corner);
      for (int k = 0; k < 3; ++k)
        if (((corner >> k) & 1) == 0) take_edge(x, y, corner, k);
    }
    aim(pair, normal);
    name(OnBox(x, pair.p), OnBox(y, pair.q), x, y);
  }

 private:
  // Feature on which a point of a box's surface lies: a face, an edge or a corner.
  struct OnBox {
    int bounds = 0, axis = 0, corner = 0;  // a face's axis, or the axis along an edge

    FAN_FN OnBox(const PlacedSolid& box, const double* point) {
      double local[3];
      into_frame(box, point, local);
      const double near = BoxTolerances::rounding * length3(box.half);
      int free = 0, bound = 0;
      for (int k = 0; k < 3; ++k) {
        corner |= (local[k] > 0.0 ? 1 : 0) << k;
        const bool at = fabs(local[k]) > box.half[k] - near;
        bounds += at;
        (at ? bound : free) = k;
      }
      axis = bounds == 1 ? bound : free;
    }
  };

  // Number and exact normal of a corner and a face, or of two edges that cross.
  FAN_FN void name(const OnBox& p, const OnBox& q, const PlacedSolid& x, const PlacedSolid& y) {
    if (p.bounds == 2 && q.bounds == 2) {
      double n[3];
      cross(x.R + 3 * p.axis, y.R + 3 * q.axis, n);
      if (!unit3(n, TouchTolerances::crossing)) return;
      turn(n);
      number = BoxFeatures::crossing(edge_number(p.axis, p.corner), edge_number(q.axis, q.corner));
    } else if (p.bounds + q.bounds == 4 && p.bounds != q.bounds) {
      const bool of_x = p.bounds == 3;
      const OnBox &face = of_x ? q : p, &at = of_x ? p : q;
      turn((of_x ? y.R : x.R) + 3 * face.axis);
      number = BoxFeatures::corner(of_x, at.corner, 2 * face.axis + (face.corner >> face.axis & 1));
    }
  }

  // Sets the normal to n or -n, on the side of the present one.
  FAN_FN void turn(const double* n) {
    const double side = side_of(dot3(n, normal));
    for (int k = 0; k < 3; ++k) normal[k] = side * n[k];
  }

  // Considers a point of the first box, or the second, and the other's nearest point to it.
  FAN_FN void take(const double* point, const PlacedSolid& other, bool of_second) {
    double local[3], p[3], apart[3];
    into_frame(other, point, local);
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
    into_frame(y, a, from);
    into_frame(y, b, to);
    const double t = nearest_to_box(from, to, y.half);
    along3(a, 2.0 * x.half[k] * t, x.R + 3 * k, point);
    take(point, y, false);
  }

  double least_ = DistanceTolerances::max_distance;
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

// The corner of a placed box that lies farthest in a direction, times `side`.
FAN_FN int corner_towards(const PlacedSolid& box, const double* direction, double side) {
  double local[3];
  into_axes(box.R, direction, local);
  int corner = 0;
  for (int k = 0; k < 3; ++k) corner |= (side_of(side * local[k]) > 0.0 ? 1 : 0) << k;
  return corner;
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
  if (overlap.flat == 0.0) return to.add(nearest.pair.p, nearest.pair.q, n, nearest.number);
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
  const int number = BoxFeatures::crossing(
      edge_number(axis.x_axis, corner_towards(x, axis.normal, -1.0)),
      edge_number(axis.y_axis, corner_towards(y, axis.normal, 1.0)));
  to.add(pair.p, pair.q, axis.normal, number);
}

// Adds the points of two faces that face one another, unless the boxes are apart and all gaps
// exceed `widest`, the widest gap along an axis. Returns whether points were added.
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
  const SharedPolygon shared(lower, upper, of_x);
  double least = DistanceTolerances::max_distance;
  for (int i = 0; i < shared.n; ++i) least = fmin(least, shared.spots[i].height);
  if (shared.n == 0 || (widest > 0.0 && least > widest + shared.tolerance)) return false;
  for (int i = 0; i < shared.n; ++i) {
    const Spot& spot = shared.spots[i];
    double below[3], above[3], normal[3];
    along3(lower.centre, spot.at[0], lower.u, below);
    along3(below, spot.at[1], lower.v, below);
    along3(below, spot.height, lower.normal, above);
    for (int c = 0; c < 3; ++c) normal[c] = of_x ? -spot.normal[c] : spot.normal[c];
    to.add(of_x ? below : above, of_x ? above : below, normal, spot.number, spot.region);
  }
  return true;
}

FAN_FN void touch_boxes(const PlacedSolid& x, const PlacedSolid& y, Touches& to) {
  using Tol = BoxTolerances;
  const BoxAxes axes(x, y);
  double across[3];
  cross(axes.of_x.normal, axes.of_y.normal, across);
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

}  // namespace fan
