"""How much memory there is, and what the rows of a run take of it."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

_UNKNOWN = 4e9
"""Bytes that are taken to be free where the system does not say."""
_FEW = 5e7
"""Bytes that are there."""
_NUMBER = 8
"""Bytes."""
ROW_COPIES = 4
"""Numbers that a run needs for each one that it writes: its pieces, those joined, its columns,
and what is computed from them. 3.1 to 3.3 were measured."""
EVENT_BYTES = 500
"""Of an event, as it is written and as it is given."""

_GROUPS = (
    ("memory.max", "memory.current", "inactive_file"),
    ("memory/memory.limit_in_bytes", "memory/memory.usage_in_bytes", "total_inactive_file"),
)
"""Limit, use, and the part of it that can be had back, of both kinds of control groups."""


def bound(need: float, given: float | None) -> float:
    """What may be taken [bytes]: what was given, or half of what is free.

    Args:
        need: bytes that are asked for; what is free is not looked up for the sake of few.
        given: None where nothing was.
    """
    if given is not None:
        return given
    return np.inf if need < _FEW else allowed()


def allowed() -> float:
    """Half of the memory that this process can still have [bytes]."""
    return 0.5 * min(filter(None, (_free(), _of_group(), _of_process())), default=_UNKNOWN)


def bytes_of(n_rows: float, width: int) -> float:
    """What a run of some rows needs until it is given [bytes]."""
    return ROW_COPIES * _NUMBER * n_rows * width


def _free() -> float | None:
    """Of the machine."""
    for line in _text(Path("/proc/meminfo")).splitlines():
        if line.startswith("MemAvailable:"):
            return 1024.0 * int(line.split()[1])
    try:
        return 0.5 * os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return None


def _of_group(root: Path = Path("/sys/fs/cgroup")) -> float | None:
    """Of the control group, as containers have one."""
    for limit, use, spare in _GROUPS:
        most, used = _text(root / limit).strip(), _text(root / use).strip()
        if most.isdigit() and used.isdigit():
            stat = _text((root / use).parent / "memory.stat").split()
            back = int(stat[stat.index(spare) + 1]) if spare in stat else 0
            return max(1.0, float(int(most) - int(used) + back))
    return None


def _of_process() -> float | None:
    """Of the process, where its addresses are limited (``ulimit -v``)."""
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
