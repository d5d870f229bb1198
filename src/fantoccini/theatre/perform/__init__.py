"""Live performances of puppets, and recordings of them."""

from fantoccini.theatre.perform.balance import Balance
from fantoccini.theatre.perform.demo import WALK_PICTURE_TIMES, walk
from fantoccini.theatre.perform.handle import Handle
from fantoccini.theatre.perform.osc import Address, Osc
from fantoccini.theatre.perform.performance import Performance
from fantoccini.theatre.perform.recording import Recording
from fantoccini.theatre.perform.score_voice import ScoreVoice
from fantoccini.theatre.perform.show import LivePlay, ShowEvent
from fantoccini.theatre.perform.tempo import TEMPO_RANGE, Tempo

__all__ = [
    "TEMPO_RANGE",
    "WALK_PICTURE_TIMES",
    "Address",
    "Balance",
    "Handle",
    "LivePlay",
    "Osc",
    "Performance",
    "Recording",
    "ScoreVoice",
    "ShowEvent",
    "Tempo",
    "walk",
]
