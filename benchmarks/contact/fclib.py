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
"""FCLIB's number of triplets for a compressed matrix."""


def read_arrays(file: Path) -> tuple[Array, Array, Array] | None:
    """W (m, m), q (m,) and the coefficients of friction; None for a planar problem."""
    with h5py.File(file) as held:
        name = "fclib_local" if "fclib_local" in held else "fclib_global"
        group = held.get(name)
        if group is None or int(group["spacedim"][0]) != 3:
            return None
        vectors = {key: np.array(value, dtype=float) for key, value in group["vectors"].items()}
        mu = vectors["mu"]
        if name == "fclib_local":
            if "V" in group:  # bodies are also joined by equations
                return None
            return _matrix(group["W"]).toarray(), vectors["q"], mu
        if "G" in group:
            return None
        H = _matrix(group["H"])
        by_M = splu(_matrix(group["M"]).tocsc()).solve
        W = H.T @ by_M(H.toarray())
        return W, vectors["w"] + H.T @ by_M(vectors["f"]), mu


def _matrix(group: h5py.Group) -> sparse.spmatrix:
    shape, kind = (int(group["m"][0]), int(group["n"][0])), int(group["nz"][0])
    x, i, p = (np.array(group[key]) for key in ("x", "i", "p"))
    if kind == _COLUMNS:
        return sparse.csc_matrix((x, i, p), shape)
    if kind == _ROWS:
        return sparse.csr_matrix((x, i, p), shape)
    return sparse.coo_matrix((x[:kind], (i[:kind], p[:kind])), shape).tocsc()
