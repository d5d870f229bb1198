"""Import of MJCF and URDF models as puppet files."""

from fantoccini.output.exchange.imported import ImportedPuppet, ImportNote
from fantoccini.output.exchange.importing import import_model

__all__ = ["ImportNote", "ImportedPuppet", "import_model"]
