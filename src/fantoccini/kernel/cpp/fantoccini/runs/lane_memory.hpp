// The memory of a bundle of lanes, written to and read from bytes member by member.
#pragma once

#include <cstring>
#include <type_traits>

#include "fantoccini/math/elementary.hpp"
#include "fantoccini/math/lane_of.hpp"

namespace fan {

// Writes the members of a bundle to `place`, or reads them from there; without a place, counts
// their bytes. Only the lanes in `lanes` change.
template <class Real>
class LaneMemory {
 public:
  using Mask = typename Traits<Real>::Mask;
  static constexpr int width = Traits<Real>::width;
  enum Direction { COUNT, WRITE, READ };

  LaneMemory(Direction direction, unsigned char* place, const Mask& lanes)
      : direction_(direction), place_(place), lanes_(lanes) {}

  // Bundles, masks and arrays of them.
  template <class... Members>
  FAN_FN void keep(Members&... members) {
    (exchange_member(members), ...);
  }

  // An array with an entry for each lane.
  template <class Entry>
  FAN_FN void keep_of_lanes(Entry (&entry)[width]) {
    static_assert(std::is_trivially_copyable_v<Entry>, "kept as bytes");
    for (int l = 0; l < width; ++l) {
      if (direction_ == WRITE && lane_of(lanes_, l)) std::memcpy(here(), &entry[l], sizeof(Entry));
      if (direction_ == READ && lane_of(lanes_, l)) std::memcpy(&entry[l], here(), sizeof(Entry));
      size_ += sizeof(Entry);
    }
    size_ = (size_ + alignment - 1) / alignment * alignment;
  }

  long long size() const { return size_; }

  static constexpr int alignment = 64;  // of every member, for vectors

 private:
  template <class Member, int n>
  FAN_FN void exchange_member(Member (&members)[n]) {
    for (Member& member : members) exchange_member(member);
  }

  FAN_FN void exchange_member(Real& member) { exchange(member); }

  template <class M, class = std::enable_if_t<std::is_same_v<M, Mask> && !std::is_same_v<M, Real>>>
  FAN_FN void exchange_member(M& member) {
    exchange(member);
  }

  template <class Member>
  FAN_FN void exchange(Member& member) {
    Member kept;
    if (direction_ != COUNT) {
      std::memcpy(&kept, here(), sizeof(Member));
      Member &to = direction_ == WRITE ? kept : member, &from = direction_ == WRITE ? member : kept;
      to = chosen_lanes(lanes_, from, to);
      if (direction_ == WRITE) std::memcpy(here(), &kept, sizeof(Member));
    }
    size_ += sizeof(Member);
  }

  FAN_FN static Real chosen_lanes(const Mask& lanes, const Real& yes, const Real& no) {
    return select(lanes, yes, no);
  }
  template <class M, class = std::enable_if_t<std::is_same_v<M, Mask> && !std::is_same_v<M, Real>>>
  FAN_FN static M chosen_lanes(const M& lanes, const M& yes, const M& no) {
    return (lanes && yes) || (!lanes && no);
  }

  FAN_FN unsigned char* here() const { return place_ + size_; }

  Direction direction_;
  unsigned char* place_;
  Mask lanes_;
  long long size_ = 0;
};

}  // namespace fan
