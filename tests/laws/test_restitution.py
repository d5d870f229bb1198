"""Strings with restitution: hdot+ = -e hdot-, without a gain of energy.

    v_D+ = v_D- - M_DD^-1 A_D^T Lambda,   Lambda >= 0,   hdot+ <= -e max(hdot-, 0), complementary

A catch takes Lambda . (hdot- + hdot+) / 2 = sum_i Lambda_i (1 - e_i) hdot-_i / 2 >= 0, for any e of
the strings.
"""

from __future__ import annotations

import json
from functools import cache

import numpy as np
import pytest

import fantoccini as fan
from fantoccini import Marionette, State, Trajectory
from fantoccini.base.rotation import exp, multiply
from fantoccini.dynamics.compiled import Evaluation

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]

G = 9.81


def falling_bob(e: float, drop: float) -> tuple[Marionette, State]:
    """A bob of 2 kg that falls by `drop` until its string is straight."""
    string = {"name": "s", "path": [{"world": [0, 0, 1]}, {"body": "bob"}], "length": 1.0}
    string["restitution"] = {"parameter": "e", "value": 0.5}
    body = {"name": "bob", "joint": {"type": "translation", "axes": ["z"]}, "mass": 2.0}
    description = {"puppet": "bob", "bodies": [body], "strings": [string]}
    marionette = fan.loads(json.dumps(description)).with_parameters({"e": e})
    return marionette, marionette.state({"bob.z": drop})


@pytest.mark.parametrize("e", [0.5, 0.8])
def test_a_dropped_bob_bounces_as_in_the_closed_form(e):
    """The n-th catch has e^n times the first one's speed, 2 e^n v / g after the previous one."""
    drop = 0.5
    marionette, x0 = falling_bob(e, drop)
    first, v = np.sqrt(2 * drop / G), np.sqrt(2 * G * drop)
    end = first + 2 * v * e / (G * (1 - e))
    run = fan.simulate(marionette, x0, t_end=end + 0.5)
    catches = [event for event in run.events if event.kind == "catch"]
    n = np.arange(len(catches))
    speeds, times = np.array([c.speed for c in catches]), np.array([c.t for c in catches])
    assert len(n) >= 10
    height = (speeds**2 - (v * e**n) ** 2) / (2 * G)
    worst = np.max(np.abs(height))
    assert worst <= 1e-11, f"{worst:.2e} m of the height that a bounce begins at"
    expected = first + 2 * v / G * (e - e ** (n + 1)) / (1 - e)
    worst = np.max(np.abs(times - expected))
    assert worst <= 1e-6, f"{worst:.2e} s"
    impulses = np.array([c.impulse for c in catches])
    assert impulses == pytest.approx(2.0 * (1 + e) * speeds, rel=1e-12)
    assert len([event for event in run.events if event.kind == "accumulation"]) == 1
    assert abs(run.events[-1].t - end) <= 1e-3, f"{run.events[-1].t - end:.2e} s from the end"
    assert run.tension["s"][-1] == pytest.approx(2.0 * G, rel=1e-12)
    assert run.ledger["impact"][-1] == pytest.approx(2.0 * G * drop, rel=1e-9)
    assert np.max(np.abs(run.ledger["residual"])) <= 1e-9


def test_a_bob_with_restitution_1_returns_to_its_height():
    marionette, x0 = falling_bob(1.0, 0.5)
    first = np.sqrt(2 * 0.5 / G)
    run = fan.simulate(marionette, x0, t_end=6 * first)
    assert len([event for event in run.events if event.kind == "catch"]) == 3
    assert run.q_D[-1, 0] == pytest.approx(0.5, abs=1e-9)
    assert run.ledger["impact"][-1] == pytest.approx(0.0, abs=1e-12)


STRINGS = 5


@cache
def stone() -> Marionette:
    """A uniformly spinning body on strings with driven upper ends and lengths."""
    rng = np.random.default_rng(4)
    strings = [
        {
            "name": f"s{i}",
            "path": [
                {"body": "stone", "at": rng.uniform(-0.4, 0.4, 3).tolist()},
                {"driven": ["x", "y", "z"], "at": [0, 0, 1]},
            ],
            "length": "driven",
            "restitution": {"parameter": f"e{i}", "value": 0.5},
        }
        for i in range(STRINGS)
    ]
    body = {"name": "stone", "joint": {"type": "free"}, "mass": 1.0, "inertia": [0.02] * 3}
    return fan.loads(json.dumps({"puppet": "stone", "bodies": [body], "strings": strings}))


def thrown(rng: np.random.Generator, flight: float) -> State | None:
    """A stone in free flight that is caught by several strings at once after `flight` seconds;
    None if one of them would be overstepped earlier.
    """
    puppet = stone()
    table = puppet.coordinates
    at_catch = puppet.state({"stone.rotation": rng.normal(size=3)})
    v_D = np.concatenate([rng.normal(size=3) - [0.0, 0.0, 2.0], 3.0 * rng.normal(size=3)])
    q_K = at_catch.q_K.copy()
    lengths = np.array([string.length_index[0] for string in puppet.tree.strings])
    ends = np.setdiff1d(np.arange(table.n_qK), lengths)
    q_K[ends] = rng.uniform((-0.8, -0.8, 0.7), (0.8, 0.8, 2.3), (STRINGS, 3)).ravel()
    q_K[lengths] = 0.0
    paths = puppet.library.evaluate("rows", q_D=at_catch.q_D, q_K=q_K, p=puppet.p).h
    q_K[lengths] = paths
    closing = Evaluation.at_state(puppet, at_catch.replace(v_D=v_D, q_K=q_K)).hdot > 0.05
    q_K[lengths] += ~closing
    q_D = at_catch.q_D.copy()
    gravity = np.array([0.0, 0.0, -G])
    q_D[:3] -= v_D[:3] * flight - 0.5 * gravity * flight**2
    q_D[3:] = multiply(q_D[3:], exp(-v_D[3:] * flight))
    v_D[:3] -= gravity * flight
    x0 = at_catch.replace(q_D=q_D, v_D=v_D, q_K=q_K)
    return x0 if np.max(Evaluation.at_state(puppet, x0).h) < 0 else None


def around(run: Trajectory, t: float) -> tuple[State, State]:
    """The states just before and after the first catch, at t."""
    rows = np.flatnonzero(run.t == t)
    return run.state(int(rows[0])), run.state(int(rows[-1]))


def random_restitutions(rng: np.random.Generator) -> np.ndarray:
    """(STRINGS,) restitutions: 0, 1 and numbers between."""
    return rng.choice([0.0, 1.0, rng.random()], STRINGS) * rng.choice([1.0, rng.random()])


def with_restitutions(e: np.ndarray) -> Marionette:
    return stone().with_parameters({f"e{i}": float(x) for i, x in enumerate(e)})


def energy_rise(run: Trajectory) -> float:
    """Largest rise of T + V between rows, relative to the largest kinetic energy."""
    energy = run.ledger["kinetic"] + run.ledger["potential"]
    return float(np.max(np.diff(energy)) / np.max(run.ledger["kinetic"]))


def test_strings_of_unequal_restitution_caught_together():
    rng = np.random.default_rng(5)
    together = shared = 0
    rises, ratios, breaches = [], [], []
    for _ in range(400):
        e, x0 = random_restitutions(rng), thrown(rng, 0.01)
        if x0 is None:
            continue
        puppet = with_restitutions(e)
        run = fan.simulate(puppet, x0, t_end=0.011, effort=False)
        rises.append(energy_rise(run))
        catches = [event for event in run.events if event.kind == "catch"]
        if not catches:
            continue
        first = [event for event in catches if event.t == catches[0].t]
        index = [int(event.name[1:]) for event in first]
        impulse = np.array([event.impulse for event in first])
        together += len(first) >= 2
        shared += np.count_nonzero(impulse) >= 2
        before, after = around(run, first[0].t)
        before, after = (
            Evaluation.at_state(puppet, before).hdot[index],
            Evaluation.at_state(puppet, after).hdot[index],
        )
        assert np.max(np.abs(before - [event.speed for event in first])) <= 1e-12
        assert np.min(impulse) >= 0.0
        faster = after + e[index] * before
        breaches.append(np.max(faster))
        ratios.append(np.max(np.abs(impulse * faster)))
    assert np.max(rises) <= 1e-12, f"energy rises by {np.max(rises):.2e}"
    assert np.max(breaches) <= 1e-12, f"{np.max(breaches):.2e} m/s beyond -e hdot-"
    assert np.max(ratios) <= 1e-12, f"{np.max(ratios):.2e} W of strings that pull and loosen more"
    assert together >= 150, f"{together} catches of several strings"
    assert shared >= 100, f"{shared} catches in which several strings took an impulse"


def test_a_stone_that_bounces_among_strings_never_gains_energy():
    rng = np.random.default_rng(6)
    catches = runs = 0
    while runs < 12:
        x0 = thrown(rng, 0.01)
        if x0 is None:
            continue
        runs += 1
        run = fan.simulate(with_restitutions(random_restitutions(rng)), x0, t_end=2.0, effort=False)
        assert energy_rise(run) <= 1e-8, f"energy rises by {energy_rise(run):.2e}"
        scale = np.max(run.ledger["kinetic"])
        residual = np.max(np.abs(run.ledger["residual"])) / scale
        assert residual <= 1e-8, f"{residual:.2e} of the kinetic energy"
        min_loss = np.min(np.diff(run.ledger["impact"])) / scale
        assert min_loss >= -1e-10, f"a catch gives {-min_loss:.2e} of the kinetic energy"
        assert np.max(run.violation.values) <= 1e-9
        catches += sum(event.kind == "catch" for event in run.events)
    assert catches >= 200, f"{catches} catches"


def test_unresolvable_bounces_end():
    """A stiff winch and a restitution of 1 bounced every 0.7 us, 740,000 times in 0.3 s."""
    winch = fan.loads("""
puppet: winch
bodies:
  - {name: bob, joint: {type: translation, axes: [x, z]}, mass: 1}
strings:
  - {name: line, path: [{body: bob}, {world: [0, 0, 1]}], length: driven, restitution: 1}
drives:
  - {on: line.length, inertia: 1.0e-5, drum: 0.02,
     control: {type: pd, stiffness: 3000, damping: 10}}
pose: {bob.z: 0, line.length: 1.0}
""")
    x0 = winch.state({"bob.z": 0.0, "line.length": 1.0, "line.command.length": 1.0 + 1e-5})
    run = fan.simulate(winch, x0, t_end=0.3, throw=False, max_memory=1e8)
    assert run.status is fan.Status.DONE
    assert len(run.events) < 100
    scale = 0.5 * 3000 * 1e-5**2
    assert np.max(np.abs(run.ledger["residual"])) < 1e-3 * scale
    assert -1e-3 * scale < run.ledger["impact"][-1] < 2 * scale
    wide = x0.replace(q_K=x0.q_K + 1e-3 - 1e-5)
    bounces = fan.simulate(winch, wide, t_end=0.02)
    assert len(bounces.events) > 5
    assert bounces.ledger["impact"][-1] == pytest.approx(0.0, abs=1e-9)
