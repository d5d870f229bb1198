"""What a puppet does: the Marionette, its rest, its runs, their derivatives, clearances."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
