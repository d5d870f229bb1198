"""A puppet, a motion or a plan in the browser; the first call loads viser."""

from fantoccini.web.showing import show

__all__ = ["show"]
