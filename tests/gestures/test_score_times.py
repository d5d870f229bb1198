"""Named times across lanes; holds; phrases."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base.errors import FileError

pytestmark = pytest.mark.medium

NUMBER = """\
score: number
tempo: 100
speed: 1.2
acceleration: 12
marks: {after: hello.end + 2}
lanes:
  head:
    - {gesture: nod, at: low.low + 1}
  body:
    - {gesture: bow, on: {low: after}, name: low}
    - {gesture: bow, name: again}
  arm:
    - {gesture: wave, on: {up: 4}, name: hello}
captions:
  - {at: hello.up, until: nod.second - 0.5, text: Hello}
"""
HOLDS = """\
score: holds
tempo: 60
lanes:
  body:
    - {hold: 2}
    - {gesture: sit}
    - {hold: 3, name: seated}
    - {gesture: bow}
  head:
    - {gesture: nod, at: seated.start + 1}
"""
PHRASES = """\
score: phrases
tempo: 60
speed: 2
acceleration: 20
phrases:
  hello:
    - {gesture: wave, on: {up: 1}, name: first}
    - {gesture: nod, at: first.end + 1}
    - {hold: 1}
  both: [{phrase: hello}, {gesture: bow}]
lanes:
  body:
    - {phrase: hello, at: 2, repeat: 3}
    - {phrase: both, mirrored: true, on: {low: 40}, faster: 0.9}
marks: {up: hello.up 3}
"""


def load_number(marionette, folder, text: str) -> fan.theatre.Score:
    path = folder / "number.yaml"
    path.write_text(text, encoding="utf-8")
    return fan.load_score(marionette, path)


def test_times_refer_to_cues_of_any_lane(marionette, tmp_path):
    score = load_number(marionette, tmp_path, NUMBER)
    assert score, score.changes
    nod, low, again, hello = score.cues
    assert hello.name == "hello" and hello.marks["up"] == pytest.approx(4 * 0.6)
    assert score.marks["after"] == pytest.approx(hello.end + 2 * 0.6)
    assert low.marks["low"] == pytest.approx(score.marks["after"])
    assert nod.start == pytest.approx(low.marks["low"] + 0.6) and nod.name == "nod"
    assert again.start == pytest.approx(low.end)
    (caption,) = score.captions
    assert caption.start == pytest.approx(hello.marks["up"])
    assert caption.end == pytest.approx(nod.marks["second"] - 0.3)


def test_a_delay_moves_all_cues_that_refer_to_it(marionette, tmp_path):
    text = """\
score: late
lanes:
  head: [{gesture: nod, at: bow.start}]
  body: [{gesture: sit}, {gesture: bow, at: 1.3}]
"""
    score = load_number(marionette, tmp_path, text)
    nod, _, bow = score.cues
    assert len(score.changes) == 1 and bow.start > 1.31
    assert nod.start == pytest.approx(bow.start)


def test_a_lane_rests_in_a_hold_and_continues_at_its_end(marionette, tmp_path):
    score = load_number(marionette, tmp_path, HOLDS)
    assert score, score.changes
    sit, bow, nod = score.cues
    assert sit.start == pytest.approx(2.0) and bow.start == pytest.approx(sit.end + 3.0)
    assert nod.start == pytest.approx(sit.end + 1.0)
    seated, _ = score.offsets(sit.end)
    still, rates = score.offsets(sit.end + 0.9)
    np.testing.assert_allclose(still, seated, atol=1e-12)
    np.testing.assert_allclose(rates, 0.0, atol=1e-12)
    text = HOLDS.replace("hold: 3", "hold: 0.1")
    (change,) = load_number(marionette, tmp_path, text).changes
    assert change.line == 8 and "bow begins" in str(change) and "after the hold" in str(change)


def test_holds_end_lanes_and_are_waited_for(marionette, tmp_path):
    text = "score: h\nlanes: {body: [{gesture: nod}, {hold: 4, at: 3}]}\n"
    assert load_number(marionette, tmp_path, text).duration == pytest.approx(7.0)
    text = "score: h\nlanes: {body: [{hold: 4}, {gesture: nod, at: 3}]}\n"
    (change,) = load_number(marionette, tmp_path, text).changes
    assert "nod begins at 4.00 s instead of at 3.00 s: the hold ends at 4.00 s" in str(change)


def test_a_phrase_is_played_like_a_gesture(marionette, tmp_path):
    score = load_number(marionette, tmp_path, PHRASES)
    assert score, score.changes
    hello, both = score.cues
    assert hello.gesture == "hello" and hello.start == pytest.approx(2.0)
    wave, nod = (
        fan.theatre.load_gesture(marionette, "wave"),
        fan.theatre.load_gesture(marionette, "nod"),
    )
    phrase_duration = 0.1 + wave.duration + 1.0 + nod.duration + 1.0  # its hand is up after 0.9 s
    assert hello.end - hello.start == pytest.approx(3 * phrase_duration)
    assert score.marks["up"] == pytest.approx(2.0 + 2 * phrase_duration + 1.0)
    assert both.marks["low"] == pytest.approx(40.0)
    assert both.end - both.start == pytest.approx((phrase_duration + 2.6) / 0.9)
    # Three rounds are the same motion; the mirrored one moves the left hand.
    right_y = marionette.coordinates.v_K.index("hand_right.y")
    for t in np.linspace(2.0, 2.0 + phrase_duration, 40):
        first, third = score.offsets(t)[0], score.offsets(t + 2 * phrase_duration)[0]
        np.testing.assert_allclose(first, third, atol=1e-9)
        offsets, _ = score.offsets(both.start + (t - 2.0) / 0.9)
        left_y = marionette.coordinates.v_K.index("hand_left.y")
        assert offsets[left_y] == pytest.approx(-first[right_y], abs=1e-9)


@pytest.mark.parametrize(
    ("text", "change", "line", "message"),
    [
        (NUMBER, ("low.low + 1", "lwo.low + 1"), 8, "did you mean 'low.low'"),
        (NUMBER, ("low.low + 1", "low.lowest"), 8, "low has no mark 'lowest'; did you mean 'low'"),
        (NUMBER, ("low.low + 1", "low"), 8, r"which moment of low, as in low\.low"),
        (NUMBER, ("low.low + 1", "low.low + x"), 8, "needed: a time, a mark, or a moment"),
        (NUMBER, ("low.low + 1", "hello.start - 20"), 8, "before the score"),
        (NUMBER, ("name: again", "name: low"), 11, "needed: a name of its own"),
        (NUMBER, ("name: again", "name: after"), 11, "needed: a name of its own"),
        (NUMBER, (", name: again", ", name: a.b"), 11, "a name is up to 64 letters"),
        (NUMBER, ("hello.end", "low.end"), 5, r"by way of lanes.body\[0\] \(line 10\)"),
        (NUMBER, ("hello.end + 2", "after + 2"), 5, "waits for itself"),
        (NUMBER, ("on: {low: after}", "at: again.end"), 10, r"\(line 11\)"),
        (
            NUMBER.replace(", name: low", "").replace(", name: again", ""),
            ("low.low + 1", "bow.low"),
            8,
            "2 cues play 'bow', on lines 10, 11",
        ),
        (NUMBER, ("hello.up,", "helo.up,"), 15, "did you mean 'hello.up'"),
        (HOLDS, ("hold: 2", "hold: 2, gesture: bow"), 5, "both `gesture` and `hold`"),
        (HOLDS, ("hold: 2", "hold: 2, larger: 3"), 5, "found `hold` with `larger`"),
        (HOLDS, ("hold: 2", "at: 2"), 5, "found none of them"),
        (HOLDS, ("hold: 2", "hold: -1"), 5, "from 0.001 to 1000"),
        (HOLDS, ("seated.start + 1", "seated.up"), 10, "seated has no mark 'up'"),
        (PHRASES, ("first.end + 1", "hello.up"), 8, "the names are first.end"),
        (PHRASES, ("on: {up: 1}", "on: {up: 0.2}"), 7, r"beats \(0\.70 s\) before the phrase"),
        (PHRASES, ("gesture: bow", "phrase: both"), 10, "part of itself: both -> both"),
        (PHRASES, ("phrase: hello, at", "phrase: helo, at"), 13, "did you mean 'hello'"),
        (PHRASES, ("gesture: nod", "gesture: nodd"), 8, "did you mean 'nod'"),
        (PHRASES, ("on: {low: 40}", "on: {lower: 40}"), 14, "did you mean 'low'"),
        (PHRASES, ("[{phrase: hello}, {gesture: bow}]", "[]"), 10, "at least 1 item"),
        (NUMBER, ("on: {low: after}", "on: {start: 3}"), 10, "bow has no mark 'start'"),
        (NUMBER, ("on: {up: 4}", "on: {end: 4}"), 13, "wave has no mark 'end'"),
        (NUMBER, ("on: {up: 4}", "repeat: 2, on: {up 2: 9}"), 13, "wave has no mark 'up 2'"),
    ],
)
def test_mistakes_have_places(marionette, tmp_path, text, change, line, message):
    assert change[0] in text
    with pytest.raises(FileError, match=message) as error:
        load_number(marionette, tmp_path, text.replace(*change, 1))
    assert f"number.yaml:{line}" in str(error.value)


def test_a_time_before_the_score_is_reported_once(marionette, tmp_path):
    marks = "marks: {after: hello.end - 9, later: after + 1}"
    text = NUMBER.replace("marks: {after: hello.end + 2}", marks)
    with pytest.raises(FileError) as error:
        load_number(marionette, tmp_path, text)
    assert str(error.value).count("comes") == 1


def test_a_dash_may_belong_to_a_name(marionette, tmp_path):
    text = """\
score: dash
marks: {verse-2: 3, turn: 9}
lanes:
  body: [{gesture: nod, at: verse-2}, {gesture: bow, at: turn-2}]
"""
    nod, bow = load_number(marionette, tmp_path, text).cues
    assert nod.start == pytest.approx(3.0) and bow.start == pytest.approx(7.0)


def test_an_exceeded_bound_in_a_phrase_is_reported_at_its_cue(marionette, tmp_path):
    text = PHRASES.replace("phrase: hello, at: 2", "phrase: hello, at: 2, faster: 4")
    changes = load_number(marionette, tmp_path, text).changes
    assert changes and {change.line for change in changes} == {13}


def test_nested_phrases_have_a_bounded_size(marionette, tmp_path):
    text = """\
score: big
phrases:
  many: [{gesture: nod, repeat: 200}]
  more: [{phrase: many, repeat: 1000}]
lanes: {body: [{phrase: more, repeat: 1000}]}
"""
    reason = "many would have 800000 pieces, of 100000 at most"
    with pytest.raises(FileError, match=reason) as error:
        load_number(marionette, tmp_path, text)
    assert "number.yaml:4: phrases.more[0].repeat: found 1000" in str(error.value)
