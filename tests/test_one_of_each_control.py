"""Parts of control exist once: a second one of a kind fails here."""

from __future__ import annotations

import ast
import inspect
from pathlib import Path

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.control.problems.balance import best_support
from fantoccini.control.tasks import Answer, AnswerStatus, ControlFile, ProblemFile, TaskFile

pytestmark = pytest.mark.medium

PACKAGE = Path(__file__).resolve().parents[1] / "src" / "fantoccini"
SOLVERS = {"solve", "cho_factor", "cholesky"}
ANSWERS = (
    fan.control.PlanResult,
    fan.control.Optimum,
    fan.control.ReachedPose,
    fan.control.TuningResult,
)


def functions(folder: Path = PACKAGE) -> dict[str, ast.FunctionDef]:
    """``file: name`` of every function and method."""
    return {
        f"{file.relative_to(folder)}: {node.name}": node
        for file in sorted(folder.rglob("*.py"))
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef)
    }


def factors_a_stage(function: ast.FunctionDef) -> bool:
    """Whether it solves with a sum R + B'P B, also through a variable or a function of SciPy."""
    named = {
        target.id: node.value
        for node in ast.walk(function)
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Name)
    }
    for call in (node for node in ast.walk(function) if isinstance(node, ast.Call)):
        name = ast.unparse(call.func).rsplit(".", 1)[-1]
        if name.startswith("solve_discrete"):
            return True
        if name not in SOLVERS or not call.args:
            continue
        matrix = call.args[0]
        matrix = named.get(matrix.id, matrix) if isinstance(matrix, ast.Name) else matrix
        if not (isinstance(matrix, ast.BinOp) and isinstance(matrix.op, ast.Add)):
            continue
        later = [named.get(x.id, x) if isinstance(x, ast.Name) else x for x in operands(matrix)]
        if any(isinstance(x, ast.BinOp) and isinstance(x.op, ast.MatMult) for x in later):
            return True
    return False


def operands(matrix: ast.BinOp) -> tuple[ast.expr, ast.expr]:
    return matrix.left, matrix.right


def test_one_function_factors_a_stage_of_riccatis_recursion():
    """``stationary_gain`` solves with a sum as well, but factors no stage."""
    solvers = {name for name, function in functions().items() if factors_a_stage(function)}
    assert solvers == {"base/riccati.py: step", "base/riccati.py: stationary_gain"}
    second = "def gain(A, B, Q, R, P):\n    M = R + B.T @ P @ B\n    return np.linalg.solve(M, A)"
    (function,) = ast.parse(second).body
    assert isinstance(function, ast.FunctionDef) and factors_a_stage(function)


def test_compiled_stages_are_factored_in_one_file():
    """Programs and clamped motions use `StageRiccati` to eliminate their stages."""
    folder = PACKAGE / "kernel" / "cpp" / "fantoccini"
    headers = {p.name: p.read_text(encoding="utf-8") for p in folder.rglob("*.hpp")}
    assert [name for name, text in headers.items() if "bool eliminate(int" in text] == [
        "stage_riccati.hpp"
    ]
    for name in ("stage_program.hpp", "stage_clamped.hpp"):
        assert "StageRiccati riccati_;" in headers[name]


def test_one_function_relaxes_a_puppet_to_rest():
    """Relaxation and settling differ in the acting forces, and in the condition to stop."""
    folder = PACKAGE / "dynamics" / "equilibrium"
    runs = [
        name
        for name, function in functions(folder).items()
        for node in ast.walk(function)
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("Run", "simulate")
    ]
    assert runs == ["letting_go.py: let_go"]


def test_one_newton_method_ends_the_searches_for_rests():
    """Relaxation and descent approach a rest; its stability is decided in one place."""
    folder = PACKAGE / "dynamics" / "equilibrium"
    stable = {
        name
        for name, function in functions(folder).items()
        if not name.startswith(("vibration.py", "plausible.py"))
        for node in ast.walk(function)
        if isinstance(node, ast.Call) and ast.unparse(node.func).startswith("np.linalg.eig")
    }
    assert stable == {"newton.py: curvature", "newton.py: instability"}
    using = {
        name
        for name, function in functions(folder).items()
        for node in ast.walk(function)
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "newton"
    }
    assert using == {
        "descent.py: descended",
        "newton.py: nearest_to_requested",
        "relaxation.py: relaxed",
    }


def test_all_searches_for_equilibria_end_in_one_function():
    """Poses of `reach`, and targets of the rollouts of plans, are rests."""
    arm = fan.puppets.arm2d()
    x = arm.rest()
    bent = float(x.q_D[1]) + 0.3
    pose = fan.reach(arm, {"elbow": bent}, x)[0]
    assert pose and pose.state.q_D[1] == pytest.approx(bent)
    assert arm.rest(pose.state).q_D == pytest.approx(pose.state.q_D, abs=1e-12)
    problem = fan.control.Problem(arm, x, {"elbow": bent})
    led = problem.rollouts.laws[0]
    again = arm.rest(x.replace(q_D=led.q_D, q_K=led.q_K))
    assert problem.rests_at_goal and again.q_D == pytest.approx(led.q_D, abs=1e-9)


def test_one_outer_loop_iterates_quadratic_programs():
    """Methods compute its steps and accept them; its end is decided in one place."""
    folder = PACKAGE / "control"
    loops = {
        name
        for name, function in functions(folder).items()
        if not name.startswith("problems/")  # their least squares have no bounds
        for node in ast.walk(function)
        if isinstance(node, ast.For) and "iterations" in ast.unparse(node.iter)
    }
    assert loops == {"optimal/iterations.py: improve"}
    methods = {
        name.rsplit(": ", 1)[0] for name in functions(folder) if name.endswith(": prepare_next")
    }
    assert methods == {
        "optimal/iterations.py",
        "optimal/sqp.py",
        "optimal/trust_region.py",
        "planning/descent.py",
    }
    programs = {
        str(file.relative_to(folder))
        for file in folder.rglob("*.py")
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call)
        and ast.unparse(node.func) in ("self._solver.solve", "ca.conic")
    }
    one_step = {"optimal/clamped.py"}  # an update of MPC makes only one iteration
    assert programs == methods - {"optimal/iterations.py"} | one_step


def test_steps_are_judged_by_one_set_of_ratios():
    """The least decrease of a step that is taken, and those that change damping and radius."""
    ratios = {"MIN_DECREASE_RATIO", "POOR_DECREASE_RATIO", "GOOD_DECREASE_RATIO"}
    assigned = {
        str(file.relative_to(PACKAGE))
        for file in (PACKAGE / "control").rglob("*.py")
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
        if node.id.upper() in ratios | {"TAKEN", "DECREASE"}
    }
    assert assigned == {"control/optimal/iterations.py"}
    for method in ("sqp", "trust_region"):
        text = (PACKAGE / "control" / "optimal" / f"{method}.py").read_text(encoding="utf-8")
        assert all(ratio in text for ratio in ratios)


def test_tensions_that_balance_a_pose_are_those_of_its_rest():
    """Plans compute them by SciPy, and runs in the compiled solver."""
    for puppet in (fan.puppets.arm2d(), fan.puppets.crane()):
        x = puppet.rest()
        residual, tension, _ = best_support(puppet, x.q_D[None], x.q_K[None])
        of_runs = puppet.forward_dynamics(x).tension[: tension.shape[1]]
        assert tension[0] == pytest.approx(of_runs, rel=1e-9)
        assert np.max(np.abs(residual)) < 1e-9 * puppet.weight


def test_one_reader_opens_the_files_of_control():
    """Tasks and problems share the keys of their start, their reader and their messages."""
    folder = PACKAGE / "control"
    opens = [
        str(file.relative_to(folder))
        for file in sorted(folder.rglob("*.py"))
        if "read_document(" in file.read_text(encoding="utf-8")
    ]
    assert opens == ["tasks/control_file.py"]
    assert issubclass(TaskFile, ControlFile) and issubclass(ProblemFile, ControlFile)


def boxes_in_python() -> fan.control.Problem:
    """The bundled problem ``arm3d_boxes``, written out by hand."""
    arm = fan.puppets.arm3d()
    start = {"shoulder.rotation": [0.0, 0.0, 0.0], "elbow": np.radians(6.0)}
    pose = {"shoulder.rotation": [0.0, np.radians(-80.0), 0.0], "elbow": np.radians(80.0)}
    return fan.control.Problem(
        arm,
        arm.rest({**start, "hand.x": 0.3, "hand.length": 1.32}),
        fan.control.Goal.pose(arm, pose, speed_weight=0.1),
        [
            {"name": "low", "type": "box", "size": [0.14, 0.4, 0.12], "at": [0.25, 0.0, -0.42]},
            {"name": "high", "type": "box", "size": [0.1, 0.16, 0.2], "at": [0.32, -0.12, -0.1]},
        ],
        tolerance=0.25,
        bounds=fan.control.Bounds(speed=0.5, acceleration=2.0, clearance=0.005),
        slack=False,
    )


def test_files_of_both_kinds_are_tasks_for_plans_and_optimisations(tmp_path: Path):
    """A problem file gives a task with all that plans need; a task file with an end is planned."""
    task = fan.control.load_task("arm3d_boxes")
    assert type(task) is fan.Task and task.conditions.tolerance == 0.25 and len(task.obstacles) == 2
    assert fan.control.Problem.from_task(task).fingerprint == boxes_in_python().fingerprint
    text = "problem: p\npuppet: arm2d\ngoal: {pose: {elbow: 0.3}}\nobjective: time\nsegment: 0.2\n"
    (tmp_path / "own.yaml").write_text(text + "strings: false\nreserve: 0.1\nduration: [1, 3]\n")
    conditions = fan.control.load_task(tmp_path / "own.yaml").conditions
    assert conditions.objective == "time"
    assert conditions.rollouts == fan.control.RolloutOptions(
        n_checks=10, reserve=0.1, strings=False
    )
    (tmp_path / "task.yaml").write_text(
        "task: t\npuppet: arm2d\nduration: [1, 3]\nslack: true\nend: {hand.length: 0.7}\n"
    )
    problem = fan.control.load_problem(tmp_path / "task.yaml", tolerance=0.2)
    assert problem.max_duration == 3.0 and problem.tolerance == 0.2


def test_options_are_a_few_objects():
    """Options are objects: no function has more than 13 arguments, `self` included."""
    folder = PACKAGE / "control"
    longest = {
        name: len([*(a := function.args).posonlyargs, *a.args, *a.kwonlyargs])
        for name, function in functions(folder).items()
    }
    assert {name: n for name, n in longest.items() if n > 13} == {}


def test_a_task_serves_plans_and_optimisations():
    """A problem is a task prepared for a search; there is no other description of a task."""
    assert list(inspect.signature(fan.control.Problem.from_task).parameters) == ["task", "rollouts"]
    folder = PACKAGE / "control"
    text = {str(p.relative_to(folder)): p.read_text("utf-8") for p in folder.rglob("*.py")}
    assert [name for name in text if "class Task:" in text[name]] == ["tasks/task.py"]
    arm = fan.puppets.arm2d()
    problem = fan.control.Problem(arm, arm.rest(), {"elbow": 0.3}, tolerance=0.2)
    assert isinstance(problem.task, fan.Task) and problem.task.conditions.tolerance == 0.2
    assert problem.task.required_end.required.sum() == 1 + arm.coordinates.n_vD
    for function in (fan.plan, fan.optimise, fan.MPC.__init__):
        annotations = [x.annotation for x in inspect.signature(function).parameters.values()]
        assert any("Task" in str(annotation).split(" | ") for annotation in annotations), function


def test_plans_and_optimisations_have_the_same_bounds():
    for function in (fan.follow, fan.Task.__init__, fan.control.Problem.__init__):
        (bounds,) = (
            x for x in inspect.signature(function).parameters.values() if x.name == "bounds"
        )
        assert bounds.annotation.removesuffix(" | None") == "Bounds"
    folder = PACKAGE / "control"
    assert sum("class Bounds:" in p.read_text("utf-8") for p in folder.rglob("*.py")) == 1


def test_answers_have_one_boolean_value():
    """Only ``Answer`` defines ``__bool__``; ``ReachedPoses`` is true if all of its poses are."""
    folder = PACKAGE / "control"
    own = [
        f"{file.relative_to(folder)}: {node.name}"
        for file in sorted(folder.rglob("*.py"))
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.ClassDef)
        and any(isinstance(x, ast.FunctionDef) and x.name == "__bool__" for x in node.body)
    ]
    assert own == ["optimal/reached.py: ReachedPoses", "tasks/answer.py: Answer"]
    for kind in ANSWERS:
        assert issubclass(kind, Answer)


def test_answers_have_statuses_of_one_enumeration():
    """Other statuses are those of MPC updates and of polishing, which return no answer."""
    folder = PACKAGE / "control"
    own = [
        node.name
        for file in sorted(folder.rglob("*.py"))
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.ClassDef)
        and {ast.unparse(base) for base in node.bases} & {"Outcome", "enum.Enum", "Enum"}
    ]
    assert sorted(own) == ["AnswerStatus", "MPCStatus", "PolishStatus"]
    for kind in ANSWERS:
        assert kind.__annotations__["status"] == "AnswerStatus"


def test_a_status_says_whether_an_answer_holds():
    """An answer `holds` if its status does, except for one status."""
    folder = PACKAGE / "control"
    own = [
        f"{name}: {prop}"
        for name, prop in (key.rsplit(": ", 1) for key in functions(folder))
        if prop in ("holds", "is_minimum")
    ]
    assert own == [
        "planning/result.py: holds",
        "tasks/answer.py: holds",
        "tasks/answer.py: is_minimum",
    ]
    solved = {status.name for status in AnswerStatus if status.holds and status.is_minimum}
    assert solved == {"SOLVED", "NARROW", "EXACT", "REACHED"}
    assert AnswerStatus.TIMEOUT.holds and not AnswerStatus.TIMEOUT.is_minimum
    assert not AnswerStatus.VIOLATED.holds and not AnswerStatus.OUT_OF_TIME.holds


def test_one_function_carries_changes_across_impulses():
    """Catches and impacts select their rows; the saltation matrix is computed in one place."""
    parts = ("force_change", "restitution_change")
    users = {
        name
        for name, function in functions().items()
        for node in ast.walk(function)
        if isinstance(node, ast.Call) and ast.unparse(node.func) in parts
    }
    assert users == {"dynamics/simulation/saltation.py: _changes_after"}
