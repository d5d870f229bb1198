"""Drawing and replay on browser pages; ``live`` has the pages with a live puppet."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
