"""Parts of a displacement that a puppet can reach, for messages.

A part is the k-th of n equal parts of the displacement.
"""

from __future__ import annotations

from collections.abc import Callable


def reachable_part(is_reachable: Callable[[int], bool], n: int) -> int | None:
    """Largest number k of n parts of a displacement that is reachable, by bisection.

    Args:
        is_reachable: whether k parts can be reached; all n cannot.
        n: number of parts.

    Returns:
        k in [0, n), or None if even the start of the displacement cannot be reached.
    """
    low, high = 0, n
    if not is_reachable(low):
        return None
    while high - low > 1:
        middle = (low + high) // 2
        if is_reachable(middle):
            low = middle
        else:
            high = middle
    return low
