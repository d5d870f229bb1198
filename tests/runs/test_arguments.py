"""Plausible wrong arguments are refused, and the message says what is needed."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan


@pytest.fixture(scope="module")
def caught(arm):
    """A start from which the string is caught once, at about 0.17 s."""
    x = arm.rest({"hand.length": 0.8})
    q_D = x.q_D.copy()
    q_D[0] += 0.4
    return arm.state(dict(zip(arm.coordinates.q_D, q_D, strict=True)) | {"hand.length": 0.9})


def test_a_run_of_a_batch_says_that_events_are_not_recorded(arm, caught, tmp_path):
    single_run = fan.simulate(arm, caught, t_end=1.0)
    batch = fan.simulate_batch(arm, [caught, caught], t_end=1.0, save="all")
    run = batch.trajectory(1)
    n = single_run.summary()["tension"]["hand"]["catches"]
    assert n >= 1 and batch.catches[1] == n
    run.save(tmp_path / "run.npz")
    for loaded in (run, fan.Trajectory.load(tmp_path / "run.npz")):
        summary = loaded.summary()
        assert summary["events"] is None and summary["drives"] is None
        assert summary["tension"]["hand"]["catches"] is None
        assert "not recorded" in loaded._repr_html_()
        assert "impulse:hand" not in loaded.columns() and "events not recorded" in repr(loaded)
        with pytest.raises(ValueError, match="a batch keeps no events"):
            _ = loaded.impulse


def test_events_keep_their_times(arm, caught):
    run = fan.simulate(arm, caught, t_end=1.0)
    event = next(e for e in run.events if e.kind == "catch")
    after = np.linspace(event.t + 0.05, 1.0, 6)
    later = run.resample(after)
    assert all(e.t >= after[0] for e in later.events)
    coarse = run.resample([0.0, event.t - 0.05, event.t + 0.05, 1.0])
    assert coarse.impulse["hand"][2] >= event.impulse > 0.0
    assert not np.any(coarse.impulse["hand"][:2])
    exact = run.impulse["hand"]
    at = np.flatnonzero(run.t == event.t)
    assert exact[at[-1]] == event.impulse and not np.any(exact[at[:-1]])


def test_inputs_of_different_puppets_are_not_joined(arm):
    crane = fan.puppets.crane()
    lift = fan.Input.waypoints(arm, {"hand.length": [(0, 0.8), (1, 0.7)]})
    other = fan.Input.hold(crane)
    with pytest.raises(ValueError, match=r"inputs\[1\] is of another puppet .* needed: hand"):
        lift.then(other)
    with pytest.raises(TypeError, match=r"inputs\[1\] is a str; it must be an Input"):
        lift.then("lift.yaml")
    with pytest.raises(ValueError, match="inputs is empty"):
        fan.Input.concatenate([])


@pytest.mark.parametrize(
    ("field", "t", "q_K", "v_K", "acc_K"),
    [
        ("acc_K", 3, "n", "n", (1,)),
        ("acc_K", 3, "1", "1", ()),
        ("q_K", 3, (3,), "1", "n"),
        ("v_K", 3, "1", (3,), "n"),
        ("t", 1, "1", "1", "n"),
    ],
)
def test_segments_check_the_shapes_of_their_arrays(arm, field, t, q_K, v_K, acc_K):
    n_K = arm.coordinates.n_vK

    def zeros(shape):
        known = {"n": (2, n_K), "1": (n_K,), (1,): (1, n_K), (3,): (3, n_K), (): (2,)}
        return np.zeros(known[shape]) + 0.8

    with pytest.raises(fan.errors.InputError, match=f"{field}: has the shape"):
        fan.Input.segments(arm, np.arange(float(t)), zeros(q_K), zeros(v_K), zeros(acc_K))


def refused(arm, x0):
    hold = fan.Input.hold(arm)
    yield lambda: arm.with_winches([12.0, 0.5, 0.0]), "winches have the shape"
    yield lambda: fan.simulate(arm, x0, t_end=1.0, save_every=10), "save_every is for fixed"
    yield lambda: fan.simulate_batch(arm, [x0], t_end=1.0, save_every=10), "save_every is for"
    yield lambda: fan.simulate(arm, {"elbow": 0.3}, hold), r"x0 is a dict; it must be a State"
    yield lambda: fan.simulate(arm, x0, {"hand": 1}), r"inputs is a dict; it must be an Input"
    yield lambda: fan.simulate(arm, [x0], hold), "x0 are several; .* fan.simulate_batch"
    yield lambda: fan.simulate(arm, x0, t_end=np.inf), "t_end is inf; it must be a finite time"
    yield lambda: fan.TimeStepping(dt=np.inf), "dt is inf; it must be a finite number greater"
    yield lambda: fan.TimeStepping(extrapolate="no"), "extrapolate is 'no'; it must be True or"
    yield lambda: fan.Event(rtol="1e-6"), "rtol is '1e-6'; it must be a finite number"
    yield lambda: fan.Input.hold("arm2d"), "found 'arm2d', a str; needed: a Marionette"
    yield lambda: arm.wrench_forces(x0, {"lower": [0, 0, 1]}), r"wrenches\['lower'\] has the shape"
    yield lambda: arm.linearise(x0, rows="hnd"), "no string or limit is called 'hnd'"
    yield lambda: fan.simulate(arm, x0, t_end=0.1).save("run.csv"), "saved as .npz"
    yield lambda: fan.simulate(arm, x0, t_end=0.1).resample(0.05), "times must be a list"
    yield lambda: fan.simulate(arm, x0, t_end=0.1).at([0.05]), "it must be one time"
    yield lambda: fan.simulate(arm, x0, t_end=0.1).tension[0], "no string is called 0"
    end = "it must be a finite time later than the start"
    for t_end in ("1", True, np.nan, 1j, [1.0]):
        yield lambda t=t_end: fan.simulate(arm, x0, t_end=t), end
        yield lambda t=t_end: fan.simulate_batch(arm, [x0], t_end=t), end
        yield lambda t=t_end: fan.dynamics.sensitivity(arm, x0, t_end=t), end
        yield lambda t=t_end: arm.stepper(x0).run(t, lambda x: {}, 20), end
    yield lambda: fan.simulate(arm, x0, t_end=1.0, save_at=["0.5"]), "found text"


def complex_or_text(arm, x0):
    """Functions of numbers, called with complex numbers and text."""
    yield lambda q: x0.replace(q_D=q(x0.q_D))
    yield lambda q: x0.replace(v_K=q(x0.v_K))
    yield lambda q: x0.replace(t=q(np.array(0.5))[()])
    yield lambda q: fan.State(0.0, q(x0.q_D), x0.v_D, x0.q_K, x0.v_K, x0.taut)
    yield lambda q: arm.state({"hand.length": q(np.array([0.8]))[0]})
    yield lambda q: arm.forward_dynamics(x0, q(np.zeros(2)))
    yield lambda q: arm.linearise(x0, u_D=q(np.zeros(2)))
    yield lambda q: arm.linearise_steps(q(x0.q_D), x0.v_D, x0.q_K, x0.v_K)
    yield lambda q: arm.rollout(x0, q(np.zeros((3, 2))))
    yield lambda q: arm.stepper(x0).advance(0.1, q(np.zeros(2)))
    yield lambda q: arm.stepper_batch(x0, 2).advance(0.1, q(np.zeros(2)))
    yield lambda q: arm.with_winches(q(np.array([[12.0, 0.5, 0.0]])))
    yield lambda q: fan.simulate(arm, x0, t_end=1.0, save_at=q(np.array([0.5])))
    yield lambda q: fan.Input.segments(
        arm, np.array([0.0, 1.0]), x0.q_K, x0.v_K, q(np.zeros((1, 2)))
    )
    yield lambda q: fan.Input.samples(
        arm, np.array([0.0, 1.0]), {"hand.length": q(np.array([0.8, 0.7]))}
    )
    yield lambda q: fan.Input.waypoints(
        arm, {"hand.length": [(0.0, 0.8), (1.0, q(np.array([0.7]))[0])]}
    )


@pytest.mark.parametrize("kind", [complex, np.complex64, str])
@pytest.mark.filterwarnings("error")
def test_complex_numbers_and_text_are_refused(arm, kind):
    """The imaginary part of complex numbers was dropped; text of a number counted as a number."""
    x0 = arm.rest({"hand.length": 0.8})
    for call in complex_or_text(arm, x0):
        with pytest.raises((ValueError, TypeError, fan.FantocciniError), match=r"found|must be"):
            call(lambda a: a.astype(kind))


def test_refusals_name_the_needed_argument(arm):
    x0 = arm.rest({"hand.length": 0.8})
    for call, message in refused(arm, x0):
        with pytest.raises((ValueError, TypeError, KeyError, fan.FantocciniError), match=message):
            call()


def test_one_row_may_be_named_without_a_list(arm):
    x0 = arm.rest({"hand.length": 0.8})
    assert arm.linearise(x0, rows="hand").rows == ("hand",)


def test_a_stopped_stepper_under_feedback_keeps_its_states(arm):
    x0 = arm.rest({"hand.length": 0.8})
    stepper = arm.stepper(x0)
    states = stepper.run(5.0, lambda x: {"hand.length": -1.0}, 20, throw=False)
    assert not stepper.arrived and len(states) > 2 and states[-1].t == stepper.state.t < 5.0
    with pytest.raises(fan.errors.SimulationError):
        arm.stepper(x0).run(5.0, lambda x: {"hand.length": -1.0}, 20)


def test_a_law_that_forgets_return_is_refused(arm):
    """Regression: the run continued in open loop."""
    x0 = arm.rest({"hand.length": 0.8})
    stepper = arm.stepper(x0)

    def law(x):
        if x.t > 0.12:
            {"hand.length": 0.1}  # noqa: B018  # a forgotten return
        else:
            return {"hand.length": 0.1}

    with pytest.raises(TypeError, match=r"the law returned None at t = 0.15 s; it must return"):
        stepper.run(1.0, law, 20)
    assert stepper.state.t == pytest.approx(0.15)


def test_every_error_is_public():
    def kinds(kind):
        return {kind} | {k for sub in kind.__subclasses__() for k in kinds(sub)}

    known = [k for k in kinds(fan.FantocciniError) if k.__module__ == "fantoccini.base.errors"]
    assert all(getattr(fan.errors, k.__name__) is k for k in known)
