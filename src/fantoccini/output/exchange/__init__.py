"""Puppets as models of other programs, and models of other programs as puppets."""

from fantoccini.output.exchange.imported import (
    Imported,
    ImportNote,
)
from fantoccini.output.exchange.importing import import_model

__all__ = [
    "ImportNote",
    "Imported",
    "import_model",
]
