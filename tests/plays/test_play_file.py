"""Mistakes in play files are reported with their lines; the JSON Schema of play files."""

from __future__ import annotations

import jsonschema
import pytest

import fantoccini as fan
from fantoccini.base.documents.located import read_file
from fantoccini.theatre.script import is_play
from plays.conftest import HEAD, Plays

pytestmark = pytest.mark.medium

ACT = "acts:\n  - act: one\n    cues:\n      - {cue}\n"


def checked_messages(plays: Plays, cue: str, head: str = HEAD) -> list[str]:
    """Messages for the mistakes in a cue; each must name the cue's line."""
    path = plays.write(ACT.format(cue=cue), head)
    with pytest.raises(fan.errors.FileError) as caught:
        fan.load_play(path)
    line = read_file(path).lines["acts", 0, "cues", 0]
    assert [mistake.line for mistake in caught.value.mistakes] == [line] * len(
        caught.value.mistakes
    )
    return [mistake.message for mistake in caught.value.mistakes]


@pytest.mark.parametrize(
    ("cue", "expected"),
    [
        ("{who: pierrot}", "found no verb; needed: one of `does`, `walks to`"),
        ("{who: pierrot, does: wave, walks to: centre}", "found both `does` and `walks to`"),
        ("{who: pierot, does: wave}", "no player is called 'pierot'; did you mean 'pierrot'?"),
        ("{who: pierrot, does: wafe}", "did you mean 'wave'?"),
        ("{who: pierrot, does: walk}", "walk needs a place: use `walks to:`"),
        ("{who: pierrot, does: wave, how: timidely}", "did you mean 'timidly'?"),
        ("{who: pierrot, walks to: centre, how: twice}", "only `does` has `how`"),
        ("{who: pierrot, does: wave, near: 1}", "only walks have it"),
        ("{who: pierrot, does: wave, on: {high: 3}}", "wave has no mark 'high'"),
        ("{who: pierrot, does: wave, on: {up: 3}, after: 2}", "found both `on` and `when`"),
        ("{who: pierrot, does: wave, when: drums}", "needed: a time, a mark, or a moment of a cue"),
        ("{who: pierrot, does: wave, lasts: 3, faster: 2}", "found both `lasts` and `faster`"),
        ("{who: pierrot, does: wave, on: {end: 3}}", "needed: a mark, or `when`"),
        ("{who: pierrot, walks to: nowhere}", "found 'nowhere'; needed: a place [x, y]"),
        ("{who: pierrot, turns to: nowhere}", "found 'nowhere'; needed: an angle"),
        ("{who: pierrot, does: wave, facing: left}", "only walks have it"),
        ("{who: pierrot, walks to: [1, 2, 3]}", "needed: [x, y]"),
        ("{who: pierrot, does: nod, when: columbine arrives}", "columbine has no walk before"),
        ("{who: pierrot, does: nod, when: 9000}", "an act lasts 30 minutes at most"),
        ("{who: pierrot, walks to: [1]}", "needed: a mark, a player, or a place"),
        ("{who: pierrot, walks too: centre}", "this key is not known; did you mean 'walks to'?"),
    ],
)
def test_a_wrong_cue_is_reported_at_its_line(plays: Plays, cue: str, expected: str):
    messages = checked_messages(plays, cue)
    assert any(expected in message for message in messages), messages


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        ("pierrot: {at: west}", "pierrot: {at: wast}", "no mark is called 'wast'"),
        ("pierrot: {at: west}", "west: {at: west}", "is the name of a player"),
        ("pierrot: {at: west}", "left: {at: west}", "is the name of a direction"),
        ("pierrot: {at: west}", "pierrot: {at: west, puppet: pupet}", "no bundled puppet"),
        ("facing: audience", "facing: audiense", "did you mean 'audience'?"),
        ("x: [-1, 1]", "x: [1, -1]", "needed: the lower one first"),
        ("space:", "clear: 0\n  space:", "found 0"),
        ("pierrot: {at: west}", "pierrot: {at: west, puppet: arm2d}", "needed: a puppet that "),
        ("tempo: 100", "tempo: 100\nsound: [{file: a.wav, at: drums}]", "a name of `times`"),
    ],
)
def test_a_wrong_stage_or_cast_is_reported(plays: Plays, before: str, after: str, expected: str):
    path = plays.write(ACT.format(cue="{who: all, does: nod}"), HEAD.replace(before, after))
    with pytest.raises(fan.errors.FileError, match=expected.replace("?", r"\?")):
        fan.load_play(path)


def test_keys_may_be_written_with_a_space_or_an_underline(plays: Plays):
    for key in ("walks to", "walks_to"):
        path = plays.write(ACT.format(cue=f"{{who: nobody, {key}: centre}}"))
        with pytest.raises(fan.errors.FileError, match="no player is called 'nobody'"):
            fan.load_play(path)


def test_the_schema_accepts_valid_plays_and_refuses_two_verbs(plays: Plays):
    schema = fan.theatre.play_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    good = read_file(plays.write(ACT.format(cue="{who: all, walks to: centre, near: 40 cm}")))
    jsonschema.validate(good.data, schema)
    assert is_play(good.file)
    bad = read_file(plays.write(ACT.format(cue="{who: all, does: nod, walks to: centre}")))
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(bad.data, schema)


def test_circular_times_are_reported(plays: Plays):
    acts = """
acts:
  - act: one
    cues:
      - {who: pierrot, does: wave, when: nod.end}
      - {who: columbine, does: nod, when: wave.end}
"""
    with pytest.raises(fan.errors.FileError, match="waits for itself, by way of"):
        fan.load_play(plays.write(acts))


def test_a_time_of_a_later_act_is_refused(plays: Plays):
    acts = """
acts:
  - act: one
    cues: [{who: pierrot, does: wave, when: nod.end}]
  - act: two
    cues: [{who: columbine, does: nod}]
"""
    with pytest.raises(fan.errors.FileError, match="a cue of a later act"):
        fan.load_play(plays.write(acts))


def test_acts_have_names_of_their_own_and_nobody_enters_twice(plays: Plays):
    acts = """
acts:
  - act: one
    cues: [{who: pierrot, enters to: centre}]
  - act: one
    cues: [{who: pierrot, enters to: west}]
"""
    with pytest.raises(fan.errors.FileError, match="another act is called 'one'"):
        fan.load_play(plays.write(acts))
    first, second = acts.rsplit("act: one", 1)
    with pytest.raises(fan.errors.FileError, match="on the stage already"):
        fan.load_play(plays.write(f"{first}act: two{second}"))
