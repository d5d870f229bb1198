"""The puppet and motion that most pictures show."""

from __future__ import annotations

import pytest
from tests.view.still_life import StillLife, bundled, swinging

from fantoccini.motion import Trajectory


@pytest.fixture(scope="module")
def swung() -> tuple[StillLife, Trajectory]:
    """The bundled marionette, without a compiled model, and an invented motion of one second."""
    marionette = bundled("marionette")
    return marionette, swinging(marionette)
