"""Reasons for refused cues: in the unit of the file, in one sentence, with what is possible."""

from __future__ import annotations

import re

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base.documents import Located
from fantoccini.base.errors import FileError, InputError
from fantoccini.theatre.cast.cues import act_time_in_words
from fantoccini.theatre.retarget import TooShortError
from fantoccini.theatre.script import ScriptLog

pytestmark = pytest.mark.medium
TEMPO = 120.0


@pytest.fixture(scope="module")
def marionette():
    return fan.puppets.marionette()


def test_times_in_reasons_are_in_beats_of_the_act():
    assert act_time_in_words(12.0, 4.0, 60.0 / TEMPO) == "on beat 16.0 of the act (12.00 s)"


def test_a_clip_that_is_too_short_is_reported_in_beats():
    assert str(TooShortError("wave", 0.8, 1.55, 60.0 / TEMPO)) == (
        "found 1.6 beats for wave; needed: more than 3.1 beats, which the motions to its "
        "start and back take"
    )
    assert str(TooShortError("wave", 0.8, 1.55)).startswith("found 0.8 s for wave")


def test_durations_of_scripts_are_in_the_unit_of_their_file():
    assert ScriptLog(Located(), TEMPO).duration_in_words(1.25) == "2.50 beats (1.25 s)"
    assert ScriptLog(Located(), None).duration_in_words(1.25) == "1.25 s"


def test_the_reason_gives_how_much_lower_a_place_must_be_for_pointing(marionette):
    high = np.array([0.1, 0.1, 0.9])
    with pytest.raises(InputError) as caught:
        fan.theatre.load_gesture(marionette, "point", to=high)
    (mistake,) = caught.value.mistakes
    message_match = re.fullmatch(
        r"the left hand cannot point there: the place is too high; needed: (\d\.\d\d) m lower, or "
        r"farther away",
        mistake.message,
    )
    lower = float(message_match[1])
    assert fan.theatre.load_gesture(marionette, "point", to=high - [0.0, 0.0, lower]).marks
    with pytest.raises(InputError, match="the place is too high"):
        fan.theatre.load_gesture(marionette, "point", to=high - [0.0, 0.0, lower - 0.04])


POSES = """gesture: offer
poses:
  strings: [hand_right]
  at: [0, 1, 2]
  points: {forearm_right: [[0, 0, 0], [0.02, 0, UP], [0, 0, 0]]}
  of: {forearm_right: [0, 0, -0.09]}
"""


def test_the_reason_gives_how_much_of_a_key_pose_can_be_reached(marionette, tmp_path):
    path = tmp_path / "offer.yaml"
    path.write_text(POSES.replace("UP", "0.5"))
    with pytest.raises(FileError) as caught:
        fan.theatre.load_gesture(marionette, path)
    (mistake,) = caught.value.mistakes
    assert mistake.line == 4 and "\n" not in mistake.message
    message_match = re.fullmatch(
        r"at 1 s: forearm_right comes no nearer to its place than \d+\.\d cm; (\d+) % of the way "
        r"there can be reached",
        mistake.message,
    )
    share = int(message_match[1]) / 100.0
    for factor, can in ((share, True), (share + 0.03, False)):
        place = f"[{0.02 * factor}, 0, {0.5 * factor}]"
        path.write_text(POSES.replace("[0.02, 0, UP]", place))
        if can:
            assert fan.theatre.load_gesture(marionette, path).uses
        else:
            with pytest.raises(FileError, match="comes no nearer"):
                fan.theatre.load_gesture(marionette, path)


def test_a_time_before_the_act_is_reported_in_beats(plays):
    play = plays.compile(
        """{who: pierrot, does: wave, when: 6}
        {who: columbine, does: bow, when: wave.start - 9}"""
    )
    (refused,) = [cue for cue in play.cues if cue.refused]
    assert "its time is 3.00 beats (1.80 s) before its act" in refused.refused
