"""The names of the package, and where each is defined."""

from .exporting import export as export
from .formats import ENDINGS as ENDINGS
from .scene import check_bodies as check_bodies
