"""Body map of a puppet, from its file, or from its tree, shapes and strings at rest.

A limb is an arm, leg, wing, tail or neck. A segment is a body with the bodies fixed on it, and a
doubt a sign that a guess may be wrong.
"""

from fantoccini.dynamics.body_map.finding import find_body_map

__all__ = ["find_body_map"]
