"""Sweeps of scenes: names with a dot, parameters of members, contact, and batches of puppets."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan

pytestmark = pytest.mark.slow

PLANK_YAML = """
puppet: plank
bodies:
- name: board
  joint: {type: free}
  shapes: [{type: box, size: [0.1, 0.1, 0.02], mass: {parameter: load, value: 0.5}}]
strings:
- name: line
  path: [{body: board, at: [0, 0, 0.01]}, {driven: [x], at: [0, 0, 0.4]}]
  length: driven
pose: {board.z: 0.2, line.length: 0.19}
"""
STAGE_YAML = """
scene: stage
floor: 0
contact: true
puppets:
- {name: one, puppet: plank.yaml}
- {name: two, puppet: plank.yaml, at: [0.5, 0, 0], parameters: {load: 1.5}}
props:
- {name: ball, at: [0.25, 0, 0.0301], shapes: [{type: sphere, radius: 0.03, mass: 0.05}]}
"""
SHORT_LENGTH, LONG_LENGTH = 0.19, 0.45


@pytest.fixture(scope="module")
def stage(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stage")
    (folder / "plank.yaml").write_text(PLANK_YAML)
    (folder / "stage.yaml").write_text(STAGE_YAML)
    return fan.load(folder / "stage.yaml")


def make_trial():
    return fan.lab.Trial(
        inputs={"two.line.length": [(0.0, SHORT_LENGTH), (0.6, LONG_LENGTH)]},
        t_end=1.0,
        method=fan.TimeStepping(dt=2e-3),
        keep=["last one.board.z", "last two.board.z", "max tension:one.line", "ball.z"],
        times=np.linspace(0.0, 1.0, 3),
    )


def test_a_trial_sweeps_a_scene(stage, tmp_path):
    over = {"p:one.load": [0.5, 1.0], "dt": [2e-3, 1e-3]}
    sweep = fan.sweep(make_trial(), over, puppet=stage, store=tmp_path / "kept")
    assert not sweep.failures and np.all(sweep["status"] == "DONE")
    assert sweep["last two.board.z"] == pytest.approx(0.01, abs=1e-4)  # let down onto the floor
    assert sweep["last one.board.z"] == pytest.approx(0.2, abs=1e-6)
    weights = 9.81 * np.array([[0.5, 0.5], [1.0, 1.0]])
    assert sweep["max tension:one.line"] == pytest.approx(weights, rel=1e-3)
    assert sweep["ball.z"].shape == (2, 2, 3)
    assert sweep["ball.z"] == pytest.approx(0.03, abs=2e-4)
    resumed = fan.sweep(make_trial(), over, puppet=stage, store=tmp_path / "kept")
    assert np.array_equal(resumed["ball.z"], sweep["ball.z"])
    run = make_trial().run(sweep.case(1, 0))
    assert run.contact.force_on("two.board", len(run))[-1, 2] == pytest.approx(1.5 * 9.81, rel=1e-3)


def test_a_user_may_give_initial_states_and_a_study(stage):
    def study(case):
        puppet = case.marionette
        x0 = puppet.state({"one.board.x": 0.0, "ball.x": 0.25 + 0.01 * case.rng.normal()})
        run = fan.simulate(puppet, x0, t_end=0.2, method=case["method"], save_every=10)
        return {"ball": run["ball.x"][-1], "points": len(run.contact)}

    cases = {"method": {"steps": fan.TimeStepping(dt=2e-3)}, "p:two.load": [1.0, 2.0]}
    sweep = fan.sweep(study, cases, puppet=stage, seeds=2)
    assert sweep["ball"].shape == (1, 2, 2) and np.all(sweep["points"] > 0)
    assert np.ptp(sweep["ball"]) > 1e-4


def test_bundled_scenes_are_swept_side_by_side():
    puppets = {"promenade": fan.puppets.promenade(), "marionette": fan.puppets.marionette()}
    over = {"puppet": puppets}
    keep = ["last torso.z", "max tension:head"]
    study = fan.lab.Trial(t_end=0.3, method="timestepping", keep=keep)
    sweep = fan.sweep(study, over)
    assert list(sweep["status"]) == ["DONE", "DONE"]
    standing_height, hanging_height = sweep["last torso.z"]
    assert 0.335 < standing_height < hanging_height


def test_workers_receive_a_whole_scene(stage):
    """Workers of Ray receive the text of a scene's puppets, not the file."""
    import pickle

    received = pickle.loads(pickle.dumps(stage))
    x0 = stage.state({"ball.z": 0.1})
    original_run, received_run = (
        fan.simulate(m, x0, t_end=0.2, method="timestepping") for m in (stage, received)
    )
    assert (
        np.array_equal(original_run.q_D, received_run.q_D)
        and len(original_run.contact) == len(received_run.contact) > 0
    )
