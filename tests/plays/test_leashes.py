"""Leashes of plays: drawn between two players, and never stretched."""

from __future__ import annotations

import numpy as np
import pytest
from tests.plays.conftest import HEAD, Plays
from tests.plays.tiny import CUES, write_play

import fantoccini as fan
from fantoccini.output.view.camera import Viewport
from fantoccini.output.view.compose import string_lines
from fantoccini.output.view.drawing import PictureOptions, fit_layout
from fantoccini.output.view.geometry import run_geometry
from fantoccini.theatre.plays import check_play

pytestmark = pytest.mark.slow

NEARBY = HEAD.replace("east: {at: [0, -0.6]}", "east: {at: [0, 0.1]}")
ACT = "acts:\n  - act: one\n    cues:\n"


def leash(length: float | str) -> str:
    ends = "held by: pierrot, side: left, to: columbine"
    return f"leashes:\n  lead: {{{ends}, length: {length}}}\n"


def distance(play: fan.theatre.Play, run: fan.Trajectory) -> np.ndarray:
    """(T,) distance of his hand and her neck, from poses of bodies and the file's points [m]."""
    marionette = play.marionette
    poses = marionette.poses(run.q_D, run.q_K)
    arm = poses[:, marionette.link_index("pierrot.forearm_left")]
    hand = np.array(play.cast.players["pierrot"].marionette.body_map.parts["arm_left"].end)
    neck = poses[:, marionette.link_index("columbine.skull"), :, 3]
    return np.linalg.norm(arm[:, :, :3] @ hand + arm[:, :, 3] - neck, axis=1)


@pytest.fixture(scope="module", name="walk")
def _walk(tmp_path_factory):
    """A play in which she walks off, with a leash that is long enough for half of it."""
    plays = Plays(tmp_path_factory.mktemp("leash"))
    cues = "      - {who: pierrot, does: nod}\n      - {who: columbine, walks to: [0.5, -0.6]}\n"
    return plays, cues


def test_a_long_leash_stays_slack_and_is_drawn(walk):
    plays, cues = walk
    play = fan.load_play(plays.write(leash(1.6) + ACT + cues, NEARBY))
    assert play.changes == ()
    verification = fan.theatre.verify_play(play)
    assert verification, verification.faults
    run = verification.run
    assert 1.2 < distance(play, run).max() < 1.58
    assert not run.taut["lead"].any()
    geometry = run_geometry(play.marionette, run.resample(run.t[::400]))
    (k,) = (i for i, name in enumerate(geometry.names) if name == "lead")
    points = geometry.string_curves(2)[k].points
    end_points = points[[0, -1]]
    assert np.linalg.norm(end_points[1] - end_points[0]) == pytest.approx(
        distance(play, run)[800], abs=1e-6
    )
    assert (
        0.0 <= points[:, 2].min() < end_points[:, 2].min() - 0.05
    )  # it hangs, or lies on the floor
    layout = fit_layout(geometry, Viewport(0, 0, 300, 300), PictureOptions.resolve(look="stage"))
    assert len({tuple(line.colour) for line in string_lines(geometry, 2, layout)}) == 2


def test_a_cue_that_would_stretch_a_leash_is_refused_with_the_length_it_needs(walk):
    plays, cues = walk
    play = fan.load_play(plays.write(leash("70 cm") + ACT + cues, NEARBY))
    (change,) = play.changes
    assert "columbine: walks to [0.5, -0.6] cannot be done: lead, 0.7 m long, would" in str(change)
    assert str(change).split(":")[1] == str(play.cues[1].line)
    verification = fan.theatre.verify_play(play)
    assert verification, verification.faults
    needed = float(str(change).split("needs to be ")[1].split(" m")[0])
    longer = fan.load_play(plays.write(leash(needed) + ACT + cues, NEARBY), before=play)
    assert longer.changes == ()
    shorter = fan.load_play(plays.write(leash(needed - 0.05) + ACT + cues, NEARBY), before=play)
    assert len(shorter.changes) == 1


def test_the_walk_is_refused_and_not_the_wave_of_the_player_who_stays(walk):
    plays, _ = walk
    cues = (
        "      - {who: columbine, walks to: [0.5, -0.6], when: 0.5}\n"
        "      - {who: pierrot, does: nod, when: 1}\n"
    )
    play = fan.load_play(plays.write(leash(0.7) + ACT + cues, NEARBY))
    (change,) = play.changes
    assert "columbine: walks to [0.5, -0.6] cannot be done: lead, 0.7 m long" in str(change)


def test_the_length_that_a_refusal_at_the_start_gives_suffices(walk):
    plays, _ = walk
    cues = "      - {who: columbine, does: nod}\n"
    with pytest.raises(fan.errors.FileError) as caught:
        fan.load_play(plays.write(leash(0.2) + ACT + cues, NEARBY))
    needed = float(str(caught.value).split("at the start: ")[1].split(" m")[0])
    with pytest.raises(fan.errors.FileError, match="needed at the start"):
        fan.load_play(plays.write(leash(needed - 0.01) + ACT + cues, NEARBY))
    stage = plays.write(leash(needed) + ACT + cues, NEARBY)
    assert check_play(stage).leashes["lead"].length == needed


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (leash(0.2), r"found 0\.2 m; needed at the start: 0\.\d\d m"),
        (leash("-5 cm"), "needed: a positive number"),
        (leash(1.0).replace("columbine", "colombine"), "did you mean 'columbine'"),
        (leash(1.0).replace("columbine", "pierrot"), "found 'pierrot' at both ends"),
        (leash(1.0).replace("lead", "west"), "is the name of a mark"),
    ],
)
def test_a_wrong_leash_is_reported(walk, given, text):
    plays, cues = walk
    with pytest.raises(fan.errors.FileError, match=text):
        fan.load_play(plays.write(given + ACT + cues, NEARBY))


def test_a_leash_needs_a_hand_and_a_head(tmp_path):
    path = write_play(tmp_path, CUES, "leashes: {lead: {held by: one, to: two, length: 1}}\n")
    with pytest.raises(fan.errors.FileError, match=r"leashes.lead\['held by'\]: bob.yaml: player"):
        check_play(path)


def test_the_length_of_a_leash_may_have_a_unit(tmp_path):
    path = tmp_path / "play.yaml"
    path.write_text(NEARBY + leash("160 cm") + ACT + "      - {who: pierrot, does: nod}\n")
    assert check_play(path).leashes["lead"].length == 1.6
    path.write_text(path.read_text().replace("160 cm", "0 cm"))
    with pytest.raises(fan.errors.FileError, match=r"leashes\.lead\.length: found"):
        check_play(path)
