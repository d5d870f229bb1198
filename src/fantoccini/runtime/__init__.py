"""The compiled puppet: the one package that speaks to the shared library, through ctypes."""

from fantoccini.runtime.compiled import Complementarity, Library, Run, RunOptions, n_packed
from fantoccini.runtime.outside import OutsideRun
from fantoccini.runtime.slopes import Slopes

__all__ = ["Complementarity", "Library", "OutsideRun", "Run", "RunOptions", "Slopes", "n_packed"]
