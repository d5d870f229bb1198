// One lane of a Real; for a double the number itself.
#pragma once

namespace fan {

inline double& lane_of(double& x, int) { return x; }
inline double lane_of(const double& x, int) { return x; }
inline bool lane_of(bool x, int) { return x; }
template <class Real>
decltype(auto) lane_of(Real& x, int lane) {
  return x[lane];
}
template <class Real>
auto lane_of(const Real& x, int lane) {
  return x[lane];
}

}  // namespace fan
