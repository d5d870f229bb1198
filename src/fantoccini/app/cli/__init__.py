"""The command line: ``fantoccini --help``. Every command imports its modules when it is called.

FILE stands for a puppet file, or the name of a bundled puppet; a run is a simulated motion.
"""

from fantoccini.app.cli.app import main

__all__ = ["main"]
