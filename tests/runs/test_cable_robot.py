"""Redundant strings: a box on eight winches, moved by its exact inverse kinematics."""

from __future__ import annotations

import numpy as np
import pytest
from tests.runs.cable_robot import LIMITED, NAMES, REWOUND, lengths, moved, robot

import fantoccini as fan
from fantoccini import Status
from fantoccini.dynamics.steppers import contradiction, first_excess_tension, may_be_redundant

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

METHODS = ("event", "timestepping", "variational")


@pytest.mark.parametrize("method", METHODS)
def test_lengths_that_contradict_one_another_are_named(eight, method):
    """Rounding between samples suffices; no method continues, or ends without a reason."""
    x0, inputs = moved(eight)
    with pytest.raises(fan.errors.SimulationError) as caught:
        fan.simulate(eight, x0, inputs, method=method)
    run, text = caught.value.trajectory, str(caught.value)
    assert run.status is Status.REDUNDANT_STRINGS and run.causes == NAMES
    assert "are 8 strings on 6 degrees of freedom, and their lengths contradict" in text
    assert "m/s^2" in text and "max_tension" in text
    assert 0.0 < run.t[-1] < 1.0 and np.max(run.violation.values) < 1e-6
    assert all(event.t <= run.t[-1] for event in run.events)
    by = contradiction(eight, run.state(len(run) - 1), run.acc_K[-1])
    assert max(by.speed, by.acceleration) > 0.0


@pytest.fixture(scope="module")
def giving():
    return robot({i: ", max_tension: 60, rewind_speed: 0.5" for i in (0, 2, 4, 6)})


def test_yielding_winches_move_it(giving):
    """The advice works: four winches with a largest tension yield to the others."""
    x0, inputs = moved(giving)
    run = fan.simulate(giving, x0, inputs, 1.5, method="timestepping")
    assert run.status is Status.DONE
    assert run.q_D[-1][:3] == pytest.approx([0.3, 0.0, 0.0], abs=1e-3)
    assert np.max(run.tension.values) < 10 * giving.weight


@pytest.fixture(scope="module", params=[LIMITED, REWOUND], ids=["kept", "rewound"])
def limited(request):
    return robot(request.param)


@pytest.mark.parametrize("seed", range(10))
def test_slipping_strings_beside_taut_ones_do_not_stop_time(limited, seed):
    """Strings that slip by the contradictions of the samples were caught and released for
    ever. If they are decided together, the run ends where fixed steps do, energies balance, and
    no catch adds energy; a slipping string pulls with its largest tension, and none with more.
    """
    random = np.random.default_rng(seed)
    shift = random.uniform(-0.3, 0.3, 3) if seed else np.array([0.3, 0.0, 0.0])
    max_tensions = random.uniform(20.0, 150.0, 4) if seed else np.full(4, 60.0)
    n, end = (int(random.integers(11, 151)), random.uniform(0.4, 2.0)) if seed else (101, 1.0)
    giving = limited.with_parameters(
        {f"most{i}": m for i, m in zip(LIMITED, max_tensions, strict=True)}
    )
    x0, inputs = moved(giving, shift, n, end)
    run = fan.simulate(giving, x0, inputs, end + 0.2)
    assert run.status is Status.DONE
    assert len(run.events) < 1000
    assert np.max(np.abs(run.ledger["residual"])) < 1e-8
    assert np.min(np.diff(run.ledger["impact"], prepend=0.0)) > -1e-9
    assert np.max(run.violation.values) < 1e-11
    for i, largest in zip(LIMITED, max_tensions, strict=True):
        assert np.max(run.tension[f"c{i}"]) <= largest * (1 + 1e-9)
        assert np.min(run.slip[f"c{i}"]) >= 0.0
        slipped = np.diff(run.slip[f"c{i}"]) > 1e-9
        assert run.tension[f"c{i}"][1:][slipped] == pytest.approx(largest)
    stepped = fan.simulate(giving, x0, inputs, end + 0.2, method=fan.TimeStepping(dt=5e-4))
    assert np.max(np.abs(run.q_D[-1] - stepped.q_D[-1])) < 1e-5
    for i in LIMITED:
        assert run.slip[f"c{i}"][-1] == pytest.approx(stepped.slip[f"c{i}"][-1], abs=1e-5)


TWO = """
puppet: two
bodies:
  - {name: bob, joint: {type: translation, axes: [x, z]}, mass: 1}
strings:
  - {name: slips, path: [{body: bob}, {world: [-0.5, 0, 1]}], length: driven,
     max_tension: {parameter: most, value: 20}, rewind_speed: 0.3}
  - {name: holds, path: [{body: bob}, {world: [0.5, 0, 1]}], length: 1.2}
"""


@pytest.mark.parametrize("most", [8.0, 20.0, 60.0])
@pytest.mark.parametrize("length", [0.7, 1.3])
def test_a_driven_winch_that_slips_beside_a_taut_string(most, length):
    """It had 298,581 catches and releases of impulse 0 in 0.4 ms."""
    two = fan.loads(TWO).with_parameters({"most": most})
    x0 = two.project(two.state({"slips.length": 1.2}))
    inputs = fan.Input.waypoints(two, {"slips.length": [(0, 1.2), (0.5, length), (1.0, 1.2)]})
    run = fan.simulate(two, x0, inputs, 1.5)
    assert len(run.events) < 200
    assert np.max(np.abs(run.ledger["residual"])) < 1e-9
    stepped = fan.simulate(two, x0, inputs, 1.5, method=fan.TimeStepping(dt=5e-4))
    assert run.slip["slips"][-1] == pytest.approx(stepped.slip["slips"][-1], abs=5e-3)


@pytest.mark.parametrize("method", METHODS)
def test_consistent_redundant_strings_hold(eight, method):
    """At rest eight strings share the weight, without a warning."""
    x0, _ = moved(eight)
    run = fan.simulate(eight, x0, t_end=0.2, method=method)
    assert run.status is Status.DONE
    motion = [(run.state(i), run.acc_K[i]) for i in range(len(run))]
    assert first_excess_tension(eight, run.tension.values, motion.__getitem__) is None
    assert np.max(run.tension.values) < 3 * eight.weight
    assert contradiction(eight, *motion[5]).speed == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_redundant_strings_stop_runs_of_a_batch(eight, method):
    """They ended with the method's first error, or DONE; runs that hold are unaffected."""
    x0, inputs = moved(eight)
    held_inputs = fan.Input.hold(eight, 1.0).bound(x0.q_K)
    batch = fan.simulate_batch(eight, x0, [held_inputs, inputs, held_inputs], 0.5, method=method)
    single = fan.simulate(eight, x0, inputs, 0.5, method=method, throw=False)
    assert single.status is Status.REDUNDANT_STRINGS
    assert batch.status.tolist() == [Status.DONE, Status.REDUNDANT_STRINGS, Status.DONE]
    assert batch.causes(1) == NAMES and not batch.causes(0) and not batch.causes(2)


@pytest.mark.parametrize("method", ["event", "variational"])
def test_redundant_strings_stop_a_stepper(eight, method):
    """A stepper has the status of a single run."""
    x0, inputs = moved(eight)
    stepper = eight.stepper(x0, method)
    with pytest.raises(fan.errors.SimulationError, match="are 8 strings on 6 degrees of freedom"):
        stepper.advance(0.5, inputs=inputs)
    assert stepper.status is Status.REDUNDANT_STRINGS
    assert stepper.contradiction.names == NAMES
    with pytest.raises(fan.errors.SimulationError, match="contradict one another"):
        stepper.advance(0.1)


def test_only_redundant_strings_are_checked(eight, giving):
    """Batches of other puppets have no extra cost."""
    assert may_be_redundant(eight) and not may_be_redundant(giving)
    assert not may_be_redundant(fan.puppets.arm2d())
    text = """
puppet: hung
bodies:
  - {name: bob, joint: {type: translation, axes: [x, y, z]}, mass: 1}
  - {name: far, joint: {type: free}, shapes: [{type: sphere, radius: 0.1, mass: 1}]}
strings:
"""
    line = "  - {{name: s{0}, path: [{{body: bob}}, {{world: [{0}, 0, 1]}}], length: 2}}\n"
    hung = [line.format(i) for i in range(4)]
    assert may_be_redundant(fan.loads(text + "".join(hung)))
    assert not may_be_redundant(fan.loads(text + "".join(hung[:3])))


def test_two_hands_that_pull_apart_are_not_redundant():
    """There is no redundant string, but an impossible pull: the status is unchanged."""
    between = fan.loads("""
puppet: between
bodies:
  - {name: bob, joint: {type: translation, axes: [x, y, z]}, mass: 1}
strings:
  - {name: left, path: [{body: bob}, {driven: [x], at: [-1, 0, 0.5]}], length: 1.2}
  - {name: right, path: [{body: bob}, {driven: [x], at: [1, 0, 0.5]}], length: 1.2}
""")
    inputs = fan.Input.waypoints(between, {"left.x": [(0, -1), (1, -2)]})
    for method in ("event", "variational"):
        run = fan.simulate(between, between.rest(), inputs, method=method, throw=False)
        assert run.status in (Status.IMPOSSIBLE_INPUT, Status.TENSION_CAP)
        assert set(run.causes) == {"left", "right"}


def test_a_failing_step_is_refused_as_in_a_stepper(eight):
    start = zip(NAMES, lengths(np.zeros(3)), strict=True)
    x0 = eight.state({f"{name}.length": length for name, length in start})
    acc_K = np.full(8, -1e7)
    with pytest.raises(fan.errors.SimulationError) as of_stepper:
        eight.stepper(x0).advance(0.002, acc_K)
    with pytest.raises(fan.errors.SimulationError) as of_step:
        eight.linearise_step(x0, acc_K)
    assert of_step.value.status is of_stepper.value.status
    assert str(of_step.value) == str(of_stepper.value)
