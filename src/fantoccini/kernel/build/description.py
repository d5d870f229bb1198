"""Facts about this machine for ``fantoccini doctor``."""

from __future__ import annotations

import os
import platform
from pathlib import Path

from fantoccini.base import BuildError
from fantoccini.kernel.build.cache import contents
from fantoccini.kernel.build.compiler import BASE_FLAGS, compile_flags, find_compiler
from fantoccini.kernel.build.folders import cache_folder, reason_for_distrust
from fantoccini.kernel.build.key import casadi_version, processor


def describe() -> dict[str, str]:
    """Label -> text about the compiler, its flags, the processor and the cache.

    Faults of the compiler and of the cache folder are under the key ``problem``; without it, the
    machine can compile puppets.
    """
    descriptions: dict[str, str] = {}
    problems: list[str] = []
    try:
        compiler = find_compiler()
        descriptions["compiler"] = f"{compiler.version} ({' '.join(compiler.command)})"
        descriptions["flags"] = " ".join((*BASE_FLAGS, *compile_flags(compiler)))
    except BuildError as error:
        descriptions["compiler"] = "none"
        problems.append(str(error))
    descriptions["processor"] = platform.processor() or platform.machine()
    descriptions["features"] = _features()
    descriptions["casadi"] = casadi_version()
    root = cache_folder()
    descriptions["cache"] = str(root)
    descriptions |= {kind: f"{n} ({size / 1e6:.1f} MB)" for kind, (n, size) in contents().items()}
    if trouble := reason_for_distrust(root) or _unwritable(root):
        problems.append(f"the cache folder is not used: {trouble}")
    if problems:
        descriptions["problem"] = "\n".join(problems)
    return descriptions


def _features() -> str:
    """The processor's vector extensions."""
    have = processor().split()
    feature_names = ("asimd", "neon", "sve", "sse2", "sse4_2", "avx", "avx2", "fma", "avx512f")
    return " ".join(name for name in feature_names if name in have) or "unknown"


def _unwritable(root: Path) -> str:
    """Reason why a folder, or its nearest existing parent, cannot be written; empty if it can."""
    nearest_existing = root
    while not nearest_existing.exists() and nearest_existing != nearest_existing.parent:
        nearest_existing = nearest_existing.parent
    if not nearest_existing.is_dir():
        return f"{nearest_existing} is not a folder"
    return "" if os.access(nearest_existing, os.W_OK) else f"{nearest_existing} cannot be written"
