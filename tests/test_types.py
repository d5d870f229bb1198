"""The public functions are typed, so that editors can check a user's script."""

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

SCRIPT = """
from typing import assert_type

import numpy as np
from numpy.typing import NDArray

import fantoccini as fan

Array = NDArray[np.float64]

arm = fan.load("arm2d.yaml", string_model="chain")
assert_type(arm, fan.Marionette)
assert_type(fan.loads("name: arm"), fan.Marionette)
x0 = arm.rest({"hand.length": 0.8, "shoulder": "30 deg", "bar.rotation": (1.0, 0.0, 0.0, 0.0)})
assert_type(x0, fan.State)
assert_type(arm.project(arm.state()), fan.State)
lift = fan.Input.waypoints(arm, {"hand.length": [(0, 0.8), (1.5, 0.5)]})
assert_type(lift, fan.Input)

run = fan.simulate(arm, x0, lift, method=fan.Event(rtol=1e-9), save_at=np.linspace(0, 1, 5))
assert_type(run, fan.Trajectory)
assert_type(run.tension["hand"], Array)
assert_type(run.events[0].kind, fan.motion.EventKind)
assert_type(run.status, fan.Status)
assert_type(run.state(0), fan.State)
many = fan.simulate_batch(arm, [x0, x0], lift, method="timestepping", save="all")
assert_type(many, fan.Trajectories)
assert_type(many.trajectory(0), fan.Trajectory)
found = fan.dynamics.sensitivity(arm, x0, lift, t_end=1.0)
assert_type(found, fan.dynamics.RunSensitivity)
assert_type(found.passages[0].jump, Array)

acc_D, tension = arm.forward_dynamics(x0)
assert_type(acc_D, Array)
assert_type(tension, Array)
lin = arm.linearise(x0, rows=["hand"])
assert_type(lin, fan.dynamics.Linearisation)
assert_type(lin.A, Array)
assert_type(lin.tension_partials.q_D, Array)
assert_type(arm.linearise_step(x0, dt=0.01), fan.dynamics.StepLinearisation)
assert_type(arm.modes(x0)[0], fan.dynamics.Mode)
assert_type(arm.mass_matrix(x0), Array)
assert_type(arm.kinetic_energy(x0), float)
assert_type(arm.with_parameters({"mass": 1.0}), fan.Marionette)

stepper = arm.stepper(x0, fan.TimeStepping(dt=0.001))
assert_type(stepper, fan.dynamics.Stepper)
assert_type(stepper.advance(0.1, {"hand.length": -0.1}), fan.State)
assert_type(stepper.run(1.0, lambda x: {"hand.length": -x.t}, rate=100.0), list[fan.State])
assert_type(arm.flow(x0, lift), fan.dynamics.Flow)
"""

WRONG_SCRIPT = """
import fantoccini as fan

arm = fan.load("arm2d.yaml")
fan.simulate(arm, arm.rest(), method="euler")
fan.simulate(arm, [arm.rest()])
arm.stepper(arm.rest(), 0.002)
fan.TimeStepping(rtol=1e-9)
"""


def mypy_errors(script: str, folder: Path) -> list[str]:
    """Errors of `mypy --strict` in a script that uses the package."""
    api = pytest.importorskip("mypy.api")
    file = folder / "script.py"
    file.write_text(script, encoding="utf-8")
    config = str(ROOT / "pyproject.toml")
    options = ["--strict", "--config-file", config, "--cache-dir", str(folder / "cache")]
    report, failure, _ = api.run([*options, str(file)])
    assert not failure
    return [line for line in report.splitlines() if line.startswith(str(file))]


@pytest.mark.slow
def test_an_editor_knows_what_the_public_functions_return(tmp_path, monkeypatch):
    """mypy --strict accepts the typed results in one script, and finds the mistakes in another."""
    monkeypatch.chdir(ROOT)
    assert mypy_errors(SCRIPT, tmp_path) == []
    lines = [int(line.split(":")[1]) for line in mypy_errors(WRONG_SCRIPT, tmp_path)]
    assert sorted(set(lines)) == [5, 6, 7, 8]
