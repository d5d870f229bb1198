"""One stepping engine: its loop, the lane record, statuses and linearised steps exist once."""

from __future__ import annotations

import ast
import re
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.kernel.contract import LANE

pytestmark = pytest.mark.medium

PACKAGE = Path(fan.__file__).parent


def sources() -> dict[str, ast.Module]:
    """The package's modules by their paths."""
    return {
        file.relative_to(PACKAGE).as_posix(): ast.parse(file.read_text(encoding="utf-8"))
        for file in sorted(PACKAGE.rglob("*.py"))
    }


SOURCES = sources()
CPP = PACKAGE / "kernel" / "cpp" / "fantoccini"
HEADERS = {
    file.relative_to(CPP).as_posix(): re.sub(r"//[^\n]*", "", file.read_text(encoding="utf-8"))
    for file in sorted(CPP.rglob("*.hpp"))
    if file.name != "contract.hpp"
}


def test_one_loop_steps_trajectories():
    """Batches, steppers, runs, rollouts and their gradients call it; pools count finished runs."""
    advanced = {
        (path, name)
        for path, text in HEADERS.items()
        for name in re.findall(r"(\w+)(?:\.|->)advance\(", text)
        if name != "pool"
    }
    assert advanced == {
        ("runs/stepping.hpp", "trajectory"),
        ("interface/derivatives.hpp", "flow"),  # derivatives of a smooth piece, by adaptive steps
    }
    calling = {path for path, text in HEADERS.items() if re.search(r"\bmake_steps\(", text)}
    assert calling == {
        "derivatives/rollout_gradient.hpp",
        "derivatives/step_touches.hpp",
        "runs/grid_run.hpp",
        "runs/lane_batch.hpp",
        "runs/stepping.hpp",
        "search/rollouts.hpp",
        "timestepping/lane_stepper.hpp",
    }


def test_inputs_of_runs_are_evaluated_by_one_function():
    """A run finds its piece by breaks, each lane its own; held inputs are one without breaks.

    As a piece of lanes, held inputs take 2.5 times as long to evaluate: 72 ns instead of 29 for
    three coordinates in eight lanes.
    """
    evaluating = {path for path, text in HEADERS.items() if re.search(r"\bmotion_of<", text)}
    assert evaluating == {
        "derivatives/flow_derivatives.hpp",  # derivatives by the polynomials of a run's piece
        "runs/drive.hpp",
        "runs/held_drive.hpp",
        "runs/lane_batch.hpp",
    }
    drives = {
        name
        for text in HEADERS.values()
        for name in re.findall(r"\n(?:class|struct) (\w*Drive)\b", text)
    }
    assert drives == {"Drive", "HeldDrive", "LaneDrive"}


def functions(text: str) -> list[str]:
    """Bodies of a header's functions, with numbered arguments and one name for numbers."""
    bodies = []
    for match in re.finditer(r"\b(\w+)\(([^(){};]*)\)\s*(?:const\s*)?(?:FAN_INLINE\s*)?\{", text):
        if match[1] in ("if", "for", "while", "switch"):
            continue
        end, depth = match.end(), 1
        while depth:
            depth += {"{": 1, "}": -1}.get(text[end], 0)
            end += 1
        body = re.sub(r"\s+", " ", text[match.end() : end - 1]).strip()
        arguments = [part.split()[-1].strip("*&") for part in match[2].split(",") if part.strip()]
        for i, argument in enumerate(arguments):
            body = re.sub(rf"\b{re.escape(argument)}\b", f"${i}", body)
        bodies.append(re.sub(r"\b(double|Real)\b", "T", body))
    return bodies


def test_no_function_of_the_headers_is_duplicated():
    """Bodies of more than one line are compared without the names of their arguments."""
    bodies = Counter(body for text in HEADERS.values() for body in functions(text))
    assert len(bodies) > 1000
    assert [body for body, n in bodies.items() if n > 1 and len(body) > 100] == []


def test_structures_and_their_arrays_are_built_in_one_place():
    """No other module fills a structure, or allocates arrays by the sizes of a puppet."""
    filling, making = set(), set()
    for path, tree in SOURCES.items():
        for node in ast.walk(tree):
            if not isinstance(node, ast.Call):
                continue
            kind = node.func.value if isinstance(node.func, ast.Subscript) else None
            if kind and ast.unparse(kind) == "structures" and (node.args or node.keywords):
                filling.add(path)
            allocates = ast.unparse(node.func) in ("np.zeros", "np.empty", "np.full")
            if allocates and path.startswith("kernel/runtime/") and "sizes[" in ast.unparse(node):
                making.add(path)
    assert filling == {"kernel/runtime/packing.py"}
    assert making == {"kernel/runtime/compiled.py", "kernel/runtime/frozen_flow.py"}


def test_the_lane_record_is_declared_once():
    """No other literal names parts that only the lane record has."""
    own = {"fresh", "advanced"}
    assert own < {part.name for part in LANE}
    naming = {
        path
        for path, tree in SOURCES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and node.value in own
    }
    assert naming == {"kernel/contract/lanes.py"}


def test_one_place_decides_the_status_of_a_run():
    """Other functions report and check the cause; only `decide` sets the status."""
    deciding = {
        path
        for path, tree in SOURCES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and node.attr == "REDUNDANT_STRINGS"
    }
    assert deciding == {"dynamics/steppers/verdict.py"}
    calling = {
        path
        for path, tree in SOURCES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "decide"
    }
    assert calling == {
        "dynamics/derivatives/step_linearisation.py",
        "dynamics/simulation/batch_verdicts.py",
        "dynamics/simulation/judging.py",
        "dynamics/simulation/run.py",
        "dynamics/steppers/stepper.py",
    }
    checking = {
        path
        for path, tree in SOURCES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and node.attr in ("GAINED_ENERGY", "UNBALANCED")
    }
    assert checking == {
        "base/errors.py",
        "dynamics/simulation/judging.py",
        "dynamics/steppers/soundness.py",
    }


def test_one_discrete_linearisation():
    """`linearise_step` equals `linearise_steps` of one state, to the last bit."""
    calling = {
        path
        for path, tree in SOURCES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and node.attr == "step_derivatives"
    }
    assert calling == {"dynamics/derivatives/step_partials.py"}
    (function,) = (
        node
        for node in SOURCES["dynamics/derivatives/step_partials.py"].body
        if isinstance(node, ast.FunctionDef) and node.name == "linearise_steps"
    )
    named = [argument.arg for argument in function.args.args]
    assert named == ["marionette", "inputs", "options", "buffer"], "not one argument for each array"
    arm = fan.puppets.arm2d()
    x = arm.rest({"hand.length": 0.8}).replace(v_D=[0.3, -0.2])
    single = arm.linearise_step(x, [0.4, -0.7], [0.01, -0.02])
    many = arm.linearise_steps(
        *([a, a] for a in (x.q_D, x.v_D, x.q_K, x.v_K)), [0.4, -0.7], [0.01, -0.02], forces=True
    )
    assert np.array_equal(single.A, many.A[0]) and np.array_equal(single.B, many.B[1])
    assert np.array_equal(single.tension, many.tension[0])


def test_the_classes_that_step_by_held_accelerations():
    """A run and a batch; below them, the lanes and the class that builds a batch of single runs."""
    stepping = {
        node.name
        for tree in SOURCES.values()
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef)
        for method in node.body
        if isinstance(method, ast.FunctionDef)
        and method.name == "advance"
        and {"duration", "acc_K"} <= {argument.arg for argument in method.args.args}
    }
    assert stepping == {"Stepper", "StepperBatch", "LaneSteppers", "Engine", "SeparateRuns"}


def test_progress_has_one_callback():
    """Parameters called `progress` have one type."""
    kinds = {
        (path, ast.unparse(argument.annotation or ast.Constant(None)))
        for path, tree in SOURCES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef)
        for argument in (*node.args.args, *node.args.kwonlyargs)
        if argument.arg == "progress"
    }
    others = {x for x in kinds if "OnProgress" not in x[1] and x[1] != "Progress"}
    assert others == set()
    declared = {
        path
        for path, tree in SOURCES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Assign | ast.AnnAssign)
        and ast.unparse(node).startswith(("OnProgress", "Progress ="))
    }
    assert declared == {"base/progress.py"}
