"""Plays in which a player sits down and stands up again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.theatre.plays.sitting import sit

pytestmark = [pytest.mark.slow, pytest.mark.long]

PLAY = """\
play: rest
tempo: 100
stage:
  marks: {{west: {{at: [0, 0.6], facing: right}}, east: {{at: [0, -1.2], facing: left}}}}
  obstacles: [{obstacles}]
cast: {{pierrot: {{at: west}}{cast}}}
props: {{{props}}}
acts:
  - act: One
    cues:
{cues}
"""
CHAIR = "chair: {{at: {at}, facing: {facing}}}"
BENCH = "{{name: bench, type: box, size: [0.2, 0.2, {h}], at: [0.5, -0.1, {z}]}}"
SITS = "{who: pierrot, sits on: SEAT}"
WAVES = "{who: pierrot, does: wave, how: timidly}"
STANDS = "{who: pierrot, stands up from: SEAT, after: 1}"
BOWS = "{who: pierrot, does: bow}"


def compiled_play(
    folder: Path,
    *cues: str,
    seat: str = "chair",
    props: str = "",
    obstacles: str = "",
    cast: str = "",
) -> fan.theatre.Play:
    path = folder / "rest.yaml"
    lines = "\n".join(f"      - {cue.replace('SEAT', seat)}" for cue in cues)
    path.write_text(
        PLAY.format(cues=lines, props=props, obstacles=obstacles, cast=cast), encoding="utf-8"
    )
    return fan.load_play(path)


def check_sits(play: fan.theatre.Play) -> None:
    """Nothing is refused or touches, the trunk is upright, and the feet are on the floor."""
    assert not play.changes
    verification = fan.theatre.verify_play(play)
    assert verification.faults == ()
    run, stage = verification.run, play.marionette
    cues = {cue.name: cue for cue in play.cues}
    k = int(np.searchsorted(run.t, cues["sit"].end))
    poses = stage.poses(run.q_D[k : k + 1], run.q_K[k : k + 1])[0]
    places = {
        name: poses[stage.link_index(name)]
        for name in ("torso", "thigh_left", "thigh_right", "shin_left", "shin_right")
    }
    # The trunk leans back by less than 25 degrees; -z of a thigh or shin is along it.
    assert places["torso"][2, 2] > np.cos(np.radians(25.0))
    for side in ("left", "right"):
        assert abs(places[f"thigh_{side}"][2, 2]) < np.sin(np.radians(30.0))
        assert places[f"shin_{side}"][2, 2] > np.cos(np.radians(40.0))


def test_she_sits_on_a_chair_waves_stands_up_and_bows(tmp_path):
    props = CHAIR.format(at="[0.1, -0.2]", facing="audience")
    check_sits(compiled_play(tmp_path, SITS, WAVES, STANDS, BOWS, props=props))


@pytest.mark.parametrize("facing", ["left", "back"])
def test_she_sits_wherever_a_chair_stands(tmp_path, facing):
    props = CHAIR.format(at="[0.3, -0.4]", facing=facing)
    check_sits(
        compiled_play(tmp_path, SITS, WAVES, STANDS, "{who: pierrot, walks to: west}", props=props)
    )


def test_she_comes_up_to_a_chair_head_on_and_sits_twice(tmp_path):
    path = tmp_path / "twice.yaml"
    path.write_text("""
play: twice
cast: {pierrot: {at: [0.5, 0]}}
props: {chair: {at: [-0.1, 0], facing: audience}}
acts:
  - act: One
    cues:
      - {who: pierrot, sits on: chair}
      - {who: pierrot, stands up from: chair, after: 1}
      - {who: pierrot, sits on: chair, name: again}
      - {who: pierrot, stands up from: chair, after: 1, name: up}
""")
    check_sits(fan.load_play(path))


@pytest.mark.parametrize("height", [0.13, 0.16])
def test_she_sits_on_an_obstacle(tmp_path, height):
    bench = BENCH.format(h=height, z=height / 2)
    check_sits(compiled_play(tmp_path, SITS, WAVES, STANDS, BOWS, seat="bench", obstacles=bench))


def reasons(play: fan.theatre.Play) -> str:
    return "\n".join(map(str, play.changes))


def test_a_sitting_player_does_not_walk_and_her_seat_is_taken(tmp_path):
    play = compiled_play(
        tmp_path,
        SITS,
        "{who: pierrot, walks to: west}",
        "{who: columbine, sits on: chair}",
        props=CHAIR.format(at="[0.1, -0.2]", facing="audience"),
        cast=", columbine: {at: east}",
    )
    assert len(play.changes) == 2
    assert "pierrot sits on chair; needed before: `stands up from`" in reasons(play)
    assert "columbine: sits on chair cannot be done: pierrot sits on chair" in reasons(play)


def test_standing_up_needs_the_seat_of_the_player(tmp_path):
    props = CHAIR.format(at="[0.1, -0.2]", facing="audience")
    play = compiled_play(tmp_path, BOWS, STANDS, props=props)
    assert len(play.changes) == 1
    assert "pierrot does not sit on chair, but stands" in reasons(play)


def test_a_seat_is_neither_too_high_nor_too_low(tmp_path):
    bench = BENCH.format(h=0.2, z=0.1)
    play = compiled_play(tmp_path, SITS, seat="bench", obstacles=bench)
    assert len(play.changes) == 1
    assert "m below the pelvis; needed: 0.09 to 0.18 m" in reasons(play)


def test_standing_up_reverses_sitting_down():
    puppet = fan.puppets.marionette()
    sitting = sit(puppet, "", "seat", 0.14)
    (down, still), (up, rates) = sitting.down.ends[0], sitting.up.ends[0]
    assert np.array_equal(down, np.zeros_like(down))
    assert still == pytest.approx(up, abs=1e-12)
    assert rates == pytest.approx(np.zeros_like(rates), abs=1e-12)
    assert np.max(np.abs(still)) > 0.05
