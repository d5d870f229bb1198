"""A puppet, a motion or a plan in the browser; the first call loads viser."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
