"""Live performances of puppets, and recordings of them."""

from fantoccini.perform.balance import Balance
from fantoccini.perform.handle import Handle
from fantoccini.perform.performance import Performance
from fantoccini.perform.recording import Recording
from fantoccini.perform.show import Happening, Show

__all__ = ["Balance", "Handle", "Happening", "Performance", "Recording", "Show"]
