"""Siconos in an interpreter of its own: ``python siconos_worker.py FILE SOLVER MOST TOLERANCE``.

Solves a problem in Siconos's text format with one of its solvers, and prints seconds of the
processor, 1 when solved, iterations; then r.
"""

from __future__ import annotations

import sys
import time

import numpy as np
import siconos.numerics as sn


def main(file: str, solver: str, max_iterations: str, tolerance: str) -> None:
    problem = sn.frictionContact_new_from_filename(file)
    options = sn.SolverOptions(getattr(sn, f"SICONOS_FRICTION_3D_{solver}"))
    options.dparam[sn.SICONOS_DPARAM_TOL] = float(tolerance)
    options.iparam[sn.SICONOS_IPARAM_MAX_ITER] = int(max_iterations)
    n = 3 * problem.numberOfContacts
    r, u = np.zeros(n), np.zeros(n)
    began = time.process_time()
    info = sn.fc3d_driver(problem, r, u, options)
    took = time.process_time() - began
    print(took, int(info == 0), options.iparam[sn.SICONOS_IPARAM_ITER_DONE])
    print("\n".join(map(repr, map(float, r))))


if __name__ == "__main__":
    main(*sys.argv[1:])
