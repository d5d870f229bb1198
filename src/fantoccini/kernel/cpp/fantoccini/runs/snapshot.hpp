// The whole state of a run except its inputs, as bytes: a run that restores it gives the same
// results to the last bit.
#pragma once

#include <cstring>
#include <type_traits>

namespace fan {

// Writes members one after another to `out`, or reads them from `from`; counts their bytes.
// Pointers in them (into the run's own arrays) are invalid after reading; runs set them again
// before use.
class Snapshot {
 public:
  Snapshot(unsigned char* out, const unsigned char* from) : out_(out), from_(from) {}

  template <class... Members>
  void keep(Members&... members) {
    (copy(members), ...);
  }

  long long size() const { return size_; }

 private:
  template <class Member>
  void copy(Member& member) {
    static_assert(std::is_trivially_copyable_v<Member>, "kept as bytes");
    void* place = &member;
    if (out_) std::memcpy(out_ + size_, place, sizeof(Member));
    if (from_) std::memcpy(place, from_ + size_, sizeof(Member));
    size_ += static_cast<long long>(sizeof(Member));
  }

  unsigned char* out_;
  const unsigned char* from_;
  long long size_ = 0;
};

}  // namespace fan
