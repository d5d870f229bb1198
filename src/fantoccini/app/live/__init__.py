"""Pages with a live puppet: controls, takes, scores and live plays."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
