"""A rod on two strings, compared with a run that tries all combinations of slack and taut."""

from __future__ import annotations

import json

import numpy as np
import pytest

import fantoccini as fan
from harness import polynomial_input, start
from oracles import rod_events
from oracles.arm2d_events import waypoints

pytestmark = pytest.mark.own_puppets

MASS, INERTIA, ARMS = 0.5, 0.012, (-0.3, 0.25)
TOPS = ((-0.4, 0.8), (0.35, 0.8))

PUPPET = {
    "puppet": "swing",
    "bodies": [
        {"name": "slide", "joint": {"type": "translation", "axes": ["x", "z"]}},
        {
            "name": "rod",
            "parent": "slide",
            "joint": {"type": "revolute", "axis": [0, -1, 0]},
            "mass": MASS,
            "inertia": [0.0, INERTIA, INERTIA],
        },
    ],
    "strings": [
        {
            "name": name,
            "path": [{"body": "rod", "at": [arm, 0.0, 0.0]}, {"world": [x, 0.0, z]}],
            "length": "driven",
        }
        for name, arm, (x, z) in zip(("left", "right"), ARMS, TOPS, strict=True)
    ],
}
"""The bodies: a massless slide that carries the rod's hinge."""

CASES = {
    # start, velocity, times and lengths of the two strings
    "a catch that loosens the other": (
        [0.03, 0.07, -0.124],
        [-1.0, 0.95, -0.4],
        [0.0, 0.27, 0.58, 1.03, 1.43, 1.7],
        [[0.9, 0.77, 0.66, 0.86, 0.64, 0.74], [0.9, 0.75, 0.81, 0.86, 0.93, 0.7]],
        8,
    ),
    "one and the other": (
        [0.086, 0.026, -0.187],
        [0.34, 0.89, 0.85],
        [0.0, 0.31, 0.8, 1.1, 1.39, 1.73],
        [[0.9, 0.83, 0.64, 0.91, 0.9, 0.6], [0.9, 0.64, 0.69, 0.75, 0.76, 0.76]],
        6,
    ),
}


@pytest.fixture(scope="module")
def swing(tmp_path_factory):
    path = tmp_path_factory.mktemp("puppet") / "swing.yaml"
    path.write_text(json.dumps(PUPPET))
    return fan.load(path)


@pytest.mark.parametrize("case", CASES)
def test_two_strings_slack_and_taut(swing, case):
    """Kinds, strings, times, impulses and the end state, to 1e-8."""
    q, v, times, lengths, n_events = CASES[case]
    drive = waypoints(*(list(zip(times, row, strict=True)) for row in lengths))
    rod = rod_events.Rod(
        MASS, INERTIA, np.array(ARMS), 9.81, np.array(TOPS), drive.breaks, drive.coef
    )
    theirs = rod_events.simulate(rod, q, v, times[-1])
    assert len(theirs.events) == n_events

    names = ("slide.x", "slide.z", "rod")
    pose = dict(zip(names, q, strict=True))
    pose |= {"left.length": lengths[0][0], "right.length": lengths[1][0]}
    x0 = start(swing, pose, dict(zip(names, v, strict=True)))
    coef = {"left.length": drive.coef[:, 0], "right.length": drive.coef[:, 1]}
    inputs = polynomial_input(swing, drive.breaks, coef, x0.q_K)
    run = fan.simulate(swing, x0, inputs, t_end=times[-1], method=fan.Event(rtol=1e-12, atol=1e-12))
    ours = [e for e in run.events if e.kind in ("catch", "release")]
    assert [(str(e.kind), e.name) for e in ours] == [
        (kind, ("left", "right")[row]) for _, kind, row, _, _ in theirs.events
    ]
    for event, (t, _, _, impulse, _) in zip(ours, theirs.events, strict=True):
        assert event.t == pytest.approx(t, abs=1e-8)
        assert event.impulse == pytest.approx(impulse, abs=1e-8)
    assert swing.coordinates.q_D == names
    end = np.concatenate([run.q_D[-1], run.v_D[-1]])
    np.testing.assert_allclose(end, theirs.state, atol=1e-8)
