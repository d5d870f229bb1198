"""Pages with a live puppet: controls, takes, scores and live plays.

A handle is a driven string end, or a body on a driven joint, that a viewer can drag. A take is a
recording of a performance for editing. A score times gestures of a puppet; a cue is a line of a
score or play.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
