"""Puppets, starts and inputs with events, and the compiled integrator's runs of them."""

from __future__ import annotations

import fantoccini as fan

BAR = """
puppet: bar
bodies:
  - {name: bar, joint: {type: free}, mass: 0.4, inertia: [0.0006, 0.008, 0.0085]}
  - name: doll
    parent: bar
    joint: {type: ball, at: [0.05, 0, -0.02]}
    mass: 0.2
    com: [0, 0, -0.12]
    inertia: [0.001, 0.001, 0.0002]
strings:
  - {name: left, path: [{body: bar, at: [-0.25, 0, 0]}, {world: [-0.3, 0, 1]}], length: driven}
  - {name: right, path: [{body: bar, at: [0.25, 0, 0]}, {world: [0.35, 0.1, 1]}], length: driven}
pose: {left.length: 0.8, right.length: 0.75}
"""
"""A free bar on two strings with a doll on a ball joint below it."""


WINCH = """
puppet: winch
bodies:
  - {name: bob, joint: {type: translation, axes: [x, z]}, mass: 1}
strings:
  - name: line
    path: [{body: bob}, {world: [0, 0, 1]}]
    length: driven
    max_tension: 15
    rewind_speed: 0.3
  - {name: other, path: [{body: bob}, {world: [0.5, 0, 1]}], length: 1.05}
pose: {line.length: 0.8}
"""
"""A bob on a string whose winch slips and rewinds, and on one of fixed length."""


SPRINGY = """
puppet: springy
bodies:
  - {name: bob, joint: {type: translation, axes: [x, z]}, mass: 0.25}
strings:
  - {name: line, path: [{body: bob}, {world: [0, 0, 0.6]}], length: 0.6, restitution: 0.5}
"""
"""A bob on a string that rebounds with half the speed."""


def jerk(arm):
    """A pull and a quick release: the string goes slack and is caught."""
    points = [(0, 0.8), (0.15, 0.5), (0.4, 0.5), (0.6, 0.8)]
    return fan.Input.waypoints(arm, {"hand.length": points})


def arm_case():
    arm = fan.puppets.arm2d()
    return arm, arm.rest({"hand.length": 0.8}), jerk(arm), 0.5


def bar_case():
    bar = fan.loads(BAR)
    pull = fan.Input.waypoints(
        bar,
        {
            "left.length": [(0, 0.8), (0.12, 0.6), (0.5, 0.65)],
            "right.length": [(0, 0.75), (0.2, 0.6), (0.5, 0.65)],
        },
    )
    return bar, bar.rest(), pull, 0.6


def winch_case():
    winch = fan.loads(WINCH)
    x0 = winch.project(winch.state({"bob.x": 0.4, "bob.z": 0.35}))
    return winch, x0, None, 1.0


def springy_case():
    springy = fan.loads(SPRINGY)
    return springy, springy.project(springy.state({"bob.x": 0.3, "bob.z": 0.4})), None, 0.57


CASES = {
    "arm": (arm_case, 2),
    "bar": (bar_case, 4),
    "winch": (winch_case, 8),
    "springy": (springy_case, 10),
}
"""Puppet, start, inputs and end; least number of events."""


def references():
    """Case -> its arguments and the compiled integrator's run."""
    runs = {}
    for name, (case, min_events) in CASES.items():
        arguments = case()
        run = fan.simulate(*arguments, method=fan.Event(rtol=1e-12, atol=1e-12))
        assert len(run.events) >= min_events
        runs[name] = arguments, run
    return runs
