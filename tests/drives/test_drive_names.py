"""A coordinate with a drive has its own name and its command's, in inputs and runs."""

from __future__ import annotations

import json

import numpy as np
import pytest

import fantoccini as fan
from drives.test_drives import BOB, MACHINES
from fantoccini.base.errors import InputError, StateError, UnknownNameError
from fantoccini.control.tasks import DrivenBounds
from fantoccini.model.puppet import loads
from fantoccini.model.tree import grow
from fantoccini.motion import Input
from fantoccini.motion.archive import table_from_json, table_to_json

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]


def table(text: str):
    return grow(loads(text)).coordinates


def message_of(make, *given) -> list[tuple[str, str]]:
    with pytest.raises(InputError) as caught:
        make(*given)
    return [(problem.key, problem.message) for problem in caught.value.mistakes]


def test_two_names_for_one_input_are_a_mistake():
    bob, way = table(BOB), [(0, 0.8), (1, 0.7)]
    both = {"line.length": way, "line.command.length": way}
    ((key, message),) = message_of(Input.waypoints, bob, both)
    assert key == "['line.command.length']"
    assert message == "is given twice: as line.length and as line.command.length; leave one out"
    columns = dict.fromkeys(both, np.array([0.8, 0.7]))
    assert message_of(Input.samples, bob, [0, 1], columns) == [(key, message)]


def test_a_rotation_comes_in_four_columns_of_either_name(tmp_path):
    machines, t = table(MACHINES), [0.0, 0.5, 1.0]
    angle = np.array([0.0, 0.2, 0.3])
    q = np.stack([np.cos(angle), np.sin(angle), 0 * angle, 0 * angle], axis=-1)
    inputs = [Input.samples(machines, t, {"head.rotation": q})]
    for owner in ("head.", "head.command."):
        names = [owner + x for x in ("qw", "qx", "qy", "qz")]
        inputs.append(Input.samples(machines, t, dict(zip(names, q.T, strict=True))))
        path = tmp_path / "head.csv"
        rows = [",".join(map(repr, [s, *p.tolist()])) for s, p in zip(t, q, strict=True)]
        path.write_text("\n".join([",".join(["t", *names]), *rows]))
        inputs.append(Input.load(machines, path))
    for other in inputs[1:]:
        np.testing.assert_array_equal(other.coef, inputs[0].coef)
        np.testing.assert_array_equal(other.base, inputs[0].base)
    columns = dict(zip(("head.qw", "head.qx", "head.qy", "head.qz"), q.T, strict=True))
    for also in ("head.rotation", "head.command.rotation"):
        ((_, message),) = message_of(Input.samples, machines, t, columns | {also: q})
        assert message.startswith("is given twice")
    del columns["head.qz"]
    assert message_of(Input.samples, machines, t, columns) == [
        ("head.qw", "needs the columns head.qz as well")
    ]
    ((_, message),) = message_of(Input.waypoints, machines, {"head.qw": [(0, 1.0)]})
    assert message.startswith("is one number of a rotation")


def test_a_table_reads_back_with_its_commands():
    whole = table(MACHINES)
    data = json.loads(json.dumps(table_to_json(whole)))
    starts = {"start_D": whole.start_D, "start_K": whole.start_K}
    assert table_from_json(data, starts).commands == whole.commands
    del data["commands"]  # of runs without drives in their format
    assert table_from_json(data, starts).commands == {}


def test_a_puppet_hangs_at_rest_where_a_drive_is_started():
    """simulate --start line.length=0.7 and a Trial's start equal those of a plain input."""
    from fantoccini.app.cli_support.start import start_state
    from fantoccini.lab.sweeps.trial import start_state as trial_start

    bob = fan.loads(BOB)
    rest = bob.rest({"line.length": 0.7})
    for x in (
        start_state(bob, None, {"line.length": 0.7}, True),
        trial_start(bob, None, {"line.length": 0.7}),
    ):
        np.testing.assert_array_equal(x.q_D, rest.q_D)
        assert np.abs(bob.forward_dynamics(x)[0]).max() < 1e-10


def test_a_plan_winds_a_winch():
    """Its bounds accept either name, and its result arrives in another simulation."""
    bob = fan.loads(BOB)
    x0, goal = bob.rest({"line.length": 0.8}), bob.rest({"line.length": 0.7})
    asked = fan.control.Bounds({"line.command.length": (0.5, 0.9)}, {"line.length": 0.4}, 1.5)
    plan = fan.plan(bob, x0, goal, bounds=asked, tolerance=0.05, seed=1)
    assert plan and plan.verify().arrives
    length = bob.coordinates.q_K.index("line.command.length")
    bounds = plan.problem.rollouts.bounds
    assert (bounds.low[length], bounds.high[length]) == (0.5, 0.9)
    assert bounds.movable.tolist() == [i == length for i in range(2)]
    assert DrivenBounds.from_bounds(bob, fan.control.Bounds()).low[length] == 1e-3
    with pytest.raises(StateError, match=r"given twice: as line\.length and line\.command\.length"):
        DrivenBounds.from_bounds(
            bob, fan.control.Bounds(speed={"line.length": 0.4, "line.command.length": 0.4})
        )
    with pytest.raises(UnknownNameError, match="did you mean"):
        DrivenBounds.from_bounds(bob, fan.control.Bounds(speed={"line.lenght": 0.4}))


def test_bounds_of_optimisations_accept_either_name():
    """Both names of a coordinate with a drive mean its command, as in plans."""
    bob = fan.loads(BOB)
    position, force, speed = {"line.length": (0.5, 0.9)}, {"line.length": (-9.0, 0.0)}, 0.4

    def numbers(name: str) -> list[np.ndarray]:
        bounds = fan.control.Bounds(
            {name: position["line.length"]},
            {name: speed},
            held=(name,),
            force={name: force["line.length"]},
        )
        return [*bounds.intervals(bob), bounds.magnitudes(bob, "jerk"), *bounds.forces(bob)]

    own, command = numbers("line.length"), numbers("line.command.length")
    assert all(np.array_equal(a, b) for a, b in zip(own, command, strict=True))
    assert np.isin([0.5, 0.9, speed], np.concatenate(own[:2])).all() and np.sum(own[2] == 0.0) == 1
    with pytest.raises(StateError, match=r"speed of .* is given twice: as line\.length and"):
        both = fan.control.Bounds(speed={"line.length": 0.4, "line.command.length": 0.4})
        both.magnitudes(bob, "speed")
