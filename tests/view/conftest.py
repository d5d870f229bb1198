"""The puppet and motion that most pictures show."""

from __future__ import annotations

import pytest
from tests.view.still_life import StillLife, bundled_still_life, swinging_motion

from fantoccini.motion import Trajectory


@pytest.fixture(scope="module")
def swung() -> tuple[StillLife, Trajectory]:
    """The bundled marionette, without a compiled model, and an invented motion of one second."""
    marionette = bundled_still_life("marionette")
    return marionette, swinging_motion(marionette)
