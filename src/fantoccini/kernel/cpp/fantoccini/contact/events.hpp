// Events of contacts: two parts touch, slide, stick and lift.
//
// A meeting comprises all contact between two parts. It slides once a point that pushes moves
// across the normal faster than `slides`, and sticks once no such point is faster than `sticks`;
// between the two thresholds its mode is unchanged.
#pragma once

#include "fantoccini/contact/push.hpp"
#include "fantoccini/contract.hpp"
#include "fantoccini/math/space.hpp"

namespace fan {

struct ContactEventTolerances {
  // m/s: far above rounding errors of speeds at rest, far below visible sliding.
  static constexpr double slides = 1e-3, sticks = 5e-4;
};

template <int capacity>
class ContactEvents {
 public:
  static constexpr int most = 3 * capacity;  // per step

  // Records the meetings at the start, without events.
  void begin(const ContactArrays& in, const ContactPush* push, int n) { collect(in, push, n); }

  // Writes the changes since the last call; `row` is the row of the first meeting.
  template <class Record>
  void write(
      const ContactArrays& in, const ContactPush* push, int n, double t, int row, Record& out) {
    const int n_before = n_;
    Meeting before[array_size(capacity)];
    for (int i = 0; i < n_; ++i) before[i] = meeting_[i];
    collect(in, push, n);
    for (int i = 0; i < n_before; ++i)
      if (!known(before[i].which, meeting_, n_))
        out.event(t, LIFT, row + before[i].which, 0.0, 0.0);
    for (int i = 0; i < n_; ++i) {
      Meeting& now = meeting_[i];
      const Meeting* old = known(now.which, before, n_before);
      const bool slid = old && old->slides;
      now.slides = now.speed > (slid ? Tolerance::sticks : Tolerance::slides);
      if (!old) out.event(t, TOUCH, row + now.which, 0.0, 0.0);
      if (now.slides != slid) out.event(t, slid ? STICK : SLIDE, row + now.which, 0.0, now.speed);
    }
  }

 private:
  using Tolerance = ContactEventTolerances;

  struct Meeting {
    int which;
    double speed;  // m/s: the largest across the normal of its points
    bool slides;
  };

  // Collects the meetings of the points that push.
  void collect(const ContactArrays& in, const ContactPush* push, int n) {
    n_ = 0;
    for (int i = 0; i < n; ++i) {
      const int which = in.meetings[push[i].pair];
      Meeting* own = known(which, meeting_, n_);
      if (!own) {
        own = meeting_ + n_++;
        *own = {which, 0.0, false};
      }
      const double *v = push[i].velocity, *normal = push[i].normal;
      const double along = dot3(v, normal), square = dot3(v, v) - along * along;
      const double speed = square > 0.0 ? sqrt(square) : 0.0;
      if (speed > own->speed) own->speed = speed;
    }
    for (int i = 0; i < n_; ++i) meeting_[i].slides = meeting_[i].speed > Tolerance::slides;
  }

  template <class M>
  static M* known(int which, M* list, int n) {
    for (int i = 0; i < n; ++i)
      if (list[i].which == which) return list + i;
    return nullptr;
  }

  int n_ = 0;
  Meeting meeting_[array_size(capacity)];
};

}  // namespace fan
