"""Drawing and replay on browser pages; ``live`` has the pages with a live puppet.

A node is an object of the page that viser draws, such as a body or a string.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
