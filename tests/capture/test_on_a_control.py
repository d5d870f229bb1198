"""A puppet whose strings hang on a control follows a clip: its bars move and turn."""

from __future__ import annotations

import pytest
from benchmarks.capture.clips import write

import fantoccini as fan

pytestmark = [pytest.mark.slow, pytest.mark.long]


def test_a_puppet_on_a_control_follows_a_clip(tmp_path):
    (bow,) = (path for path in write(tmp_path, "mixamo") if path.stem == "bow")
    airplane = fan.puppets.airplane()
    placed = fan.theatre.retarget.place_clip(airplane, bow, end=1.2)
    followed = fan.theatre.follow_clip(airplane, placed)
    assert followed, followed.status
    assert followed.far < 0.06
