"""What makes a compiled model what it is, beside the puppet: part of the cache's key."""

from __future__ import annotations

import hashlib
from pathlib import Path

from fantoccini import codegen, equations, tree

_NOT_GENERATING = (
    "printing.py", "notation.py", "forms.py", "c99.py", "contract.py"
)  # fmt: skip
"""Modules beside the derivation that shape nothing that is compiled."""
_ALONE = ("derivatives", "variational")
"""Modules that shape nothing but the libraries whose names begin with theirs."""


def fingerprint(what: str = "model") -> str:
    """The generator's version: that of the text, and a hash of all code that shapes it.

    Args:
        what: which of a puppet's libraries.
    """
    digest = hashlib.sha256()
    folders = [Path(module.__file__).parent for module in (equations, tree, codegen)]
    for file in sorted(f for folder in folders for f in folder.glob("*.py")):
        left_out = file.name in _NOT_GENERATING or file.name == "__init__.py"
        if not left_out and (what.startswith(file.stem) or file.stem not in _ALONE):
            digest.update(file.read_bytes())
    return f"{codegen.VERSION}-{digest.hexdigest()}"
