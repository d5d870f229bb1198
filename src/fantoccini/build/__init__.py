"""Source text -> a shared library on this machine, made once and kept in a cache.

The only place that runs a compiler. :func:`fingerprint` makes the key from everything that can
change the library; :func:`obtain` returns the folder that holds it, deriving and compiling only
when it is not there yet.
"""

from fantoccini.build.cache import clear, obtain
from fantoccini.build.closure import code_fingerprint
from fantoccini.build.compiler import (
    Compiler,
    compile_flags,
    default_flags,
    find_compiler,
)
from fantoccini.build.description import describe
from fantoccini.build.entry import INFO, LIBRARY, Source
from fantoccini.build.folders import cache_folder
from fantoccini.build.key import fingerprint, runtime_folder

__all__ = [
    "INFO",
    "LIBRARY",
    "Compiler",
    "Source",
    "cache_folder",
    "clear",
    "code_fingerprint",
    "compile_flags",
    "default_flags",
    "describe",
    "find_compiler",
    "fingerprint",
    "obtain",
    "runtime_folder",
]
