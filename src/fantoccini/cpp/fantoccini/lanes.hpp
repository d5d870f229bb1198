// Real as a bundle of doubles: one trajectory per lane. Included before the rest of the runtime:
// the bundle is a type of std, so step code finds select and any only if they are declared by then.
#pragma once

#include <experimental/simd>

#include "real.hpp"

namespace fan {

template <int width>
using Lanes = std::experimental::fixed_size_simd<double, width>;

template <int width_>
struct Traits<Lanes<width_>> {
  using Mask = typename Lanes<width_>::mask_type;
  static constexpr int width = width_;
};

template <int width>
FAN_FN Lanes<width> select(
    const typename Lanes<width>::mask_type& mask, const Lanes<width>& yes, Lanes<width> no) {
  std::experimental::where(mask, no) = yes;
  return no;
}

template <class T, class Abi>
FAN_FN bool any(const std::experimental::simd_mask<T, Abi>& mask) {
  return std::experimental::any_of(mask);
}

}  // namespace fan
