// Elementary functions, compared with the C library on long doubles.
//
// stdin: numbers. stdout, for each: the errors of sine, cosine, arctangent and inverse root (of its
// absolute value) in units in the last place, on doubles and then on lanes; then 1 if all lanes of
// a bundle agree, and 0 otherwise.
#include <cmath>
#include <cstdio>

#include "fantoccini/math/elementary.hpp"
#include "fantoccini/math/lanes.hpp"

namespace {

using Wide = fan::Lanes<8>;

double units(double found, long double right) {
  if (std::isnan(right)) return std::isnan(found) ? 0.0 : INFINITY;
  const double size = std::fabs(double(right));
  return double(fabsl(found - right)) / (std::nextafter(size, INFINITY) - size);
}

template <class Real>
void all(const Real& x, Real* out) {
  using std::abs;
  fan::sine_cosine(x, out, out + 1);
  out[2] = fan::arctangent(x);
  out[3] = fan::inverse_root(Real(abs(x)));
}

}  // namespace

int main() {
  double x;
  while (std::scanf("%lf", &x) == 1) {
    const long double right[] = {sinl(x), cosl(x), atanl(x), 1.0L / sqrtl(fabsl(x))};
    double one[4];
    all(x, one);
    Wide eight[4];
    all(Wide(x), eight);
    bool same = true;
    for (int k = 0; k < 4; ++k) std::printf("%.3f ", units(one[k], right[k]));
    for (int k = 0; k < 4; ++k) {
      std::printf("%.3f ", units(eight[k][0], right[k]));
      for (int lane = 1; lane < 8; ++lane)
        same = same && (std::isnan(eight[k][0]) || eight[k][lane] == eight[k][0]);
    }
    std::printf("%d\n", int(same));
  }
}
