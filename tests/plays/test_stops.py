"""Reports with line and player: stopped runs, timeouts, and impossible cues."""

from __future__ import annotations

import dataclasses
import time
from pathlib import Path

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base import Progress
from fantoccini.theatre.cast.result_cache import OutOfTime, ResultCache
from fantoccini.theatre.plays import check_play, compiling, runs
from plays.conftest import Plays
from plays.tiny import TOUCHING_CUES, write_play

pytestmark = pytest.mark.medium

TWO_HOPS_OF_ONE = """\
      - {who: one, does: hop.yaml, when: 0.5}
      - {who: one, does: hop.yaml, when: 3, name: again}
      - {who: two, does: hop.yaml, when: 1, name: other}
"""


def make_simulate_fail(monkeypatch, fails_for, error: Exception) -> None:
    """Make the simulator raise an error for certain marionettes, states and methods."""
    real_simulate = runs.simulate

    def simulate(marionette, x, inputs, **options):
        if fails_for(x, inputs, options):
            raise error
        return real_simulate(marionette, x, inputs, **options)

    monkeypatch.setattr(runs, "simulate", simulate)


ERRORS = [
    fan.errors.StateError("hold is at its bound and moves past it"),
    fan.errors.SimulationError(fan.Status.NOT_SETTLED),
    ValueError("t_end is 0; it must be later than the start"),
    ZeroDivisionError("division by zero"),
]


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_an_error_of_the_simulator_refuses_its_cue_and_the_rest_is_played(
    tmp_path, monkeypatch, error
):
    """Regression: it ended the whole play, without line, player and cue."""
    path = write_play(tmp_path, TWO_HOPS_OF_ONE)
    make_simulate_fail(monkeypatch, lambda x, inputs, _: is_second_hop(x, inputs), error)
    play = fan.load_play(path)
    (change,) = play.changes
    assert change.line == play.cues[1].line == 15
    assert change.message.startswith("one: hop.yaml cannot be done: one's run stops on beat 3.0")
    assert str(error) in change.message
    assert [bool(cue.refused) for cue in play.cues] == [False, True, False]
    verification = fan.theatre.verify_play(play)
    assert verification, verification.faults


def is_second_hop(x: fan.State, inputs: fan.Input) -> bool:
    """Whether this is the second hop of a player, with 2 s until the end; the first has 2.5 s."""
    length = x.coordinates.q_K.index("hold.length")
    rise = float(np.abs(inputs.evaluate(0.25)[0] - inputs.evaluate(0.0)[0])[length])
    return x["hold.y"] < 0.0 and rise > 1e-3 and inputs.end < 2.2


def test_an_error_at_the_start_is_reported_with_player_and_line(tmp_path, monkeypatch):
    path = write_play(tmp_path)
    error = fan.errors.StateError("nothing can begin here")
    make_simulate_fail(monkeypatch, lambda x, *_: x["hold.y"] < 0.0, error)
    with pytest.raises(
        fan.errors.FileError, match=r"tiny.yaml:9: cast.one: one's run stops at the star"
    ):
        fan.load_play(path)


def test_an_error_in_the_verification_is_a_fault_with_line_player_and_cue(tmp_path, monkeypatch):
    play = fan.load_play(write_play(tmp_path, TWO_HOPS_OF_ONE))
    play = dataclasses.replace(play, cache=ResultCache())
    make_simulate_fail(monkeypatch, lambda x, inputs, _: is_second_hop(x, inputs), ERRORS[0])
    verification = fan.theatre.verify_play(play)
    assert not verification
    (fault,) = [message for message in verification.faults if "run stops" in message]
    assert fault.startswith("line 15: one: hop.yaml: one's run stops in First <act>, beat 3.0")
    assert verification.run.status is not fan.Status.DONE
    make_simulate_fail(monkeypatch, lambda x, inputs, _: x["hold.y"] < 0.0, ERRORS[0])
    play = dataclasses.replace(play, cache=ResultCache())
    with pytest.raises(
        fan.errors.FileError, match=r"tiny\.yaml:9: cast\.one: line 14: one: hop\.yaml: "
    ):
        fan.theatre.verify_play(play)


def test_a_play_out_of_time_is_that_of_its_last_complete_round(tmp_path, monkeypatch):
    """Regression: it stopped only between rounds, of any duration."""
    path = write_play(tmp_path, TOUCHING_CUES)
    real_simulate, start_time = runs.simulate, time.monotonic()
    call_times = []

    def slowly(*arguments, progress, **options):
        call_times.append(time.monotonic() - start_time)
        if len(call_times) <= 4:
            return real_simulate(*arguments, progress=progress, **options)
        while True:  # a run that never ends
            time.sleep(0.01)
            progress(Progress())

    monkeypatch.setattr(runs, "simulate", slowly)
    play = fan.load_play(path, within=1.0)
    seconds = time.monotonic() - start_time
    assert seconds < 10.0
    (remark, *_) = play.remarks
    assert "compiling was stopped after 1 round" in str(remark)
    assert play.counts.startswith("2 of 2 cues can be done, ")
    assert play.duration > 0.0 and not play
    assert play.cache.deadline == np.inf


def test_a_verification_out_of_time_measures_its_partial_run(tmp_path, monkeypatch):
    play = fan.load_play(write_play(tmp_path))

    def stopped(self, *, exact=False):
        if exact:
            raise OutOfTime
        return real_runs(self)

    real_runs = type(play).runs
    monkeypatch.setattr(type(play), "runs", stopped)
    verification = fan.theatre.verify_play(play, within=3.0)
    assert not verification
    assert "the time limit passed after 3 s" in verification.faults[0]
    assert verification.run.t[-1] == pytest.approx(play.duration)
    monkeypatch.undo()
    assert fan.theatre.verify_play(play, within=0.0)  # all is cached


def test_nothing_is_computed_after_the_time_limit():
    cache = ResultCache()
    assert cache.get("a", lambda: 1) == 1
    with cache.time_limit(time.monotonic() - 1.0):
        assert cache.get("a", lambda: 2) == 1
        with pytest.raises(OutOfTime):
            cache.get("b", lambda: 2)
    assert cache.get("b", lambda: 2) == 2


IMPOSSIBLE_CUES = {
    "walks": ("{who: one, walks to: there}", "acts[0].cues[0]['walks to']: one cannot do"),
    "enters": ("{who: one, enters to: there}", "acts[0].cues[0]['enters to']: one cannot do"),
    "exits": ("{who: one, exits to: there}", "acts[0].cues[0]['exits to']: one cannot do"),
    "turns": ("{who: one, turns to: back}", "acts[0].cues[0]['turns to']: one cannot do"),
    "looks": ("{who: two, looks at: one}", "acts[0].cues[0]['looks at']: two cannot do `looks at`"),
    "points": ("{who: all, points at: [1, 0, 1]}", "acts[0].cues[0]['points at']: one cannot do"),
    "mirrored": ("{who: one, does: hop.yaml, mirrored: true}", None),
}


@pytest.mark.parametrize(("cue", "message"), IMPOSSIBLE_CUES.values(), ids=IMPOSSIBLE_CUES)
def test_check_refuses_cues_that_a_puppet_cannot_do(tmp_path, cue, message):
    """Regression: players without legs walked, and players without a head looked."""
    path = write_play(tmp_path, f"      - {cue}\n")
    if message is None:
        assert check_play(path).play == "tiny"
        return
    with pytest.raises(fan.errors.FileError) as error:
        check_play(path)
    assert f"{path}:14: {message}" in str(error.value)
    assert "has no body map" in str(error.value)
    # When compiled, the cue is left out, and the rest is played.
    play = fan.load_play(path)
    assert len(play.refused) == 1 and play.refused[0].line == 14
    optional = cue.replace("}", ", optional: true}")
    assert check_play(write_play(tmp_path, f"      - {optional}\n"))


SEATS_AND_PROPS = {
    "sits": ("{who: two, sits on: block}", "sits on", "two"),
    "rises": ("{who: two, stands up from: block}", "stands up from", "two"),
    "gives": ("{who: one, gives: bag, to: two}", "gives", "one"),
    "takes up": ("{who: two, picks up: bag}", "picks up", "two"),
}


@pytest.mark.parametrize(("cue", "verb", "who"), SEATS_AND_PROPS.values(), ids=SEATS_AND_PROPS)
def test_check_names_the_player_without_the_bodies_for_a_seat_or_a_prop(tmp_path, cue, verb, who):
    """Regression: it named pairs of contact, at the line of the stage."""
    props = (
        "props:\n  bag: {shapes: [{type: box, size: [0.05, 0.05, 0.05]}], mass: 0.1, at: [1, 0]}\n"
    )
    for text in (cue, cue.replace("}", ", optional: true}")):
        path = write_play(tmp_path, f"      - {text}\n", props)
        with pytest.raises(fan.errors.FileError) as error:
            check_play(path)
        message = f"{path}:14: acts[0].cues[0]['{verb}']: {who} cannot do `{verb}`: bob.yaml: "
        assert message in str(error.value).replace("cues[0].gives", "cues[0]['gives']")
        assert "has no body map" in str(error.value) and "contact.pairs" not in str(error.value)


def test_check_names_the_player_without_a_forearm_who_holds_a_prop(tmp_path):
    path = write_play(tmp_path, extra_keys="props:\n  ball: {held by: one}\n")
    with pytest.raises(fan.errors.FileError) as caught:
        check_play(path)
    assert "props.ball['held by']: one cannot hold it: bob.yaml: " in str(caught.value)
    assert "has no body map" in str(caught.value)


def test_check_refuses_a_gesture_that_cannot_be_mirrored(tmp_path):
    path = write_play(tmp_path, "      - {who: one, does: lean.yaml, mirrored: true}\n")
    lean = "gesture: lean\nmoves: {arm_left.length: [[0, 0], [1, 1 cm]]}\n"
    (tmp_path / "lean.yaml").write_text(lean)
    ball = (tmp_path / "bob.yaml").read_text().replace("hold", "arm_left")
    (tmp_path / "bob.yaml").write_text(ball)
    with pytest.raises(
        fan.errors.FileError, match=r"tiny.yaml:14: acts\[0\].cues\[0\].does: .*arm_right"
    ):
        check_play(path)
    assert check_play(replace_in_play(path, "mirrored: true", "how: twice"))


def replace_in_play(path: Path, old: str, new: str) -> Path:
    """A play with a part of its text replaced."""
    path.write_text(path.read_text().replace(old, new))
    return path


def test_check_refuses_walks_to_impossible_places(plays: Plays):
    acts = """acts:
  - act: one
    cues:
      - {who: pierrot, walks to: far}
      - {who: pierrot, walks to: centre, past: [table]}
      - {who: columbine, walks to: far, near: 2}
      - {who: columbine, walks to: far, optional: true, name: maybe}
      - {who: columbine, walks to: pierrot, name: near_him}
"""
    path = plays.write(acts)
    with pytest.raises(fan.errors.FileError) as caught:
        check_play(path)
    first, second = str(caught.value).splitlines()
    assert "cues[0]['walks to']: pierrot cannot get there: the place is" in first
    assert "outside of the hands' space" in first
    assert "cues[1].past[0]: pierrot cannot get there: table is there" in second
    play = fan.load_play(path)
    assert [bool(cue.refused) for cue in play.cues][:3] == [True, True, False]


def test_check_simulates_nothing_for_possible_cues(plays: Plays, monkeypatch):
    monkeypatch.setattr(compiling, "make_round", None)
    acts = """acts:
  - act: one
    cues:
      - {who: pierrot, walks to: centre}
      - {who: columbine, looks at: pierrot}
      - {who: pierrot, points at: columbine}
      - {who: columbine, does: wave, mirrored: true, how: twice}
"""
    assert check_play(plays.write(acts)).play == "trial"


@pytest.mark.slow
def test_a_gesture_follows_a_walk_despite_a_catch_at_its_beginning(plays: Plays):
    """Regression: its part began with a string at its bound, and the whole play ended."""
    cues, beat = "{who: pierrot, walks to: [0, 0.3]}\n{who: pierrot, does: nod, when: 12}", 0.6
    play = plays.compile(cues)
    walk, run = play.cues[0], play.runs().players["pierrot"]
    catches = [
        event
        for event in run.events
        if event.kind == "catch"
        and 1e-4 < event.speed < 1e-2
        and walk.end + 0.5 < event.t < 12 * beat - 0.5
    ]
    assert catches
    for event in catches[:: max(1, len(catches) // 4)]:
        changed_play = plays.compile(cues.replace("12}", f"{event.t / beat!r}}}"), before=play)
        assert changed_play.cues[1].wanted == pytest.approx(event.t, abs=1e-12)
        assert not any("run stops" in str(change) for change in changed_play.changes)
        assert not changed_play.runs().stops
