// Of the points that push in a step, by their modes: which velocities move on as they did until one of
// them touches and springs back (contact_rebounds.hpp), and which one that is.
#pragma once

#include "contact_groups.hpp"
#include "contract.hpp"

namespace fan {

// The share of a step of length dt at whose end a point touches that springs back, u_n being the
// speed at which it parts at the start; above 1 for a point that does not.
inline double touch_share(const StepContact& point, double u_n, double dt) {
  if (!(point.bounces > 0.0) || point.closes != 0.0) return 2.0;
  return fmin(fmax(point.gap, 0.0) / (-u_n * dt), 1.0);
}

template <class Model>
class TouchDelays {
 public:
  static constexpr int N = Model::n_vD, C = Model::n_contacts;
  // Difference between shares of a step that is rounding.
  static constexpr double same = 1e-9;

  bool some = false;     // whether anything is delayed
  int by[room(N)];       // of each velocity, the point it waits for, or -1
  double share[room(N)];  // and the share of the step for which

  // From the touch_share() of n points.
  void find(const StepContact* points, int n, const double* touch) {
    some = false;
    for (int k = 0; k < N; ++k) {
      by[k] = -1;
      share[k] = 0.0;
    }
    groups_.begin();
    for (int i = 0; i < n; ++i) tree_[i] = groups_.joined(points[i].links[0], points[i].links[1]);
    for (int i = 0; i < n; ++i) {
      if (!(touch[i] <= 1.0)) continue;
      const int group = groups_.named(tree_[i]);
      bool first = true;
      for (int j = 0; j < n; ++j)
        if (groups_.named(tree_[j]) == group && (touch[j] < touch[i] || (touch[j] == touch[i] && j < i)))
          first = false;
      if (!first) continue;
      for (int k = 0; k < N; ++k) {
        if (groups_.named(groups_.tree_of_velocity(k)) != group) continue;
        by[k] = i;
        share[k] = touch[i];
        some = true;
      }
    }
  }

  // Whether point i is not the first of its group, but no later than it.
  bool is_tied(const double* touch, int i) const {
    if (!(touch[i] <= 1.0)) return false;
    for (int k = 0; k < N; ++k)
      if (by[k] >= 0 && by[k] != i &&
          groups_.named(tree_[by[k]]) == groups_.named(tree_[i]) && touch[i] - share[k] < same)
        return true;
    return false;
  }

 private:
  ContactGroups<Model> groups_;
  int tree_[room(C)];
};

}  // namespace fan
