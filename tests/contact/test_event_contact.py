"""Event-driven contact, compared with closed forms to 1e-8: touches, lifts, sticks and slides."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import fantoccini as fan
from contact.bodies import G, balls_that_meet, ladder, on_slope, rocking_block, thrown
from contact.events import CLOSE, of, sound
from fantoccini import Status

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]


@pytest.mark.parametrize("slope", [0.1, 1.0])
def test_a_block_on_a_slope_below_the_threshold_stays(slope):
    """Nothing moves; friction balances the weight along the slope; corners share it equally."""
    marionette = on_slope(slope, 1.05 * np.tan(slope))
    run = fan.simulate(marionette, marionette.state({"body.z": 0.05}), t_end=5.0)
    sound(run)
    assert not run.events
    assert np.max(np.abs(run.q_D - run.q_D[0])) < 1e-12
    force = run.contact.force_on("body", len(run))
    assert np.allclose(force, [-G * np.sin(slope), 0.0, G * np.cos(slope)], atol=1e-10)


@pytest.mark.parametrize("slope", [0.3, 0.8])
def test_a_block_above_the_threshold_slides_at_its_acceleration(slope):
    """a = g (sin - mu cos); friction dissipates mu N times the displacement."""
    mu = 0.6 * np.tan(slope)
    marionette, a = on_slope(slope, mu), G * (np.sin(slope) - mu * np.cos(slope))
    run = fan.simulate(marionette, marionette.state({"body.z": 0.05}), t_end=0.5)
    sound(run)
    assert abs(run["body.x"][-1] - a * 0.125) < CLOSE
    assert abs(run.ledger["friction"][-1] - mu * G * np.cos(slope) * a * 0.125) < CLOSE
    assert [event.kind for event in run.events] == ["slide"]


@pytest.mark.parametrize("mu", [0.1, 0.7])
def test_a_sliding_block_stops_at_its_stopping_distance(mu):
    """s = v^2 / (2 mu g), t = v / (mu g)."""
    marionette, speed = on_slope(0.0, mu), np.hypot(1.0, 0.7)
    x0 = thrown(marionette, {"body.z": 0.05}, {"body.x": 1.0, "body.y": 0.7})
    run = fan.simulate(marionette, x0, t_end=1.2 * speed / (mu * G))
    sound(run)
    assert abs(np.hypot(run["body.x"][-1], run["body.y"][-1]) - speed**2 / (2 * mu * G)) < CLOSE
    [stick] = of(run, "stick")
    assert abs(stick.t - speed / (mu * G)) < CLOSE
    assert np.max(np.abs(run.v_D[-1])) < 1e-12


def test_a_block_pushed_up_a_steep_slope_turns_and_slides_back():
    """Friction reverses with the block's motion, at an event."""
    slope, mu, v = 0.5, 0.3, 2.0
    run = fan.simulate(
        on_slope(slope, mu),
        thrown(on_slope(slope, mu), {"body.z": 0.05}, {"body.x": -v}),
        t_end=1.5,
    )
    sound(run)
    up, down = (G * (np.sin(slope) + sign * mu * np.cos(slope)) for sign in (1, -1))
    first, back = of(run, "slide")
    assert first.t == 0.0 and abs(back.t - v / up) < CLOSE
    exact = -(v**2) / (2 * up) + down * (1.5 - v / up) ** 2 / 2
    assert abs(run["body.x"][-1] - exact) < CLOSE


def test_a_ball_thrown_sliding_comes_to_roll_at_five_sevenths_of_its_speed():
    """v = 5/7 v0 from t = 2 v0 / (7 mu g) on; friction dissipates 1/7 of the energy."""
    marionette = on_slope(0.0, 0.3, "sphere")
    run = fan.simulate(marionette, thrown(marionette, {"body.z": 0.1}, {"body.x": 2.0}), t_end=0.5)
    sound(run)
    roll = 2 * 2.0 / (7 * 0.3 * G)
    displacement = 2.0 * roll - 0.3 * G * roll**2 / 2 + 10.0 / 7.0 * (0.5 - roll)
    assert abs(run["v:body.x"][-1] - 10.0 / 7.0) < CLOSE
    assert abs(run["body.x"][-1] - displacement) < CLOSE
    assert abs(run.ledger["friction"][-1] - 0.5 * 2.0**2 * 2 / 7) < CLOSE
    assert abs(of(run, "stick")[0].t - roll) < CLOSE


def test_a_hoop_with_backspin_comes_back():
    """For I = m r^2: v = (v0 - r w0) / 2 when it rolls."""
    marionette = on_slope(0.0, 0.4, "sphere", mass="1", inertia="[0.01, 0.01, 0.01]")
    x0 = thrown(marionette, {"body.z": 0.1}, {"body.x": 1.0, "body.wy": -30.0})
    run = fan.simulate(marionette, x0, t_end=1.0)
    sound(run)
    assert abs(run["v:body.x"][-1] + 1.0) < CLOSE


def test_a_ball_with_restitution_comes_to_rest_when_its_bounces_accumulate():
    """Speeds decrease by e from bounce to bounce; all end at t = v/g (1 + 2 e / (1 - e))."""
    marionette = fan.loads("""
puppet: ball
floor: 0
contact: {restitution: 0.7}
bodies:
- {name: body, joint: {type: free}, shapes: [{type: sphere, radius: 0.1, mass: 1}]}
""")
    run = fan.simulate(marionette, marionette.state({"body.z": 1.1}), t_end=4.0)
    sound(run)
    v = np.sqrt(2 * G)
    touches = of(run, "touch")
    assert np.allclose([event.speed for event in touches[:20]], v * 0.7 ** np.arange(20), rtol=1e-7)
    [end] = of(run, "accumulation")
    assert abs(end.t - v / G * (1 + 2 * 0.7 / 0.3)) < CLOSE
    assert abs(run["body.z"][-1] - 0.1) < 1e-12
    assert np.isclose(run.ledger["impact"][-1], G, atol=CLOSE)


def test_bounces_that_accumulate_about_the_end_of_a_run_end_with_it():
    """The end of the series is after the bounce that predicts it, but no event is after the run."""
    marionette = fan.loads(BALL)
    x0 = marionette.state({"body.z": 1.1})
    events = fan.simulate(marionette, x0, t_end=4.0).events
    [k] = [k for k, event in enumerate(events) if event.kind == "accumulation"]
    t_end = 0.5 * (events[k - 1].t + events[k].t)
    assert events[k - 1].t < t_end < events[k].t
    run = fan.simulate(marionette, x0, t_end=t_end)
    assert [event.t for event in run.events][-1] == t_end == run.t[-1]


def test_a_ladder_leaves_the_wall_at_two_thirds_of_its_height():
    """Without friction a ladder's top leaves the wall at 2/3 of its initial height."""
    angle = np.deg2rad(70.0)
    marionette, x0 = ladder(angle)
    run = fan.simulate(marionette, x0, t_end=0.55)
    sound(run)
    [lift] = of(run, "lift")
    assert lift.name == "rod|wall"
    height = run["rod.z"][np.searchsorted(run.t, lift.t)] - 0.001
    assert abs(height - 0.5 * np.sin(angle) * 2 / 3) < CLOSE


@pytest.mark.parametrize("mu", [0.2, 0.4, 0.6])
def test_a_falling_rod_slips_when_its_forces_leave_the_cone(mu):
    """A rod with a round foot of radius r rolls until |F| = mu N, both from its energy."""
    r, start = 1e-3, 1e-2
    marionette = fan.loads(f"""
puppet: pencil
floor: 0
contact: {{friction: {mu}}}
bodies:
- name: rod
  joint: {{type: free}}
  shapes: [{{type: sphere, radius: {r}, at: [0, 0, -0.5]}}]
  mass: 1
  inertia: [0.083333333333333333, 0.083333333333333333, 1.0e-6]
""")
    x0 = marionette.state(
        {
            "rod.x": 0.5 * np.sin(start),
            "rod.z": 0.5 * np.cos(start) + r,
            "rod.rotation": (np.cos(start / 2), 0.0, np.sin(start / 2), 0.0),
        }
    )
    run = fan.simulate(marionette, x0, t_end=2.4)
    assert run.status is Status.DONE
    slide = of(run, "slide")[0]
    angle_of_slip = 2 * np.arcsin(run["rod.qy"][np.searchsorted(run.t, slide.t)])

    def excess(angle: float) -> float:
        """|F| - mu N of the rolling rod: T = A(angle) w^2 / 2, V = g cos(angle) / 2."""
        s, c = np.sin(angle), np.cos(angle)
        A = (r + c / 2) ** 2 + s**2 / 4 + 1 / 12
        dA = -r * s
        squared = G * (np.cos(start) - c) / A
        acc = (G * s / 2 - dA * squared / 2) / A
        F = (r + c / 2) * acc - s / 2 * squared
        N = G - s / 2 * acc - c / 2 * squared
        return float(abs(F) - mu * N)

    angles = np.linspace(start, np.pi / 2, 2001)
    first = int(np.argmax([excess(a) > 0.0 for a in angles]))
    assert abs(angle_of_slip - brentq(excess, angles[first - 1], angles[first], xtol=1e-14)) < CLOSE


def test_a_rocking_block_loses_housners_share_at_every_impact():
    """The ratio of angular velocities is 1 - 3/2 sin^2 a, tan a = width over height."""
    marionette, x0, a = rocking_block(0.05)
    run = fan.simulate(marionette, x0, t_end=1.2)
    sound(run)
    impacts = of(run, "touch")
    assert len(impacts) == 5
    for impact in impacts:
        w = run["v:block.wy"][np.abs(run.t - impact.t) < 1e-12]
        assert abs(w[-1] / w[0] - (1 - 1.5 * np.sin(a) ** 2)) < CLOSE


def test_two_balls_that_meet_keep_their_momentum():
    """Inelastic, off-centre and with friction: momentum to rounding, energy never increases."""
    marionette, x0 = balls_that_meet()
    run = fan.simulate(marionette, x0, t_end=1.0)
    sound(run, 1e-12)
    momentum = np.array([marionette.momentum(run.state(i)) for i in (0, len(run) - 1)])
    assert np.allclose(momentum[0], momentum[1], atol=1e-12)
    assert np.all(np.diff(run.ledger["kinetic"]) < 1e-12)
    assert [event.kind for event in run.events] == ["touch", "lift"]


def test_two_hung_bobs_collide_with_their_strings_as_one_problem():
    """The strings take part in the impact; the energy never rises and the strings stay exact."""
    marionette = fan.loads("""
puppet: bobs
contact: {friction: 0.3, restitution: 0.5}
bodies:
- {name: a, joint: {type: free}, shapes: [{type: sphere, radius: 0.1, mass: 1}]}
- {name: b, joint: {type: free}, shapes: [{type: sphere, radius: 0.07, mass: 0.3}]}
strings:
- {name: sa, path: [{body: a}, {world: [0, 0, 1]}], length: 1}
- {name: sb, path: [{body: b}, {world: [0.17, 0, 1]}], length: 1}
""")
    x0 = marionette.state({"a.x": -0.6, "a.z": 0.2, "b.x": 0.17, "b.z": 0.0})
    run = fan.simulate(marionette, x0, t_end=3.0)
    sound(run)
    energy = run.ledger["kinetic"] + run.ledger["potential"]
    assert np.all(np.diff(energy) < 1e-9)
    assert run.violation.values.max() < 1e-12
    assert len(of(run, "touch")) >= 3
    speed = np.sqrt(2 * G * 0.2)
    assert abs(of(run, "touch")[0].speed - speed) < CLOSE


HEAP = """
puppet: heap
floor: 0
contact: {friction: %s, restitution: %s}
obstacles:
- {name: post, type: box, size: [0.1, 0.1, 0.6], at: [0.3, 0.05, 0.3]}
bodies:
- {name: a, joint: {type: free}, shapes: [{type: box, size: [0.2, 0.3, 0.1], mass: 1}]}
- {name: b, joint: {type: free}, shapes: [{type: sphere, radius: 0.1, mass: 1}]}
- name: c
  joint: {type: free}
  shapes: [{type: capsule, from: [-0.15, 0, 0], to: [0.15, 0, 0], radius: 0.05, mass: 0.5}]
- {name: d, joint: {type: free}, shapes: [{type: ellipsoid, radii: [0.1, 0.15, 0.08], mass: 0.7}]}
"""


@pytest.mark.parametrize(("friction", "restitution"), [(0.5, 0.0), (0.5, 0.5)])
def test_a_random_heap_comes_to_rest_or_has_a_status(friction, restitution):
    """Nothing overlaps, the energies balance, and a run that stops has a specific status."""
    marionette, rng = fan.loads(HEAP % (friction, restitution)), np.random.default_rng(3)
    arrived = 0
    for _ in range(3):
        place, speed = {}, {}
        for i, name in enumerate("abcd"):
            place |= {f"{name}.x": rng.uniform(-0.2, 0.2), f"{name}.z": 0.3 + 0.4 * i}
            speed |= {f"{name}.{axis}": rng.uniform(-2, 2) for axis in "xyz"}
        run = fan.simulate(marionette, thrown(marionette, place, speed), t_end=2.0, throw=False)
        assert run.status in (Status.DONE, Status.TOO_MANY_EVENTS, Status.NO_UNIQUE_MOTION)
        arrived += run.status is Status.DONE
        assert run.contact.gap.min(initial=0.0) > -1e-9
        if run.status is Status.DONE:
            assert np.max(np.abs(run.ledger["residual"])) < 1e-7
        assert np.all(np.isfinite(run.q_D))
    assert arrived >= 1


def test_a_rough_heap_with_points_on_edges_reaches_its_end():
    """A capsule wedged between floor and post rolls over the post's edge, where the surface bends.

    Steps used to shrink to rounding (over 12 s) or end with NO_UNIQUE_MOTION. In the last one a box
    comes to stand beside the post.
    """
    marionette = fan.loads(HEAP % (1.0, 0.0))
    for seed in (2, 13, 15, 23, 19):
        rng, place, speed = np.random.default_rng(seed), {}, {}
        for i, name in enumerate("abcd"):
            place |= {f"{name}.x": rng.uniform(-0.2, 0.2), f"{name}.z": 0.3 + 0.4 * i}
            speed |= {f"{name}.{axis}": rng.uniform(-2, 2) for axis in "xyz"}
        run = fan.simulate(marionette, thrown(marionette, place, speed), t_end=2.0)
        sound(run, 1e-9)


def test_a_rod_dragged_into_a_rough_floor_jams_by_name():
    """Painleve: above mu = 4/3 friction can jam a sliding rod, which then has no unique motion."""
    marionette = fan.loads("""
puppet: painleve
floor: 0
contact: {friction: 2.5}
bodies:
- name: rod
  joint: {type: free}
  shapes: [{type: sphere, radius: 0.001, at: [0, 0, -0.5]}]
  mass: 1
  inertia: [0.083333333333333333, 0.083333333333333333, 1.0e-4]
""")
    lean = 0.6
    x0 = thrown(
        marionette,
        {
            "rod.x": -0.5 * np.sin(lean),
            "rod.z": 0.5 * np.cos(lean) + 0.001,
            "rod.rotation": (np.cos(lean / 2), 0.0, -np.sin(lean / 2), 0.0),
        },
        {"rod.x": 3.0},
    )
    run = fan.simulate(marionette, x0, t_end=1.0, throw=False)
    assert run.status is Status.NO_UNIQUE_MOTION
    with pytest.raises(fan.errors.SimulationError, match="Painlev"):
        fan.simulate(marionette, x0, t_end=1.0)


BALL = """
puppet: ball
floor: 0
contact: {friction: 0, restitution: 0.5}
bodies:
- {name: body, joint: {type: free}, shapes: [{type: sphere, radius: 0.1, mass: 1}]}
"""


def test_a_batch_includes_contact_and_flight():
    """Each run equals a single one; the ball that starts high touches nothing."""
    marionette = fan.loads(BALL)
    starts = [marionette.state({"body.z": z}) for z in (0.25, 5.0)]
    times = np.linspace(0.0, 0.4, 5)
    batch = fan.simulate_batch(marionette, starts, t_end=0.4, save_at=times)
    assert np.all(batch.status == Status.DONE)
    for i, x0 in enumerate(starts):
        single = fan.simulate(marionette, x0, t_end=0.4, save_at=times)
        assert np.allclose(batch.q_D[i, -1], single.q_D[-1], atol=1e-12)


def test_the_ledger_has_an_impact_at_the_start():
    """The first sample is before the impact; the ledger contains all losses."""
    marionette = fan.loads(BALL)
    run = fan.simulate(
        marionette, thrown(marionette, {"body.z": 0.1}, {"body.z": -1.0}), t_end=0.05
    )
    sound(run, 1e-12)
    assert run["v:body.z"][0] == -1.0 and run["v:body.z"][1] == 0.5
    assert np.isclose(run.ledger["impact"][-1], 0.375)


@pytest.mark.parametrize("gap", [-9e-7, 9e-7])
def test_a_start_that_nearly_touches_is_brought_to_touch(gap):
    """This is not an event, and is not in the ledger."""
    marionette = fan.loads(BALL)
    run = fan.simulate(marionette, marionette.state({"body.z": 0.1 + gap}), t_end=0.2)
    sound(run, 1e-12)
    assert not run.events and abs(run["body.z"][-1] - 0.1) < 1e-12


@pytest.mark.parametrize("method", [fan.Event(), fan.TimeStepping(dt=1e-3)], ids=["event", "steps"])
def test_a_driven_bat_gives_a_ball_its_restitution(method):
    """A bat does work on the ball, which leaves it at e times the speed of approach."""
    marionette = fan.loads("""
puppet: bat
gravity: [0, 0, 0]
contact: {friction: 0, restitution: 0.5}
bodies:
- name: bat
  joint: {type: prismatic, axis: [1, 0, 0], driven: true}
  shapes: [{type: box, size: [0.1, 0.4, 0.4], mass: 1}]
- {name: ball, joint: {type: free}, shapes: [{type: sphere, radius: 0.1, mass: 1}]}
""")
    inputs = fan.Input.waypoints(marionette, {"bat": [(0.0, 0.0), (0.4, 0.6)]})
    x0 = marionette.state({"ball.x": 0.4})
    run = fan.simulate(marionette, x0, inputs, t_end=0.4, method=method)
    touch = of(run, "touch")[0].t
    bat = inputs.evaluate(touch)[1][0]
    assert bat > 1.0
    accuracy = 1e-8 if isinstance(method, fan.Event) else 0.02
    assert abs(run["v:ball.x"][-1] / (1.5 * bat) - 1.0) < accuracy
