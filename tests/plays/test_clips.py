"""Clips of motion capture in plays: agreement of the run, bounds, and mistakes."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from benchmarks.capture.clips import write
from scipy.spatial.transform import Rotation
from tests.capture.test_retarget import NAMES, STANDS, capture_of

import fantoccini as fan
from fantoccini.theatre.capture import clip_names
from fantoccini.theatre.cast import clips
from fantoccini.theatre.gestures import gesture_names
from fantoccini.theatre.plays import check_play
from fantoccini.theatre.retarget import (
    ClipGesture,
    clip_gesture,
    figure_of,
    find_mapping,
    place_on_spot,
)
from fantoccini.theatre.retarget.deviations import PART_GROUPS
from fantoccini.theatre.retarget.mapping import joints_of
from fantoccini.theatre.retarget.placing import part_targets
from fantoccini.theatre.retarget.retargeting import part_positions
from plays.conftest import HEAD, Plays
from plays.test_play_file import checked_messages
from plays.tiny import BALL

pytestmark = [pytest.mark.slow, pytest.mark.long]

FRAMES = 60
BOUNDS = {"speed": 1.5, "acceleration": 12.0}
"""Bounds of a stage without bounds in its file."""
MAX_PEAK_RATIO = 1.0 + 2e-3
"""Factor by which peaks may exceed a bound, as in the verification of a play."""


@pytest.fixture(scope="module", name="wave")
def _wave(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two seconds of a clip of a waving person: the arm goes up."""
    folder = tmp_path_factory.mktemp("clips")
    whole = next(path for path in write(folder, "lafan1") if path.stem == "wave")
    head, _, motion = whole.read_text().partition("MOTION\n")
    _, interval, *rows = motion.splitlines()
    text = [f"{head}MOTION", f"Frames: {FRAMES}", interval, *rows[20 : 20 + FRAMES], ""]
    path = folder / "up.bvh"
    path.write_text("\n".join(text))
    return path


@pytest.fixture(name="short")
def _short(wave: Path, plays: Plays) -> Path:
    """The clip in a folder beside the plays."""
    (plays.folder / "clips").mkdir()
    return Path(shutil.copy(wave, plays.folder / "clips"))


@pytest.fixture(scope="module", name="waving")
def _waving(wave: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[fan.theatre.Play, Path]:
    """A play in which one player walks and turns first, and each waves as in a clip."""
    plays = Plays(tmp_path_factory.mktemp("waving"))
    shutil.copy(wave, plays.folder)
    play = plays.compile(
        "{who: pierrot, walks to: [0.1, 0.4], facing: left}\n{who: pierrot, does: up.bvh}\n"
        "{who: columbine, does: up.bvh, name: hers}\n"
        "{who: columbine, does: nod, when: up.over + 2}"
    )
    return play, plays.folder / "up.bvh"


@pytest.fixture(scope="module", name="verified")
def _verified(waving: tuple[fan.theatre.Play, Path]) -> fan.theatre.Verification:
    return fan.theatre.verify_play(waving[0])


@pytest.fixture(scope="module", name="clip_motion")
def _clip_motion(waving: tuple[fan.theatre.Play, Path]) -> ClipGesture:
    player = waving[0].cast.players["pierrot"]
    return clip_gesture(
        place_on_spot(player.marionette, waving[1], start=player.rest_state), **BOUNDS
    )


def test_a_play_with_a_clip_compiles_and_is_verified(
    waving: tuple[fan.theatre.Play, Path], verified: fan.theatre.Verification
):
    play, _ = waving
    assert play.changes == ()
    assert verified, verified.faults
    marks = play.cues[1].marks["pierrot"]
    assert marks["start"] < marks["begins"] < marks["over"] < marks["end"]
    # The clip's time begins and ends slowly, over 0.5 s each.
    lasts = (FRAMES - 1) / 30.0 + 0.5
    assert marks["over"] - marks["begins"] == pytest.approx(lasts, abs=1e-3)
    assert play.cues[3].start == pytest.approx(marks["over"] + 2 * 0.6, abs=1e-9)


@pytest.mark.parametrize(
    ("who", "number", "max_excess"),
    # Errors of the motion beyond those of hanging poses, as a share of the height; after a walk and
    # a turn the remaining swing is added.
    [("columbine", 3, 0.025), ("pierrot", 2, 0.09)],
)
def test_the_limbs_follow_the_clip(
    waving: tuple[fan.theatre.Play, Path],
    verified: fan.theatre.Verification,
    clip_motion: ClipGesture,
    who: str,
    number: int,
    max_excess: float,
):
    """The stage's run is compared with the clip at the place of the player."""
    play, _ = waving
    start = play.cues[number - 1].start
    player, retargeted, table = (
        play.cast.players[who],
        clip_motion.retargeted,
        play.marionette.coordinates,
    )
    run = verified.run.resample(start + clip_motion.t)
    table_of_player = player.marionette.coordinates
    q_D = run.q_D[:, [table.q_D.index(f"{who}.{name}") for name in table_of_player.q_D]]
    q_K = run.q_K[:, [table.q_K.index(f"{who}.{name}") for name in table_of_player.q_K]]
    positions = part_positions(retargeted.figure, player.marionette.poses(q_D, q_K))
    xy, heading = [player.start.x, player.start.y], player.start.heading
    for walk in play.walks[who]:
        (xy,), (heading,) = walk.footing(np.array([start]))
    rotation = Rotation.from_euler("z", heading).as_matrix()
    middle = np.array([player.middle.real, player.middle.imag, 0.0])

    def rms(errors: list[np.ndarray]) -> float:
        size = float(np.sqrt(np.mean(np.sum(np.square(errors), axis=-1))))
        return size / retargeted.figure.height

    for group in ("hands", "head"):
        parts = PART_GROUPS[group]
        clip = [retargeted.targets.parts[part] for part in parts]
        wanted = [(path - middle) @ rotation.T + [*xy, 0.0] for path in clip]
        error = rms([positions[part] - path for part, path in zip(parts, wanted, strict=True)])
        pose_error = rms(
            [
                retargeted.hanging_positions[part] - path
                for part, path in zip(parts, clip, strict=True)
            ]
        )
        assert error - pose_error < max_excess, group
        if who == "columbine":  # as where the gesture was computed
            (expected_excess,) = [row.excess for row in clip_motion.report if row.name == group]
            assert error - pose_error == pytest.approx(expected_excess, abs=3e-3)
    path = retargeted.targets.parts["hand_right"]
    assert rms([path - path[0]]) > 0.2  # a puppet at rest does not move it


def test_a_clip_keeps_its_bounds_in_any_heading(clip_motion: ClipGesture):
    for angle in np.radians([0.0, 30.0, 45.0, 100.0]):
        speed, acceleration = clip_motion.gesture.turned(float(angle)).peaks
        assert np.max(speed) <= BOUNDS["speed"] * MAX_PEAK_RATIO
        assert np.max(acceleration) <= BOUNDS["acceleration"] * MAX_PEAK_RATIO
    offsets, rates = clip_motion.gesture.ends
    assert np.max(np.abs(offsets)) < 1e-9
    assert np.max(np.abs(rates)) < 1e-9
    assert clip_motion.crossings == ()


def test_turning_and_travel_are_left_out(marionette: fan.Marionette):
    """A clip of a person who turns and wanders equals one without these motions."""
    rng = np.random.default_rng(3)
    positions = STANDS + 0.02 * rng.normal(size=(60, len(NAMES), 3))
    head_rotations = Rotation.random(60, random_state=1).as_matrix()
    turns = _spin(np.cumsum(rng.normal(scale=0.3, size=60)))
    travel = np.cumsum(rng.normal(scale=0.1, size=(60, 1, 3)), axis=0) * [1.0, 1.0, 0.0]
    turned_clip = capture_of(
        np.einsum("tij,tkj->tki", turns, positions) + travel, turns @ head_rotations
    )
    figure, plain_clip = (
        figure_of(marionette, marionette.rest()),
        capture_of(positions, head_rotations),
    )
    joints = joints_of(find_mapping(plain_clip.skeleton), plain_clip.skeleton)
    plain_places, turned_places = (
        part_targets(figure, clip, joints, 0.0, turning=0.0) for clip in (plain_clip, turned_clip)
    )
    for part, path in plain_places.parts.items():
        np.testing.assert_allclose(turned_places.parts[part], path, atol=1e-9)
    # All turning is kept by default, and half of it on demand.
    spun_positions = np.einsum("tij,kj->tki", _spin(0.05 * np.arange(60)), STANDS)
    for turning in (1.0, 0.5):
        places = part_targets(
            figure, capture_of(spun_positions), joints, 0.0, turning=turning
        ).parts
        across = places["shoulder_left"] - places["shoulder_right"]
        angle = np.unwrap(np.arctan2(-across[:, 0], across[:, 1]))
        np.testing.assert_allclose(angle, turning * 0.05 * np.arange(60), atol=1e-9)


def _spin(angles: np.ndarray) -> np.ndarray:
    return Rotation.from_euler("z", angles[:, None]).as_matrix()


@pytest.mark.parametrize(
    ("name", "change", "expected"),
    [
        ("none.bvh", None, "no file beside this one, and no bundled gesture or clip"),
        ("../up.bvh", None, "no file beside this one"),
        ("walk_upp", None, "did you mean 'walk_up'?"),
        ("clips/up.bvh", ("HIERARCHY", "HIERARKY"), "up.bvh:1: found 'HIERARKY'; needed: "),
        # One frame too few is only remarked on.
        ("clips/up.bvh", ("Frames: 60", "Frames: 62"), "the file ends after 60 frames"),
    ],
)
def test_mistakes_of_clips_are_reported_at_their_cue(
    plays: Plays, short: Path, name: str, change: tuple[str, str] | None, expected: str
):
    if change is not None:
        short.write_text(short.read_text().replace(*change))
    (message,) = checked_messages(plays, f"{{who: pierrot, does: {name}}}")
    assert expected in message


def test_joints_that_are_not_found_ask_for_a_mapping_file_beside_the_clip(
    plays: Plays, short: Path
):
    text = short.read_text().replace("LeftForeArm", "Elbow")
    short.write_text(re.sub("OFFSET .*", "OFFSET 0 0 0", text))
    (message,) = checked_messages(plays, "{who: pierrot, does: clips/up.bvh}")
    assert "elbow_left is missing; by their shape: found no pairs of limbs" in message
    assert "give a mapping file up.yaml beside it (`fantoccini mapping`" in message


def test_doubtful_joints_of_a_clip_are_a_warning(plays: Plays, short: Path):
    """The clip's left is its right; a mapping file beside it would decide."""
    text = short.read_text().replace("Left", "L-").replace("Right", "Left").replace("L-", "Right")
    short.write_text(text.replace("LeftForeArm", "LeftElbow"))
    path = plays.write(
        "acts:\n  - act: one\n    cues:\n      - {who: pierrot, does: clips/up.bvh}\n"
    )
    with pytest.warns(UserWarning, match="up: doubtful: the toes point backwards"):
        check_play(path)


def test_a_player_without_a_persons_bodies_is_reported(plays: Plays, short: Path):
    head = HEAD.replace("{at: west}", "{at: west, puppet: bob.yaml}")
    (plays.folder / "bob.yaml").write_text(BALL)
    path = plays.write(
        "acts:\n  - act: one\n    cues:\n      - {who: pierrot, does: clips/up.bvh}\n", head
    )
    with pytest.raises(fan.errors.FileError, match="has no body 'torso', the trunk of a person"):
        check_play(path)


def test_a_mapping_file_beside_a_clip_is_used_for_it(plays: Plays, short: Path):
    short.write_text(short.read_text().replace("LeftForeArm", "Elbow"))
    joints = {**fan.theatre.retarget.load_mapping("motionbuilder").joints, "elbow_left": "Elbow"}
    lines = "".join(f"  {part}: {joint}\n" for part, joint in joints.items())
    short.with_suffix(".yaml").write_text(f"mapping: mine\njoints:\n{lines}")
    check_play(
        plays.write("acts:\n  - act: one\n    cues:\n      - {who: pierrot, does: clips/up.bvh}\n")
    )


def test_a_check_simulates_nothing_and_a_change_keeps_the_clip(
    plays: Plays, short: Path, monkeypatch: pytest.MonkeyPatch
):
    cues = "{who: pierrot, does: clips/up.bvh}\n{who: columbine, does: nod}"
    first = plays.compile(cues, on_disk=True)
    recompiled = plays.compile(cues)
    for name, motion in first.motions.items():
        assert np.array_equal(motion.coef, recompiled.motions[name].coef)

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a clip is made again")

    monkeypatch.setattr(clips, "clip_gesture", refuse)
    for options in ({"before": first}, {"on_disk": True}):
        changed = plays.compile(cues.replace("nod", "bow"), **options)
        motions = changed.motions["pierrot"], first.motions["pierrot"]
        assert np.array_equal(motions[0].coef[:20], motions[1].coef[:20])
    check_play(plays.folder / "trial.yaml")
    short.write_text(short.read_text() + "\n")  # another file with equal content
    with pytest.raises(AssertionError, match="made again"):
        plays.compile(cues, before=first)


def test_clips_take_the_options_of_gestures(plays: Plays, short: Path):
    play = plays.compile(
        "{who: pierrot, does: clips/up.bvh, lasts: 9, mirrored: true}\n"
        "{who: columbine, does: clips/up.bvh, larger: 1.05, repeat: 2, when: 0}"
    )
    assert play.changes == ()
    verification = fan.theatre.verify_play(play)
    assert verification, verification.faults
    first, second = (cue.marks[who] for cue, who in zip(play.cues, play.cast.players, strict=True))
    assert first["end"] - first["start"] == pytest.approx(9 * 0.6, abs=1e-9)
    assert {"begins", "over", "begins 2", "over 2"} <= {*second}
    for speed, _, acceleration, _ in verification.peaks.values():
        assert speed <= BOUNDS["speed"] * MAX_PEAK_RATIO
        assert acceleration <= BOUNDS["acceleration"] * MAX_PEAK_RATIO
    # The other arm goes up.
    mirrored_motion = {
        name: np.ptp(verification.run[f"{name}.length"])
        for name in ("pierrot.hand_left", "pierrot.hand_right")
    }
    plain_motion = {
        name: np.ptp(verification.run[f"{name}.length"])
        for name in ("columbine.hand_left", "columbine.hand_right")
    }
    assert (mirrored_motion["pierrot.hand_left"] > mirrored_motion["pierrot.hand_right"]) != (
        plain_motion["columbine.hand_left"] > plain_motion["columbine.hand_right"]
    )


def test_a_clip_that_is_too_fast_is_refused_with_a_remedy(plays: Plays, short: Path):
    slow_stage = HEAD.replace("stage:\n", "stage:\n  speed: 0.2\n  acceleration: 1\n")
    cue = f"{{who: pierrot, does: clips/{short.name}, faster: 2}}"
    play = fan.load_play(plays.write(f"acts:\n  - {{act: one, cues: [{cue}]}}\n", slow_stage))
    (refused,) = [cue.refused for cue in play.cues]
    match = re.search(r"the hands would be \d+ % of the puppet's height farther", refused)
    remedy = re.search(r"with `faster: ([\d.]+)` it can be done$", refused)
    assert match, refused
    assert remedy, refused
    assert 1.0 <= float(remedy[1]) < 2.0


def test_no_clip_has_the_name_of_a_gesture():
    assert not {*clip_names()} & {*gesture_names()}
