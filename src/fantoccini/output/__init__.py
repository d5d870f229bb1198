"""What is seen, and what other programs read: pictures, films, reports, formats out and in."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
