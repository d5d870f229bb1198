"""Strings on slipping winches with contact, event-driven: closed forms, ledgers, fixed steps.

A winch slips while its string pulls with its largest tension: 0 < tau < max: sdot = 0; tau = max:
sdot >= 0. Its string has no impulse.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import fantoccini as fan
from contact.bodies import G, thrown
from fantoccini import Status

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

TOLERANCE = 1e-8
MAX_SLIP_ERROR = 1e-10
"""Largest deviation of a slip from its string's gap [m]: WinchTolerances::max_length_error."""


def sound(run: fan.Trajectory, residual: float = 1e-9) -> None:
    """Assert that the run reached its end, that nothing overlaps and that the ledger balances."""
    assert run.status is Status.DONE
    assert run.contact.gap.min(initial=0.0) > -1e-12
    assert run.violation.values.max() < MAX_SLIP_ERROR
    assert np.max(np.abs(run.ledger["residual"])) < residual


def kinds(run: fan.Trajectory) -> list[str]:
    """Kinds of the events, in order."""
    return [event.kind.value for event in run.events]


def time_of(run: fan.Trajectory, kind: str) -> float:
    """The time of the only event of a kind."""
    [event] = [event for event in run.events if event.kind == kind]
    return event.t


MU = 0.4


def pulled(most: float, shape: str = "box") -> fan.Marionette:
    """A body of 1 kg on a floor, and a rope from its middle, level, to a winch 2 m away."""
    sizes = {"box": ("size: [0.2, 0.3, 0.1]", 0.05), "sphere": ("radius: 0.1", 0.1)}
    size, height = sizes[shape]
    marionette = fan.loads(f"""
puppet: pulled
floor: 0
contact: {{friction: {MU}}}
bodies:
- {{name: body, joint: {{type: free}}, shapes: [{{type: {shape}, {size}, mass: 1}}]}}
strings:
- name: rope
  path: [{{body: body}}, {{world: [2, 0, {height}]}}]
  length: driven
  max_tension: {{parameter: most, value: 3}}
""")
    return marionette.with_parameters({"most": most})


def test_a_winch_that_pulls_less_than_friction_holds_slips_beside_a_block_at_rest():
    """All wound length becomes slip; the winch loses max times that."""
    block = pulled(3.0)
    wind = fan.Input.waypoints(block, {"rope.length": [(0, 2.0), (1.0, 1.2)]})
    x0 = block.state({"body.z": 0.05, "rope.length": 2.0})
    run = fan.simulate(block, x0, wind, t_end=1.5)
    sound(run, 1e-12)
    assert kinds(run) == ["slip", "grip"]
    assert np.max(np.abs(run.q_D - run.q_D[0])) < 1e-12
    assert abs(run.slip["rope"][-1] - 0.8) < TOLERANCE
    assert abs(run.ledger["slip"][-1] - 3.0 * 0.8) < TOLERANCE
    assert run.ledger["friction"][-1] == pytest.approx(0.0, abs=1e-12)


def test_a_block_that_a_winch_drags_slips_grips_and_slides_to_a_stop():
    """It follows the winch while this needs less than max; otherwise a = max / m - mu g."""
    max_tension = 5.0
    block = pulled(max_tension)
    wind = fan.Input.waypoints(block, {"rope.length": [(0, 2.0), (1.0, 1.2)]})
    x0 = block.state({"body.z": 0.05, "rope.length": 2.0})
    run = fan.simulate(block, x0, wind, t_end=1.5)
    sound(run, 1e-11)
    assert kinds(run) == ["slide", "slip", "release", "stick"]

    def wound(t: float) -> tuple[float, float, float]:
        """Wound length, its rate and its acceleration."""
        L, rate, acc = (float(values[0]) for values in wind.evaluate(t))
        return 2.0 - L, -rate, -acc

    a = max_tension - MU * G
    slips = brentq(lambda t: wound(t)[2] - a, 0.0, 0.1, xtol=1e-14)
    x1, v1, _ = wound(slips)
    # The rope is slack once the block is as fast as the winch, which brakes harder than mu g.
    free = brentq(lambda t: v1 + a * (t - slips) - wound(t)[1], 0.5, 0.9, xtol=1e-14)
    assert wound(free)[2] < -MU * G
    speed, way = v1 + a * (free - slips), x1 + v1 * (free - slips) + a * (free - slips) ** 2 / 2
    assert abs(time_of(run, "slip") - slips) < TOLERANCE
    assert abs(time_of(run, "release") - free) < TOLERANCE
    assert abs(time_of(run, "stick") - (free + speed / (MU * G))) < TOLERANCE
    end = way + speed**2 / (2 * MU * G)
    slip = wound(free)[0] - way
    assert abs(run["body.x"][-1] - end) < TOLERANCE
    assert abs(run.slip["rope"][-1] - slip) < TOLERANCE
    assert abs(run.ledger["slip"][-1] - max_tension * slip) < TOLERANCE
    assert abs(run.ledger["friction"][-1] - MU * G * end) < TOLERANCE


@pytest.mark.parametrize("rewind", [1e-4, 0.5])
def test_a_weight_that_its_winch_lets_down_on_the_floor_lies_there(rewind):
    """a = g - max / m until it lands; then the winch, which would rewind, pulls with max."""
    max_tension, height = 6.0, 0.7
    marionette = fan.loads(f"""
puppet: weight
floor: 0
contact: true
bodies:
- {{name: body, joint: {{type: free}}, shapes: [{{type: sphere, radius: 0.1, mass: 1}}]}}
strings:
- name: rope
  path: [{{body: body}}, {{world: [0, 0, 2]}}]
  length: 1.2
  max_tension: {max_tension}
  rewind_speed: {{parameter: rewind, value: 1}}
""")
    weight = marionette.with_parameters({"rewind": rewind})
    run = fan.simulate(weight, weight.state({"body.z": 0.8}), t_end=1.5)
    sound(run, 1e-11)
    a = G - max_tension
    [touch] = [event for event in run.events if event.kind == "touch"]
    assert abs(touch.t - np.sqrt(2 * height / a)) < TOLERANCE
    assert abs(touch.speed - np.sqrt(2 * a * height)) < TOLERANCE
    assert abs(run.ledger["impact"][-1] - a * height) < TOLERANCE
    assert abs(run.ledger["slip"][-1] - max_tension * height) < TOLERANCE
    assert abs(run.slip["rope"][-1] - height) < TOLERANCE
    assert abs(run["body.z"][-1] - 0.1) < 1e-12
    assert abs(run.tension["rope"][-1] - max_tension) < TOLERANCE
    assert abs(run.contact.force_on("body", len(run))[-1][2] - (G - max_tension)) < TOLERANCE


def test_a_rolling_ball_that_its_winch_catches_comes_to_rest_in_a_slipping_phase():
    """The rope has no impulse; a = -5/7 max / m until the ball rests, and its point sticks."""
    max_tension, v, start = 2.0, 1.5, 0.3
    ball = pulled(max_tension, "sphere")
    x0 = thrown(
        ball,
        {"body.z": 0.1, "body.x": 1.0, "rope.length": 1.0 + start},
        {"body.x": -v, "body.wy": -v / 0.1},
    )
    run = fan.simulate(ball, x0, t_end=2.0)
    sound(run, 1e-10)
    assert kinds(run)[:3] == ["catch", "slip", "grip"]
    catch = run.events[0]
    assert abs(catch.t - start / v) < TOLERANCE and abs(catch.speed - v) < TOLERANCE
    assert catch.impulse == 0.0
    a = max_tension / 1.4
    assert abs(time_of(run, "grip") - (start / v + v / a)) < TOLERANCE
    assert abs(run.slip["rope"][-1] - v**2 / (2 * a)) < TOLERANCE
    assert abs(run["body.x"][-1] - (1.0 - start - v**2 / (2 * a))) < TOLERANCE
    assert abs(run.ledger["slip"][-1] - 0.7 * v**2) < TOLERANCE
    assert np.max(np.abs(run.ledger["friction"])) < 1e-10


def test_a_ball_thrown_sliding_is_caught_while_it_slides():
    """v' = -mu g - max / m from the catch on, until the ball rolls."""
    max_tension, v, start = 2.0, 2.0, 0.05
    ball = pulled(max_tension, "sphere")
    x0 = thrown(ball, {"body.z": 0.1, "body.x": 1.0, "rope.length": 1.0 + start}, {"body.x": -v})
    run = fan.simulate(ball, x0, t_end=0.4)
    sound(run, 1e-11)
    catch = brentq(lambda t: v * t - MU * G * t**2 / 2 - start, 0.0, 0.1, xtol=1e-15)
    speed, spin = v - MU * G * catch, 2.5 * MU * G * catch
    roll = catch + (speed - spin) / (3.5 * MU * G + max_tension)
    assert abs(time_of(run, "catch") - catch) < TOLERANCE
    assert abs(time_of(run, "stick") - roll) < TOLERANCE


def with_winches(text: str, ends: list[list[float]]) -> fan.Marionette:
    """A puppet with ropes s0, s1 from points of the body a to winches with parameters."""
    for i, at in enumerate(ends):
        world = ", ".join(f"{{parameter: {axis}{i}, value: 1}}" for axis in "xyz")
        text += f"""
- name: s{i}
  path: [{{body: a, at: {at}}}, {{world: [{world}]}}]
  length: driven
  max_tension: {{parameter: most{i}, value: 5}}
  rewind_speed: {{parameter: rewind{i}, value: 1}}"""
    return fan.loads(text)


def wound_in(
    marionette: fan.Marionette,
    rng: np.random.Generator,
    place: dict[str, float],
    low: list[float],
    high: list[float],
    most: float,
    wound_lengths: list[tuple[float, float, float]],
) -> tuple[fan.Marionette, fan.State, fan.Input]:
    """The puppet with random winches between two corners, slightly slack ropes, and their inputs.

    Args:
        marionette: puppet of `with_winches`.
        rng: random numbers.
        place: places of the bodies.
        low, high: corners that the winches lie between [m].
        most: largest max_tension [N].
        wound_lengths: (time, least, most) wound length at that time [s, m, m].
    """
    numbers = {}
    for i in range(2):
        numbers |= {f"{a}{i}": float(w) for a, w in zip("xyz", rng.uniform(low, high), strict=True)}
        numbers |= {f"most{i}": rng.uniform(0.2, 1.0) * most}
        numbers |= {f"rewind{i}": float(rng.choice([1e-4, 0.1, 0.5]))}
    puppet = marionette.with_parameters(numbers)
    start, inputs = dict(place), {}
    for i, h in enumerate(_straight(puppet, place)):
        L = start[f"s{i}.length"] = float(h + rng.uniform(0.0, 0.03))
        pulls = [(t, L - float(rng.uniform(lowest, top))) for t, lowest, top in wound_lengths]
        inputs[f"s{i}.length"] = [(0, L), *pulls]
    return puppet, puppet.state(start), fan.Input.waypoints(puppet, inputs)


def _straight(puppet: fan.Marionette, place: dict[str, float]) -> np.ndarray:
    """Lengths of the two straight ropes [m]."""
    slack_state = puppet.state({**place, "s0.length": 9.0, "s1.length": 9.0})
    return puppet.constraint(slack_state)[:2] + 9.0


def test_fixed_steps_converge_to_event_driven_runs_at_their_order():
    """Errors of dt, dt / 2 and dt / 4, summed over random scenes, halve; ledgers balance."""
    marionette = with_winches(
        """
puppet: dragged
floor: 0
contact: {friction: 0.3}
bodies:
- {name: a, joint: {type: free}, shapes: [{type: box, size: [0.2, 0.3, 0.1], mass: 1}]}
strings:""",
        [[0.1, 0.15, 0.0], [0.1, -0.15, 0.0]],
    )
    errors, moved = np.zeros(3), 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        block, x0, wind = wound_in(
            marionette,
            rng,
            {"a.z": 0.05},
            [0.7, -0.6, 0.05],
            [1.2, 0.6, 0.4],
            8.0,
            [(0.3, 0.05, 0.25), (0.7, 0.0, 0.4)],
        )
        run = fan.simulate(block, x0, wind, t_end=0.8)
        sound(run)
        moved += {"catch", "slip", "grip", "slide"} <= set(kinds(run))
        for k, dt in enumerate((2e-3, 1e-3, 5e-4)):
            method = fan.TimeStepping(dt=dt)
            stepped_run = fan.simulate(block, x0, wind, t_end=0.8, method=method)
            errors[k] += np.max(np.abs(stepped_run.q_D[-1] - run.q_D[-1]))
    assert moved >= 8
    assert np.all(errors[:-1] > 1.5 * errors[1:]) and errors[0] > 3.0 * errors[2]
    assert errors[2] < 12 * 1e-3


def test_a_box_hung_from_winches_over_a_floor_has_a_balanced_ledger():
    """Catches, slips, impacts and friction with a post and a ball: the ledger balances."""
    marionette = with_winches(
        """
puppet: hung
floor: 0
contact: {friction: 0.5, restitution: 0.3}
obstacles:
- {name: post, type: box, size: [0.1, 0.1, 0.6], at: [0.35, 0.05, 0.3]}
bodies:
- {name: a, joint: {type: free}, shapes: [{type: box, size: [0.2, 0.3, 0.1], mass: 1}]}
- {name: b, joint: {type: free}, shapes: [{type: sphere, radius: 0.1, mass: 0.5}]}
strings:""",
        [[0.1, 0.15, 0.05], [-0.1, -0.15, 0.05]],
    )
    met = 0
    for seed in range(8):
        rng = np.random.default_rng(seed)
        hung, x0, wind = wound_in(
            marionette,
            rng,
            {"a.z": 0.4, "b.x": -0.35, "b.z": 0.1},
            [-0.6, -0.6, 0.8],
            [0.6, 0.6, 1.2],
            15.0,
            [(0.4, 0.0, 0.3), (0.8, -0.5, 0.0)],
        )
        run = fan.simulate(hung, x0, wind, t_end=1.0)
        sound(run, 1e-8)
        met += {"slip", "touch"} <= set(kinds(run))
    assert met >= 5
