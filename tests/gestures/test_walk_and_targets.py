"""Walks that turn, pointing and looking at places, gestures of a scene's members."""

from __future__ import annotations

import jsonschema
import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base.documents.located import read_file
from fantoccini.base.errors import FileError, InputError, StateError, UnknownNameError
from fantoccini.theatre.script import score_schema

pytestmark = pytest.mark.slow

STRINGS = (
    "head",
    "shoulder_left",
    "shoulder_right",
    "hand_left",
    "hand_right",
    "knee_left",
    "knee_right",
)
HAND = np.array([0.0, 0.0, -0.09])
STEP_TIME = 0.6

SCORE = """\
score: targets
tempo: 100
acceleration: 12
lanes:
  body:
    - {gesture: walk, steps: 4, step: 6 cm, turn: 30 deg, lasts: 4}
    - {gesture: walk, steps: 2, heading: 30 deg}
    - {gesture: look, to: [0.5, 0.4, 0.3], heading: 30 deg}
  arm:
    - {gesture: point, to: [0.5, -0.3, 0.4]}
"""
SCENE = """\
score: scene
lanes:
  pierrot:
    - {gesture: wave, of: pierrot, mirrored: true}
    - {gesture: point, of: pierrot, to: columbine.torso}
  columbine:
    - {gesture: walk, of: columbine, steps: 2, step: -2 cm}
"""


@pytest.fixture(scope="module")
def visit() -> fan.Marionette:
    return fan.puppets.visit()


def write_file(tmp_path, text: str):
    path = tmp_path / "number.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def ends_at(puppet: fan.Marionette, x0: fan.State, d: np.ndarray, of: str = "") -> np.ndarray:
    """(7,) x + i y of the strings' ends at offsets."""
    v_K = puppet.coordinates.v_K
    places = {
        p: [float(x0[f"{of}{s}.{p}"]) + d[v_K.index(f"{of}{s}.{p}")] for s in STRINGS] for p in "xy"
    }
    return np.array(places["x"]) + 1j * np.array(places["y"])


def pointing_error(
    run: fan.Trajectory, puppet: fan.Marionette, t: float, to, of: str, side: str
) -> float:
    """Angle between shoulder -> hand and shoulder -> place [deg]."""
    x = run.at(t)
    pose = puppet.pose(x, f"{of}forearm_{side}")
    shoulder = puppet.pose(x, f"{of}upper_arm_{side}")[:3, 3]
    return angle(pose[:3, 3] + pose[:3, :3] @ HAND - shoulder, np.array(to) - shoulder)


def angle(a: np.ndarray, b: np.ndarray) -> float:
    cosine = a @ b / np.linalg.norm(a) / np.linalg.norm(b)
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def simulate_gesture(puppet: fan.Marionette, gesture: fan.theatre.Gesture) -> fan.Trajectory:
    x0 = puppet.rest()
    return fan.simulate(puppet, x0, gesture.inputs(x0), method="timestepping")


@pytest.mark.parametrize(
    ("steps", "step", "turn"), [(1, 0.05, 0.2), (4, 0.06, 0.5), (7, -0.03, -3.0), (4, 0.06, 0.0)]
)
def test_all_ends_of_a_walk_move_as_one_body_along_an_arc(marionette, steps, step, turn):
    x0 = marionette.rest()
    walk = fan.theatre.load_gesture(marionette, "walk", steps=steps, step=step, turn=turn)
    assert walk.duration == pytest.approx(steps * STEP_TIME)
    first = ends_at(marionette, x0, walk.offsets(0.0)[0])
    start_middle = 0.5 * (first[1] + first[2])
    path_length = 0.0
    before = start_middle
    for t in np.linspace(0.0, walk.duration, 1001)[1:]:
        ends = ends_at(marionette, x0, walk.offsets(t)[0])
        arms = (ends - ends.mean()) / (first - first.mean())
        np.testing.assert_allclose(arms, arms[0], atol=1e-5)  # one rotation of all
        np.testing.assert_allclose(np.abs(arms), 1.0, atol=1e-5)
        middle = 0.5 * (ends[1] + ends[2])
        path_length += np.abs(((middle - before) / arms[0]).real)
        before = middle
    assert path_length == pytest.approx(steps * abs(step), rel=0.02)  # and the sway, when turning
    length = steps * step
    chord = length * (np.exp(1j * turn) - 1.0) / (1j * turn) if turn else length
    assert before - start_middle == pytest.approx(chord, abs=1e-9)
    last = ends_at(marionette, x0, walk.travel)
    np.testing.assert_allclose(last, before + np.exp(1j * turn) * (first - start_middle), atol=1e-9)


def test_knees_are_raised_alternately_at_the_marks(marionette):
    walk = fan.theatre.load_gesture(marionette, "walk", steps=4)
    assert list(walk.marks) == ["left", "right", "left 2", "right 2"]
    v_K = marionette.coordinates.v_K
    for mark, t in walk.marks.items():
        side, other = ("left", "right") if mark.startswith("left") else ("right", "left")
        d = walk.offsets(t)[0]
        assert d[v_K.index(f"knee_{side}.length")] == pytest.approx(-0.06)
        assert d[v_K.index(f"knee_{other}.length")] == pytest.approx(0.0, abs=1e-12)


def test_a_mirrored_walk_turns_to_the_other_side(marionette):
    walk = fan.theatre.load_gesture(marionette, "walk", turn=0.5).mirrored()
    other = fan.theatre.load_gesture(marionette, "walk", turn=-0.5)
    np.testing.assert_allclose(walk.travel, other.travel, atol=1e-12)


def test_bounds_hold_where_walks_are_joined(marionette):
    walk = fan.theatre.load_gesture(marionette, "walk", steps=3, turn=0.6)
    wave = fan.theatre.load_gesture(marionette, "wave").turned(0.6)
    speed, acceleration = 0.5, 4.0
    walks = walk.then(wave, walk.turned(0.6), speed=speed, acceleration=acceleration)
    peaks = np.maximum(np.maximum(walk.peaks, wave.peaks), walk.turned(0.6).peaks)
    bounds = np.maximum(peaks, np.array([[speed], [acceleration]])) * (1 + 2e-3)
    assert np.all(walks.peaks <= bounds)


def test_a_second_walk_continues_in_the_new_direction(marionette):
    """Two walks, the second in the direction of the first one's end, are one rigid motion."""
    x0 = marionette.rest()
    walk = fan.theatre.load_gesture(marionette, "walk", steps=3, step=0.05, turn=0.4)
    one_walk = fan.theatre.load_gesture(marionette, "walk", steps=6, step=0.05, turn=0.8)
    two_walks = walk.then(walk.turned(0.4))
    np.testing.assert_allclose(two_walks.travel, one_walk.travel, atol=1e-9)
    ends = ends_at(marionette, x0, two_walks.offsets(two_walks.duration)[0])
    first = ends_at(marionette, x0, 0.0 * two_walks.travel)
    np.testing.assert_allclose(
        (ends - ends.mean()) / (first - first.mean()), np.exp(0.8j), atol=1e-9
    )


def test_turning_a_gesture_turns_its_directions(marionette):
    forward = fan.theatre.Gesture.from_points(
        marionette, {"head.forward": [(0, 0), (1, 0.1)]}, travels=True
    )
    turned = forward.turned(np.radians(30.0))
    v = [marionette.coordinates.v_K.index(f"head.{part}") for part in "xy"]
    expected = [0.1 * np.cos(np.pi / 6), 0.1 * np.sin(np.pi / 6)]
    np.testing.assert_allclose(turned.offsets(1.0)[0][v], expected)
    np.testing.assert_allclose(turned.travel[v], expected)


def test_the_puppet_follows_its_ends(marionette):
    walk = fan.theatre.load_gesture(marionette, "walk", steps=4, step=0.06, turn=0.5)
    run = simulate_gesture(
        marionette, walk.then(fan.theatre.Gesture.rest(marionette, 3.0, everything=False))
    )
    before, after = (marionette.pose(run.at(t), "torso") for t in (0.0, run.t[-1]))
    displacement = after[:2, 3] - before[:2, 3]
    path_length = 0.24 * (np.exp(0.5j) - 1.0) / 0.5j
    np.testing.assert_allclose(displacement, [path_length.real, path_length.imag], atol=0.03)
    assert np.arctan2(after[1, 0], after[0, 0]) == pytest.approx(0.5, abs=0.1)


def test_hands_point_at_places_in_front(marionette):
    """The direction is within 15 degrees from the mark until the hand returns, at ten places."""
    rng = np.random.default_rng(11)
    worst = 0.0
    for _ in range(10):
        to = rng.uniform([0.3, -1.0, 0.1], [1.5, 1.0, 1.0])
        gesture = fan.theatre.load_gesture(marionette, "point", to=to)
        (string,) = gesture.uses
        side = "left" if to[1] > 0.0 else "right"
        assert string == f"hand_{side}"
        run, mark_time = simulate_gesture(marionette, gesture), gesture.marks["points"]
        errors = [
            pointing_error(run, marionette, mark_time + s, to, "", side)
            for s in np.linspace(0, 1.5, 7)
        ]
        worst = max(worst, *errors)
    print(f"worst of ten places: {worst:.1f} deg")
    assert worst < 15.0


@pytest.mark.parametrize(
    ("to", "before", "after"),
    [
        ([0.5, 0.3, 0.3], 30.0, 12.0),
        ([0.5, -0.5, 0.1], 44.0, 12.0),
        ([1.0, 2.0, 0.45], 64.0, 12.0),
        ([-0.2, 1.0, 0.2], 97.0, 20.0),
    ],
)
def test_a_face_turns_to_a_place(marionette, to, before, after):
    gesture = fan.theatre.load_gesture(marionette, "look", to=to)
    run, mark_time = simulate_gesture(marionette, gesture), gesture.marks["there"]
    angles = []
    for t in (0.0, *np.linspace(mark_time, mark_time + 1.5, 7)):
        pose = marionette.pose(run.at(t), "skull")
        angles.append(angle(pose[:3, 0], np.array(to) - pose[:3, 3]))
    print(f"{to}: {angles[0]:.1f} deg before, {max(angles[1:]):.1f} at most after")
    assert angles[0] > before and max(angles[1:]) < after


@pytest.mark.parametrize(("strings", "turned"), [(STRINGS, 57.0), (STRINGS[:3], 53.0)])
def test_a_face_turns_with_all_ends(marionette, strings, turned):
    x0, points, angle = marionette.rest(), {}, np.linspace(0.0, 1.0, 13)
    for string in strings:
        start_middle = complex(x0[f"{string}.x"], x0[f"{string}.y"])
        d = (np.exp(1j * angle) - 1.0) * start_middle
        for part, offsets in (("x", d.real), ("y", d.imag)):
            points[f"{string}.{part}"] = list(zip(3.0 * angle, offsets, strict=True))
    rest = fan.theatre.Gesture.rest(marionette, 3.0, everything=False)
    run = simulate_gesture(
        marionette, fan.theatre.Gesture.from_points(marionette, points).then(rest)
    )
    face = marionette.pose(run.at(run.t[-1]), "skull")[:3, 0]
    assert np.degrees(np.arctan2(face[1], face[0])) == pytest.approx(turned, abs=2.0)


def test_members_have_the_bundled_gestures(marionette, visit):
    alone = fan.theatre.load_gesture(marionette, "wave")
    wave = fan.theatre.load_gesture(visit, "wave", of="columbine")
    assert wave.uses == ("columbine.hand_right",)
    assert wave.mirrored().uses == ("columbine.hand_left",)
    np.testing.assert_allclose(wave.peaks.max(axis=1), alone.peaks.max(axis=1))
    walk = fan.theatre.load_gesture(visit, "walk", of="columbine", turn=0.5)
    walk_alone = fan.theatre.load_gesture(marionette, "walk", turn=0.5)
    first_index = visit.coordinates.v_K.index("columbine.head.x")
    np.testing.assert_allclose(walk.travel[first_index:], walk_alone.travel, atol=1e-12)
    assert not walk.travel[:first_index].any()


def test_a_member_points_at_places_of_the_world(visit):
    """She looks towards -x: the left side of the world is on her right."""
    for to, side in (([0.0, 0.9, 0.5], "right"), ([-0.2, -0.8, 0.4], "left")):
        gesture = fan.theatre.load_gesture(visit, "point", of="columbine", to=to)
        assert gesture.uses == (f"columbine.hand_{side}",)
        run, mark_time = simulate_gesture(visit, gesture), gesture.marks["points"]
        for s in np.linspace(0.0, 1.5, 4):
            assert pointing_error(run, visit, mark_time + s, to, "columbine.", side) < 15.0


def test_scores_have_walks_and_targets(marionette, visit, tmp_path):
    jsonschema.validate(read_file(write_file(tmp_path, SCORE)).data, score_schema())
    score = fan.load_score(marionette, write_file(tmp_path, SCORE))
    assert score, score.changes
    assert [cue.gesture for cue in score.cues] == ["walk", "walk", "look", "point"]
    walk = fan.theatre.load_gesture(marionette, "walk", steps=4, step=0.06, turn=np.pi / 6).then(
        fan.theatre.load_gesture(marionette, "walk", steps=2).turned(np.pi / 6)
    )
    np.testing.assert_allclose(score.lanes["body"].travel, walk.travel, atol=1e-12)
    text = SCENE.replace("score: scene", "score: scene\nacceleration: 12")
    jsonschema.validate(read_file(write_file(tmp_path, text)).data, score_schema())
    scene = fan.load_score(visit, write_file(tmp_path, text))
    assert scene, scene.changes
    assert all("." in string for string in scene.gesture.uses)
    assert "pierrot.hand_left" in scene.lanes["pierrot"].uses


@pytest.mark.parametrize(
    ("text", "change", "line", "message"),
    [
        (SCORE, ("steps: 4", "steps: 0"), 6, "steps"),
        (SCORE, ("6 cm", "6 feet"), 6, "needed: a length"),
        (SCORE, ("6 cm", "6"), 6, "needed: at most 1 m"),
        (SCORE, ("30 deg, lasts", "400 deg, lasts"), 6, "at most 90 deg in each"),
        (SCORE, ("lasts: 4", "larger: 2"), 6, "found both `turn` and `larger`"),
        (SCORE, ("lasts: 4", "repeat: 2"), 6, "found both `turn` and `repeat`"),
        (SCORE, ("lasts: 4", "to: skull"), 6, "walk has no 'to'"),
        (SCORE, ("lasts: 4", "stepps: 4"), 6, "did you mean 'step"),
        (SCORE, ("steps: 2, heading: 30 deg", "heading: north"), 7, "heading"),
        (SCORE, ("[0.5, 0.4, 0.3]", "[0.5, 0.4]"), 8, "needed: three numbers, or the name"),
        (SCORE, ("[0.5, 0.4, 0.3]", "skul"), 8, "did you mean 'skull'"),
        (SCORE, ("look, to", "look, steps: 2, to"), 8, "look has no 'steps'; those with it: walk"),
        (SCORE, ("[0.5, -0.3, 0.4]", "[-1, 0, 0.4]"), 10, "cannot point there"),
        (SCORE, ("[0.5, -0.3, 0.4]", "upper_arm_right"), 10, "needed: a place"),
        (SCORE, ("point, to", "wave, to"), 10, "wave has no 'to'; those with it: point, look"),
        (SCORE, ("point, to", "point, of: pierrot, to"), 10, "no member of a scene"),
        (SCENE, ("of: pierrot, mir", "of: pierot, mir"), 4, "did you mean 'pierrot'"),
        (SCENE, ("gesture: wave, of: pierrot", "gesture: wave"), 4, "`of`, a member of the scene"),
        (
            SCENE,
            ("gesture: walk, of: columbine", "gesture: walk"),
            7,
            "walk needs `of`, a member of the scene: pierrot, columbine",
        ),
    ],
)
def test_mistakes_have_places(marionette, visit, tmp_path, text, change, line, message):
    assert change[0] in text
    path = write_file(tmp_path, text.replace(*change))
    with pytest.raises(FileError, match=message) as error:
        fan.load_score(visit if text == SCENE else marionette, path)
    assert f"number.yaml:{line}" in str(error.value)


def test_keys_of_gestures_are_not_for_phrases(marionette, tmp_path):
    text = "score: s\nphrases: {p: [{gesture: bow}]}\nlanes:\n  a: [{phrase: p, to: skull}]\n"
    with pytest.raises(FileError, match=r"number.yaml:4.*only a gesture has `to`"):
        fan.load_score(marionette, write_file(tmp_path, text))


def test_wrong_arguments_of_gestures_are_named(marionette, visit):
    with pytest.raises(InputError, match="wave has no 'steps'"):
        fan.theatre.load_gesture(marionette, "wave", steps=3)
    with pytest.raises(UnknownNameError, match="did you mean 'pierrot'"):
        fan.theatre.load_gesture(visit, "wave", of="pierot")
    with pytest.raises(TypeError, match="takes a Marionette"):
        fan.theatre.load_gesture(marionette.coordinates, "walk")
    with pytest.raises(StateError, match="arm2d has no body map"):
        fan.theatre.load_gesture(fan.puppets.arm2d(), "walk")
    with pytest.raises(
        StateError, match=r"moves head\.x, which is not a driven coordinate; needed: strings"
    ):
        fan.theatre.load_gesture(fan.puppets.stand6(), "walk")


def test_a_files_mistakes_keep_their_lines_for_members(visit, tmp_path):
    path = write_file(tmp_path, "gesture: g\nmoves:\n  hand_rigt.up: [[0, 0], [1, 1 cm]]\n")
    with pytest.raises(FileError, match=r"number.yaml:3"):
        fan.theatre.load_gesture(visit, path, of="pierrot")


@pytest.mark.parametrize(
    ("phrases", "lanes", "line", "message"),
    [
        ("{w: [{gesture: walk, turn: 80 deg}]}", "[{phrase: w, larger: 2}]", 3, "w turns, and"),
        ("{w: [{gesture: walk, turn: 80 deg}]}", "[{phrase: w, repeat: 2}]", 3, "w turns: each"),
        ("{}", "[{gesture: look, to: [0, 1, 0.3], larger: 1.8}]", 3, "turns, and cannot be scaled"),
        ("{bad: [{gesture: wve}]}", "[{gesture: bow}]", 2, "is called 'wve'"),
    ],
)
def test_lanes_that_would_pull_strings_apart_are_refused(tmp_path, phrases, lanes, line, message):
    path = tmp_path / "walk.yaml"
    path.write_text(f"score: walk\nphrases: {phrases}\nlanes: {{body: {lanes}}}\n")
    with pytest.raises(FileError, match=rf"walk\.yaml:{line}: .*({message})"):
        fan.load_score(fan.puppets.marionette(), path)


def test_successive_turns_need_their_headings(tmp_path):
    path = tmp_path / "walk.yaml"
    turning = "{gesture: walk, turn: 80 deg}, {gesture: walk, turn: 80 deg"
    text = "score: walk\nlanes: {body: [" + turning + "%s}]}"
    puppet = fan.puppets.marionette()
    path.write_text(text % "")
    (change,) = fan.load_score(puppet, path).changes
    assert "give `heading: 80 deg`" in change.message
    path.write_text(text % ", heading: 80 deg")
    assert not fan.load_score(puppet, path).changes


def test_nested_phrases_end(tmp_path):
    path = tmp_path / "deep.yaml"
    deep = "".join(f"  p{i}: [{{phrase: p{i + 1}}}]\n" for i in range(200))
    last = "  p200: [{gesture: bow}]\nlanes: {a: [{phrase: p0}]}\n"
    path.write_text(f"score: deep\nphrases:\n{deep}{last}")
    with pytest.raises(FileError, match="more than 30 deep"):
        fan.load_score(fan.puppets.marionette(), path)


def test_marks_are_numbered_and_dashes_may_be_minus(tmp_path):
    path = tmp_path / "marks.yaml"
    path.write_text(
        "score: marks\nlanes:\n  a: [{gesture: walk, on: {left 2: 4}}]\n"
        "  b: [{gesture: wave, at: walk.end-1}]\n"
    )
    score = fan.load_score(fan.puppets.marionette(), path)
    walk, wave = (next(c for c in score.cues if c.gesture == name) for name in ("walk", "wave"))
    assert walk.marks["left 2"] == pytest.approx(4.0)
    assert wave.start == pytest.approx(walk.end - 1.0)
