"""The performing part of a page, without the page: scores, GO, repeated gestures."""

from __future__ import annotations

from itertools import count
from types import SimpleNamespace

import pytest
from tests.show.browser import until

import fantoccini as fan
from fantoccini.app.live import stage as stage_module
from fantoccini.app.live.stage import Stage
from fantoccini.app.live.watched_file import CHECK_INTERVAL

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


def test_go_begins_a_score_even_if_it_waits_or_has_ended(made):
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


def test_a_button_ends_its_gesture_after_a_change_of_mirrored(made):
    gesture_player = made.stage.gesture_player
    gesture_player.options.repeat = gesture_player.options.mirrored = True
    gesture_player.press("wave")
    made.performance.advance(0.2)
    gesture_player.options.mirrored = False
    gesture_player.press("wave")
    assert gesture_player.playing == ("wave, mirrored",)
    made.performance.advance(gesture_player.gestures["wave"].duration + 2.0)
    assert gesture_player.playing == ()


def test_a_score_continues_with_a_saved_puppet(made):
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
    times, results = count(CHECK_INTERVAL, CHECK_INTERVAL), []
    until(
        lambda: results.append(made.stage.poll(next(times))) or results[-1] is not None, "a score"
    )
    assert results[-1] == ()
    assert made.stage.score.marionette is second
    assert made.stage.score.cues[0].gesture == "shake"
