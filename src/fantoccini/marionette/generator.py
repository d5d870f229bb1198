"""What makes a compiled model what it is, beside the puppet: part of the cache's key."""

from __future__ import annotations

import hashlib
from pathlib import Path

from fantoccini import codegen, equations, tree

_NOT_GENERATING = (
    "printing.py", "notation.py", "forms.py", "c99.py", "contract.py"
)  # fmt: skip
"""Modules beside the derivation that shape nothing that is compiled."""
_DERIVATIVES = "derivatives.py"
"""Modules that shape the derivatives' library alone."""


def fingerprint(derivatives: bool = False) -> str:
    """The generator's version: that of the text, and a hash of all code that shapes it.

    Args:
        derivatives: of the derivatives' library, not of the model's.
    """
    digest = hashlib.sha256()
    folders = [Path(module.__file__).parent for module in (equations, tree, codegen)]
    for file in sorted(f for folder in folders for f in folder.glob("*.py")):
        left_out = file.name in _NOT_GENERATING or file.name == "__init__.py"
        if not left_out and (derivatives or file.name != _DERIVATIVES):
            digest.update(file.read_bytes())
    return f"{codegen.VERSION}-{digest.hexdigest()}"
