"""The compiled puppet: the one package that speaks to the shared library, through ctypes."""

from fantoccini.runtime.compiled import Complementarity, Library, Run, RunOptions
from fantoccini.runtime.outside import OutsideRun

__all__ = ["Complementarity", "Library", "OutsideRun", "Run", "RunOptions"]
