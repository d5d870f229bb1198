"""What is performed on a page, without the page: scores, GO, gestures that repeat."""

from __future__ import annotations

from itertools import count
from types import SimpleNamespace

import pytest
from tests.show.browser import until

import fantoccini as fan
from fantoccini.app.live import stage as stage_module
from fantoccini.app.live.stage import Stage
from fantoccini.app.live.watched_file import INTERVAL

pytestmark = pytest.mark.medium

SCORE = """\
score: short
tempo: 60
lanes: {head: [{gesture: nod, at: 1}]}
waits: {curtain: {at: 0}}
"""


@pytest.fixture
def made(tmp_path):
    """A stage with a score."""
    file = tmp_path / "short.yaml"
    file.write_text(SCORE, encoding="utf-8")
    performance = fan.Performance(fan.puppets.marionette())
    stage = Stage(performance, tmp_path, score=file)
    yield SimpleNamespace(stage=stage, performance=performance, file=file)
    stage.finish()


def test_go_begins_a_score_also_one_that_waits_at_once_or_has_ended(made):
    made.stage.go()
    made.performance.advance(1.0)
    assert made.performance.score.t > 0.5
    made.stage.seek(made.stage.score.duration)
    made.performance.advance(1.0)
    assert made.performance.score.conductor.done
    made.stage.go()
    made.performance.advance(1.5)
    assert 0.0 < made.performance.score.t < made.stage.score.duration


def test_one_beat_a_second_is_a_tempo(made):
    assert made.stage.score.tempo == made.stage.gesture_player.tempo.bpm == 60.0
    made.file.write_text(SCORE.replace("tempo: 60\n", ""), encoding="utf-8")
    assert fan.load_score(made.performance.marionette, made.file).tempo is None


def test_a_button_ends_what_it_repeats_though_mirrored_has_changed(made):
    gesture_player = made.stage.gesture_player
    gesture_player.options.again = gesture_player.options.mirrored = True
    gesture_player.press("wave")
    made.performance.advance(0.2)
    gesture_player.options.mirrored = False
    gesture_player.press("wave")
    assert gesture_player.playing == ("wave, mirrored",)
    made.performance.advance(gesture_player.gestures["wave"].duration + 2.0)
    assert gesture_player.playing == ()


def test_a_score_goes_on_with_a_puppet_that_was_saved(made):
    made.stage.go()
    made.performance.advance(1.0)
    t = made.performance.score.t
    assert made.stage.replace(fan.puppets.marionette()) == ()
    assert made.performance.score.t == t and made.performance.score.running
    assert made.stage.score.marionette is made.performance.marionette
    lost = made.stage.replace(fan.puppets.crane())
    assert "the score ended" in lost and made.performance.score is None


def test_a_score_read_for_the_puppet_before_is_read_again(made, monkeypatch):
    read = stage_module.load_score

    def slow(marionette, path):
        if marionette is first:
            made.performance.replace(second)
        return read(marionette, path)

    first, second = made.performance.marionette, fan.puppets.marionette()
    monkeypatch.setattr(stage_module, "load_score", slow)
    made.file.write_text(SCORE.replace("nod", "shake"), encoding="utf-8")
    looks, found = count(INTERVAL, INTERVAL), []
    until(lambda: found.append(made.stage.poll(next(looks))) or found[-1] is not None, "a score")
    assert found[-1] == ()
    assert made.stage.score.marionette is second
    assert made.stage.score.cues[0].gesture == "shake"
