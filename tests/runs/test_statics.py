"""Rest: equilibria that are minima, with non-negative tensions."""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import nnls

import fantoccini as fan
from fantoccini.base import tangent
from fantoccini.dynamics.equilibrium.support import unsupported_groups

pytestmark = pytest.mark.medium


@pytest.mark.parametrize("name", fan.puppets.names())
def test_every_bundled_puppet_hangs_still(name):
    puppet = getattr(fan.puppets, name)()
    x = puppet.rest()
    acc, tension = puppet.forward_dynamics(x)
    assert np.max(np.abs(acc)) < 1e-9
    assert np.min(tension) >= 0.0
    assert np.max(puppet.constraint(x)) < 1e-9


@pytest.mark.parametrize("name", ["marionette", "marionette_bar", "stand6", "crane"])
def test_vertical_string_forces_carry_the_weight(name):
    puppet = getattr(fan.puppets, name)()
    x = puppet.rest()
    _, tension = puppet.forward_dynamics(x)
    lift = 0.0
    for force, points, string in zip(
        tension, puppet.string_points(x.q_D, x.q_K).values(), puppet.tree.strings, strict=False
    ):
        # Forces of a string on its points on the puppet's own bodies.
        for k, point in enumerate(string.points):
            if point.link < 0 or puppet.tree.links[point.link].role == "driven":
                continue
            for other in (k - 1, k + 1):
                if 0 <= other < len(points):
                    d = points[other] - points[k]
                    lift += force * d[2] / np.linalg.norm(d)
    assert lift == pytest.approx(puppet.weight, rel=1e-9)


def test_a_head_without_its_string_falls():
    """Upright on the neck it is in equilibrium, but not at a minimum."""
    puppet = fan.puppets.marionette()
    x = puppet.rest({"head.length": 0.75})
    head = puppet.pose(x, "skull")[:3, 2]
    assert head[2] < 0.8
    assert puppet.forward_dynamics(x)[1][0] == 0.0


def test_an_inverted_pendulum_is_pushed_off_its_top():
    text = """
puppet: rod
bodies:
  - name: rod
    joint: {type: revolute, axis: [0, -1, 0]}
    mass: 1.0
    com: [0, 0, 0.5]
    inertia: [0.02, 0.02, 0.001]
"""
    rod = fan.loads(text)
    x = rod.rest()
    assert abs(np.cos(x.q_D[0]) + 1.0) < 1e-12


def test_an_unsupported_puppet_has_no_rest():
    text = """
puppet: stone
bodies:
  - name: stone
    joint: {type: free}
    shapes: [{type: sphere, radius: 0.1, mass: 1.0}]
"""
    with pytest.raises(fan.errors.StateError, match="no equilibrium"):
        fan.loads(text).rest()


def test_an_unsupported_bar_is_detected_in_the_file():
    """It was relaxed for 72 s before the message "no equilibrium"."""
    text = fan.puppets.path("marionette_bar").read_text()
    free = fan.loads(text.replace("joint: {type: free, driven: true}", "joint: {type: free}"))
    with pytest.raises(
        fan.errors.StateError, match=r"nothing holds bar, torso, .* make bar driven"
    ):
        free.rest()
    assert "library" not in vars(free.libraries)  # nothing is compiled for it


HELD = {
    "{type: revolute, axis: [0, 1, 0]}": True,
    "{type: prismatic, axis: [1, 0, 0]}": True,
    "{type: prismatic, axis: [0, 0, 1]}": False,
    "{type: prismatic, axis: [0, 0, 1], limits: {upper: 1}}": False,
    "{type: prismatic, axis: [0, 0, 1], limits: {lower: -1}}": True,
    "{type: prismatic, axis: [0, 0, -1], limits: {lower: -1}}": False,
    "{type: prismatic, axis: [0, 0, 1], spring: {stiffness: 5}}": True,
    "{type: translation, axes: [x, y]}": True,
    "{type: translation, axes: [x, z]}": False,
    "{type: translation, axes: [x, z], orientation: {rpy: [90 deg, 0, 0]}}": True,
    "{type: free}": False,
    "{type: free, driven: true}": True,
    "{type: fixed}": True,
}


@pytest.mark.parametrize(("joint", "held"), HELD.items())
def test_bodies_are_supported_by_joints_or_ties(joint, held):
    text = (
        f"{{puppet: p, bodies: [{{name: bar, joint: {joint}, mass: 1, inertia: [1, 1, 1]}}, "
        "{name: bob, joint: {type: translation, axes: [x, y, z]}, mass: 1}], "
        "strings: [{name: s, path: [{body: bob}, {body: bar}], length: 1}]MORE}"
    )
    puppet = fan.loads(text.replace("MORE", ""))
    assert (unsupported_groups(puppet) == ()) is held
    tied = "{name: k, between: [{body: bob}, {world: [0, 0, 2]}], stiffness: 9, rest: 1}"
    assert unsupported_groups(fan.loads(text.replace("MORE", f", springs: [{tied}]"))) == ()
    assert unsupported_groups(fan.loads(text.replace("MORE", ", gravity: [0, 0, 0]"))) == ()


def test_lengths_that_do_not_fit_are_named():
    crane = fan.puppets.crane()
    arm = fan.puppets.arm2d()
    assert crane is not None
    with pytest.raises(fan.errors.StateError, match="hand"):
        arm.rest({"hand.length": 0.05, "hand.x": 2.0})


@pytest.mark.parametrize(("name", "seed"), [("marionette", 0), ("stand6", 6), ("stand6", 13)])
def test_rest_is_found_from_distant_states(name, seed):
    """Lengths are off by a tenth: soft modes, limits that become active, saddles on the way."""
    puppet = getattr(fan.puppets, name)()
    x0, rng, values = puppet.rest(), np.random.default_rng(seed), {}
    for q, _ in puppet.coordinates.scalars_K:
        coordinate, start = puppet.coordinates.q_K[q], x0.q_K[q]
        if coordinate.endswith("length"):
            values[coordinate] = start * (1 + rng.uniform(-0.1, 0.1))
        else:
            values[coordinate] = start + rng.uniform(-0.1, 0.1)
    x = puppet.rest(values)
    acc, tension = puppet.forward_dynamics(x)
    assert np.max(np.abs(acc)) < 1e-7
    assert np.min(tension) >= 0.0
    run = fan.simulate(puppet, x, t_end=2.0)
    assert np.max(np.abs(run.q_D - x.q_D)) < 1e-6


DACHSHUND = """
puppet: min_rest
mirror: {plane: xz, from: left, to: right}
bodies:
  - name: trunk
    joint: {type: free}
    shapes: [{type: capsule, from: [-0.1, 0, 0], to: [0.1, 0, 0], radius: 0.038, density: 480}]
  - name: thigh_left
    parent: trunk
    joint:
      type: revolute
      axis: [0, -1, 0]
      at: [-0.095, 0.034, -0.015]
      limits: {lower: -60 deg, upper: 80 deg}
    shapes: [{type: capsule, from: [0, 0, 0], to: [0, 0, -0.05], radius: 0.017, density: 480}]
  - name: shank_left
    parent: thigh_left
    joint: {type: revolute, axis: [0, 1, 0], at: [0, 0, -0.055], limits: {lower: 0, upper: 100 deg}}
    shapes: [{type: capsule, from: [0, 0, 0], to: [0, 0, -0.055], radius: 0.011, density: 480}]
strings:
  - name: shoulder
    path: [{body: trunk, at: [0.085, 0, 0.042]}, {world: [0.085, 0, 0.65]}]
    length: 0.60
  - name: rump
    path: [{body: trunk, at: [-0.095, 0, 0.036]}, {world: [-0.095, 0, 0.65]}]
    length: 0.60
  - name: knee_left
    path: [{body: shank_left, at: [0.01, 0, -0.005]}, {world: [-0.10, 0.065, 0.65]}]
    length: 0.72
"""


@pytest.fixture(scope="module")
def dachshund() -> fan.Marionette:
    return fan.loads(DACHSHUND)


@pytest.mark.parametrize("z", [-0.03, 0.0, 0.02, 0.1])
def test_rest_from_below_and_above(dachshund, z):
    """Three strings 6 to 14 mm too short and knees at their limits; the rest is unique."""
    x = dachshund.rest({"trunk.z": z})
    acc, tension = dachshund.forward_dynamics(x)
    assert np.max(np.abs(acc)) < 1e-7
    assert np.min(tension) >= 0.0
    assert np.max(dachshund.constraint(x)) < 1e-9
    assert np.max(np.abs(x.q_D - dachshund.rest({"trunk.z": 0.02}).q_D)) < 1e-8


@pytest.mark.parametrize("z", [-0.02, 0.0, 0.004])
def test_project_gives_the_nearest_state(dachshund, z):
    """M (q - q_0) = -A^T y with y >= 0 on the active rows: no row is held for good."""
    state = dachshund.state({"trunk.z": z, "thigh_left": 0.4, "shank_left": -0.05})
    x, table = dachshund.project(state), dachshund.coordinates
    h = dachshund.constraint(x)
    assert np.max(h) < 1e-12
    met = h > -1e-9
    places = table.scalars_D, table.quaternions_D
    moved = tangent.between(*places, state.q_D, x.q_D, table.n_vD)
    force = dachshund.mass_matrix(x) @ moved
    _, residual = nnls(dachshund.A_D(x)[met].T, -force)
    assert residual < 1e-7 * np.linalg.norm(force)
    assert np.array_equal(dachshund.project(x).q_D, x.q_D)


def test_a_straight_limb_bends():
    """A pull along itself has no slope; states to both sides are valid."""
    rod = fan.loads("""
puppet: straight
bodies:
  - {name: rod, joint: {type: revolute, axis: [0, -1, 0]}, mass: 1, com: [0, 0, -0.2],
     inertia: [0.02, 0.02, 0.001]}
strings:
  - {name: pull, path: [{body: rod, at: [0, 0, -0.5]}, {world: [0, 0, 1]}], length: 1.2}
""")
    for x in (rod.project(rod.state()), rod.rest()):
        assert abs(rod.constraint(x)[0]) < 1e-9
        tip = rod.pose(x, "rod") @ [0.0, 0.0, -0.5, 1.0]
        assert np.hypot(tip[0], tip[2] - 1.0) == pytest.approx(1.2, abs=1e-9)


def test_a_heavily_damped_puppet_rests_too():
    """Creeping motions are not simulated to rest: V is minimised by descent."""
    bob = fan.loads("""
puppet: creeping
bodies:
  - {name: bob, joint: {type: translation, axes: [x, z], damping: 300}, mass: 0.1}
strings:
  - {name: line, path: [{body: bob}, {world: [0, 0, 1]}], length: 1.0}
pose: {bob.x: 0.4, bob.z: 0.5}
""")
    assert bob.rest().q_D == pytest.approx([0.0, 0.0], abs=1e-9)


def test_contradictory_lengths_name_the_distance():
    """Two ends 1.2 m apart and strings of 0.5 m each miss one another by 200 mm."""
    bob = fan.loads("""
puppet: apart
bodies:
  - {name: bob, joint: {type: translation, axes: [x, y, z]}, mass: 0.1}
strings:
  - {name: left, path: [{body: bob}, {world: [-0.6, 0, 0]}], length: 0.5}
  - {name: right, path: [{body: bob}, {world: [0.6, 0, 0]}], length: 0.5}
""")
    for search in (bob.rest, lambda: bob.project(bob.state())):
        with pytest.raises(fan.errors.StateError, match=r"left is too short by 100 mm.*Tried"):
            search()


@pytest.mark.parametrize("eye", ["[0, 0, 0.35]", "[0.02, 0.03, 0.35]"])
def test_a_load_that_swings_to_rest_does_not_turn_about_its_string(eye: str):
    """This rotation is undetermined, and no input could undo it: it keeps its initial value."""
    file = Path(fan.__file__).parent / "model" / "puppets" / "crane.yaml"
    crane = fan.loads(file.read_text().replace("at: [0, 0, 0.35]}", f"at: {eye}}}"))
    first = crane.rest()
    for values in ({"trolley": 1.0}, {"trolley": -0.5, "load.x": 0.2, "load.y": 0.1}):
        moved = crane.difference(first.q_D, crane.rest(values).q_D)
        moved[0] -= values["trolley"]
        assert np.max(np.abs(moved)) < 1e-11


CARRIED = {
    "contact: true": True,
    "floor: 0": True,
    "contact: true, floor: 0": False,
    "contact: {meets: [self]}, floor: 0": True,
    "contact: {pairs: [{between: [crate, floor], meet: false}]}, floor: 0": False,
    "contact: {pairs: [{between: [crate, floor], meet: false}], meets: [floor]}, floor: 0": True,
    "contact: true, obstacles: [{name: t, type: box, size: [1, 1, 1], at: [9, 0, 0]}]": False,
}


@pytest.mark.parametrize(("scene", "falls"), CARRIED.items())
def test_a_body_is_carried_only_by_what_it_may_touch(scene, falls):
    """Regression: with `contact`, two loose bodies without a floor were let fall for a minute."""
    ball = "joint: {type: free}, shapes: [{type: sphere, radius: 0.1, mass: 1}]"
    text = f"{{puppet: p, {scene}, bodies: [{{name: crate, {ball}}}, {{name: ball, {ball}}}]}}"
    assert bool(unsupported_groups(fan.loads(text))) is falls
