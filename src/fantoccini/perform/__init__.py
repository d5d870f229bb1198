"""perform: a puppet that is alive in somebody's hands, and recordings of it."""

from fantoccini.perform.handle import Handle
from fantoccini.perform.performance import Performance
from fantoccini.perform.recording import Recording

__all__ = ["Handle", "Performance", "Recording"]
