"""Camera cues of plays: their times, targets and mistakes."""

from __future__ import annotations

import numpy as np
import pytest
from tests.plays.tiny import CUES, write_play

import fantoccini as fan
from fantoccini.output.view.drawing import PictureOptions
from fantoccini.output.view.films import Frames
from fantoccini.output.view.geometry import run_geometry
from fantoccini.theatre.plays import check_play

pytestmark = pytest.mark.medium

SHOTS = """\
    camera:
      - {when: hello.top, at: two, from: 30 deg, zoom: 0.8}
      - {at: here, above: 20 deg}
      - {when: two is done, over: 0.5, from: left}
      - {when: 2, at: [one, two], over: 0.25}
"""
NAMED = CUES.replace("on: {top: 2}", "on: {top: 2.5}, name: hello")


def shots(tmp_path, lines: str, cues: str = NAMED) -> tuple[fan.theatre.Play, list]:
    play = fan.load_play(write_play(tmp_path, cues, lines))
    return play, list(play.shots)


def test_shots_have_their_times_targets_and_sides(tmp_path):
    _, (place, both, close, wide) = shots(tmp_path, SHOTS)
    assert [shot.t for shot in (place, both, close, wide)] == pytest.approx([0.0, 2.0, 2.5, 3.0])
    assert place.place == (0.0, -0.3) and place.bodies == ()
    assert place.elevation == pytest.approx(np.radians(20.0))
    assert both.bodies == ("one.ball", "two.ball")
    assert both.over == 0.25
    assert {body.split(".")[0] for body in close.bodies} == {"two"}
    assert close.azimuth == pytest.approx(np.radians(30.0)) and close.zoom == 0.8
    assert wide.bodies == () and wide.place is None
    assert wide.azimuth == pytest.approx(np.pi / 2) and wide.over == 0.5


def test_a_play_without_camera_has_no_shots(tmp_path):
    assert shots(tmp_path, "")[1] == []


def test_times_count_from_the_act(tmp_path):
    cues = NAMED + (
        "  - act: Second\n    after: 1\n    cues:\n      - {who: one, does: hop.yaml}\n"
    )
    play, (shot,) = shots(tmp_path, "    camera: [{when: 0.5, at: one}]\n", cues)
    assert shot.t == pytest.approx(play.acts["Second"] + 0.5)


def test_the_film_shows_a_player_where_the_shot_wants_it(tmp_path):
    """The ball is in the middle of the picture in its own shot, but not before."""
    play, shown = shots(tmp_path, "    camera: [{when: 2, at: two, zoom: 0.3}]\n")
    run = fan.theatre.verify_play(play).run
    t = np.arange(0.0, 3.4, 0.1)
    geometry = run_geometry(play.marionette, run.resample(t))
    options = PictureOptions.resolve(view=(0.0, 10.0), size=(320, 240), look="stage")
    frames = Frames(geometry, options, follow=False, shots=shown)
    viewport = frames.layout.viewport
    ball = play.marionette.link_index("two.ball")

    seen = np.array(
        [
            camera.project(geometry.poses[k, ball, :, 3], viewport)[:2] - viewport.centre
            for k, camera in enumerate(frames.cameras)
        ]
    )
    assert abs(seen[10, 0]) > 30.0
    # Afterwards it hops up and down, and the camera keeps its height.
    assert np.abs(seen[22:, 0]).max() < 2.0
    assert np.abs(seen[22:, 1]).max() < 0.1 * viewport.height


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ("{at: tow}", "no player, prop, mark or obstacle is called 'tow'; did you mean 'two'"),
        ("{at: [one, block]}", "found 'block' with others; needed: players and props, or one"),
        ("{from: front}", "needed: an angle, or audience, left, back, right"),
        ("{from: audiense}", "did you mean 'audience'"),
        ("{above: 89 deg}", "found `above: 89 deg`; needed: -80 to 80 deg"),
        ("{zoom: 0}", "needed: a number from 0.001 to 1000"),
        ("{when: helo.top}", "did you mean 'hello.top'"),
        ("{when: hello.tip}", "hello has no mark 'tip'"),
        ("{when: 99999}", "an act lasts 30 minutes at most"),
        ("{over: -1}", "found -1"),
        ("{too: one}", "this key is not known"),
    ],
)
def test_a_wrong_shot_is_reported_with_its_line(tmp_path, line, text):
    path = write_play(tmp_path, NAMED, f"    camera:\n      - {line}\n")
    with pytest.raises(fan.errors.FileError) as caught:
        check_play(path)
    (mistake,) = caught.value.mistakes
    assert text in mistake.message and mistake.line == 17


def test_a_shot_cannot_wait_for_a_later_act(tmp_path):
    cues = (
        NAMED
        + "    camera: [{when: late.top}]\n"
        + ("  - act: Second\n    cues:\n      - {who: one, does: hop.yaml, name: late}\n")
    )
    with pytest.raises(fan.errors.FileError, match="waits for late on line 19, a cue of a later"):
        check_play(write_play(tmp_path, cues))
