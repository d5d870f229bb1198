// The velocities that move a contact point. Its column W = F^-T A_D^T differs from zero only there,
// for they are also all that the ancestors of the two bodies move with; the rest is left out of
// every sum.
#pragma once

#include "real.hpp"

namespace fan {

// In order; those of some lane.
template <int n_vD>
struct MovedBy {
  int n = 0;
  int entry[room(n_vD)];

  // Adds those of a link, listed in order, to what is there.
  FAN_FN void add(const int* begin, const int* end) {
    if (n == 0) {
      while (begin < end) entry[n++] = *begin++;
      return;
    }
    int merged[room(n_vD)], count = 0, i = 0;
    while (i < n || begin < end) {
      const int own = i < n ? entry[i] : n_vD, other = begin < end ? *begin : n_vD;
      merged[count++] = own < other ? own : other;
      i += own <= other;
      begin += other <= own;
    }
    for (n = 0; n < count; ++n) entry[n] = merged[n];
  }

  // Whether no velocity moves both points, as those of different puppets: entries of either lie
  // beyond the other's.
  FAN_FN bool is_apart(const MovedBy& other) const {
    return n == 0 || other.n == 0 || entry[n - 1] < other.entry[0] ||
           other.entry[other.n - 1] < entry[0];
  }

  // row . v.
  template <class Real>
  FAN_FN Real along(const Real* row, const Real* v) const {
    Real even = Real(0.0), odd = Real(0.0);
    int j = 0;
    for (; j + 2 <= n; j += 2) {
      even += row[entry[j]] * v[entry[j]];
      odd += row[entry[j + 1]] * v[entry[j + 1]];
    }
    if (j < n) even += row[entry[j]] * v[entry[j]];
    return even + odd;
  }

  // The products of three columns of this point with another column.
  template <class Real>
  FAN_FN void products(const Real (*a)[room(n_vD)], const Real* b, Real* out) const {
    Real first = Real(0.0), second = Real(0.0), third = Real(0.0);
    for (int j = 0; j < n; ++j) {
      const int k = entry[j];
      first += a[0][k] * b[k];
      second += a[1][k] * b[k];
      third += a[2][k] * b[k];
    }
    out[0] = first;
    out[1] = second;
    out[2] = third;
  }
};

}  // namespace fan
