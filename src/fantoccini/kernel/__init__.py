"""How equations become numbers: contract, derivation, generated code, build and runtime."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
