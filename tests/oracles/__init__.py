"""Independent answers that the package is compared with.

Nothing here imports the equations of the package: the answers come from the paper's text, from
closed forms, and from SymPy, SciPy and MuJoCo.
"""
