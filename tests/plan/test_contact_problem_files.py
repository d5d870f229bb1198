"""Problem files with allowed contacts, and goals that touch, stand and push."""

from __future__ import annotations

import jsonschema
import numpy as np
import pytest
from tests.cli.command import fantoccini
from tests.plan.touching_bodies import ARM, HANGING_ARM, LEVEL, over_table

import fantoccini as fan
from fantoccini.base.documents.located import read_file
from fantoccini.base.errors import FileError
from fantoccini.control.tasks import problem_schema

pytestmark = pytest.mark.slow

TOUCH = """\
problem: lay
puppet: arm.yaml
start: {wrist.length: 0.55, sleeve.length: 0.6}
goal:
  touch: [[hand, shelf]]
margin: 0.005
contact: keep off
obstacles:
  - {name: shelf, type: box, size: [0.2, 0.3, 0.02], at: [0.4, 0, 0.45]}
"""

PUSH = """\
problem: push
puppet: yard.yaml
start: {wrist.length: 1.12, sleeve.length: 0.87}
goal:
  point: {body: crate, by: [0.1, 0, 0]}
contact: {touch: [[hand, crate]]}
tolerance: 0.05
"""

YARD = """\
scene: floor
floor: 0
contact: {friction: 0.4}
puppets: [{name: one, puppet: hanging.yaml}]
props:
  - {name: crate, at: [0.15, 0, 0.08],
     shapes: [{type: box, size: [0.08, 0.12, 0.16], mass: 0.05}]}
"""


@pytest.fixture
def folder(tmp_path):
    for name, text in (("arm", ARM), ("hanging", HANGING_ARM), ("yard", YARD)):
        (tmp_path / f"{name}.yaml").write_text(text, encoding="utf-8")
    return tmp_path


def write_problem(folder, text: str):
    path = folder / "problem.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_with_a_touch_equals_python(folder):
    file_problem = fan.control.load_problem(write_problem(folder, TOUCH))
    arm, start = over_table()
    shelf = {"name": "shelf", "type": "box", "size": [0.2, 0.3, 0.02], "at": [0.4, 0, 0.45]}
    problem = fan.control.Problem(
        arm,
        start,
        fan.control.Goal.touch(arm, [("hand", "shelf")]),
        [shelf],
        bounds=fan.control.Bounds(clearance=0.005),
    )
    assert (
        file_problem.hold == problem.hold > 0.0 and file_problem.fingerprint == problem.fingerprint
    )
    a, b = fan.control.solve(file_problem, seed=1), fan.control.solve(problem, seed=1)
    assert a and a.path == b.path and np.array_equal(a.tree.q_D, b.tree.q_D)
    assert LEVEL["wrist.length"] == start.q_K[arm.coordinates.q_K.index("wrist.length")]


def test_a_file_with_a_push(folder):
    problem = fan.control.load_problem(write_problem(folder, PUSH))
    assert problem.push.prop == "crate" and problem.push.pusher == "hand"
    assert problem.push.goal_position - problem.push.start_position == pytest.approx(
        [0.1, 0.0, 0.0]
    )
    assert fan.control.solve(problem, seed=0, time_limit=60.0)
    short_hold = fan.control.load_problem(write_problem(folder, PUSH + "hold: 0.25\n"))
    assert short_hold.hold == 0.25 and short_hold.fingerprint != problem.fingerprint


def test_a_file_with_a_stance():
    problem = fan.control.load_problem("marionette_stand")
    assert problem.goal.share == 0.1 and problem.goal.numbers.driven_weight == 1.0
    plan = fan.control.solve(problem, seed=0, time_limit=120.0)
    assert plan and plan.verify().share >= 0.1


def test_the_command_reports_touches(folder):
    path = write_problem(folder, TOUCH)
    result = fantoccini("plan", path, "--seed", "1")
    assert result.exit_code == 0, result.stderr
    assert "hand on shelf" in result.stdout and "step quartered" in result.stdout
    distant = write_problem(folder, TOUCH.replace("at: [0.4, 0, 0.45]", "at: [2, 0, 0.45]"))
    result = fantoccini("plan", distant)
    assert result.exit_code == 1 and "hand reaches at most" in result.stderr


@pytest.mark.parametrize(
    ("text", "change", "line", "message"),
    [
        (TOUCH, ("[hand, shelf]", "[hand, shelv]"), 5, "shelv"),
        (TOUCH, ("[hand, shelf]", "[hand]"), 5, "goal.touch"),
        (TOUCH, ("keep off", "keep of"), 7, "contact"),
        (TOUCH, ("keep off", "{touch: [[hand, upper]]}"), 7, "never touch"),
        (TOUCH, ("touch: [[hand, shelf]]", "stand: {on: []}"), 5, "goal.stand"),
        (TOUCH, ("touch: [[hand, shelf]]", "stand: {on: [[hand, shelf]], share: 2}"), 5, "share"),
        (TOUCH, ("touch: [[hand, shelf]]", "speed_weight: 1"), 4, "neither a pose nor a point"),
        (PUSH, ("by: [0.1, 0, 0]", "at: [0, 0, 0]"), 5, "neither `place` nor `by`"),
        (PUSH, ("by: [0.1, 0, 0]", "by: [0.1, 0, 0], place: [0, 0, 0]"), 5, "both `place` and"),
        (PUSH, ("[hand, crate]", "[hand, box]"), 6, "box"),
        (PUSH, ("tolerance: 0.05", "hold: -1"), 7, "hold"),
    ],
)
def test_mistakes_have_places(folder, text, change, line, message):
    assert change[0] in text
    path = write_problem(folder, text.replace(*change))
    with pytest.raises(FileError, match=message) as caught:
        fan.control.load_problem(path)
    assert f"problem.yaml:{line}" in str(caught.value)


@pytest.mark.parametrize("text", [TOUCH, PUSH])
def test_the_schema_accepts_them(folder, text):
    jsonschema.validate(read_file(write_problem(folder, text)).data, problem_schema())
    wrong = read_file(write_problem(folder, text.replace("contact:", "contract:"))).data
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(wrong, problem_schema())
