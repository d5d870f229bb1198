"""Independent answers that the package is compared with.

Nothing here imports the equations of the package, except where a module says so: the answers come
from the paper's text, from closed forms, and from SymPy, SciPy and MuJoCo.
"""
