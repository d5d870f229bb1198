"""Independent results for comparison with the package.

No module imports the equations of the package, except where it says so: the results come from the
paper's text, from closed forms, and from SymPy, SciPy and MuJoCo.
"""
