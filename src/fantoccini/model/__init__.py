"""What a puppet is: its file, its scene, its meshes, and the tree of its links."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
