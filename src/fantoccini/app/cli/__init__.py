"""The command line: ``fantoccini --help``. Every command loads what it needs when it is called."""

from fantoccini.app.cli.app import main

__all__ = ["main"]
