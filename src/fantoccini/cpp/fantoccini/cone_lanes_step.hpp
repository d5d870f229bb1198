// A step of Newton's method for a bundle of lanes (cone_lanes.hpp): the modes of rows and contacts,
// and the linear equations that they leave.
//
// The unknowns of a lane, rows between their bounds and contacts that touch, are packed, so that a
// bundle's matrix has the size of the largest lane's. A contact has three unknowns, x = T z, and
// three equations L s = 0:
//
//   stick   T = L = 1
//   slide   T = (1, mu d; 0, d'), L = (1, 0; 0, d'): x_n with its friction along the direction d of
//           sliding, and the part across it, d'; the third is left out
#pragma once

#include "cone_law.hpp"
#include "lane_of.hpp"
#include "lanes.hpp"
#include "triple.hpp"

namespace fan {

struct ConeLanesTolerances {
  // Steps. More are for the scalar solver: few lanes would make them, and all would pay.
  static constexpr int steps = 3;
  // Residual that needs no refinement.
  static constexpr double refined = 1e-14;
  // Unknowns of a lane: more are for the scalar solver.
  static constexpr int most_singles = 24, most_contacts = 16;
};

// The matrix G: of the gathered rows, of contacts with them, of contacts with contacts j <= i.
template <class Real, int M, int C>
struct LaneMatrix {
  const Real* singles;
  int stride;
  const Triple<Real> (*across)[room(M)];
  const Triple<Real> (*blocks)[room(C)][3];
};

template <class Real, int n_rows, int n_points>
class ConeLanesStep : protected ConeLaw {
 public:
  static constexpr int M = room(n_rows), C = room(n_points), width = Traits<Real>::width;
  using Mask = typename Traits<Real>::Mask;
  using Matrix = LaneMatrix<Real, n_rows, n_points>;
  using Own = ConeLanesTolerances;
  using Places = LanePlaces<width>;

  int n_single = 0, n_contacts = 0;
  int single[M], contact[C];               // which rows and contacts of G, in order
  Mask has_single[M], has_contact[C];      // lanes in which they take part
  Real lower[M], upper[M];
  Real mu[C], most;                        // most: bound on the normal impulses
  Real b_single[M], x_single[M], s_single[M];
  Real b[3 * C], x[3 * C], s[3 * C];       // x: on entry the guess
  Real residual;                           // as in cone.hpp

 protected:
  static constexpr int N = Own::most_singles + 3 * Own::most_contacts;

  FAN_FN static Real larger_of(const Real& p, const Real& q) { return select(p > q, p, q); }

  FAN_FN const Real& of_singles(int a, int b) const {
    return G_->singles[single[a] * G_->stride + single[b]];
  }
  FAN_FN const Triple<Real>* block(int i, int j) const { return G_->blocks[contact[i]][contact[j]]; }

  // The modes of all rows in the lanes that are open; lanes whose unknowns are too many, or in which
  // a normal impulse is at its bound, are closed.
  FAN_FN void choose(Mask& open) {
    using std::sqrt;
    Places n_singles = {}, n_touching = {};  // unknown so far
    any_base_ = false;
    const auto list = [&](const Mask& free, int which, int most, Places& n, Places* places, Places& number) {
      number = n;
      for (int l = 0; l < width; ++l) {
        const bool own = lane_of(free, l) && n[l] < most;
        if (own) places[n[l]][l] = which;
        else number[l] = 0;
        n[l] += lane_of(free, l);
      }
    };
    for (int a = 0; a < n_single; ++a) {
      const Real w = x_single[a] - s_single[a] * inverse_single_[a];
      const Mask has = has_single[a] && open;
      const Mask free = has && w > lower[a] && w < upper[a];
      base_[a] = select(has && !free, select(w > lower[a], upper[a], lower[a]), Real(0.0));
      any_base_ = any_base_ || any(base_[a] != Real(0.0));
      list(free, a, Own::most_singles, n_singles, place_single_, number_single_[a]);
      free_[a] = free;
    }
    Mask full = Real(0.0) > Real(1.0);
    for (int i = 0; i < n_contacts; ++i) {
      const Real *y = x + 3 * i, *u = s + 3 * i, &by = inverse_[i];
      const Real w = y[0] - u[0] * by, p = y[1] - u[1] * by, q = y[2] - u[2] * by;
      const Mask touches = has_contact[i] && open && w > Real(0.0);
      full = full || (touches && !(w < most));
      const Real radius = mu[i] * w, size = sqrt(p * p + q * q);
      const Mask sticks = size <= radius && radius > Real(0.0);
      const Mask moves = size > Real(0.0);
      const Real scaled = Real(1.0) / select(moves, size, Real(1.0));
      const Real along = select(moves, Real(p * scaled), Real(0.0));
      const Real across = select(moves, Real(q * scaled), Real(0.0));
      const Mask turns = !sticks && radius > Tolerance::smallest_disc * size;
      Mode& mode = mode_[i];
      const Real one = Real(1.0), zero = Real(0.0);
      mode.friction[0] = select(sticks, zero, Real(mu[i] * along));
      mode.friction[1] = select(sticks, zero, Real(mu[i] * across));
      mode.second[0] = select(sticks, one, select(turns, -across, zero));
      mode.second[1] = select(turns, along, zero);
      mode.third = select(sticks, one, zero);
      mode.own = select(turns, Real((size - radius) / select(turns, radius, one) * g_[i]), zero);
      list(touches, i, Own::most_contacts, n_touching, place_, number_[i]);
      touches_[i] = touches;
    }
    Real crowded = Real(0.0);
    for (int l = 0; l < width; ++l)
      if (n_singles[l] > Own::most_singles || n_touching[l] > Own::most_contacts) {
        n_singles[l] = n_touching[l] = 0;
        lane_of(crowded, l) = 1.0;
      }
    open = open && !full && !(crowded > Real(0.5));
    n_free_ = fill(n_singles, place_single_, is_free_);
    n_touching_ = fill(n_touching, place_, is_touching_);
    if (any_base_) take_base();
  }

  // Lanes with fewer unknowns than others have none in the last places. Returns the most.
  FAN_FN static int fill(const Places& n, Places* places, Mask* has) {
    int most = 0;
    for (int l = 0; l < width; ++l)
      if (n[l] > most) most = n[l];
    for (int k = 0; k < most; ++k) {
      Real there = Real(0.0);
      for (int l = 0; l < width; ++l) {
        if (k < n[l]) lane_of(there, l) = 1.0;
        else places[k][l] = 0;
      }
      has[k] = there > Real(0.5);
    }
    return most;
  }

  // b less what rows at their bounds do.
  FAN_FN void take_base() {
    for (int a = 0; a < n_single; ++a) {
      beside_single_[a] = b_single[a];
      for (int c = 0; c < n_single; ++c) beside_single_[a] -= of_singles(a, c) * base_[c];
    }
    for (int i = 0; i < n_contacts; ++i)
      for (int d = 0; d < 3; ++d) {
        beside_[3 * i + d] = b[3 * i + d];
        for (int c = 0; c < n_single; ++c)
          beside_[3 * i + d] -= G_->across[contact[i]][single[c]].of[d] * base_[c];
      }
  }

  // Numbers of the lanes of a mask at their places behind `first`.
  FAN_FN static Real at(const Real* first, const Places& places, const Mask& mask) {
    return gathered(reinterpret_cast<const double*>(first), places, mask);
  }

  // Places of whole Reals: where their numbers of each lane are.
  FAN_FN static Places of_lanes(const Places& places) { return places * width + own_lane(); }

  FAN_FN static Places own_lane() {
    Places out;
    for (int l = 0; l < width; ++l) out[l] = l;
    return out;
  }

  // The matrix and right sides of the packed unknowns.
  FAN_FN void assemble() {
    n_ = n_free_ + 3 * n_touching_;
    Places row[Own::most_contacts], column[Own::most_singles];  // among those of G
    const Real one = Real(1.0);
    const Real *from_single = any_base_ ? beside_single_ : b_single, *from = any_base_ ? beside_ : b;
    for (int k = 0; k < n_free_; ++k) {
      const Mask& here = is_free_[k];
      for (int l = 0; l < width; ++l) column[k][l] = single[place_single_[k][l]];
      const Places own = of_lanes(place_single_[k]);
      right_[k] = at(from_single, own, here) + raise_ * at(centre_single_, own, here);
      for (int m = 0; m <= k; ++m) {
        const Places where = of_lanes(column[k] * G_->stride + column[m]);
        A_[k * n_ + m] = A_[m * n_ + k] = at(G_->singles, where, here && is_free_[m]);
      }
      A_[k * n_ + k] = select(here, Real(A_[k * n_ + k] + raise_), one);
    }
    for (int k = 0; k < n_touching_; ++k) {
      const Mask& here = is_touching_[k];
      for (int l = 0; l < width; ++l) row[k][l] = contact[place_[k][l]];
      Mode& mode = packed_[k];
      take_mode(of_lanes(place_[k] * int(sizeof(Mode) / sizeof(Real))), here, mode);
      const int first = n_free_ + 3 * k;
      const Places own = of_lanes(place_[k] * 3);
      Real r[3];
      FAN_UNROLL for (int d = 0; d < 3; ++d)
        r[d] = at(from + d, own, here) + raise_ * at(centre_ + d, own, here);
      mode.rows(r);
      FAN_UNROLL for (int d = 0; d < 3; ++d) right_[first + d] = r[d];
      for (int m = 0; m < n_free_; ++m) {
        const Places where = of_lanes((row[k] * M + column[m]) * 3);
        const Mask both = here && is_free_[m];
        Real v[3], u[3];
        FAN_UNROLL for (int d = 0; d < 3; ++d)
          v[d] = u[d] = at(&G_->across[0][0].of[d], where, both);
        mode.rows(v);
        mode.columns(u);
        FAN_UNROLL for (int d = 0; d < 3; ++d) {
          A_[(first + d) * n_ + m] = v[d];
          A_[m * n_ + first + d] = u[d];
        }
      }
      for (int m = 0; m <= k; ++m) {
        const Places where = of_lanes((row[k] * C + row[m]) * 9);
        const Mask both = here && is_touching_[m];
        Real B[9], turned[9];
        FAN_UNROLL for (int d = 0; d < 9; ++d)
          B[d] = turned[d % 3 * 3 + d / 3] = at(&G_->blocks[0][0][0].of[0] + d, where, both);
        put(B, k, m);
        if (m < k) put(turned, m, k);
      }
      Real* own_block = A_ + first * n_ + first;
      const Mask third = here && mode.third > Real(0.5);
      const Mask second = here && (mode.second[0] != Real(0.0) || mode.second[1] != Real(0.0));
      own_block[0] = select(here, Real(own_block[0] + raise_), one);
      own_block[n_ + 1] = select(second, Real(own_block[n_ + 1] + (raise_ + mode.own)), one);
      own_block[2 * n_ + 2] = select(third, Real(own_block[2 * n_ + 2] + raise_), one);
    }
  }

  // The mode of a contact: T and L, and what its second unknown adds to its own equation.
  struct Mode {
    Real friction[2], second[2], third, own;

    // v <- L v.
    FAN_FN void rows(Real* v) const {
      v[1] = second[0] * v[1] + second[1] * v[2];
      v[2] = third * v[2];
    }

    // v <- v T.
    FAN_FN void columns(Real* v) const {
      v[0] += friction[0] * v[1] + friction[1] * v[2];
      rows(v);
    }

    // v <- T v.
    FAN_FN void spread(Real* v) const {
      const Real p = v[0] * friction[0] + v[1] * second[0];
      v[2] = v[0] * friction[1] + v[1] * second[1] + v[2] * third;
      v[1] = p;
    }
  };

  FAN_FN void take_mode(const Places& places, const Mask& mask, Mode& to) const {
    const Mode& from = mode_[0];
    to.friction[0] = at(&from.friction[0], places, mask);
    to.friction[1] = at(&from.friction[1], places, mask);
    to.second[0] = at(&from.second[0], places, mask);
    to.second[1] = at(&from.second[1], places, mask);
    to.third = at(&from.third, places, mask);
    to.own = at(&from.own, places, mask);
  }

  // Writes the block of packed contacts k and m.
  FAN_FN void put(Real* B, int k, int m) {
    Real* out = A_ + (n_free_ + 3 * k) * n_ + n_free_ + 3 * m;
    FAN_UNROLL for (int d = 0; d < 3; ++d) packed_[m].columns(B + 3 * d);
    FAN_UNROLL for (int e = 0; e < 3; ++e) {
      Real u[3] = {B[e], B[3 + e], B[6 + e]};
      packed_[k].rows(u);
      FAN_UNROLL for (int d = 0; d < 3; ++d) out[d * n_ + e] = u[d];
    }
  }

  // A_ = L U with ones on L's diagonal, without pivoting: what goes wrong shows in the residual.
  // Four columns at a time: the trailing block is read and written once for all four.
  FAN_FN void factorise() {
    const int n = n_;
    for (int first = 0; first < n; first += 4) {
      const int end = first + 4 < n ? first + 4 : n;
      for (int k = first; k < end; ++k) {
        const Real* top = A_ + k * n;
        const Real inverse = pivot_[k] = Real(1.0) / top[k];
        for (int i = k + 1; i < n; ++i) {
          Real* row = A_ + i * n;
          const Real share = row[k] = row[k] * inverse;
          const int last = i < end ? n : end;
          for (int j = k + 1; j < last; ++j) row[j] -= share * top[j];
        }
      }
      const Real *p = A_ + first * n, *q = p + n, *r = q + n, *s = r + n;
      for (int i = end; i < n; ++i) {
        Real* row = A_ + i * n;
        const Real a = row[first], b = row[first + 1], c = row[first + 2], d = row[first + 3];
        for (int j = end; j < n; ++j) row[j] = row[j] - a * p[j] - b * q[j] - c * r[j] - d * s[j];
      }
    }
  }

  FAN_FN void substitute() {
    const int n = n_;
    for (int i = 1; i < n; ++i) {
      const Real* row = A_ + i * n;
      Real left = right_[i];
      for (int k = 0; k < i; ++k) left -= row[k] * right_[k];
      right_[i] = left;
    }
    for (int i = n - 1; i >= 0; --i) {
      const Real* row = A_ + i * n;
      Real left = right_[i];
      for (int k = n - 1; k > i; --k) left -= row[k] * right_[k];
      right_[i] = left * pivot_[i];
    }
  }

  // Right sides that remove what is left of s where the unknowns are free.
  FAN_FN void load_residuals() {
    for (int k = 0; k < n_free_; ++k) right_[k] = -at(s_single, of_lanes(place_single_[k]), is_free_[k]);
    for (int k = 0; k < n_touching_; ++k) {
      const Places own = of_lanes(place_[k] * 3);
      Real r[3];
      FAN_UNROLL for (int d = 0; d < 3; ++d) {
        r[d] = -at(s + d, own, is_touching_[k]);
        if (d > 0) r[d] -= packed_[k].own * at(x + d, own, is_touching_[k]);
      }
      packed_[k].rows(r);
      FAN_UNROLL for (int d = 0; d < 3; ++d) right_[n_free_ + 3 * k + d] = r[d];
    }
  }

  // The x of a whole step, from the unknowns.
  FAN_FN void spread() {
    for (int k = 0; k < n_touching_; ++k) packed_[k].spread(right_ + n_free_ + 3 * k);
    for (int a = 0; a < n_single; ++a)
      next_single_[a] = base_[a] + at(right_, of_lanes(number_single_[a]), free_[a]);
    for (int i = 0; i < n_contacts; ++i) {
      const Places where = of_lanes(number_[i] * 3);
      FAN_UNROLL for (int d = 0; d < 3; ++d)
        next_[3 * i + d] = at(right_ + n_free_ + d, where, touches_[i]);
    }
  }

  Real next_single_[M], next_[3 * C];  // x of a whole step
  const Matrix* G_ = nullptr;
  Real top_, raise_, centre_single_[M], centre_[3 * C];
  Real g_single_[M], inverse_single_[M], g_[C], inverse_[C];
  Real base_[M], beside_single_[M], beside_[3 * C];  // x of rows at a bound, and b beside them
  bool any_base_ = false;
  Mode mode_[C], packed_[Own::most_contacts];
  int n_ = 0, n_free_ = 0, n_touching_ = 0;          // unknowns, packed rows and contacts
  Places place_single_[Own::most_singles], place_[Own::most_contacts];  // which they are
  Places number_single_[M], number_[C];  // and which of these a row or contact is
  Mask free_[M], touches_[C];
  Mask is_free_[Own::most_singles], is_touching_[Own::most_contacts];
  Real A_[N * N], right_[N], pivot_[N];
};

}  // namespace fan
