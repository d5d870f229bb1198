"""Identification, parameter studies, and the check of the mixed model.

A record is measurements of a puppet in motion under known inputs; a sweep is one study applied to
many cases. In the mixed model of the paper, some coordinates are dynamic and the others are driven
inputs.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
