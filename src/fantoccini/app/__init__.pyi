"""The names of the package, and where each is defined."""

from . import cli as cli, console as console, live as live, pages as pages, web as web
from .web import show as show
