"""What a puppet's numbers are: identification, sweeps, and the kinematic reduction."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
