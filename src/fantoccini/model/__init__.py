"""The description of a puppet: puppet and scene files, meshes, and the tree of links.

A link is an entry of the tree: a body on its joint, a driven string end, or a point mass of a
chain. A row is a string, limit, spring or drive; a string has the gap h = path length - length <=
0. A driven coordinate is given as a function of time (an end or length of a string, or a driven
joint), a dynamic one moves by the equations of motion.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
