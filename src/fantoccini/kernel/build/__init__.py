"""Source text -> a shared library, compiled once on this machine and cached.

:func:`fingerprint` is the key, a hash of everything that can change the library. :func:`obtain`
returns the library's folder, and derives and compiles only if the library is not in the cache.

The cache is a folder of the user; an entry is the folder of one library in it.
"""

from fantoccini.kernel.build.cache import clear, contents, obtain
from fantoccini.kernel.build.closure import code_fingerprint
from fantoccini.kernel.build.compiler import Compiler, compile_flags, default_flags, find_compiler
from fantoccini.kernel.build.description import describe
from fantoccini.kernel.build.entry import INFO, LIBRARY, Source, early_objects
from fantoccini.kernel.build.folders import cache_folder
from fantoccini.kernel.build.kept import RESULTS, ArrayStore, kept_arrays
from fantoccini.kernel.build.key import fingerprint, results_fingerprint, runtime_folder

__all__ = [
    "INFO",
    "LIBRARY",
    "RESULTS",
    "ArrayStore",
    "Compiler",
    "Source",
    "cache_folder",
    "clear",
    "code_fingerprint",
    "compile_flags",
    "contents",
    "default_flags",
    "describe",
    "early_objects",
    "find_compiler",
    "fingerprint",
    "kept_arrays",
    "obtain",
    "results_fingerprint",
    "runtime_folder",
]
