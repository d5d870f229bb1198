"""Memory that a run may take, and memory that its samples need."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

import numpy as np


class MemoryModel(NamedTuple):
    """Numbers of the memory bound.

    Attributes:
        assumed_free: taken to be free where the system does not say [bytes].
        always_free: granted without looking, which costs a file read [bytes].
        number: size of a double [bytes].
        copies: doubles needed for each one saved: pieces, joined pieces, columns, and results
            computed from them; 3.1 to 3.3 were measured.
        event: as written and as handed out [bytes].
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


def bound(need: float, given: float | None) -> float:
    """What may be taken [bytes]: what was given, or half of what is free.

    Args:
        need: bytes asked for; little memory is granted without looking up what is free.
        given: None where nothing was.
    """
    if given is not None:
        return given
    return np.inf if need < MEMORY.always_free else allowed()


def allowed() -> float:
    """Half of the memory that this process can still have [bytes]."""
    free = filter(None, (_free(), of_group(), _of_process()))
    return 0.5 * min(free, default=MEMORY.assumed_free)


def bytes_of(n_samples: float, width: int) -> float:
    """Memory that a run needs for samples of so many numbers, until it is returned [bytes]."""
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
    """Free memory of the control group, as containers have one [bytes]."""
    for limit, use, spare in _GROUPS:
        most, used = _text(root / limit).strip(), _text(root / use).strip()
        if most.isdigit() and used.isdigit():
            stat = _text((root / use).parent / "memory.stat").split()
            back = int(stat[stat.index(spare) + 1]) if spare in stat else 0
            return max(1.0, float(int(most) - int(used) + back))
    return None


def _of_process() -> float | None:
    """Free addresses of the process, where they are limited (``ulimit -v``) [bytes]."""
    try:
        import resource

        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
        pages = int(_text(Path("/proc/self/statm")).split()[0])
        used = pages * os.sysconf("SC_PAGE_SIZE")
    except (ImportError, IndexError, OSError, ValueError):
        return None
    return None if limit == resource.RLIM_INFINITY else max(1.0, float(limit - used))


def _text(file: Path) -> str:
    try:
        return file.read_text(encoding="ascii")
    except (OSError, UnicodeDecodeError):
        return ""
