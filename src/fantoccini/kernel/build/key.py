"""The key of a library: a hash of everything that can change it.

A fingerprint is such a hash, in hexadecimal.
"""

from __future__ import annotations

import hashlib
import json
import platform
import sys
from collections.abc import Iterable
from functools import cache
from importlib import metadata
from pathlib import Path

from fantoccini.kernel.build.compiler import BASE_FLAGS, compile_flags, find_compiler
from fantoccini.kernel.build.significant import significant_cpp

_COMPUTING = ("numpy", "scipy", "coacd", "coal", "trimesh")
"""Libraries that compute numbers, beside CasADi."""


def fingerprint(canonical: str, generator: str, flags: Iterable[str] = ()) -> str:
    """The key of a puppet's library in the cache.

    Args:
        canonical: canonical form of the puppet.
        generator: hash of the code that generates the source text (:func:`code_fingerprint`).
        flags: compiler flags beyond the standard ones, and other texts that distinguish libraries
            of one puppet.

    Returns:
        64 hexadecimal digits, which depend on the arguments, CasADi's version, the runtime's
        headers, the compiler, the standard flags and the processor, but not on Python's version.
    """
    compiler = find_compiler()
    parts = {
        "canonical": canonical,
        "generator": generator,
        "flags": list(flags),
        "standard flags": [*BASE_FLAGS, *compile_flags(compiler)],
        "casadi": casadi_version(),
        "runtime": runtime_hash(runtime_folder()),
        "compiler": [compiler.kind, compiler.version, *compiler.command],
        "processor": [sys.platform, platform.machine(), processor()],
    }
    text = json.dumps(parts, sort_keys=True, ensure_ascii=True)
    return hashlib.sha256(text.encode("ascii")).hexdigest()


def results_fingerprint() -> str:
    """A hash of everything that can change computed numbers, except the arguments.

    It depends on all files of the package, on the versions of Python and of libraries that compute,
    and, as :func:`fingerprint`, on the compiler, its flags and the processor.
    """
    versions = [f"{name} {version_of(name)}" for name in _COMPUTING]
    return fingerprint("", package_hash(), [platform.python_version(), *versions])


@cache
def package_hash() -> str:
    """SHA-256 of the names and contents of the package's files: Python, C++, YAML and others."""
    folder = Path(__file__).resolve().parents[2]
    total = hashlib.sha256()
    for file in sorted(folder.rglob("*")):
        if file.is_file() and "__pycache__" not in file.parts:
            content = file.read_bytes()
            total.update(f"{file.relative_to(folder).as_posix()}\0{len(content)}\0".encode())
            total.update(content)
    return total.hexdigest()


def runtime_folder() -> Path:
    """The include folder of the C++ runtime."""
    return Path(__file__).resolve().parent.parent / "cpp"


def runtime_hash(folder: Path) -> str:
    """SHA-256 of the names and the code (without comments) of the runtime's headers."""
    total = hashlib.sha256()
    for file in sorted(folder.rglob("*.hpp")):
        code = significant_cpp(file.read_text(encoding="utf-8")).encode()
        total.update(f"{file.relative_to(folder).as_posix()}\0{len(code)}\0".encode() + code)
    return total.hexdigest()


def casadi_version() -> str:
    """The installed CasADi's version from its metadata, which is much faster than an import."""
    return version_of("casadi")


def version_of(name: str) -> str:
    """Version of an installed distribution; ``none`` without it."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "none"


def processor(cpuinfo: Path = Path("/proc/cpuinfo")) -> str:
    """The processor's features, which ``-march=native`` uses; its name if they are unknown."""
    try:
        with open(cpuinfo, encoding="utf-8", errors="replace") as lines:
            for line in lines:
                label, _, value = line.partition(":")
                if label.strip() in ("flags", "Features"):
                    return " ".join(sorted(set(value.split())))
    except OSError:
        pass
    return platform.processor()
