"""Task files: their meaning, and mistakes with their places."""

from __future__ import annotations

import jsonschema
import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base import rotation
from fantoccini.base.documents.located import read_file
from fantoccini.base.errors import FileError, StateError
from fantoccini.control.tasks import task_names, task_schema
from fantoccini.control.tasks.shapes import Circle

pytestmark = pytest.mark.slow

TRACK = """\
task: lift
puppet: arm2d
start: {hand.length: 0.8}
duration: 0.4
tracks:
  - point: lower
    at: [0.3, 0, 0]
    circle: {by: [0, 0, 0.02], normal: [0, 1, 0]}
    weight: 1.0e+4
  - coordinate: elbow
    times: [0, 0.2, 0.4]
    values: [50 deg, 60 deg, 1.0]
    start: 0.1
  - {tension: hand, value: 1.0, weight: 0.5, end: 0.3}
  - {velocity: "*", value: 0, weight: 0.01}
smooth: {acceleration: 1.0e-3}
bounds:
  position: {hand.length: [0.5, null]}
  joint: {elbow: [0, 120 deg]}
  tension: {hand: [0.1, 50]}
  speed: 2.0
  acceleration: {hand.x: 5.0}
  held: [hand.x]
interval: 0.05
step: 0.025
"""
CRANE = """\
task: move
puppet: crane
start: {trolley: -0.5, hoist.length: 2.4}
end: {trolley: 0.5}
duration: [1, 5]
time_weight: 2.0
slack: true
interval: 0.1
"""


def write_file(folder, text: str, name: str = "task.yaml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_bundled_tasks_have_their_stated_content():
    assert set(task_names()) == {"circle", "crane", "swing_up"}
    crane = fan.control.load_task("crane")
    assert crane.name == "crane" and crane.is_free and crane.end is not None
    assert crane.x0.q_K[0] == -1.0 and crane.end.q_K[0] == 1.0
    swing_up = fan.control.load_task("swing_up")
    assert swing_up.explore == 1 and not swing_up.bounds.tension
    assert np.degrees(swing_up.end.q_D) == pytest.approx([151.6, -107.5], abs=0.1)
    circle = fan.control.load_task("circle")
    path = np.array([circle.tracks[0].path(t) for t in np.linspace(0.0, 2.0, 101)])
    assert np.ptp(path[:, 1]) == pytest.approx(0.1, rel=1e-3)
    assert set(circle.bounds.held) == {
        name
        for name in circle.marionette.coordinates.v_K
        if name.split(".")[0] not in ("hand_right", "shoulder_left", "shoulder_right")
    }


def test_a_file_equals_a_gesture_in_python(tmp_path):
    file_task = fan.control.load_task(write_file(tmp_path, TRACK))
    arm = fan.puppets.arm2d()
    x0 = arm.rest({"hand.length": 0.8})
    poses = arm.poses(x0.q_D[None], x0.q_K[None])[0]
    pose = poses[[link.name for link in arm.tree.links].index("lower")]
    place = pose[:, :3] @ [0.3, 0, 0] + pose[:, 3]

    def circle(t):
        s = t / 0.4
        phi = 2.0 * np.pi * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        # It begins below the centre, and turns about y: from -z towards -x.
        return place + 0.02 * np.array([-np.sin(phi), 0.0, 1.0 - np.cos(phi)])

    elbow = [0.0, 0.2, 0.4], [np.radians(50), np.radians(60), 1.0]
    task = fan.Task(
        arm,
        x0,
        0.4,
        [
            fan.control.Track.point("lower", circle, at=(0.3, 0.0, 0.0), weight=1e4),
            fan.control.Track.coordinate("elbow", elbow, start=0.1),
            fan.control.Track.tension("hand", 1.0, weight=0.5, end=0.3),
            fan.control.Track.velocity("*", weight=0.01),
        ],
        fan.control.Smooth(acceleration=1e-3),
        fan.control.Bounds(
            position={"hand.length": (0.5, np.inf)},
            joint={"elbow": (0.0, np.radians(120))},
            tension={"hand": (0.1, 50.0)},
            speed=2.0,
            acceleration={"hand.x": 5.0},
            held=("hand.x",),
        ),
        interval=0.05,
        dt=0.025,
    )
    assert np.array_equal(file_task.x0.q_D, x0.q_D)
    assert file_task.bounds == task.bounds
    assert (file_task.durations, file_task.interval, file_task.dt) == (
        task.durations,
        task.interval,
        task.dt,
    )
    # The cost of a rest includes all weights, paths and times; a step depends on the bounds.
    a, b = (fan.optimise(task, iterations=1) for task in (file_task, task))
    for (_, first), (_, other) in zip(a.curve, b.curve, strict=True):
        assert first == pytest.approx(other, rel=1e-10) and first > 0.0


def test_free_durations_ends_and_slack(tmp_path):
    task = fan.control.load_task(write_file(tmp_path, CRANE))
    crane = task.marionette
    assert task.durations == (1.0, 5.0) and task.time_weight == 2.0
    expected = crane.rest({"trolley": 0.5, "hoist.length": 2.4})
    assert task.end.q_K == pytest.approx(expected.q_K) and task.end.q_D == pytest.approx(
        expected.q_D
    )
    assert task.bounds.tension == {}
    taut_task = fan.control.load_task(write_file(tmp_path, CRANE.replace("slack: true\n", "")))
    assert not taut_task.conditions.slack and taut_task.bounds.tension == {}
    best = fan.optimise(taut_task, iterations=0)
    low, high = best.bounds.tension["hoist"]
    assert 0.0 < low < 0.1 * crane.weight and high == np.inf
    assert (
        fan.control.Problem.from_task(taut_task).fingerprint
        == fan.control.Problem.from_task(best.task).fingerprint
    )


def test_paths_from_csv(tmp_path):
    write_file(tmp_path, "t,x,y,z\n0,0.5,0,-0.1\n0.4,0.5,0,0\n", "points.csv")
    write_file(tmp_path, "t,value\n0,1\n0.1,2\n", "numbers.csv")
    write_file(tmp_path, "t,qw,qx,qy,qz\n0,1,0,0,0\n0.1,-1,0,0,0\n", "turns.csv")
    text = (
        "task: t\npuppet: arm2d\nduration: 0.4\ntracks:\n  - {point: lower, csv: points.csv}\n"
        "  - {tension: hand, csv: numbers.csv}\n  - {orientation: lower, csv: turns.csv}\n"
        "  - {orientation: upper, value: [0, 90 deg, 0]}\n"
    )
    points, numbers, turns, orientation = (
        track.path for track in fan.control.load_task(write_file(tmp_path, text)).tracks
    )
    assert np.array_equal(points[0], [0.0, 0.4])
    assert np.array_equal(points[1], [[0.5, 0.0, -0.1], [0.5, 0.0, 0.0]])
    assert np.array_equal(numbers[1], [[1.0], [2.0]])
    assert np.array_equal(turns[1], [[1.0, 0, 0, 0]] * 2), "signs do not jump"
    assert rotation.log(np.array(orientation)) == pytest.approx([0.0, np.pi / 2, 0.0])


@pytest.mark.parametrize("turns", [1.0, -2.0, 0.25])
def test_a_circle_begins_and_ends_at_rest(turns):
    normal = np.array([2.0, -1.0, 2.0]) / 3.0
    place, centre = np.array([0.3, 0.1, 0.2]), np.array([0.2, 0.0, 0.4])
    circle = Circle.near(place, centre, normal, 0.05, turns, 1.0, 3.0)
    t = np.linspace(0.5, 3.5, 3001)
    p = np.array([circle(instant) for instant in t]) - centre
    assert np.linalg.norm(p, axis=1) == pytest.approx(0.05)
    assert p @ normal == pytest.approx(0.0, abs=1e-15)
    speed = np.linalg.norm(np.diff(p, axis=0), axis=1) / np.diff(t)
    assert speed[(t[1:] <= 1.0) | (t[:-1] >= 3.0)] == pytest.approx(0.0, abs=1e-12)
    assert np.max(speed) == pytest.approx(1.875 * 2 * np.pi * abs(turns) * 0.05 / 2.0, rel=1e-4)
    assert np.sum(np.linalg.norm(np.diff(p, axis=0), axis=1)) == pytest.approx(
        2 * np.pi * abs(turns) * 0.05, rel=1e-4
    )
    areas = np.cross(p[:-1], p[1:]) @ normal
    assert np.all(np.sign(turns) * areas >= -1e-18)
    start_offset = (place - centre) - normal * (normal @ (place - centre))
    assert p[0] == pytest.approx(0.05 * start_offset / np.linalg.norm(start_offset))


def test_a_circle_needs_a_beginning():
    with pytest.raises(StateError, match="starts on the circle's axis"):
        Circle.near(np.zeros(3), np.array([0, 0, 1.0]), np.array([0, 0, 1.0]), 0.1, 1.0, 0.0, 1.0)


MISTAKES = [
    (TRACK, ("puppet: arm2d", "puppet: arm2"), 2, "puppet", "did you mean 'arm2d'"),
    (TRACK, ("hand.length: 0.8", "hand.lenght: 0.8"), 3, "start", "did you mean 'hand.length'"),
    (TRACK, ("duration: 0.4", "duration: -1"), 4, "duration", "positive"),
    (CRANE, ("[1, 5]", "[5, 1]"), 5, "duration", "the first is the shortest"),
    (CRANE, ("{trolley: 0.5}", "{trolly: 0.5}"), 4, "end.trolly", "did you mean 'trolley'"),
    (TRACK, ("hand.length: 0.8", "hand.length: 0.1"), 3, "start", "no state"),
    (TRACK, ("point: lower", "point: lowr"), 6, "tracks[0].point", "did you mean 'lower'"),
    (TRACK, ("elbow\n", "elbo\n"), 10, "tracks[1].coordinate", "did you mean 'elbow'"),
    (TRACK, ("tension: hand", "tension: hnd"), 14, "tracks[2].tension", "did you mean 'hand'"),
    (TRACK, ('"*"', "elbo"), 15, "tracks[3].velocity", "did you mean 'elbow'"),
    (TRACK, ("by: [0, 0, 0.02]", "by: [0, 0.1, 0]"), 8, "tracks[0].circle", "the circle's axis"),
    (TRACK, ("by: [0, 0, 0.02], ", ""), 8, "tracks[0].circle", "neither `centre` nor `by`"),
    (TRACK, ("weight: 1.0e+4", "wieght: 1.0e+4"), 9, "tracks[0].wieght", "did you mean 'weight'"),
    (TRACK, ("  - point: lower", "  - elbow: lower"), 6, "tracks[0]", "not known"),
    (TRACK, ("value: 1.0,", ""), 14, "tracks[2]", "its path: found none"),
    (TRACK, ("{tension", "{coordinate: elbow, tension"), 14, "tracks[2]", "coordinate and tension"),
    (TRACK, ("[0, 0.2, 0.4]", "[0, 0.2]"), 11, "tracks[1].times", "2 times for 3 values"),
    (TRACK, ("[0, 0.2, 0.4]", "[0, 0.4, 0.2]"), 11, "tracks[1].times", "rising"),
    (TRACK, ("60 deg,", "[1, 2],"), 12, "tracks[1].values[1]", "a number"),
    (TRACK, ("value: 1.0", "csv: ../numbers.csv"), 14, "tracks[2].csv", "no file in this one"),
    (TRACK, ("[0.5, null]", "[0.5, 0.2]"), 18, "bounds.position", "the first must be less"),
    (TRACK, ("[0.5, null]", "[0.9, null]"), 17, "bounds", "hand.length is 0.8 at the start"),
    (TRACK, ("joint: {elbow", "joint: {elbw"), 19, "bounds.joint.elbw", "did you mean 'elbow'"),
    (TRACK, ("tension: {hand:", "tension: {hnd:"), 20, "bounds.tension.hnd", "'hand'"),
    (TRACK, ("speed: 2.0", "speed: 0"), 21, "bounds.speed", "greater than 0"),
    (TRACK, ("{hand.x: 5.0}", "{hand.y: 5.0}"), 22, "bounds.acceleration", "'hand.x'"),
    (TRACK, ("held: [hand.x]", "held: [hand.y]"), 23, "bounds.held[0]", "'hand.x'"),
    (TRACK, ("interval: 0.05", "interval: 1.0e-6"), 24, "interval", "allowed: 10000"),
    (CRANE, ("slack: true", "explore: 1"), 7, "explore", "needed: slack: true"),
    (CRANE, ("slack: true", "slack: true\nexplore: -1"), 8, "explore", "greater than or equal"),
]


@pytest.mark.parametrize(("text", "change", "line", "key", "message"), MISTAKES)
def test_mistakes_have_places(tmp_path, text, change, line, key, message):
    assert change[0] in text
    with pytest.raises(FileError) as caught:
        fan.control.load_task(write_file(tmp_path, text.replace(*change, 1)))
    (reported,) = (str(mistake) for mistake in caught.value.mistakes)
    assert f"task.yaml:{line}: {key}" in reported and message in reported


def test_all_mistakes_of_a_task_are_reported_at_once(tmp_path):
    text = TRACK.replace("hand.length: 0.8", "hnd: 1").replace("held: [hand.x]", "held: [x]")
    with pytest.raises(FileError) as caught:
        fan.control.load_task(write_file(tmp_path, text))
    assert [mistake.line for mistake in caught.value.mistakes] == [3, 23]


def test_mistakes_of_a_table_have_its_own_lines(tmp_path):
    write_file(tmp_path, "t,value\n0,1\n1,two\n2,three\n", "numbers.csv")
    text = TRACK.replace("value: 1.0", "csv: numbers.csv")
    with pytest.raises(FileError) as caught:
        fan.control.load_task(write_file(tmp_path, text))
    assert [mistake.line for mistake in caught.value.mistakes] == [14, 14]
    assert "numbers.csv:3: value[1]: found 'two'" in str(caught.value)
    write_file(tmp_path, "t,v\n0,1\n", "numbers.csv")
    with pytest.raises(FileError, match="no column value"):
        fan.control.load_task(write_file(tmp_path, text))


def test_circles_of_free_durations_need_an_end(tmp_path):
    circle = "tracks: [{point: load, circle: {by: [0, 0, 1], normal: [0, 1, 0]}}]\n"
    with pytest.raises(FileError, match="duration is free"):
        fan.control.load_task(write_file(tmp_path, CRANE + circle))
    circle_with_end = circle.replace("load,", "load, end: 2.0,")
    assert (
        fan.control.load_task(write_file(tmp_path, CRANE + circle_with_end)).tracks[0].path.end
        == 2.0
    )


STAGE_YAML = "task: t\npuppet: promenade\nduration: 1\n"


def test_puppets_with_contact_have_tasks_with_periodic_ends_and_guesses(tmp_path):
    motion = "coordinates: {head.x: [[0, 0], [1, 0.03]]}"
    write_file(tmp_path, f"name: g\nduration: 1\n{motion}\n", "g.yaml")
    options = "periodic: {torso.x: 0.03, head.x: 0.03}\nguess: g.yaml\n"
    task = fan.control.load_task(write_file(tmp_path, STAGE_YAML + options))
    assert task.required_end.state.q_K[0] - task.x0.q_K[0] == pytest.approx(0.03)
    assert task.guess.evaluate(1.0)[0][0] == pytest.approx(0.03)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("periodic: {torso.x: 0.03, torso.u: 0.03}", r"task\.yaml:4: periodic.torso\.u: .*torso"),
        ("guess: nowhere.yaml", r"task\.yaml:4: guess: .*no file"),
        ("periodic: {}\nend: {}", "both `end` and `periodic`"),
    ],
)
def test_mistakes_of_periodic_ends_and_guesses(tmp_path, line, words):
    with pytest.raises(FileError, match=words):
        fan.control.load_task(write_file(tmp_path, f"{STAGE_YAML}{line}\n"))


@pytest.mark.parametrize("text", [TRACK, CRANE])
def test_the_schema_knows_them(tmp_path, text):
    jsonschema.validate(read_file(write_file(tmp_path, text)).data, task_schema())
    wrong = read_file(write_file(tmp_path, text.replace("duration:", "duraton:"))).data
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(wrong, task_schema())
