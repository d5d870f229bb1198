"""Least times of cranes on many grids, within 0.1 % of nonlinear collocation on the same grid."""

from __future__ import annotations

import math

import pytest
from tests.optimal.least_time_oracle import Problem, least_time

import fantoccini as fan

pytestmark = pytest.mark.medium

TOLERANCE = 1e-3
"""Relative distance from the other program's least time."""


def chain(lengths: tuple[float, ...], masses: tuple[float, ...], link_kind: str = "string"):
    """Bobs below a driven trolley, each on a string or a rod of the previous one."""
    lines = ["puppet: chain", "bodies:"]
    if link_kind == "rod":
        lines.append("- {name: trolley, joint: {type: translation, axes: [x], driven: true}}")
        for k, (length, mass) in enumerate(zip(lengths, masses, strict=True)):
            z_pin = -lengths[k - 1] if k else 0.0
            lines.append(
                f"- {{name: bob{k}, parent: {f'bob{k - 1}' if k else 'trolley'}, mass: {mass}, "
                f"com: [0, 0, {-length}], inertia: [0, 0, 0], "
                f"joint: {{type: revolute, axis: [0, -1, 0], at: [0, 0, {z_pin}]}}}}"
            )
        return fan.loads("\n".join(lines))
    z, upper_point = 0.0, "{driven: [x], at: [0, 0, 0]}"
    strings, pose = ["strings:"], []
    for k, (length, mass) in enumerate(zip(lengths, masses, strict=True)):
        z -= length
        lines.append(
            f"- {{name: bob{k}, joint: {{type: translation, axes: [x, z]}}, "
            f"shapes: [{{type: sphere, radius: 0.02, mass: {mass}}}]}}"
        )
        bob_point = f"{{body: bob{k}, at: [0, 0, 0]}}"
        strings.append(f"- {{name: line{k}, path: [{bob_point}, {upper_point}], length: {length}}}")
        upper_point, pose = bob_point, [*pose, f"bob{k}.z: {z}"]
    return fan.loads("\n".join([*lines, *strings, f"pose: {{{', '.join(pose)}}}"]))


def optimum(
    problem: Problem, interval: float, dt: float, link_kind: str = "string"
) -> fan.control.Optimum:
    puppet = chain(problem.lengths, problem.masses, link_kind)
    trolley = "trolley.x" if link_kind == "rod" else "line0.x"
    bounds = fan.control.Bounds(speed=problem.speed, acceleration=problem.acceleration)
    x0, end = puppet.rest(), puppet.rest({trolley: problem.distance})
    if link_kind == "string":
        bounds = bounds.with_taut_strings(puppet, x0)
    task = fan.Task(
        puppet,
        x0,
        problem.duration,
        [],
        fan.control.Smooth(problem.weight, 0.0),
        bounds,
        end=end,
        interval=interval,
        dt=dt,
    )
    return fan.optimise(task, time_limit=600.0)  # of a machine with other load


def interval_count(duration: tuple[float, float], interval: float) -> int:
    return math.ceil(duration[1] / interval - 1e-9)


CASES = {
    # lengths, masses, distance, speed, acceleration, duration, interval, dt, link_kind
    "short": ((1.0,), (1.0,), 0.5, 0.8, 1.0, (0.5, 3.0), 0.1, 0.05, "string"),
    "bob, 0.02 and 0.01": ((1.0,), (1.0,), 2.0, 1.0, 1.0, (1.0, 8.0), 0.02, 0.01, "string"),
    "bob, 0.05 and 0.012": ((1.0,), (1.0,), 2.0, 1.0, 1.0, (1.0, 8.0), 0.05, 0.012, "string"),
    "bob, one step": ((1.0,), (1.0,), 2.0, 1.0, 1.0, (1.0, 8.0), 0.08, 0.1, "string"),
    "bob, long and heavy": ((2.2,), (7.0,), 1.3, 0.6, 0.4, (2.0, 9.0), 0.1, 0.03, "string"),
    "rod": ((0.6,), (0.3,), 0.4, 0.5, 2.0, (0.4, 4.0), 0.05, 0.02, "rod"),
    "double": ((1.0, 0.6), (2.0, 1.0), 1.0, 1.0, 1.0, (1.0, 6.0), 0.1, 0.02, "string"),
    "double, light hook": ((1.4, 0.5), (0.4, 3.0), 1.5, 0.9, 0.7, (2.0, 7.0), 0.07, 0.05, "rod"),
}


@pytest.mark.parametrize(
    "name", [n if n == "short" else pytest.param(n, marks=pytest.mark.slow) for n in CASES]
)
def test_the_least_time_is_that_of_collocation_on_the_same_grid(name: str):
    lengths, masses, distance, speed, acceleration, duration, interval, dt, link_kind = CASES[name]
    N = interval_count(duration, interval)
    problem = Problem(lengths, masses, distance, speed, acceleration, duration, N)
    best = optimum(problem, interval, dt, link_kind)
    duration_found = best.run.t[-1]
    exact_duration = least_time(problem, guess=0.5 * sum(duration))
    assert best.status is fan.control.AnswerStatus.SOLVED, best.summary()
    assert duration_found == pytest.approx(exact_duration, rel=TOLERANCE)
