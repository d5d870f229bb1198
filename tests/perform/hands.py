"""The hands of a performance, for measurements in tests."""

from __future__ import annotations

import fantoccini as fan
from fantoccini.theatre.perform.hands import Hands


def hands_of(live: fan.Performance) -> Hands:
    """The groups of its driven coordinates, with its bounds."""
    return Hands.for_puppet(
        live.marionette, live.state, live.speed, live.acceleration, live.lengths
    )
