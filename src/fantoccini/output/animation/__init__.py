"""Motions as animations that other programs open: glTF, OpenUSD, BVH, CSV, MCAP.

``export`` chooses the format by the file's suffix; ``formats.py`` lists them.

A key is a value at a time, between which players interpolate; a track is a curve with its keys. A
link is a body on its joint.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
