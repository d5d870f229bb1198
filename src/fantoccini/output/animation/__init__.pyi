"""The names of the package, and where each is defined."""

from .exporting import export as export
from .formats import SUFFIXES as SUFFIXES, format_of as format_of
from .scene import Bodies as Bodies, check_bodies as check_bodies
