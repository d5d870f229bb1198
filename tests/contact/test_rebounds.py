"""Bodies that rebound within a fixed step touch first, in single runs and in lanes."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from contact.bodies import G, stepped, thrown
from contact.files import BOUNCER
from fantoccini.base.errors import Status

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

OTHER_AWAY = {"other.x": -50.0, "other.z": 5.0}


@pytest.fixture(scope="module")
def bouncer() -> fan.Marionette:
    return fan.loads(BOUNCER)


def turned(way: np.ndarray, e: float) -> np.ndarray:
    """Distance from the touched surface, by the displacement beyond it without contact."""
    return np.where(way < 0.0, -way, e * way)


@pytest.fixture(scope="module")
def elastic() -> dict[float, fan.Marionette]:
    return {e: fan.loads(BOUNCER.replace("0.8", str(e))) for e in (0.0, 0.3, 0.8, 1.0)}


@pytest.mark.parametrize("dt", [1e-3, 2e-3, 5e-3])
@pytest.mark.parametrize("e", [0.0, 0.3, 0.8, 1.0])
def test_a_ball_rebounds_at_its_touch(elastic, e, dt):
    """z = v (t* - t) until it touches at t*, and e v (t - t*) afterwards, at every sample."""
    for speed in (0.3, 3.0, 10.0, 20.0, 40.0):
        for high in (0.0131, 0.0204, 0.05):
            for axis, start, sign in (("z", 0.05 + high, -1.0), ("x", 9.9 - high, 1.0)):
                place = {**OTHER_AWAY, "ball.z": 5.0} | {f"ball.{axis}": start}
                x0 = thrown(elastic[e], place, {f"ball.{axis}": sign * speed})
                run = stepped(elastic[e], x0, 3 * high / speed + 2 * dt, dt)
                displacement = speed * run.t - high
                gap = run[f"ball.{axis}"] - 0.05 if axis == "z" else 9.9 - run[f"ball.{axis}"]
                # Without restitution the landing step ends at the floor.
                sure = (
                    np.full(len(displacement), True)
                    if e > 0.0
                    else (displacement < 0.0) | (displacement > speed * dt)
                )
                assert np.allclose(gap[sure], turned(displacement, e)[sure], rtol=0, atol=1e-12)
                assert gap.min() > -1e-12
                assert run.status is Status.DONE
                assert len(run.contact) and np.max(np.abs(run.contact.gap)) < 1e-12
                assert np.diff(run.ledger["kinetic"]).max() <= 1e-12 * speed**2


@pytest.mark.parametrize(("speed", "dt"), [(35.0, 5e-4), (300.0, 5e-4), (300.0, 2e-3), (9.0, 2e-5)])
def test_a_bullet_springs_back_in_however_short_a_step(elastic, speed, dt):
    """Regression: its impulse was bounded by the largest force over the step, 300 m/s went on."""
    x0 = thrown(elastic[0.8], {**OTHER_AWAY, "ball.z": 5.0, "ball.x": 9.87}, {"ball.x": speed})
    run = stepped(elastic[0.8], x0, 20 * dt + 0.06 / speed, dt)
    displacement = speed * run.t - 0.03
    assert run.status is Status.DONE
    assert np.allclose(9.9 - run["ball.x"], turned(displacement, 0.8), rtol=0, atol=1e-11)
    assert run.ledger["kinetic"][-1] == pytest.approx(0.64 * run.ledger["kinetic"][0], rel=1e-9)


def test_a_falling_ball_rebounds_at_its_touch(elastic):
    """Under gravity, places are exact to the order of dt^2 g, and energies to that of dt g v."""
    ball = fan.loads(BOUNCER.replace("[0, 0, 0]", "[0, 0, -9.81]"))
    for high in np.linspace(0.2, 0.3, 7):
        run = stepped(ball, thrown(ball, {**OTHER_AWAY, "ball.z": 0.05 + high}, {}), 0.3, 2e-3)
        v = np.sqrt(2 * G * high)
        since = run.t - v / G
        exact = np.where(since < 0.0, high - G * run.t**2 / 2, 0.8 * v * since - G * since**2 / 2)
        deviation = np.abs(run["ball.z"] - 0.05 - exact)
        assert deviation.max() < 3 * G * 2e-3 * 0.3
        assert np.max(np.abs(run.contact.gap)) < 2e-3**2 * G
        assert run.status is Status.DONE


def test_several_balls_rebound_at_different_times_within_one_step():
    """Five in a step, at least 0.1 us apart; none waits for another."""
    bodies = "".join(
        f"- {{name: b{k}, joint: {{type: prismatic, axis: [0, 0, 1]}}, "
        f"shapes: [{{type: sphere, radius: 0.05, mass: 1, at: [{k}, 0, 0]}}]}}\n"
        for k in range(5)
    )
    balls = fan.loads(
        "puppet: rain\ngravity: [0, 0, 0]\nfloor: 0\n"
        f"contact: {{friction: 0, restitution: 0.8}}\nbodies:\n{bodies}"
    )
    high = np.array([0.021, 0.021002, 0.03, 0.0358, 0.0399])
    x0 = thrown(
        balls, {f"b{k}": 0.05 + h for k, h in enumerate(high)}, {f"b{k}": -20.0 for k in range(5)}
    )
    run = stepped(balls, x0, 0.012, 2e-3)
    displacement = 20.0 * run.t[:, None] - high
    assert np.allclose(run.q_D - 0.05, turned(displacement, 0.8), rtol=0, atol=1e-12)
    assert np.max(np.abs(run.contact.gap)) < 1e-12
    assert sorted(e.name for e in run.events if e.kind == "touch") == [
        f"b{k}|floor" for k in range(5)
    ]
    assert run.ledger["residual"] == pytest.approx(np.zeros(len(run)), abs=1e-9)


@pytest.mark.parametrize("dt", [1e-3, 5e-3])
def test_impacts_pass_through_a_row_of_balls_within_a_step(dt):
    """e = 1: the last ball leaves with the whole speed, for any number of steps between."""
    bodies = "".join(
        f"- {{name: b{k}, joint: {{type: prismatic, axis: [1, 0, 0]}}, "
        "shapes: [{type: sphere, radius: 0.05, mass: 1}]}\n"
        for k in range(5)
    )
    row = fan.loads(
        "puppet: row\ngravity: [0, 0, 0]\ncontact: {friction: 0, restitution: 1}\n"
        f"bodies:\n{bodies}"
    )
    place = np.concatenate([[0.0], np.cumsum([0.103, 0.101, 0.101, 0.1005])])
    x0 = thrown(row, {f"b{k}": x for k, x in enumerate(place)}, {"b0": 20.0})
    run = stepped(row, x0, 0.02, dt)
    assert run.v_D[-1] == pytest.approx([0.0, 0.0, 0.0, 0.0, 20.0], abs=1e-9)
    # Each stops at the next one; the last one moves for the remaining time.
    at = [*(place[1:] - 0.1), place[4] + 20.0 * 0.02 - (place[4] - 0.4)]
    assert run.q_D[-1] == pytest.approx(at, abs=1e-9)
    assert np.max(np.abs(run.contact.gap)) < 1e-9


def test_a_box_that_falls_on_one_corner_after_the_other_adds_no_energy():
    """Corners touch at different times; none is struck at a distance or passes the floor."""
    box = fan.loads("""
puppet: box
gravity: [0, 0, 0]
floor: 0
contact: {friction: 0.3, restitution: 0.8}
bodies:
- {name: body, joint: {type: free}, shapes: [{type: box, size: [0.2, 0.3, 0.1], mass: 1}]}
""")
    rng = np.random.default_rng(0)
    for _ in range(6):
        tilt = np.concatenate([[1.0], 0.02 * rng.normal(size=3)])
        place = {"body.z": 0.07, "body.rotation": tuple(tilt / np.linalg.norm(tilt))}
        run = stepped(box, thrown(box, place, {"body.z": -10.0}), 0.02, 2e-3)
        assert run.status is Status.DONE
        lost = np.diff(run.ledger["impact"] + run.ledger["friction"])
        assert lost.min() > -1e-9 * run.ledger["kinetic"][0]
        assert run["v:body.z"][-1] > 0.0


def test_a_bullet_rebounds_at_the_wall(bouncer):
    """It has 400 m/s: 0.8 m in a step of 2 ms. Faster ones exceed the largest force."""
    x0 = thrown(bouncer, {**OTHER_AWAY, "ball.z": 5.0}, {"ball.x": 400.0})
    run = stepped(bouncer, x0, 0.03, 2e-3)
    displacement = 400.0 * run.t - 9.9
    assert np.allclose(
        run["ball.x"],
        np.where(displacement < 0, 9.9 + displacement, 9.9 - 0.8 * displacement),
        atol=1e-9,
    )
    assert run.contact.gap.max() < 1e-9


def test_colliding_balls_touch_before_they_separate(bouncer):
    """Head-on: momentum, e times the closing speed, and both places in closed form."""
    x0 = thrown(
        bouncer, {"ball.x": 0.0, "ball.z": 5.0, "other.x": 1.0, "other.z": 5.0},
        {"ball.x": 10.0, "other.x": -7.0},
    )  # fmt: skip
    run = stepped(bouncer, x0, 0.08, 2e-3)
    t = run.t - (1.0 - 0.12) / 17.0
    common = (0.1 * 10.0 - 0.3 * 7.0) / 0.4
    after = common - 0.8 * 17.0 * 0.75, common + 0.8 * 17.0 * 0.25
    at = 10.0 * 0.88 / 17.0, 1.0 - 7.0 * 0.88 / 17.0
    assert np.allclose(run["ball.x"], at[0] + np.where(t < 0, 10.0, after[0]) * t, atol=1e-12)
    assert np.allclose(run["other.x"], at[1] + np.where(t < 0, -7.0, after[1]) * t, atol=1e-12)
    assert np.max(np.abs(run.contact.gap)) < 1e-12


def test_lanes_rebound_at_their_touches(bouncer):
    """Each rebounds at its own time within its step, to the bits of a single run."""
    highs = np.linspace(0.01, 0.05, 9)
    starts = [
        thrown(bouncer, {**OTHER_AWAY, "ball.z": 0.05 + h}, {"ball.z": -15.0, "ball.x": 1.0})
        for h in highs
    ]
    runs = fan.simulate_batch(bouncer, starts, t_end=0.006, method=fan.TimeStepping(dt=2e-3))
    for k, h in enumerate(highs):
        displacement = 15.0 * runs.t - h
        z = runs.q_D[k, :, bouncer.coordinates.q_D.index("ball.z")] - 0.05
        assert np.allclose(z, turned(displacement, 0.8), rtol=0, atol=1e-12)
        single_run = stepped(bouncer, starts[k], 0.006, 2e-3)
        assert np.array_equal(single_run.q_D[[0, -1]], runs.q_D[k, [0, -1]])


def test_a_slab_struck_by_a_ball_stays_on_the_floor():
    """A heavy slab on the floor is not lifted by the ball that falls on it."""
    scene = fan.loads("""
puppet: anvil
floor: 0
contact:
  friction: 0.3
  restitution: 0.8
  pairs: [{between: [slab, floor], restitution: 0}]
bodies:
- {name: slab, joint: {type: free}, shapes: [{type: box, size: [1, 1, 0.1], mass: 5}]}
- {name: ball, joint: {type: free}, shapes: [{type: sphere, radius: 0.05, mass: 0.5}]}
pose: {slab.z: 0.05, ball.z: 0.3}
""")
    x0 = thrown(scene, {"slab.z": 0.05, "ball.z": 0.163, "ball.x": 0.1}, {"ball.z": -10.0})
    run = stepped(scene, x0, 0.1, 2e-3)
    assert run["ball.z"].min() > 0.15 - 1e-9
    assert np.max(np.abs(run["slab.z"] - 0.05)) < 1e-9
    assert run["v:ball.z"].max() == pytest.approx(8.0, rel=0.01)


def test_a_landing_without_restitution_closes_its_gap_within_the_step():
    """u_n+ = -gap/dt, then rest: valid at any speed, also with braking forces."""
    for lift in (0.0, 20.0):
        ball = fan.loads(f"""
puppet: lands
gravity: [0, 0, {lift}]
floor: 0
contact: {{friction: 0.3}}
bodies:
- {{name: ball, joint: {{type: free}}, shapes: [{{type: sphere, radius: 0.05, mass: 0.1}}]}}
""")
        x0 = thrown(ball, {"ball.z": 0.05 + 0.013}, {"ball.z": -10.0})
        run = stepped(ball, x0, 0.004, 2e-3)
        assert run.status is Status.DONE
        assert run["ball.z"][1] == pytest.approx(0.05, abs=1e-12)
        assert run.contact.at_sample(1).gap == pytest.approx([0.0], abs=1e-12)


SIDES = """
puppet: sides
gravity: [0, 0, 0]
floor: 0
contact: {friction: 0, restitution: 0, pairs: [{between: [p, q], restitution: 1}]}
bodies:
- name: swinger
  joint: {name: a, type: prismatic, axis: [0, 0, 1], at: [5, 0, 5], limits: {lower: -9, upper: 0}}
  shapes: [{type: sphere, radius: 0.05, mass: 1}]
- name: hung
  joint: {name: s, type: prismatic, axis: [0, 0, 1], at: [9, 0, 5]}
  shapes: [{type: sphere, radius: 0.05, mass: 1}]
- name: lands
  joint: {name: c, type: prismatic, axis: [0, 0, 1], at: [-5, 0, 0.05]}
  shapes: [{type: sphere, radius: 0.05, mass: 1}]
- name: p
  joint: {name: x, type: prismatic, axis: [1, 0, 0], at: [0, 0, 2]}
  shapes: [{type: sphere, radius: 0.05, mass: 1}]
- name: q
  joint: {name: y, type: prismatic, axis: [1, 0, 0], at: [0, 0, 2]}
  shapes: [{type: sphere, radius: 0.05, mass: 1}]
strings:
- {name: line, path: [{body: hung}, {world: [9, 0, 6]}], length: 1.5}
pose: {y: 1}
"""


@pytest.mark.parametrize("speed", [2.0, 10.0])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_inelastic_contacts_stop_while_others_rebound(speed, share):
    """A limit, a string and a landing at 0.4 of a step in which two other balls collide."""
    sides, dt = fan.loads(SIDES), 5e-3
    displacement = 0.4 * dt * speed
    place = {
        "a": -displacement,
        "s": -0.5 + displacement,
        "c": displacement,
        "x": 0.0,
        "y": 0.1 + share * dt * speed,
    }
    x0 = thrown(sides, place, {"a": speed, "s": -speed, "c": -speed, "x": speed})
    run = stepped(sides, x0, 20 * dt, dt)
    assert run.status is Status.DONE
    stopped = [run.coordinates.v_D.index(name) for name in ("a", "s", "c")]
    assert np.allclose(run.v_D[3:, stopped], 0.0, rtol=0, atol=1e-9)
    assert run["a"].max() < 1e-9 and run["s"].min() > -0.5 - 1e-9 and run["c"].min() > -1e-9
    swapped = [run.coordinates.v_D.index(name) for name in ("x", "y")]
    assert np.allclose(run.v_D[3:, swapped], [0.0, speed], rtol=0, atol=1e-9)


ROW = (
    "puppet: row\ngravity: [0, 0, 0]\ncontact: {friction: 0, restitution: 1}\nbodies:\n"
    + "".join(
        f"- {{name: b{k}, joint: {{name: x{k}, type: prismatic, axis: [1, 0, 0]}}, "
        f"shapes: [{{type: sphere, radius: 0.05, mass: 1, at: [0, {8 * (k == 3)}, 0]}}]}}\n"
        for k in range(4)
    )
    + "pose: {x1: 0.2, x2: 0.4}\n"
)


@pytest.mark.parametrize("dt", [5e-4, 2e-3, 5e-3])
def test_a_ball_struck_from_both_sides_transmits_everything(dt):
    """The outer two of three equal balls exchange their velocities through the one at rest."""
    row = fan.loads(ROW)
    for gaps in ((0.02, 0.06), (0.02, 0.021), (0.013, 0.05)):
        place = {"x0": 0.0, "x1": 0.1 + gaps[0], "x2": 0.2 + sum(gaps), "x3": 0.0}
        run = stepped(row, thrown(row, place, {"x0": 20.0, "x2": -20.0, "x3": 1.0}), 40e-3, dt)
        assert run.status is Status.DONE
        assert np.allclose(run.v_D[-1], [-20.0, 0.0, 20.0, 1.0], rtol=0, atol=1e-6)
        assert np.allclose(run["x3"], run.t, rtol=0, atol=1e-12)
        assert np.diff(run.ledger["kinetic"]).max() <= 1e-9
