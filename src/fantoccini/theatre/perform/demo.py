"""Bundled performances: the marionette greets, and on a stage with contact it walks.

A performance is a puppet played live, here by a fixed script.
"""

from __future__ import annotations

from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.puppet import performance as performance_file
from fantoccini.motion import Input, State

DURATION = 10.0
"""Duration of the greeting [s]."""

GREETING_PICTURE_TIMES = (0.0, 1.4, 2.1, 4.1, 4.9, 7.5, 8.2, 10.0)
"""Times of the greeting for pictures: hanging, the wave, two steps, the bow, hanging [s]."""

WALK_DURATION = 12.0
"""Duration of the walk [s]."""

WALK_PICTURE_TIMES = (0.0, 1.2, 1.7, 2.3, 2.9, 3.5, 4.6, 7.2, 9.7)
"""Times of the walk for pictures: hanging, five steps, standing still, the wave, the nod [s]."""


def performance(marionette: Marionette) -> tuple[State, Input, float]:
    """Greeting of the bundled marionette.

    Args:
        marionette: ``fan.puppets.marionette()``.

    Returns:
        State at rest, inputs, and duration [s].
    """
    inputs = Input.load(marionette, performance_file("greeting"))
    return marionette.rest(), inputs, DURATION


def walk(stage: Marionette) -> tuple[State, Input, float]:
    """Walk of the bundled marionette on a floor that carries it.

    Args:
        stage: ``fan.puppets.promenade()``.

    Returns:
        State at rest, inputs, and duration [s].
    """
    return stage.rest(), Input.load(stage, performance_file("walk")), WALK_DURATION
