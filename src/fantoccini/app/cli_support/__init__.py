"""Shared code of the commands: arguments, files, messages and outputs.

Commands report a wrong option as a usage error, with the exit code 2.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
