"""The names of the package, and where each is defined."""

from .live import Live as Live
from .midi import MIDI_SCRIPT as MIDI_SCRIPT
from .pad import PAD_SCRIPT as PAD_SCRIPT
from .sound import SOUND_SCRIPT as SOUND_SCRIPT
