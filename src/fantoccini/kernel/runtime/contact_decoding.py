"""Contact points of a run, decoded from the rows that compiled code writes.

A contact is a point at which two solids touch.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fantoccini.base import Array
from fantoccini.kernel.contract import CONTACT
from fantoccini.motion import ContactPoints


def contact_points(rows: Array, names: tuple[tuple[str, str], ...]) -> ContactPoints:
    """The contact points of a run.

    Args:
        rows: (n, width) output of the compiled code, with the columns of ``CONTACT``.
        names: names of the two solids of each pair that may touch.
    """
    ends = np.cumsum([part.numel({}) for part in CONTACT])
    parts: dict[str, Any] = {
        part.name: rows[:, end - part.numel({}) : end] if part.shape else rows[:, end - 1]
        for part, end in zip(CONTACT, ends, strict=True)
    }
    return ContactPoints(**parts, names=names)
