"""The exported runs: the bundled marionette greets for ten seconds; a mass is thrown."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.theatre.perform.demo import performance


@pytest.fixture(scope="session")
def greeting() -> fan.Trajectory:
    """10 s, event-driven, with hundreds of catches; the head's string is slack at times."""
    marionette = fan.puppets.marionette()
    x0, inputs, duration = performance(marionette)
    return fan.simulate(marionette, x0, inputs, duration)


@pytest.fixture(scope="session")
def greeting_glb(greeting: fan.Trajectory, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The greeting as glTF."""
    return fan.export(greeting, tmp_path_factory.mktemp("glb") / "greeting.glb")


@pytest.fixture(scope="session")
def thrown() -> fan.Trajectory:
    """A mass on a string, thrown up and aside: the string goes slack, catches and stays taut."""
    marionette = fan.puppets.string_pendulum()
    x0 = marionette.state()
    return fan.simulate(marionette, x0.replace(v_D=np.array([1.5, 2.5])), t_end=1.5)
