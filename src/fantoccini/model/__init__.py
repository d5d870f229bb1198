"""The description of a puppet: puppet and scene files, meshes, and the tree of links."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
