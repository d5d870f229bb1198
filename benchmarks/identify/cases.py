"""Synthetic records: noisy marker positions from event-driven runs with other parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

import fantoccini as fan

RATE = 60.0
"""Samples per second."""


@dataclass(frozen=True)
class Case:
    """A puppet with unknown parameters.

    Attributes:
        puppet: puppet with guessed parameters.
        truth: label -> true value: parameters, ``coordinate offset``, ``marker.at.axis``, delay.
        markers: markers with guessed positions.
        signed: parameters that may be negative.
        tensions: strings whose tension is recorded.
        beat, reach: interval between the waypoints of the motion [s], and their largest distance
            from the start [m].
    """

    puppet: fan.Marionette
    truth: Mapping[str, float]
    markers: Sequence[fan.lab.Marker]
    signed: Sequence[str] = ()
    tensions: Sequence[str] = ()
    beat: float = 0.8
    reach: float = 0.1


def motion(case: Case, duration: float, seed: int) -> fan.Input:
    """Random waypoints about the start for all driven coordinates."""
    x0, rng = case.puppet.rest(), np.random.default_rng(seed)
    times, points = np.arange(0.0, duration - 1e-9, case.beat), {}
    for q, name in enumerate(case.puppet.coordinates.q_K):
        amplitude = case.reach * (0.6 if name.endswith(".length") else 1.0)
        values = x0.q_K[q] + amplitude * rng.uniform(-1.0, 1.0, len(times))
        values[[0, -1]] = x0.q_K[q]
        points[name] = list(zip(times, values, strict=True))
    return fan.Input.waypoints(case.puppet, points)


def record(
    case: Case,
    duration: float = 30.0,
    seed: int = 0,
    *,
    noise: float = 2e-3,
    force_noise: float = 0.02,
    gaps: float = 0.0,
    outliers: float = 0.0,
    known: Mapping[str, float] | None = None,
) -> fan.lab.Record:
    """A record of a case: 60 Hz, markers with noise [m], tensions with noise [N].

    Args:
        case: the case.
        duration: [s].
        seed: seed of motion and noise.
        noise, force_noise: standard deviations [m], [N].
        gaps: largest share of the time during which each marker is hidden, in one interval.
        outliers: share of the samples with errors of some centimetres.
        known: parameter -> standard deviation of its prior.
    """
    rng = np.random.default_rng(1000 + seed)
    inputs = motion(case, duration, seed)
    true_parameters = {k: x for k, x in case.truth.items() if k in case.puppet.tree.parameters}
    true_puppet = case.puppet.with_parameters(true_parameters)
    delay = case.truth.get("delay", 0.0)
    offsets = {k.removesuffix(" offset"): x for k, x in case.truth.items() if k.endswith(" offset")}
    inputs_with_offsets = inputs
    if offsets:
        q_K, _, _ = inputs.evaluate(inputs.breaks)
        table = case.puppet.coordinates
        inputs_with_offsets = fan.Input.waypoints(
            true_puppet,
            {
                name: [
                    (t, x + offsets.get(name, 0.0))
                    for t, x in zip(inputs.breaks, q_K[:, q], strict=True)
                ]
                for q, name in enumerate(table.q_K)
            },
        )
    t = np.arange(0.2, duration - 0.2, 1.0 / RATE)
    x0 = true_puppet.rest(inputs_with_offsets.first_values())
    run = fan.simulate(
        true_puppet,
        x0,
        inputs_with_offsets,
        duration,
        method=fan.Event(rtol=1e-9, atol=1e-9),
        save_at=t - delay,
    )
    assert run.status is fan.Status.DONE, run.status
    seen = run.resample(t - delay)
    poses = true_puppet.poses(seen.q_D, seen.q_K)
    links = [link.name for link in true_puppet.tree.links]
    columns = {}
    for marker in case.markers:
        at = [
            case.truth.get(f"{marker.name}.at.{axis}", x)
            for axis, x in zip("xyz", marker.at, strict=True)
        ]
        pose = poses[:, links.index(marker.body)]
        place = pose[:, :, :3] @ np.array(at) + pose[:, :, 3]
        place = place + noise * rng.standard_normal(place.shape)
        wrong = rng.uniform(size=len(t)) < outliers
        place[wrong] += 0.05 * rng.standard_normal((int(np.sum(wrong)), 3))
        if gaps:
            first = rng.integers(len(t))
            place[first : first + int(gaps * len(t))] = np.nan
        columns |= {f"{marker.name}.{axis}": place[:, i] for i, axis in enumerate("xyz")}
    for name in case.tensions:
        columns[f"{name}.tension"] = seen.tension[name] + force_noise * rng.standard_normal(len(t))
    unknown = [
        fan.lab.Unknown(name, known=(known or {}).get(name), positive=name not in case.signed)
        for name in true_parameters
    ]
    return fan.lab.Record(
        case.puppet,
        inputs,
        t,
        columns,
        case.markers,
        unknown,
        tuple(offsets),
        "delay" in case.truth,
        name="synthetic",
    )


ARM = """
puppet: arm
bodies:
  - name: upper
    joint: {name: shoulder, type: ball, damping: {parameter: shoulder_damping, value: 2.0e-3}}
    mass: {parameter: upper_mass, value: 0.13}
    drag: {linear: {parameter: upper_drag, value: 0.02}}
    shapes: [{type: capsule, from: [0, 0, 0], to: [0, 0, -0.3], radius: 0.015, density: 600}]
  - name: lower
    parent: upper
    joint:
      {name: elbow, type: revolute, axis: [0, -1, 0], at: [0, 0, -0.3],
       damping: {parameter: elbow_damping, value: 2.0e-3}}
    mass: {parameter: lower_mass, value: 0.12}
    shapes: [{type: capsule, from: [0, 0, 0], to: [0, 0, -0.26], radius: 0.012, density: 600}]
strings:
  - name: hand
    path:
      - {body: lower, at: [0, 0, {parameter: tie, value: -0.3}]}
      - {driven: [x, y], at: [0.3, 0, 0.7]}
    length: driven
pose: {elbow: 90 deg, hand.length: 1.0}
"""

_ARM_MARKERS = (
    fan.lab.Marker("middle", "upper", (0.0, 0.015, -0.15)),
    fan.lab.Marker("wrist", "lower", (0.012, 0.0, -0.1)),
    fan.lab.Marker("tip", "lower", (0.0, 0.0, -0.25), find=True),
)

_ARM_TRUTH = {
    "shoulder_damping": 2.6e-3,
    "upper_mass": 0.16,
    "elbow_damping": 1.5e-3,
    "tie": -0.305,
    "hand.length offset": 0.004,
    "tip.at.x": 0.003,
    "tip.at.y": 0.0,
    "tip.at.z": -0.255,
    "delay": 0.013,
}


def arm() -> Case:
    """The paper's arm, with 4 dynamic and 3 driven coordinates; the lower arm's mass is given."""
    puppet = fan.loads(ARM).with_parameters({"lower_mass": 0.1})
    return Case(puppet, _ARM_TRUTH, _ARM_MARKERS, ("tie",))


_PARAMETER_EDITS = (
    ("drag: {linear: 0.15,", "drag: {linear: {parameter: drag, value: 0.15},"),
    (
        "damping: 8.0e-4\n      cone: {max: 105",
        "damping: {parameter: shoulder_damping, value: 8.0e-4}\n      cone: {max: 105",
    ),
    (
        "damping: 1.5e-3\n      cone: {max: 70",
        "damping: {parameter: hip_damping, value: 1.5e-3}\n      cone: {max: 70",
    ),
    (
        "damping: 8.0e-4\n      limits",
        "damping: {parameter: knee_damping, value: 8.0e-4}\n      limits",
    ),
    (
        'density: 1500, colour: "#e8b98a"',
        'density: {parameter: hand_density, value: 1500}, colour: "#e8b98a"',
    ),
    (
        "radius: 0.0185, density: 450",
        "radius: 0.0185, density: {parameter: thigh_density, value: 450}",
    ),
    (
        "{body: thigh_left, at: [0.018, 0, -0.115]}",
        "{body: thigh_left, at: [0.018, 0, {parameter: knee_tie, value: -0.115}]}",
    ),
)

_MARIONETTE_TRUTH = {
    "drag": 0.18,
    "neck_stiffness": 0.012,
    "shoulder_damping": 1.04e-3,
    "hand_density": 1050.0,
    "hip_damping": 1.8e-3,
    "thigh_density": 382.5,
    "knee_damping": 9.2e-4,
    "foot_density": 1320.0,
    "knee_tie": -0.110,
    "hand_left.length offset": 0.006,
    "delay": 0.013,
}


def marionette() -> Case:
    """The marionette, 25 dynamic and 21 driven coordinates, with 13 markers."""
    text = fan.puppets.path("marionette").read_text(encoding="utf-8")
    for old, new in _PARAMETER_EDITS:
        assert old in text, old
        text = text.replace(old, new, 1)
    markers = [
        fan.lab.Marker("chest_left", "torso", (0.04, 0.03, 0.08)),
        fan.lab.Marker("chest_right", "torso", (0.04, -0.03, 0.08)),
        fan.lab.Marker("back", "torso", (-0.04, 0.0, -0.05)),
        fan.lab.Marker("nose", "skull", (0.05, 0.0, 0.06)),
        fan.lab.Marker("ear", "skull", (0.0, 0.04, 0.08)),
    ]
    for side, y in (("left", 1.0), ("right", -1.0)):
        markers += [
            fan.lab.Marker(f"sleeve_{side}", f"upper_arm_{side}", (0.0, 0.015 * y, -0.08)),
            fan.lab.Marker(f"hand_{side}", f"forearm_{side}", (0.01, 0.0, -0.1)),
            fan.lab.Marker(f"thigh_{side}", f"thigh_{side}", (0.02, 0.0, -0.1)),
            fan.lab.Marker(f"foot_{side}", f"shin_{side}", (0.02, 0.01 * y, -0.13)),
        ]
    return Case(fan.loads(text), _MARIONETTE_TRUTH, markers, ("knee_tie",), beat=2.0, reach=0.06)
