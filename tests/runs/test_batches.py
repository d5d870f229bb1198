"""Batches of runs: each run equals a single one."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import fantoccini as fan
from fantoccini import Status

pytestmark = pytest.mark.medium

ARM = fan.puppets.arm2d()
X0 = ARM.rest()
END = 0.4


def wandering(n: int, seed: int = 1, **how) -> fan.motion.Inputs:
    return fan.motion.Inputs.random(ARM, n=n, seed=seed, t_end=1.0, reach=0.1, **how)


def stepped(inputs, x0=X0, **how) -> fan.Trajectories:
    how = {"method": "timestepping", "save": "all"} | how
    return fan.simulate_batch(ARM, x0, inputs, t_end=END, **how)


def same(a: fan.Trajectories, b: fan.Trajectories, rows=slice(None)) -> bool:
    """Whether some runs of a equal all runs of b, bit for bit."""
    names = ("q_D", "v_D", "acc_D", "q_K", "v_K", "acc_K")
    tables = ("tension", "limit_force", "taut", "ledger", "slip")
    arrays = [(getattr(a, n)[rows], getattr(b, n)) for n in names]
    arrays += [(getattr(a, n).values[rows], getattr(b, n).values) for n in tables]
    return all(np.array_equal(x, y, equal_nan=True) for x, y in arrays)


@pytest.mark.parametrize("puppet", ["arm2d", "marionette_bar"])
def test_a_lane_equals_the_single_run(puppet):
    """marionette_bar hangs from a rotating bar: rotations are driven too."""
    marionette = getattr(fan.puppets, puppet)()
    x0 = marionette.rest()
    inputs = fan.motion.Inputs.random(marionette, n=11, seed=3, t_end=0.5, reach=0.12, turn=0.2)
    how = {"t_end": 0.4, "method": "timestepping"}
    many, bound = (
        fan.simulate_batch(marionette, x0, inputs, save="all", **how),
        inputs.bound(x0.q_K),
    )
    assert np.sum(many.catches) + np.sum(many.releases) > 0
    for i in range(len(many)):
        single = fan.simulate(marionette, x0, bound[i], effort=False, **how)
        lane = many.trajectory(i)
        assert np.array_equal(lane.t, single.t)
        assert np.allclose(lane.q_K, single.q_K, rtol=0, atol=1e-14)
        assert np.allclose(lane.q_D, single.q_D, rtol=0, atol=1e-10)
        assert np.allclose(lane.v_D, single.v_D, rtol=0, atol=1e-8)
        assert np.array_equal(lane.taut.values, single.taut.values)
        scale = 1.0 + np.max(single.tension.values)
        assert np.allclose(lane.tension.values, single.tension.values, rtol=0, atol=1e-6 * scale)
        assert np.allclose(lane.ledger.values, single.ledger.values, rtol=0, atol=1e-8)
        kinds = [e.kind for e in single.events]
        assert many.catches[i] == sum(k in ("catch", "limit_on") for k in kinds)
        assert many.releases[i] == sum(k in ("release", "limit_off") for k in kinds)


def test_an_event_driven_run_of_a_batch_has_the_bits_of_the_single_run():
    times = np.linspace(0.0, END, 9)
    inputs = wandering(6)
    batch = fan.simulate_batch(ARM, X0, inputs, t_end=END, save_at=times, save="all")
    assert batch.method == "event"
    assert np.sum(batch.catches) > 0
    for i, own_input in enumerate(inputs.bound(X0.q_K)):
        run = fan.simulate(ARM, X0, own_input, t_end=END, save_at=times, effort=False)
        rows = [np.flatnonzero(run.t == t)[-1] for t in batch.t]
        assert np.array_equal(run.q_D[rows], batch.q_D[i])
        assert np.array_equal(run.tension.values[rows], batch.tension.values[i])
        assert np.array_equal(run.ledger.values[rows], batch.ledger.values[i])


def test_neighbours_and_threads_make_no_difference():
    inputs = wandering(29)
    batch = stepped(inputs, threads=2)
    assert same(batch, stepped(inputs, threads=1))
    assert same(batch, stepped(list(inputs.bound(X0.q_K))[3:14]), slice(3, 14))
    assert same(batch, stepped(wandering(5)), slice(5))


def test_states_and_inputs_are_paired_or_one_is_shared():
    states = [X0.replace(v_D=X0.v_D + 0.1 * i) for i in range(4)]
    states = [ARM.project(x) for x in states]
    inputs = wandering(4)
    both = stepped(inputs, states)
    for i in range(4):
        assert same(both, stepped(inputs.bound(X0.q_K)[i], [states[i]]), slice(i, i + 1))
    assert len(stepped(None, states)) == len(stepped(inputs)) == 4
    with pytest.raises(ValueError, match="4 states and 3 inputs; needed"):
        stepped(wandering(3), states)


def test_inputs_of_different_lengths_are_held_at_their_ends():
    hand = X0.q_K[ARM.coordinates.q_K.index("hand.length")]
    inputs = [
        fan.Input.waypoints(ARM, {"hand.length": [(0, hand), (0.1, hand - 0.05)]}),
        fan.Input.waypoints(
            ARM, {"hand.length": [(0, hand), (0.15, hand - 0.1), (0.3, hand - 0.02)]}
        ),
    ]
    batch = stepped(inputs)
    for i, own_input in enumerate(inputs):
        assert same(batch, stepped([own_input]), slice(i, i + 1))


def test_a_stopped_run_keeps_its_rows_and_affects_no_other():
    hold = fan.Input.hold(ARM)
    name = ARM.coordinates.v_D[0]
    pushed = hold.with_forces({name: [(0.0, 0.0), (0.1, 0.0), (0.2, 1.0)]})
    # The numbers are finite, but a force is not, from the middle of the piece on.
    force = np.array(pushed.force)
    force[int(np.searchsorted(pushed.breaks, 0.1)), 0, :2] = 1.75e308
    pushed = dataclasses.replace(pushed, force=force)
    calm = stepped([hold])
    batch = stepped([hold, pushed, hold])
    assert [Status(s) for s in batch.status] == [Status.DONE, Status.NOT_FINITE, Status.DONE]
    assert 0.09 < batch.reached[1] < END
    assert not batch.done[1]
    assert same(batch, calm, slice(0, 1)) and same(batch, calm, slice(2, 3))
    rows = batch.t <= batch.reached[1]
    assert np.all(np.isfinite(batch.q_D[1][rows])) and np.all(np.isnan(batch.q_D[1][~rows]))
    assert np.max(np.abs(batch.q_D[1][rows])) < 1e9
    assert batch.trajectory(1).t[-1] <= batch.reached[1]
    assert "NOT_FINITE" in repr(batch)


def test_an_impossible_input_has_a_status_and_strings():
    arm = fan.puppets.arm3d()
    x0 = arm.rest()
    hold = fan.Input.hold(arm)
    lengths = [n for n in arm.coordinates.q_K if n.endswith(".length")]
    pull = {n: [(0, x0.q_K[arm.coordinates.q_K.index(n)]), (0.3, 0.05)] for n in lengths}
    batch = fan.simulate_batch(arm, x0, [hold, fan.Input.waypoints(arm, pull)], t_end=0.3)
    assert batch.status[0] == Status.DONE
    assert batch.status[1] in (Status.IMPOSSIBLE_INPUT, Status.TENSION_CAP)
    assert batch.causes(1) and set(batch.causes(1)) <= set(arm.tree.row_names)


def test_only_requested_results_are_saved():
    inputs = wandering(3)
    batch = fan.simulate_batch(ARM, X0, inputs, t_end=END, method="timestepping", save_every=50)
    assert batch.t.tolist() == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])
    assert batch.q_D.shape == (3, 5, ARM.coordinates.n_qD)
    assert batch.tension["hand"].shape == (3, 5)
    assert batch.acc_D is None and batch.ledger is None
    with pytest.raises(ValueError, match="were not saved"):
        batch.trajectory(0)
    with pytest.raises(ValueError, match="save has 'q'"):
        stepped(wandering(3), save="q")


def test_results_are_written_into_arrays_of_the_caller():
    shape = (3, 201, ARM.coordinates.n_qD)
    out = {"q_D": np.zeros(shape)}
    batch = stepped(wandering(3), out=out, save=("q_D",))
    assert np.shares_memory(batch.q_D, out["q_D"])
    assert np.array_equal(out["q_D"], stepped(wandering(3)).q_D)
    with pytest.raises(ValueError, match="must be a C-contiguous float64 array of shape"):
        stepped(wandering(3), out={"q_D": np.zeros((3, 200, 2))}, save=("q_D",))
    with pytest.raises(ValueError, match="does not write"):
        stepped(wandering(3), out={"slip": np.zeros(shape)}, save=("q_D",))


@pytest.mark.parametrize("method", ["timestepping", "event"])
def test_ctrl_c_keeps_the_finished_rows(method):
    def interrupt(_: object) -> None:
        raise KeyboardInterrupt

    inputs = fan.motion.Inputs.random(ARM, n=64, seed=0, t_end=30.0, reach=0.1)
    # Much longer than the first poll of the batch takes: some seconds of work.
    t_end = 3000.0
    batch = fan.simulate_batch(
        ARM,
        X0,
        inputs,
        t_end=t_end,
        method=method,
        threads=1,
        progress=interrupt,
        save_every=10_000 if method == "timestepping" else None,
    )
    assert Status.STOPPED in batch.counts()
    stopped = batch.status == Status.STOPPED
    assert not np.any(batch.reached[stopped] >= t_end)
    for i in np.flatnonzero(stopped) if method == "timestepping" else ():
        assert np.all(np.isfinite(batch.q_D[i][batch.t <= batch.reached[i]]))


def test_progress_goes_to_the_end():
    calls: list[float] = []
    stepped(wandering(64), progress=lambda at: calls.append(at.done))
    assert calls == sorted(calls)
    assert calls[-1] == pytest.approx(END)


def test_mistakes_name_the_run():
    bad = X0.replace(q_K=X0.q_K * 0.9)
    with pytest.raises(fan.errors.StateError, match=r"states\[2] violates"):
        stepped(None, [X0, X0, bad])
    distant = fan.Input.waypoints(ARM, {"hand.length": [(0, 0.3), (1, 0.4)]})
    near = fan.Input.waypoints(ARM, {"hand.length": [(0, X0.q_K[-1]), (1, 0.4)]})
    with pytest.raises(fan.errors.InputError, match=r"\[1\]\.hand\.length"):
        stepped([near, distant])
    with pytest.raises(TypeError, match="or a list of one or more of them"):
        stepped([1, 2])
    with pytest.raises(ValueError, match="must have one time"):
        stepped(None, [X0, X0.replace(t=1.0)])


def test_random_inputs_wander_within_reach_and_are_the_same_again():
    batch = wandering(50).bound(X0.q_K)
    places = np.array([batch.evaluate(t)[0] for t in np.linspace(0, 1, 101)])
    distances = np.abs(places - X0.q_K)
    assert 0.05 < np.max(distances) <= 0.1 + 1e-12
    assert np.allclose(places[0], X0.q_K) and np.allclose(places[-1], X0.q_K)
    for own_input in (batch[0], batch[49]):
        own_input.checked()
    repeated = wandering(3).bound(X0.q_K)
    assert np.array_equal(repeated.coef, batch.coef[:3])
    assert not np.array_equal(wandering(3, seed=2).coef, wandering(3).coef)
    only = wandering(4, only=["hand.length"]).bound(X0.q_K).evaluate(0.3)[0] - X0.q_K
    moved = np.any(only != 0, axis=0)
    assert [ARM.coordinates.q_K[i] for i in np.flatnonzero(moved)] == ["hand.length"]


@pytest.mark.parametrize("method", ["event", "timestepping", "variational"])
def test_each_run_may_have_its_own_parameters(method):
    """Domain randomisation: a run of the batch equals that of the puppet with its parameters."""
    masses = np.linspace(0.05, 0.3, 11)
    lift = fan.Input.waypoints(ARM, {"hand.length": [(0, X0["hand.length"]), (END, 0.6)]})
    how = {"t_end": END, "method": method}
    batch = fan.simulate_batch(ARM, X0, lift, save="all", parameters={"m2": masses}, **how)
    assert np.ptp(batch.q_D[:, -1], axis=0).max() > 1e-3
    assert np.array_equal(batch.parameters["m2"], masses)
    assert np.all(batch.parameters["m1"] == 0.12)
    for i, mass in enumerate(masses):
        own = ARM.with_parameters({"m2": mass})
        single_batch = fan.simulate_batch(own, X0, lift, save="all", **how)
        # Event-driven tolerances of energies are relative to the weight of the argument's
        # marionette.
        if method == "event":
            assert np.allclose(batch.q_D[i], single_batch.q_D[0], rtol=0, atol=1e-7)
            assert np.allclose(batch.tension.values[i], single_batch.tension.values[0], rtol=1e-5)
        else:
            assert same(batch, single_batch, slice(i, i + 1))
        assert own.current_puppet == batch.trajectory(i).puppet


@pytest.mark.parametrize(
    ("parameters", "error", "says"),
    [
        ({"m3": 1.0}, fan.errors.UnknownNameError, "m3"),
        ({"m2": [1.0, np.nan]}, fan.errors.StateError, "parameter m2: found nan"),
        ({"m2": [[1.0]]}, ValueError, r"shape \(1, 1\)"),
        ({"m2": [0.1, -0.1, 0.2]}, fan.errors.PuppetError, "mass"),
        ({"m1": [0.1, 0.2], "m2": [0.1, 0.2, 0.3]}, ValueError, "2 of m1, 3 of m2"),
    ],
)
def test_impossible_parameters_of_a_batch_are_refused(parameters, error, says):
    with pytest.raises(error, match=says):
        fan.simulate_batch(ARM, X0, t_end=END, parameters=parameters)


def test_parameters_inputs_and_states_have_equal_numbers():
    with pytest.raises(ValueError, match="3 values of parameters"):
        fan.simulate_batch(ARM, X0, wandering(2), t_end=END, parameters={"m2": [0.1, 0.2, 0.3]})


def test_the_parameters_of_winches_are_shared():
    arm = fan.loads(
        """
puppet: weight
bodies: [{name: bob, joint: {type: free}, shapes: [{type: sphere, radius: 0.03, mass: 0.1}]}]
strings:
- {name: line, path: [{body: bob, at: [0, 0, 0]}, {driven: [x], at: [0, 0, 1]}], length: 0.5,
   max_tension: {parameter: grip, value: 3}}
"""
    )
    x0 = arm.state({"bob.z": 0.5})
    with pytest.raises(fan.errors.StateError, match="grip belongs to the winch of line"):
        fan.simulate_batch(arm, x0, t_end=0.1, parameters={"grip": [2.0, 3.0]})
    fan.simulate_batch(arm, x0, t_end=0.1, parameters={"grip": 3.0})


@pytest.mark.parametrize("method", ["event", fan.TimeStepping(dt=2e-3)])
def test_the_bundled_marionette_has_numbers_to_change(method):
    """Heavier feet and a softer neck, for each run, equal those of a puppet with these numbers."""
    puppet, n = fan.puppets.marionette(), 3
    x0 = puppet.rest()
    lift = fan.Input.waypoints(puppet, {"knee_left.length": [(0, 1.0609), (0.3, 0.98)]})
    numbers = {"foot_density": [800.0, 1200.0, 2400.0], "neck_stiffness": [0.005, 0.015, 0.03]}
    batch = fan.simulate_batch(
        puppet, x0, lift, 0.3, method=method, save=["q_D"], parameters=numbers, threads=1
    )
    ends = []
    for i in range(n):
        other = puppet.with_parameters({name: values[i] for name, values in numbers.items()})
        ends.append(fan.simulate(other, x0, lift, 0.3, method=method).q_D[-1])
        assert batch.q_D[i, -1] == pytest.approx(ends[i], abs=1e-6)
    assert np.max(np.abs(ends[0] - ends[2])) > 1e-3
