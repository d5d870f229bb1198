"""Compiled plays: cues in time and on their marks, impossible cues, and cached results."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.optimize import brentq

import fantoccini as fan
from fantoccini.dynamics.clearance import Clearance
from fantoccini.theatre.cast.companies import Meeting
from fantoccini.theatre.plays.placing import IN_TIME
from fantoccini.theatre.plays.touching import HANDLING_DISTANCE, find_touches
from plays.conftest import HEAD, Plays
from plays.tiny import TOUCHING_CUES, write_play

pytestmark = [pytest.mark.slow, pytest.mark.long]


def refusals(play: fan.theatre.Play) -> list[str]:
    """Reasons why cues are refused."""
    return [cue.refused for cue in play.cues if cue.refused]


def test_a_play_is_performed_as_written(plays: Plays):
    play = plays.compile("""
        {who: pierrot, walks to: centre, facing: left, says: Good evening}
        {who: columbine, does: wave, on: {second: 5}}
        {who: columbine, looks at: pierrot, when: pierrot arrives + 2}
        {who: [pierrot, columbine], does: nod, after: 1, name: both}
    """)
    assert play, play.changes
    walk, wave, look, nods = play.cues
    xy, heading = play.walks["pierrot"][-1].footing(np.array([walk.end]))
    assert np.allclose(xy[0], [0.3, 0.1], atol=1e-9)
    assert abs(heading[0] - 0.5 * np.pi) < 1e-9
    assert look.start == pytest.approx(walk.end + 2 * 0.6, abs=1e-9)
    assert nods.start >= max(look.end, walk.end) + 0.6 - 1e-9
    assert [str(caption) for caption in play.score.captions] == ["pierrot: Good evening"]
    verification = fan.theatre.verify_play(play)
    assert verification, verification.faults
    assert {cue_time.cue.number for cue_time in verification.cues} == {1, 2, 3, 4}
    # The limb turns on the beat: its hand leads by its lag.
    (wave_time,) = [cue_time for cue_time in verification.cues if cue_time.cue is wave]
    assert wave_time.is_limb_time
    assert abs(wave_time.observed - 5 * 0.6) <= IN_TIME
    assert wave.marks["columbine"]["second"] < 5 * 0.6 - IN_TIME


def test_hands_keep_their_bounds_and_their_space(plays: Plays):
    play = plays.compile("{who: all, walks to: centre, near: 1, past: [[0.6, 0]]}")
    verification = fan.theatre.verify_play(play)
    assert verification, verification.faults
    for speed, max_speed, acceleration, max_acceleration in verification.peaks.values():
        assert speed <= max_speed * 1.002
        assert acceleration <= max_acceleration * 1.002
    (x0, x1), (y0, y1) = verification.space
    assert x0 >= -1.0
    assert x1 <= 1.0
    assert y0 >= -1.2
    assert y1 <= 1.2


@pytest.mark.parametrize(
    ("cues", "reason"),
    [
        ("{who: pierrot, walks to: far}", "outside of the hands' space; the nearest place"),
        ("{who: pierrot, walks to: table_side}", "table is there; the nearest place"),
        ("{who: pierrot, walks to: columbine}", "columbine stands there"),
        ("{who: pierrot, walks to: west}\n{who: pierrot, does: wave, when: 0, name: w}", ""),
        ("{who: pierrot, does: nod}\n{who: pierrot, does: bow, when: 1}", "(`may wait: "),
        ("{who: pierrot, walks to: centre, on: {arrives: 2}}", "cannot arrive before"),
        ("{who: pierrot, exits to: centre}\n{who: pierrot, does: nod}", "is off the stage"),
        ("{who: pierrot, points at: [0, 0.6, 3]}", "hand cannot point there"),
        ("{who: columbine, does: bow, larger: 30}", "times slower it can be done"),
        # A wave continues in one heading.
        (
            "{who: pierrot, does: wave, larger: 0.5}\n{who: pierrot, turns to: right, when: 1}",
            "cannot begin before beat",
        ),
        ("{who: pierrot, does: nod}\n{who: pierrot, does: nod, when: 1, name: n}", "may wait"),
        ("{who: pierrot, does: wave, on: {second: 0.2}}", "cannot begin before beat 0.0"),
        ("{who: pierrot, walks to: [-0.5, 0.1], when: 0, past: [table]}", "table is there"),
    ],
)
def test_a_cue_that_cannot_be_done_is_named_and_the_rest_is_played(
    plays: Plays, cues: str, reason: str
):
    play = plays.compile(cues + "\n{who: columbine, does: nod, name: last}")
    reasons = refusals(play)
    if reason:
        assert len(reasons) == 1
        assert reason in reasons[0]
        (cue,) = [cue for cue in play.cues if cue.refused]
        (change,) = play.changes
        assert change.line == cue.line
        assert "cannot be done: " in change.message
    else:
        assert not reasons
    assert not play.cues[-1].refused
    verification = fan.theatre.verify_play(play)
    assert verification, verification.faults


def test_optional_cues_are_left_out(plays: Plays):
    play = plays.compile("""
        {who: pierrot, walks to: far, optional: true}
        {who: pierrot, does: nod}
    """)
    assert play.cues[0].refused
    assert not play.refused
    assert "is left out: " in play.changes[0].message


def test_a_place_may_be_adjusted(plays: Plays):
    play = plays.compile("{who: pierrot, walks to: table_side, near: 50 cm}")
    assert play, play.changes
    xy, _ = play.walks["pierrot"][-1].footing(np.array([play.duration]))
    assert 0.1 < abs(complex(*xy[0]) - complex(-0.5, 0.5)) <= 0.5


def test_a_wave_continues_during_a_walk(plays: Plays):
    play = plays.compile("""
        {who: pierrot, walks to: [0.6, 0.6]}
        {who: pierrot, does: wave, mirrored: true, when: 2}
    """)
    assert play, play.changes
    assert set(play.score.lanes) == {"pierrot", "pierrot 2", "columbine"}
    assert play.cues[0].start < play.cues[1].start < play.cues[1].end < play.cues[0].end + 4.0
    assert fan.theatre.verify_play(play)


def test_all_stand_when_a_show_waits(plays: Plays):
    play = plays.compile("""
        {who: pierrot, walks to: centre}
        {who: columbine, does: nod}
        {who: columbine, does: wave, go: true, name: after_go}
    """)
    assert play, play.changes
    (wait,) = play.score.waits
    assert wait.t == pytest.approx(play.cues[0].end)
    assert np.max(np.abs(play.score.offsets(wait.t)[1])) < 1e-6


def test_acts_begin_after_the_end_of_the_previous_act(plays: Plays):
    acts = """
acts:
  - act: one
    cues: [{who: pierrot, does: wave}, {who: columbine, does: nod}]
  - act: two
    after: 2
    cues: [{who: columbine, does: nod, when: 1, name: second}]
"""
    play = fan.load_play(plays.write(acts))
    assert play.acts["two"] == pytest.approx(play.cues[0].end + 1.2)
    assert play.cues[2].start == pytest.approx(play.acts["two"] + 0.6)
    assert play.when(play.cues[2].start).startswith("two, beat 1.0")


CUES = """
{who: pierrot, walks to: centre}
{who: columbine, does: march, on: {left: 5}}
{who: pierrot, does: nod}
{who: columbine, does: clap, how: timidly, name: clapping}
"""


def test_the_same_play_is_the_same_to_the_bit(plays: Plays):
    first, second = plays.compile(CUES), plays.compile(CUES)
    assert np.array_equal(first.score.gesture.coef, second.score.gesture.coef)
    assert np.array_equal(
        fan.theatre.verify_play(first).run.q_D, fan.theatre.verify_play(second).run.q_D
    )


def test_a_changed_play_uses_the_cache_and_equals_a_new_one(plays: Plays):
    first = plays.compile(CUES)
    n_computed = first.cache.n_computed
    changed_cues = CUES.replace("how: timidly", "how: smaller")
    cached = plays.compile(changed_cues, before=first)
    uncached = plays.compile(changed_cues)
    assert np.array_equal(cached.score.gesture.coef, uncached.score.gesture.coef)
    assert cached.cache is first.cache
    assert cached.cache.n_computed - n_computed < 0.6 * uncached.cache.n_computed


def run_of_neighbours(run: fan.Trajectory, y: float, x: float = 0.0) -> fan.Trajectory:
    """A run in which columbine copies pierrot, beside him and ahead of him [m]."""
    table, q_D, q_K = run.coordinates, np.array(run.q_D), np.array(run.q_K)
    for q, names in ((q_D, table.q_D), (q_K, table.q_K)):
        pierrot_indices = [i for i, name in enumerate(names) if name.startswith("pierrot.")]
        columbine_indices = [
            names.index(names[i].replace("pierrot.", "columbine.")) for i in pierrot_indices
        ]
        q[:, columbine_indices] = q[:, pierrot_indices]
        for part, offset in ((".x", x), (".y", y)):
            q[:, [i for i in columbine_indices if names[i].endswith(part)]] += offset
    return dataclasses.replace(run, q_D=q_D, q_K=q_K)


AHEAD = 0.04
"""Distance of their arms' strings where their arms meet [m]."""


def test_players_may_be_near_only_while_they_handle_a_prop(plays: Plays):
    play = plays.compile("{who: pierrot, does: nod}")
    run, clearance = fan.theatre.verify_play(play).run, Clearance(play.marionette, strings=False)
    still_run = dataclasses.replace(run, q_D=run.q_D[[0] * len(run)], q_K=run.q_K[[0] * len(run)])

    def distance_error(y: float, wanted: float) -> float:
        neighbours = run_of_neighbours(still_run, y, AHEAD)
        return float(clearance.at(neighbours.q_D[0], neighbours.q_K[0])) - wanted

    near_run, nearer_run = (
        run_of_neighbours(
            still_run, brentq(distance_error, 0.1, 0.5, args=(wanted_distance,)), AHEAD
        )
        for wanted_distance in (3.0 * HANDLING_DISTANCE, 0.5 * HANDLING_DISTANCE)
    )

    def touch_times(run: fan.Trajectory, begin: float, end: float) -> list[float]:
        meeting = Meeting(begin, end, ("pierrot", "columbine"), (), frozenset(), "given")
        return [touch.t for touch in find_touches(play.cast, run, [meeting])]

    end = float(run.t[-1])
    assert not touch_times(near_run, 0.0, end)
    assert min(touch_times(near_run, 0.0, 1.0)) == pytest.approx(1.0, abs=0.03)
    assert min(touch_times(nearer_run, 0.0, end)) == 0.0
    # A persisting touch is reported once, for any other beginnings and ends.
    assert touch_times(nearer_run, 0.5, 1.0) == touch_times(nearer_run, 0.0, end)


def test_touches_of_forced_cues_are_reported(plays: Plays):
    """Two runs of players in one place: touches of bodies and of strings are found."""
    play = plays.compile("{who: pierrot, does: nod}")
    found_touches = find_touches(
        play.cast, run_of_neighbours(fan.theatre.verify_play(play).run, 0.15)
    )
    kinds = {("string" in touch.first, "string" in touch.second) for touch in found_touches}
    assert (False, False) in kinds
    assert any("string" in touch.first for touch in found_touches)
    assert all(touch.t == 0.0 for touch in found_touches if touch.distance < 0.0)


def test_gestures_of_the_same_strings_follow_the_last_of_them(plays: Plays):
    play = plays.compile("""
        {who: pierrot, does: nod}
        {who: pierrot, does: wave, repeat: 2, when: 0}
        {who: pierrot, does: bow, when: 1, may wait: 30}
    """)
    assert play, play.changes
    nod, wave, bow = play.cues
    assert nod.end < wave.end
    assert bow.start >= wave.end - 1e-9


def test_a_turn_waits_for_the_end_of_a_wave(plays: Plays):
    play = plays.compile("""
        {who: pierrot, does: wave}
        {who: pierrot, turns to: right, when: 1, may wait: 20}
    """)
    assert play, play.changes
    assert play.cues[1].start >= play.cues[0].end - 1e-9


def test_later_cues_wait_for_a_go(plays: Plays):
    play = plays.compile("""
        {who: columbine, does: clap}
        {who: columbine, does: nod, go: true}
        {who: pierrot, walks to: centre}
        {who: pierrot, does: nod, when: 1, name: too_early}
    """)
    (reason,) = refusals(play)
    assert "before the GO of line" in reason
    (wait,) = play.score.waits
    assert np.max(np.abs(play.score.offsets(wait.t)[1])) < 1e-6
    assert fan.theatre.verify_play(play)


def test_the_cue_after_a_refused_one_waits_for_the_previous_one(plays: Plays):
    play = plays.compile("""
        {who: pierrot, does: nod, repeat: 3}
        {who: pierrot, does: nod, when: 2, name: refused}
        {who: pierrot, does: clap}
    """)
    assert play.cues[1].refused
    assert play.cues[2].start >= play.cues[0].end - 1e-9


def test_a_walk_with_a_wait_is_late(plays: Plays):
    cues = """
        {who: columbine, walks to: [0, 0.05], when: 0}
        {who: pierrot, walks to: [0.7, -0.7], when: 0, may wait: 20}
    """
    play = plays.compile(cues)
    assert play, play.changes
    run = fan.theatre.verify_play(play).run
    for cue in play.cues:
        names = [f"{cue.who[0]}.shoulder_left.{part}" for part in "xy"]
        path_length = sum(np.abs(run[name] - run[name][0]) for name in names)
        start_time = float(run.t[np.argmax(path_length > 1e-6)])
        assert start_time == pytest.approx(cue.start, abs=0.1)


def test_leaving_players_are_obstacles_until_they_have_left(plays: Plays):
    play = plays.compile("""
        {who: columbine, exits to: [0.6, 0.6], when: 0}
        {who: pierrot, walks to: [0.3, -0.6], when: 0, may wait: 30}
    """)
    assert play, play.changes
    assert fan.theatre.verify_play(play)


def test_compiling_stops_in_time_with_a_partial_result(tmp_path):
    path = write_play(tmp_path, TOUCHING_CUES)
    complete, stopped = fan.load_play(path), fan.load_play(path, within=0.0)
    assert complete.rounds > 1 and stopped.rounds == 1
    stop_message = "compiling was stopped after 1 round"
    assert any(stop_message in str(remark) for remark in stopped.deviations)
    assert not any(stop_message in str(remark) for remark in complete.deviations)
    assert any("would be" in str(remark) for remark in stopped.deviations)  # touches are reported
    assert [cue.description for cue in stopped.cues] == [cue.description for cue in complete.cues]
    assert stopped.duration > 0.0


def test_an_edited_puppet_is_read_again(plays: Plays):
    text = (fan.puppets.path("marionette")).read_text()
    (plays.folder / "mine.yaml").write_text(text)
    head = HEAD.replace("pierrot: {at: west}", "pierrot: {at: west, puppet: mine.yaml}")
    acts = "acts: [{act: one, cues: [{who: pierrot, does: nod}]}]"
    first = fan.load_play(plays.write(acts, head))
    (plays.folder / "mine.yaml").write_text(text.replace("density: 1500", "density: 2500"))
    cached = fan.load_play(plays.write(acts, head), before=first)
    uncached = fan.load_play(plays.write(acts, head))
    first_run, second_run = (
        fan.theatre.verify_play(cached).run,
        fan.theatre.verify_play(uncached).run,
    )
    assert np.array_equal(first_run.q_D, second_run.q_D)
    assert not np.array_equal(first_run.q_D, fan.theatre.verify_play(first).run.q_D)
