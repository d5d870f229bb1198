"""The command line: ``fantoccini --help``. Every command imports its modules when it is called."""

from fantoccini.app.cli.app import main

__all__ = ["main"]
