"""The bundled performance: the marionette greets, steps and bows."""

from __future__ import annotations

from pathlib import Path

from fantoccini.marionette import Marionette
from fantoccini.motion import Input, State

DURATION = 10.0
"""[s]"""

POSES = (0.0, 1.4, 2.1, 4.1, 4.9, 7.5, 8.2, 10.0)
"""Times worth a picture: hanging, the wave, two steps, the bow, hanging again [s]."""

_GREETING = Path(__file__).parent / "puppets" / "performances" / "greeting.yaml"


def performance(marionette: Marionette) -> tuple[State, Input, float]:
    """The greeting, for the bundled marionette.

    Args:
        marionette: ``fan.puppets.marionette()``.

    Returns:
        The hanging start, the inputs, and the duration [s].
    """
    inputs = Input.load(marionette, _GREETING)
    return marionette.rest(), inputs, DURATION
