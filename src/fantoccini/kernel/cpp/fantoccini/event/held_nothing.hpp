// Contacts of an event-driven run of a puppet without contacts; see held_contacts.hpp.
#pragma once

#include "fantoccini/contract.hpp"
#include "fantoccini/math/real.hpp"
#include "fantoccini/runs/snapshot.hpp"

namespace fan {

template <class Model, bool touches = (Model::n_contacts > 0)>
class HeldContacts;

template <class Model>
class HeldContacts<Model, false> {
 public:
  struct Points {
    static constexpr ContactArrays* in = nullptr;
    static constexpr int n = 0;
    static constexpr double closing = 0.0;
  };
  static constexpr Points points{};
  static constexpr double friction = 0.0;

  static constexpr bool active() { return false; }
  template <class F>
  static bool jamming(const F&) {
    return false;
  }
  static constexpr bool holds() { return false; }
  template <class F>
  static bool look_near(const F&, const double*, const double*) {
    return false;
  }
  template <class F>
  static double guard_of(const F&, int) {
    return -1.0;
  }
  template <class F>
  static void push(const F&, const double*, const double*, double*, double*, double*) {}
  static double after_of_row(int) { return 0.0; }
  static double written_tension(int, double latest) { return latest; }
  template <class F>
  static Status project(F&, double, double*) {
    return RUNNING;
  }
  template <class F>
  static void redistribute(F&) {}
  static void remember(Snapshot&) {}
};

}  // namespace fan
