"""A handwritten coordinate table: two driven lengths, a bar, and a puppet that hangs on them."""

from __future__ import annotations

import numpy as np
import pytest

from fantoccini.model.tree import Coordinate, CoordinateTable, Role

_BAR = ("bar.x", "bar.y", "bar.z", "bar.qw", "bar.qx", "bar.qy", "bar.qz")
_BAR_V = ("bar.x", "bar.y", "bar.z", "bar.wx", "bar.wy", "bar.wz")


@pytest.fixture
def table() -> CoordinateTable:
    q_D = ("elbow", "head.qw", "head.qx", "head.qy", "head.qz", "torso.z")
    q_K = ("hand.length", *_BAR, "knee.length", "crank")
    rows = [Coordinate(n, Role.DYNAMIC, n.split(".")[0], "rad", i) for i, n in enumerate(q_D)]
    rows += [
        Coordinate(
            n, Role.DRIVEN, n.split(".")[0], "rad" if n == "crank" else "1" if ".q" in n else "m", i
        )
        for i, n in enumerate(q_K)
    ]
    return CoordinateTable(
        rows=tuple(rows),
        q_D=q_D,
        v_D=("elbow", "head.wx", "head.wy", "head.wz", "torso.z"),
        q_K=q_K,
        v_K=("hand.length", *_BAR_V, "knee.length", "crank"),
        quaternions_D=((1, 1),),
        quaternions_K=((4, 4),),
        scalars_D=((0, 0), (5, 4)),
        scalars_K=((0, 0), (1, 1), (2, 2), (3, 3), (8, 7), (9, 8)),
        rotations={"bar.rotation": (4, 4)},
        start_D=np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0]),
        start_K=np.array([np.nan, 0.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0, 0.7, 0.0]),
    )
