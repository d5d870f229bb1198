"""Body map of a puppet, from its file, or from its tree, shapes and strings at rest."""

from fantoccini.dynamics.body_map.finding import find_body_map

__all__ = ["find_body_map"]
