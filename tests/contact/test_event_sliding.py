"""Event-driven sliding: forces within their cones, over edges, and at almost no speed."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import fantoccini as fan
from contact.bodies import G, thrown
from contact.events import CLOSE, of, sound

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]


def test_forces_within_steps_keep_to_their_cones():
    """If a growing push exceeds the limit of some corners, others take over."""
    marionette = fan.loads("""
puppet: chest
floor: 0
contact: {friction: 0.8}
bodies:
- {name: body, joint: {type: free}, shapes: [{type: box, size: [0.2, 0.3, 0.5], mass: 1}]}
""")
    pushes = {"body.x": [(0.0, 0.0), (0.5, 6.0), (1.0, 6.0)]}
    inputs = fan.Input.hold(marionette, 1.0).with_forces(pushes)
    x0 = marionette.state({"body.z": 0.25})
    for save_at in (None, np.linspace(0.0, 0.3, 137)):
        run = fan.simulate(marionette, x0, inputs, t_end=0.3, save_at=save_at)
        contact = run.contact
        across = contact.force - contact.normal_force[:, None] * contact.normal
        limit = 0.8 * contact.normal_force
        assert np.max(np.linalg.norm(across, axis=1) - limit) < 1e-8
        assert run.contact_residual.max() < 1e-9


@pytest.mark.parametrize(
    ("yaw", "mu", "over", "speed", "lifts"),
    [
        (0.4, 0.5, 0.02, 0.0, 0.217733),
        (0.4, 1.0, 0.02, 0.0, 0.219386),
        (0.4, 0.2, 0.0, 0.5, 0.165728),
        (0.0, 0.3, -0.1, 1.5, 0.159065),
        (0.4, 0.0, -0.1, 1.5, 0.146876),
        (0.7, 0.3, -0.05, 3.0, 0.056814),
        (0.3, 0.5, -0.1, 1.5, 0.185721),
    ],
)
def test_a_box_that_tips_over_a_tables_edge_slides_off_it_without_false_events(
    yaw, mu, over, speed, lifts
):
    """Flat, about the edge, and over the corners that leave it: no contact is lost or repeated,
    and forces obey the law until they stop.
    """
    marionette = fan.loads(f"""
puppet: edge
contact: {{friction: {mu}}}
obstacles:
- {{name: table, type: box, size: [1, 1, 0.1], at: [-0.5, 0, -0.05]}}
bodies:
- {{name: box, joint: {{type: free}}, shapes: [{{type: box, size: [0.2, 0.12, 0.1], mass: 1}}]}}
""")
    turn = (np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2))
    place = {"box.x": over, "box.z": 0.05, "box.rotation": turn}
    run = fan.simulate(marionette, thrown(marionette, place, {"box.x": speed}), t_end=0.5)
    sound(run, 1e-9)
    assert run.contact_residual.max() < 1e-7
    assert [event.kind for event in run.events] == ["slide", "lift"][mu == 0.0 :]
    assert abs(of(run, "lift")[0].t - lifts) < 1e-5


def test_a_block_on_an_accelerating_tray_slides_in_few_steps():
    """u' = -a_tray - mu g u/|u| from u = 0, where friction turns arbitrarily fast; by Radau."""
    mu = 0.05
    marionette = fan.loads(f"""
puppet: tray
contact: {{friction: {mu}}}
bodies:
- {{name: beam, joint: {{type: prismatic, axis: [1, 0, 0], driven: true}}}}
- name: tray
  parent: beam
  joint: {{type: prismatic, axis: [0, 1, 0], driven: true}}
  shapes: [{{type: box, size: [4, 4, 0.1], at: [0, 0, -0.05], mass: 1}}]
- {{name: a, joint: {{type: prismatic, axis: [1, 0, 0]}}}}
- {{name: b, parent: a, joint: {{type: prismatic, axis: [0, 1, 0]}}}}
- name: block
  parent: b
  joint: {{type: prismatic, axis: [0, 0, 1]}}
  shapes: [{{type: sphere, radius: 0.1, at: [0, 0, 0.1], mass: 1}}]
""")
    waypoints = {"beam": [(0.0, 0.0), (4.0, 4.0)], "tray": [(0.0, 0.0), (2.5, 1.0), (4.0, 0.5)]}
    drag = fan.Input.waypoints(marionette, waypoints)
    begins = brentq(lambda t: np.linalg.norm(drag.evaluate(t)[2]) - mu * G, 0.01, 1.0)
    a = drag.evaluate(begins)[2]

    def rate(t: float, u: np.ndarray) -> np.ndarray:
        return -drag.evaluate(t)[2] - mu * G * u / np.linalg.norm(u)

    u = solve_ivp(rate, (begins, 1.0), -1e-10 * a, method="Radau", rtol=1e-10, atol=1e-14).y[:, -1]
    run = fan.simulate(marionette, marionette.state(), drag, t_end=1.0)
    sound(run)
    assert np.abs(run.v_D[-1, :2] - run.v_K[-1] - u).max() < CLOSE
    assert abs(of(run, "slide")[0].t - begins) < CLOSE
    assert len(run) < 200  # 1,000 if the direction of friction had to be resolved


def test_friction_opposes_the_motion_from_the_start_of_sliding():
    """A capsule lands on one end: its friction turns with its velocity, in long steps, too."""
    rod = fan.loads("""
puppet: rod
floor: 0
contact: {friction: 0.4}
bodies:
- name: body
  joint: {type: free}
  shapes: [{type: capsule, from: [-0.1, 0, 0], to: [0.15, 0, 0], radius: 0.03, mass: 1}]
""")
    q = np.array([6e-4, -3.294e-2, 0.2450911, 0.612495, 0.162819, 0.032402, 0.772845])
    q[3:] /= np.linalg.norm(q[3:])
    v = np.array([-1.06118, 0.2702, -1.00073, 0.50413, -0.34975, 0.49673])
    start = rod.state().replace(q_D=q, v_D=v)
    ends = []
    for longest in (0.1, 0.001):
        run = fan.simulate(rod, start, t_end=0.14, method=fan.Event(max_step=longest))
        across = run.contact.velocity[:, :2], run.contact.force[:, :2]
        u, f = (np.linalg.norm(part, axis=1) for part in across)
        slides = (u > 1e-3) & (f > 1e-3)
        assert slides.sum() > 2
        against = across[0] / u[:, None] + across[1] / f[:, None]
        assert np.abs(against[slides]).max() < 1e-9
        ends.append(run.v_D[-1])
    assert ends[0] == pytest.approx(ends[1], abs=1e-8)
