"""The compiled puppet: the one package that speaks to the shared library, through ctypes."""

from fantoccini.runtime.batch import PARTS, Batch, BatchLibrary, default_threads
from fantoccini.runtime.compiled import Complementarity, Library, Run
from fantoccini.runtime.outside import OutsideRun
from fantoccini.runtime.slopes import Slopes
from fantoccini.runtime.structures import RunOptions

__all__ = [
    "PARTS",
    "Batch",
    "BatchLibrary",
    "Complementarity",
    "Library",
    "OutsideRun",
    "Run",
    "RunOptions",
    "Slopes",
    "default_threads",
]
