"""Equations of motion, from symbolic derivation to a compiled library and its calls."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
