// The velocities that move a contact point. Its column W = F^-T A_D^T is zero elsewhere, because
// they include all velocities that move the ancestors of the two bodies; sums skip the rest.
#pragma once

#include "fantoccini/math/triple.hpp"

FAN_LOOPS_BEGIN

namespace fan {

// In order.
template <int n_vD>
struct MovedBy {
  int n = 0;
  int link[2] = {-1, -1};  // the last two links added; -1 for none
  bool apart = true;       // whether they share no velocity, nor any before them

  // The velocities, in order.
  FAN_FN const int* entries() const { return listed_ ? listed_ : merged_; }

  // Removes all links.
  FAN_FN void clear() {
    n = 0;
    link[0] = link[1] = -1;
    apart = true;
  }

  // Adds the velocities of a link, listed in order.
  FAN_FN void add(int which, const int* begin, const int* end) {
    if (begin == end) return;
    link[1] = link[0];
    link[0] = which;
    if (n == 0) {
      listed_ = begin;
      n = int(end - begin);
      return;
    }
    const int* entry = entries();
    apart = apart && (entry[n - 1] < *begin || end[-1] < entry[0]);
    int merged[array_size(n_vD)], count = 0, i = 0;
    while (i < n || begin < end) {
      const int own = i < n ? entry[i] : n_vD, other = begin < end ? *begin : n_vD;
      merged[count++] = own < other ? own : other;
      i += own <= other;
      begin += other <= own;
    }
    for (n = 0; n < count; ++n) merged_[n] = merged[n];
    listed_ = nullptr;
  }

  // Whether no velocity moves both points, as for different puppets: all entries of one come after
  // the other's.
  FAN_FN bool is_apart(const MovedBy& other) const {
    const int *own = entries(), *its = other.entries();
    return n == 0 || other.n == 0 || own[n - 1] < its[0] || its[other.n - 1] < own[0];
  }

  // Number of leading entries that contain all velocities that move both points: the equal ones, if
  // the other entries of one come after the other's, as in a tree.
  FAN_FN int common(const MovedBy& other) const {
    const int *own = entries(), *its = other.entries();
    const int most = n < other.n ? n : other.n;
    int same = 0;
    while (same < most && own[same] == its[same]) ++same;
    const bool apart = same == most || own[n - 1] < its[same] || its[other.n - 1] < own[same];
    return apart ? same : n;
  }

  // Product of three rows with v, in two sums: each addition waits for the previous one.
  template <class Real>
  FAN_FN Triple<Real> along(const Triple<Real>* row, const Real* v) const {
    const int* entry = entries();
    Triple<Real> even, odd;
    even.clear();
    odd.clear();
    int j = 0;
    for (; j + 2 <= n; j += 2) {
      even.add(v[entry[j]], row[entry[j]]);
      odd.add(v[entry[j + 1]], row[entry[j + 1]]);
    }
    if (j < n) even.add(v[entry[j]], row[entry[j]]);
    even.add(Real(1.0), odd);
    return even;
  }

  // Products of three columns of this point with three others, over its first entries.
  template <class Real>
  FAN_FN void products(
      const Triple<Real>* a, const Triple<Real>* b, Triple<Real>* out, int first) const {
    const int* entry = entries();
    Triple<Real> sum[3];
    FAN_UNROLL for (int d = 0; d < 3; ++d) sum[d].clear();
    for (int j = 0; j < first; ++j) {
      const int k = entry[j];
      FAN_UNROLL for (int d = 0; d < 3; ++d) sum[d].add(a[k][d], b[k]);
    }
    FAN_UNROLL for (int d = 0; d < 3; ++d) out[d] = sum[d];
  }

 private:
  const int* listed_ = nullptr;  // of one link; of several in merged_
  int merged_[array_size(n_vD)];
};

}  // namespace fan

FAN_LOOPS_END
