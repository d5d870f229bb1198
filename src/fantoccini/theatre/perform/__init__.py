"""Live performances of puppets, and recordings of them.

A performance moves a puppet live: targets of hands go in, states come out. A handle is a driven
string end, or a body on a driven joint, that a hand can hold. A tick is the interval at which a
performance advances. A recording contains everything that repeats a performance to the last bit; a
take is a recording for editing. q_K are the driven coordinates that the hands move, v_K and acc_K
their velocities and accelerations, and n_vK is the number of these velocities.
"""

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
