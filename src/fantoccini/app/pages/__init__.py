"""Pages in the browser: what they draw and replay; live ones are in `live`."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
