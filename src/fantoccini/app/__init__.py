"""Command line, and pages in the browser.

A page shows a puppet in the browser: live, or as the replay of a motion.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
