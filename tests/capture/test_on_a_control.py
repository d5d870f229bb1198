"""A puppet whose strings hang on a control follows a clip: its bars move and turn."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.capture.clips import write

import fantoccini as fan
from fantoccini.motion import channel_names

pytestmark = [pytest.mark.slow, pytest.mark.long]


def test_a_puppet_on_a_control_follows_a_clip(tmp_path):
    (bow,) = (path for path in write(tmp_path, "mixamo") if path.stem == "bow")
    airplane = fan.puppets.airplane()
    placed = fan.theatre.retarget.place_clip(airplane, bow, end=1.2)
    followed = fan.theatre.follow_clip(airplane, placed)
    assert followed, followed.status
    assert followed.error < 0.06
    places = channel_names(airplane.coordinates)
    inputs = followed.inputs
    q_K = np.array([inputs.evaluate(t)[0] for t in np.linspace(inputs.start, inputs.end, 50)])
    ranges = {name: np.max(np.ptp(q_K[:, q], axis=0)) for name, (q, _) in places.items()}
    assert ranges["bar.rotation"] > 0.02
    assert max(ranges[f"bar.{axis}"] for axis in "xyz") > 0.01
