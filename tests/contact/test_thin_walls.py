"""Bodies that are struck within a step, or are fast, pass no thin wall."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from contact.bodies import stepped, thrown
from fantoccini.base.errors import Status

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]

RAM = """
puppet: ram
gravity: [0, 0, 0]
contact: {friction: FRICTION, restitution: RESTITUTION}
obstacles:
- {name: wall, type: box, size: [0.005, 2, 2], at: [0.1, 0, 0]}
bodies:
- {name: ball, joint: {type: free}, shapes: [{type: sphere, radius: 0.02, mass: 0.01}]}
- {name: ram, joint: {type: free}, shapes: [{type: box, size: [0.2, 0.2, 0.2], mass: 50}]}
"""


def ram(friction: float = 0.5, restitution: float = 0.0) -> fan.Marionette:
    """A ball in front of a thin wall, and a heavy box that may strike it."""
    return fan.loads(
        RAM.replace("FRICTION", str(friction)).replace("RESTITUTION", str(restitution))
    )


@pytest.mark.parametrize("restitution", [0.0, 0.8])
@pytest.mark.parametrize("gap", [1e-3, 5e-3, 2e-2])
@pytest.mark.parametrize("speed", [5.0, 20.0, 50.0])
def test_a_body_struck_within_a_step_passes_no_thin_wall(speed, gap, restitution):
    """At the start of the step the ball is at rest, 77.5 mm from a wall of 5 mm."""
    marionette = ram(0.5, restitution)
    x0 = thrown(marionette, {"ram.x": -0.12 - gap}, {"ram.x": speed})
    run = stepped(marionette, x0, 0.1, 4e-3)
    assert run["ball.x"].max() < 0.0776
    assert run.contact.gap.min() > -1e-9
    assert run["ram.x"].max() < -0.0424
    energy = run.ledger["kinetic"]
    assert np.all(np.diff(energy) < 1e-9 * energy[0])


def test_a_transmitted_impact_within_a_step_passes_no_thin_wall():
    """Three balls in a row: each contact is detected only after the previous impact."""
    row = "".join(
        f"- {{name: b{k}, joint: {{type: free}}, shapes: [{{type: sphere, radius: 0.01, mass: "
        f"{0.1 / 10**k}}}]}}\n"
        for k in range(3)
    )
    marionette = fan.loads(RAM.replace("FRICTION", "0").replace("RESTITUTION", "0") + row)
    place = {f"b{k}.x": 0.032 + 0.022 * k for k in range(3)}
    x0 = thrown(marionette, {"ram.x": -0.125, **place}, {"ram.x": 40.0})
    run = stepped(marionette, x0, 0.1, 4e-3)
    last = [run[f"{name}.x"].max() for name in ("ball", "b0", "b1", "b2")]
    assert last[-1] < 0.0876 and np.all(np.diff(last) > 0)
    assert run.contact.gap.min() > -1e-9


@pytest.mark.parametrize("speed", [50.0, 200.0])
@pytest.mark.parametrize("turn", [0.0, 300.0])
def test_a_fast_ball_passes_no_thin_wall(speed, turn):
    marionette = ram()
    start = {"ball.x": -0.4, "ball.y": -0.2, "ram.x": -3.0}
    x0 = thrown(marionette, start, {"ball.x": speed, "ball.y": 0.4 * speed, "ball.wz": turn})
    run = stepped(marionette, x0, 0.1, 4e-3)
    assert run["ball.x"].max() < 0.0776
    assert run.contact.gap.min() > -1e-9


def test_an_impact_in_a_lane_changes_no_other():
    """The others compute their contacts once, with the same result as alone."""
    marionette = ram()
    states = [
        thrown(
            marionette, {"ram.x": -0.121 - 1e-3 * k}, {"ram.x": v, "ball.y": 0.1 * k, "ram.wz": 0.3}
        )
        for k, v in enumerate((20.0, 0.5, 45.0, 1.0, 30.0, 2.0, 8.0, 50.0))
    ]
    about = {"t_end": 0.05, "method": fan.TimeStepping(dt=4e-3), "save": "all", "save_every": 1}
    together = fan.simulate_batch(marionette, states, **about)
    assert np.all(together.status == Status.DONE)
    for k, state in enumerate(states):
        single_batch = fan.simulate_batch(marionette, [state], **about)
        assert np.array_equal(single_batch.q_D[0], together.q_D[k])
        assert np.array_equal(single_batch.ledger.values[0], together.ledger.values[k])
