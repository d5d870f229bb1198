"""Memory available to a run, and memory needed for its samples.

A sample is one saved instant of a run.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

import numpy as np


class MemoryModel(NamedTuple):
    """Numbers of the memory bound.

    Attributes:
        assumed_free: free memory if the system does not report it [bytes].
        always_free: memory granted without a check, which costs a file read [bytes].
        number: size of a double [bytes].
        copies: doubles needed for each one saved: pieces, joined pieces, columns, and results
            computed from them; 3.1 to 3.3 were measured.
        event: size of an event as written and as returned [bytes].
    """

    assumed_free: float = 4e9
    always_free: float = 5e7
    number: int = 8
    copies: int = 4
    event: int = 500


MEMORY = MemoryModel()

_GROUPS = (
    ("memory.max", "memory.current", "inactive_file"),
    ("memory/memory.limit_in_bytes", "memory/memory.usage_in_bytes", "total_inactive_file"),
)
"""Limit, use, and the reclaimable part of it, for both kinds of control groups."""


def bound(n_bytes: float, max_memory: float | None) -> float:
    """Memory that a run may take [bytes]: ``max_memory``, or half of the free memory.

    Args:
        n_bytes: requested memory; small amounts are granted without a check [bytes].
        max_memory: bound set by the user, or None [bytes].
    """
    if max_memory is not None:
        return max_memory
    return np.inf if n_bytes < MEMORY.always_free else allowed()


def allowed() -> float:
    """Half of the memory still available to this process [bytes]."""
    free_amounts = filter(None, (_free(), of_group(), _of_process()))
    return 0.5 * min(free_amounts, default=MEMORY.assumed_free)


def bytes_of(n_samples: float, width: int) -> float:
    """Memory that a run needs until it returns, for samples of ``width`` numbers [bytes]."""
    return MEMORY.copies * MEMORY.number * n_samples * width


def _free() -> float | None:
    """Free memory of the machine [bytes]."""
    for line in _text(Path("/proc/meminfo")).splitlines():
        if line.startswith("MemAvailable:"):
            return 1024.0 * int(line.split()[1])
    try:
        return 0.5 * os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return None


def of_group(root: Path = Path("/sys/fs/cgroup")) -> float | None:
    """Free memory of the control group, such as a container's [bytes]."""
    for limit, use, spare in _GROUPS:
        bound_text, used_text = _text(root / limit).strip(), _text(root / use).strip()
        if bound_text.isdigit() and used_text.isdigit():
            stat = _text((root / use).parent / "memory.stat").split()
            reclaimable = int(stat[stat.index(spare) + 1]) if spare in stat else 0
            return max(1.0, float(int(bound_text) - int(used_text) + reclaimable))
    return None


def _of_process() -> float | None:
    """Free address space of the process, if limited (``ulimit -v``) [bytes]."""
    try:
        import resource

        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
        pages = int(_text(Path("/proc/self/statm")).split()[0])
        used_bytes = pages * os.sysconf("SC_PAGE_SIZE")
    except (ImportError, IndexError, OSError, ValueError):
        return None
    return None if limit == resource.RLIM_INFINITY else max(1.0, float(limit - used_bytes))


def _text(file: Path) -> str:
    try:
        return file.read_text(encoding="ascii")
    except (OSError, UnicodeDecodeError):
        return ""
