"""The derivatives' source text: a library of its own, made when somebody asks for it."""

from __future__ import annotations

from fantoccini.codegen.model import Generated, assembled
from fantoccini.codegen.straight import program
from fantoccini.equations import Derivatives

SIZES = ("n_qD", "n_vD", "n_qK", "n_vK", "n_rows", "n_p")
"""What ``fan_sizes`` of the library writes, in order."""


def generate_derivatives(derivatives: Derivatives) -> Generated:
    """The source text of a puppet's derivatives.

    Args:
        derivatives: of its equations.
    """
    functions, tree = derivatives.functions(), derivatives.tree
    table = tree.coordinates
    sizes = (
        table.n_qD, table.n_vD, table.n_qK, table.n_vK, tree.n_rows, len(tree.parameters)
    )  # fmt: skip
    maps = "\n".join(
        f"FAN_MAP({name}, {function.n_in()}, {function.n_out()})"
        for name, function in functions.items()
    )
    main = _MAIN.replace("SIZES", ", ".join(map(str, sizes))).replace("MAPS", maps)
    return assembled({name: program(f) for name, f in functions.items()}, {"main.cpp": main})


_MAIN = """\
// The derivatives of a puppet's equations of motion.
#include <cmath>

#include "fantoccini/export.hpp"
#include "fantoccini/elementary.hpp"

namespace fan {
namespace scalar {
#define casadi_real double
#include "model.c"
#undef casadi_real
}  // namespace scalar
}  // namespace fan

FAN_EXPORT void fan_sizes(int* out) {
  const int sizes[] = {SIZES};
  for (int i = 0; i < int(sizeof(sizes) / sizeof(int)); ++i) out[i] = sizes[i];
}

// Calls a function n times: argument i of call k begins at arg[i] + k * arg_stride[i].
#define FAN_MAP(NAME, N_ARG, N_RES)                                                           \\
  FAN_EXPORT int fan_map_##NAME(                                                              \\
      long long n, const double* const* arg, const long long* arg_stride, double* const* res, \\
      const long long* res_stride) {                                                          \\
    const double* a[N_ARG];                                                                   \\
    double* r[N_RES];                                                                         \\
    for (long long k = 0; k < n; ++k) {                                                       \\
      for (int i = 0; i < N_ARG; ++i) a[i] = arg[i] + k * arg_stride[i];                      \\
      for (int i = 0; i < N_RES; ++i) r[i] = res[i] + k * res_stride[i];                      \\
      fan::scalar::fan_##NAME(a, r, nullptr, nullptr, 0);                                     \\
    }                                                                                         \\
    return 0;                                                                                 \\
  }

MAPS
"""
