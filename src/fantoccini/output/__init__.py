"""Pictures, films and reports; export of motions, import of models.

A run is a simulated motion, and a solid a shape of a body or an obstacle, ready to be drawn.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
