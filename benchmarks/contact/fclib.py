"""Problems in FCLIB's own files (HDF5), by the velocities of contacts or of bodies:

u = W r + q,   or   M v = H r + f,  u = H^T v + w,  so that W = H^T M^-1 H,  q = w + H^T M^-1 f
"""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from fantoccini.base.arrays import Array

_COLUMNS, _ROWS = -1, -2
"""What FCLIB writes for the number of triplets where a matrix is compressed."""


def arrays(file: Path) -> tuple[Array, Array, Array] | None:
    """W (m, m), q (m,) and the coefficients of friction; None for one that is not in space."""
    with h5py.File(file) as held:
        name = "fclib_local" if "fclib_local" in held else "fclib_global"
        given = held.get(name)
        if given is None or int(given["spacedim"][0]) != 3:
            return None
        vectors = {key: np.array(value, dtype=float) for key, value in given["vectors"].items()}
        mu = vectors["mu"]
        if name == "fclib_local":
            if "V" in given:  # bodies are also joined by equations
                return None
            return _matrix(given["W"]).toarray(), vectors["q"], mu
        if "G" in given:
            return None
        H = _matrix(given["H"])
        by_M = splu(_matrix(given["M"]).tocsc()).solve
        W = H.T @ by_M(H.toarray())
        return W, vectors["w"] + H.T @ by_M(vectors["f"]), mu


def _matrix(given: h5py.Group) -> sparse.spmatrix:
    shape, kind = (int(given["m"][0]), int(given["n"][0])), int(given["nz"][0])
    x, i, p = (np.array(given[key]) for key in ("x", "i", "p"))
    if kind == _COLUMNS:
        return sparse.csc_matrix((x, i, p), shape)
    if kind == _ROWS:
        return sparse.csr_matrix((x, i, p), shape)
    return sparse.coo_matrix((x[:kind], (i[:kind], p[:kind])), shape).tocsc()
