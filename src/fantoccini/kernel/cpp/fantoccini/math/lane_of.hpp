// A lane of a Real, which is the number itself where that is a double; n numbers of a lane.
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

template <class Real>
void put_lane(const double* from, int n, int lane, Real* to) {
  for (int k = 0; k < n; ++k) lane_of(to[k], lane) = from[k];
}

template <class Real, class To>
void take_lane(const Real* from, int n, int lane, To* to) {
  for (int k = 0; k < n; ++k) to[k] = To(lane_of(from[k], lane));
}

}  // namespace fan
