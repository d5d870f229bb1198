"""Gestures, captured clips, plays and live performances.

The hands of a puppeteer are its driven coordinates q_K: ends of strings, lengths of strings, and
driven joints. A gesture is a short motion of them, relative to their position. A score times
gestures of one puppet; a play has several puppets, its players. A cue is a line of a score or play:
a verb with its player and time. A lane is a list of gestures in order; the offsets of all lanes add
up. A mark is a named time of a gesture or a score. A take is a recording of a performance for
editing. A scene may contain several puppets, its members; the name of a member begins the names of
its parts.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
