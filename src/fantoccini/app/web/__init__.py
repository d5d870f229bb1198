"""``show``: opens a puppet, a motion or a plan in the browser; imports viser when first called.

A plan is a motion to a goal among obstacles, with its search tree.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
