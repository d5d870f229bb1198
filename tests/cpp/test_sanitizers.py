"""The whole runtime under the address and undefined-behaviour sanitizers, without warnings."""

from __future__ import annotations

import numpy as np
import pytest

from cpp.toolchain import SANITIZE, compile_program, numbers, run_program, write_model
from fantoccini import Input, puppets, simulate
from fantoccini.kernel.runtime.structures import structures

pytestmark = pytest.mark.slow

FLAGS = ("-O1", *SANITIZE)


@pytest.fixture(scope="module", params=["arm2d", "marionette"])
def puppet(request, tmp_path_factory):
    """A marionette, its start and inputs that make strings go slack and catch, the program."""
    name = request.param
    folder = tmp_path_factory.mktemp(f"sanitized-{name}")
    write_model(name, folder)
    marionette = getattr(puppets, name)()
    rest = marionette.rest()
    table = marionette.coordinates
    waypoints, depth = {}, 0.25 if name == "arm2d" else 0.05
    for j, coordinate in enumerate(table.v_K):
        if coordinate.endswith(".length"):
            at = float(rest.q_K[table.q_K.index(coordinate)])
            low = at - depth - 0.004 * j
            waypoints[coordinate] = [(0.0, at), (0.25, low), (0.4, at), (0.7, low), (0.85, at)]
    inputs = Input.waypoints(marionette, waypoints)
    return marionette, rest, inputs, compile_program("runs.cpp", folder, *FLAGS)


def words(
    marionette, x0, inputs, *, event: bool, t_end: float, twice: bool, save_at=(), winches=None
) -> str:
    options = marionette.run_options(save_steps=not len(save_at))
    bound = inputs.bound(x0.q_K, x0.t)
    names = [name for name, _ in structures["Options"]._fields_ if name != "contacts"]
    chosen = [float(getattr(options, name)) for name in names]
    winches = np.minimum(marionette.winches if winches is None else winches, 1e300)
    parts = [
        [event, x0.t, t_end, twice, *chosen],
        x0.q_D,
        x0.v_D,
        x0.slip,
        marionette.p,
        winches,
        [len(bound.coef)],
        bound.breaks,
        bound.coef,
        bound.base,
        [len(save_at)],
        save_at,
    ]
    return "\n".join(repr(float(x)) for part in parts for x in np.ravel(part))


def last_row(found: dict[str, float]) -> np.ndarray:
    rows = sorted((int(k[3:]), x) for k, x in found.items() if k.startswith("row") and k != "rows")
    return np.array([x for _, x in rows])


@pytest.mark.parametrize("saved", [False, True], ids=["every step", "at times"])
def test_an_event_driven_run(puppet, saved):
    marionette, x0, inputs, program = puppet
    save_at = np.linspace(0.0, 1.0, 201) if saved else ()
    fed = words(marionette, x0, inputs, event=True, t_end=1.0, twice=False, save_at=save_at)
    result = numbers(run_program(program, fed))
    run = simulate(
        marionette, x0, inputs, t_end=1.0, save_at=save_at if saved else None, effort=False
    )
    assert result["status"] == 0
    assert result["finite"] == 1
    assert result["events"] == len(run.events) >= 4
    assert result["rows"] == len(run.t)
    n = marionette.coordinates.n_qD
    assert last_row(result)[1 : 1 + n] == pytest.approx(run.q_D[-1], abs=1e-6)


@pytest.mark.parametrize("event", [True, False], ids=["event", "timestepping"])
def test_a_run_that_is_given_new_inputs(puppet, event):
    marionette, x0, inputs, program = puppet
    fed = words(marionette, x0, inputs, event=event, t_end=0.6, twice=True)
    result = numbers(run_program(program, fed))
    assert result["status"] == 0
    assert result["finite"] == 1
    assert last_row(result)[0] == pytest.approx(0.6)


@pytest.mark.parametrize("event", [True, False], ids=["event", "timestepping"])
def test_a_run_with_winches_that_slip_and_strings_that_bounce(puppet, event):
    """Every second string is on a slipping winch that rewinds; another one has restitution."""
    marionette, x0, inputs, program = puppet
    winches = marionette.winches.copy()
    hanging = marionette.forward_dynamics(x0)[1][: len(winches)]
    winches[::2, 0] = 1.3 * hanging[::2] + 0.02 * marionette.weight
    winches[::2, 1] = 0.1
    winches[1::2, 2] = 0.4
    runs = {}
    for saved in (False, True):
        fed = words(
            marionette,
            x0,
            inputs,
            event=event,
            t_end=1.0,
            twice=True,
            winches=winches,
            save_at=np.linspace(0.0, 1.0, 51) if saved else (),
        )
        runs[saved] = result = numbers(run_program(program, fed))
        assert result["status"] == 0
        assert result["finite"] == 1
        assert result["events"] >= 2
    if event:
        assert runs[False]["slips"] >= 1
    n = marionette.coordinates.n_qD
    apart = last_row(runs[True])[1 : 1 + n] - last_row(runs[False])[1 : 1 + n]
    assert np.max(np.abs(apart)) < 1e-5


def test_a_time_stepping_run(puppet):
    marionette, x0, inputs, program = puppet
    fed = words(marionette, x0, inputs, event=False, t_end=1.0, twice=False)
    result = numbers(run_program(program, fed))
    run = simulate(marionette, x0, inputs, t_end=1.0, method="timestepping", effort=False)
    assert (result["status"], result["finite"]) == (0, 1)
    assert result["rows"] == len(run.t)
    n = marionette.coordinates.n_qD
    assert last_row(result)[1 : 1 + n] == pytest.approx(run.q_D[-1], abs=1e-6)


def test_an_impossible_input_ends_with_a_status(puppet):
    """Strings get shorter than the distance of their ends."""
    marionette, x0, _, program = puppet
    table = marionette.coordinates
    lengths = [n for n in table.v_K if n.endswith(".length")]
    ends = [n for n in table.v_K if not n.endswith(".length")]
    waypoints = {n: [(0.0, float(x0.q_K[table.q_K.index(n)])), (0.5, 0.02)] for n in lengths}
    waypoints |= {
        n: [(0.0, float(x0.q_K[table.q_K.index(n)])), (0.5, 3.0 * (-1) ** i)]
        for i, n in enumerate(ends)
    }
    fed = words(
        marionette, x0, Input.waypoints(marionette, waypoints), event=True, t_end=0.5, twice=False
    )
    result = numbers(run_program(program, fed))
    assert result["status"] not in (0, 1)
    assert result["finite"] == 1
    assert result["attribution"] > 0
