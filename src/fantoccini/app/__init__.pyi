"""The names of the package, and where each is defined."""

from . import cli as cli, cli_support as cli_support, live as live, pages as pages, web as web
from .web import show as show
