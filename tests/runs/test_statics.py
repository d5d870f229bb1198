"""Rest: equilibria that are minima, with strings that pull."""

import numpy as np
import pytest

import fantoccini as fan


@pytest.mark.parametrize("name", fan.puppets.names())
def test_every_bundled_puppet_hangs_still(name):
    puppet = getattr(fan.puppets, name)()
    x = puppet.rest()
    acc, tension = puppet.accelerations(x)
    assert np.max(np.abs(acc)) < 1e-9
    assert np.min(tension) >= 0.0
    assert np.max(puppet.constraint(x)) < 1e-9


@pytest.mark.parametrize("name", ["marionette", "marionette_bar", "stand6", "crane"])
def test_vertical_string_forces_carry_the_weight(name):
    puppet = getattr(fan.puppets, name)()
    x = puppet.rest()
    _, tension = puppet.accelerations(x)
    lift = 0.0
    for force, points, string in zip(
        tension, puppet.string_points(x.q_D, x.q_K), puppet.tree.strings, strict=False
    ):
        # What a string does to the points that hang from the puppet's own bodies.
        for k, point in enumerate(string.points):
            if point.link < 0 or puppet.tree.links[point.link].role == "driven":
                continue
            for other in (k - 1, k + 1):
                if 0 <= other < len(points):
                    d = points[other] - points[k]
                    lift += force * d[2] / np.linalg.norm(d)
    assert lift == pytest.approx(puppet.weight, rel=1e-9)


def test_a_head_without_its_string_falls():
    """Standing on the neck it is in equilibrium, but not at a minimum."""
    puppet = fan.puppets.marionette()
    x = puppet.rest({"head.length": 0.75})
    head = puppet.pose(x, "skull")[:3, 2]
    assert head[2] < 0.8
    assert puppet.accelerations(x)[1][0] == 0.0


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


def test_what_nothing_holds_has_no_rest():
    text = """
puppet: stone
bodies:
  - name: stone
    joint: {type: free}
    shapes: [{type: sphere, radius: 0.1, mass: 1.0}]
"""
    with pytest.raises(fan.StateError, match="no equilibrium"):
        fan.loads(text).rest()


def test_lengths_that_do_not_fit_are_named():
    crane = fan.puppets.crane()
    arm = fan.puppets.arm2d()
    assert crane is not None
    with pytest.raises(fan.StateError, match="hand"):
        arm.rest({"hand.length": 0.05, "hand.x": 2.0})


@pytest.mark.parametrize(("name", "seed"), [("marionette", 0), ("stand6", 6), ("stand6", 13)])
def test_rest_is_found_from_afar(name, seed):
    """Lengths off by a tenth: soft modes, limits that come to bear, saddles passed on the way."""
    puppet = getattr(fan.puppets, name)()
    x0, rng, values = puppet.rest(), np.random.default_rng(seed), {}
    for q, _ in puppet.coordinates.scalars_K:
        coordinate, start = puppet.coordinates.q_K[q], x0.q_K[q]
        if coordinate.endswith("length"):
            values[coordinate] = start * (1 + rng.uniform(-0.1, 0.1))
        else:
            values[coordinate] = start + rng.uniform(-0.1, 0.1)
    x = puppet.rest(values)
    acc, tension = puppet.accelerations(x)
    assert np.max(np.abs(acc)) < 1e-7
    assert np.min(tension) >= 0.0
    run = fan.simulate(puppet, x, t_end=2.0)
    assert np.max(np.abs(run.q_D - x.q_D)) < 1e-6
