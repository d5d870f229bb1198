"""Warnings about puppet files and inputs: values that are legal but far out of the usual range.

The ranges are wide, from a finger puppet to a crane. They catch mixed-up units (millimetres,
g/cm^3, degrees without their unit), which are wrong by factors from 57 to a billion.

q_K are the driven coordinates: ends and lengths of strings, driven joints. A twin is the mirror
image of a part. A marionette is a puppet with its compiled equations; `marionette.puppet` is the
description in its file. In names, D stands for dynamic coordinates, which move by the equations of
motion. Breaks are the times at which the pieces of an input meet. A row of the tree describes a
string, limit, spring or drive, a row of the coordinate table one coordinate.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from fantoccini.base import Array
from fantoccini.base.documents import Finding, Parameter
from fantoccini.dynamics.compiled import CompiledPuppet
from fantoccini.dynamics.equilibrium.initial_state import set_commands
from fantoccini.dynamics.equilibrium.sides import side_findings
from fantoccini.dynamics.equilibrium.support import no_support_message, unsupported_groups
from fantoccini.model.puppet import Body, Cone, String, has_mass, shape_inertia
from fantoccini.model.tree import Size, link_inertia, measure, path_lengths
from fantoccini.motion import Input

Range = tuple[float, float]
Path = tuple[str | int, ...]


@dataclass(frozen=True)
class UsualRanges:
    """Usual ranges of values."""

    density: Range = (5.0, 25_000.0)  # Density of solids [kg/m^3]: foam to osmium (22,600)
    body_density: Range = (0.5, 25_000.0)
    """Given mass over volume [kg/m^3]: hollow bodies may be lighter than air."""
    body_length: Range = (1e-4, 20.0)  # Length of a body [m]: a bead to a crane's jib
    puppet_length: Range = (2e-3, 100.0)  # Length of a puppet [m]
    mass: Range = (1e-6, 20_000.0)
    """Mass of a puppet [kg]: between a paper snippet and a container under a crane."""
    max_gravity: float = 30.0  # Acceleration of gravity [m/s^2]; on Jupiter 25
    max_angle: float = 2.0 * math.pi + 1e-9  # Limit, rest or start of a joint [rad]: one turn
    string_length: Range = (0.05, 10.0)
    """Length of a string over its path in the start pose, and over the puppet's size."""
    max_slack: float = 0.5
    """Slack of a string in the start pose, over its path or the puppet's size."""
    density_in_grams: Range = (0.05, 5.0)  # Usual densities as numbers in g/cm^3

    max_reach: float = 5.0  # Distance from the start, relative to the puppet's size with strings
    max_speed: float = 10.0  # Speed of a hand or winch [m/s]; a throwing hand reaches 10 to 20
    max_angular_speed: float = 100.0  # Angular speed [rad/s]: 1,000 turns a minute
    max_turns: float = 4.0  # Turns from one waypoint to the next


USUAL_RANGES = UsualRanges()
_N_TIMES = 9
"""Number of times at which each piece of inputs is evaluated."""


def warnings(marionette: CompiledPuppet, data: Any = None) -> list[Finding]:
    """Warnings: places in the puppet's file, with the value, the usual range and advice.

    Args:
        marionette: the puppet.
        data: the file's plain data, which distinguishes angles with a unit from those without.
    """
    size = measure(marionette.tree, marionette.number)
    puppet_checks = _Checks(marionette, size, data)
    return [
        *puppet_checks.whole(),
        *puppet_checks.support(),
        *puppet_checks.bodies(),
        *puppet_checks.joints(),
        *puppet_checks.strings(),
        *side_findings(
            marionette.puppet,
            marionette.tree,
            size.poses,
            float(np.linalg.norm(size.lengths)),
            marionette.number,
        ),
    ]


class _Checks:
    """Checks of one puppet; of twins, only the original is checked."""

    def __init__(self, marionette: CompiledPuppet, size: Size, data: Any):
        self.marionette, self.size, self.data = marionette, size, data
        self.puppet, self.number = marionette.puppet, marionette.number
        self.index = {link.name: i for i, link in enumerate(marionette.tree.links)}

    def whole(self) -> Iterator[Finding]:
        g = [self.number(x) for x in self.puppet.gravity]
        if np.linalg.norm(g) > USUAL_RANGES.max_gravity:
            text = f"found {np.linalg.norm(g):.4g} m/s^2; on earth it is 9.81"
            yield ("gravity",), f"{text}: is it in other units?"
        elif g[2] > 0:
            yield ("gravity",), "found a positive z; z points up, gravity usually down: -9.81"
        mass, max_length = self.size.mass, float(self.size.lengths.max())
        if mass and not USUAL_RANGES.mass[0] <= mass <= USUAL_RANGES.mass[1]:
            usual = " to ".join(map(_mass_text, USUAL_RANGES.mass))
            text = f"found {_mass_text(mass)} in all; usual: {usual}"
            yield ("bodies",), f"{text}; lengths are in m, densities in kg/m^3, masses in kg"
        if (
            max_length
            and not USUAL_RANGES.puppet_length[0] <= max_length <= USUAL_RANGES.puppet_length[1]
        ):
            text = f"found a puppet that measures {max_length:.3g} m; usual: "
            text += f"{_range_text(USUAL_RANGES.puppet_length)} m; are lengths in other units?"
            yield ("bodies",), text

    def support(self) -> Iterator[Finding]:
        body_index = {self.index[body.name]: i for i, body in enumerate(self.puppet.bodies)}
        tree = self.marionette.tree
        links_on_strings = {p.link for row in (*tree.strings, *tree.chains) for p in row.points}
        for group in unsupported_groups(self.marionette):
            if links_on_strings.isdisjoint(group):
                continue  # a prop, which may fly
            first_body = next((body_index[i] for i in group if i in body_index), None)
            path = ("bodies",) if first_body is None else ("bodies", first_body, "joint")
            yield path, no_support_message(self.marionette, group)

    def bodies(self) -> Iterator[Finding]:
        for i, body in enumerate(self.puppet.bodies):
            link = self.index[body.name]
            length = (
                self.size.bodies[link].max() if len(body.shapes) else USUAL_RANGES.body_length[0]
            )
            if not USUAL_RANGES.body_length[0] <= length <= USUAL_RANGES.body_length[1]:
                text = f"found a body that measures {length:.3g} m; usual: "
                text += f"{_range_text(USUAL_RANGES.body_length)} m; "
                has_unscaled_mesh = any(
                    s.type == "mesh" and s.scale == (1.0, 1.0, 1.0) for s in body.shapes
                )
                text += (
                    "is the mesh in mm? then write scale: 0.001"
                    if has_unscaled_mesh
                    else "is it in mm?"
                )
                yield ("bodies", i, "shapes"), text
            yield from self._densities(i, body, link)

    def _densities(self, i: int, body: Body, link: int) -> Iterator[Finding]:
        volume = 0.0
        for k, shape in enumerate(body.shapes):
            if shape.type != "mesh" or has_mass(shape):
                volume += shape_inertia(shape)[0]
            if shape.density is not None and (density := self.number(shape.density)) > 0:
                if not USUAL_RANGES.density[0] <= density <= USUAL_RANGES.density[1]:
                    density_in_grams = (
                        USUAL_RANGES.density_in_grams[0]
                        <= density
                        < USUAL_RANGES.density_in_grams[1]
                    )
                    hint = f"; in g/cm^3? then write {1000 * density:g}" if density_in_grams else ""
                    text = f"found {density:g} kg/m^3; usual: {_range_text(USUAL_RANGES.density)}"
                    yield ("bodies", i, "shapes", k, "density"), f"{text}, wood 400 to 800{hint}"
            elif shape.mass is not None and body.mass is None:
                mass, volume_of_shape = self.number(shape.mass), shape_inertia(shape)[0]
                if (
                    mass > 0
                    and not USUAL_RANGES.body_density[0]
                    <= mass / volume_of_shape
                    <= USUAL_RANGES.body_density[1]
                ):
                    yield (
                        ("bodies", i, "shapes", k, "mass"),
                        _density_message(mass, volume_of_shape),
                    )
        if body.mass is None or not (mass := self.number(body.mass)) > 0:
            return
        if (
            volume > 0
            and not USUAL_RANGES.body_density[0] <= mass / volume <= USUAL_RANGES.body_density[1]
        ):
            yield ("bodies", i, "mass"), _density_message(mass, volume)
        if body.inertia is not None:
            _, _, inertia = link_inertia(self.marionette.tree.links[link], self.number)
            radius = math.sqrt(float(np.linalg.eigvalsh(inertia)[-1]) / mass)
            if radius > USUAL_RANGES.body_length[1]:
                text = f"found a radius of gyration of {radius:.3g} m; usual: "
                text += f"up to {USUAL_RANGES.body_length[1]:g} m; are both in kg and m?"
                yield ("bodies", i, "inertia"), text

    def joints(self) -> Iterator[Finding]:
        pose = self.puppet.pose
        for i, body in enumerate(self.puppet.bodies):
            joint, name = body.joint, body.joint.name or body.name
            is_revolute = joint.type == "revolute"
            lower, upper = (
                (joint.limits.lower, joint.limits.upper) if joint.limits else (None, None)
            )
            path: Path
            for key, bound in (("lower", lower), ("upper", upper)):
                if is_revolute and bound is not None and abs(bound) > USUAL_RANGES.max_angle:
                    path = ("bodies", i, "joint", "limits", key)
                    yield path, self._angle_message(path, bound, "a limit within a full turn")
            rest = self.number(joint.spring.rest) if joint.spring else 0.0
            if is_revolute and abs(rest) > USUAL_RANGES.max_angle:
                path = ("bodies", i, "joint", "spring", "rest")
                yield path, self._angle_message(path, rest, "a rest within a full turn")
            start = pose.get(name)
            if isinstance(start, float):
                path = ("pose", name)
                is_out_of_range = (lower is not None and start < lower) or (
                    upper is not None and start > upper
                )
                if is_revolute and abs(start) > USUAL_RANGES.max_angle:
                    yield path, self._angle_message(path, start, "a start within a full turn")
                elif is_out_of_range:
                    unit = "rad" if is_revolute else "m"
                    bounds = " to ".join(
                        "none" if b is None else f"{b:.4g}" for b in (lower, upper)
                    )
                    text = f"found {start:.4g} {unit}, beyond the joint's limits, {bounds} {unit}"
                    yield path, f"{text}; a run does not start there: choose a pose within them"
            q = pose.get(f"{name}.rotation")
            if joint.cone is not None and isinstance(q, tuple):
                yield from self._cone_warnings(name, joint.cone, np.array(q))

    def _cone_warnings(self, name: str, cone: Cone, q: np.ndarray) -> Iterator[Finding]:
        a, b = np.array(cone.axis), np.array(cone.body_axis)
        w, u = q[0], q[1:]
        rotated_axis = b + 2.0 * np.cross(u, np.cross(u, b) + w * b)
        swing = math.acos(min(1.0, max(-1.0, float(a @ rotated_axis))))
        if swing > cone.max + 1e-9:
            text = f"found a swing of {math.degrees(swing):.3g} deg, beyond the joint's cone of "
            text += f"{math.degrees(cone.max):.3g} deg; a run does not start there: choose a pose "
            yield ("pose", f"{name}.rotation"), text + "within it"

    def _angle_message(self, path: Path, angle: float, usual: str) -> str:
        text = f"found {angle:g} rad, {abs(angle) / (2 * math.pi):.3g} turns; usual: {usual}"
        return (
            text if isinstance(_value_at(self.data, path), str) else f"{text}; is it {angle:g} deg?"
        )

    def strings(self) -> Iterator[Finding]:
        puppet_size = float(np.linalg.norm(self.size.lengths))
        path_lengths_by_name = path_lengths(self.marionette.tree, self.size.poses, self.number)
        for i, string in enumerate(self.puppet.strings):
            path_length = path_lengths_by_name[string.name]
            key_path, length = self._length(i, string)
            if length is None:
                continue
            if length > USUAL_RANGES.string_length[1] * (path_length + puppet_size):
                text = f"found {length:.4g} m; in the start pose its path measures "
                text += f"{path_length:.3g} m, "
                yield key_path, text + f"and the puppet {puppet_size:.3g} m: is it in other units?"
            elif length < USUAL_RANGES.string_length[0] * path_length:
                text = (
                    f"found {length:.4g} m; in the start pose its path measures {path_length:.3g} m"
                )
                yield key_path, f"{text}: is it in other units, or is a point misplaced?"
            elif length - path_length > USUAL_RANGES.max_slack * max(path_length, puppet_size):
                text = (
                    f"found {length:.4g} m; in the start pose its path measures {path_length:.3g} m"
                )
                yield key_path, f"{text}: it is slack by {length - path_length:.3g} m"

    def _length(self, i: int, string: String) -> tuple[Path, float | None]:
        """Place and length in the start pose; None for a string that is just taut."""
        if isinstance(string.length, float | Parameter):
            return ("strings", i, "length"), self.number(string.length)
        key = f"{string.name}.length"
        start = self.puppet.pose.get(key)
        return ("pose", key), start if isinstance(start, float) else None


def _density_message(mass: float, volume: float) -> str:
    text = f"found {_mass_text(mass)} in {volume:.3g} m^3, {mass / volume:.3g} kg/m^3; usual: "
    return f"{text}{_range_text(USUAL_RANGES.body_density)}; are lengths in m and the mass in kg?"


def _range_text(usual: tuple[float, float]) -> str:
    return f"{usual[0]:g} to {usual[1]:g}"


def _mass_text(mass: float) -> str:
    if mass >= 1e6:
        return f"{mass / 1000:,.0f} t"
    if mass >= 1e3:
        return f"{mass / 1000:.4g} t"
    return f"{mass:.4g} kg" if mass >= 0.1 or mass == 0 else f"{1000 * mass:.4g} g"


def _value_at(data: Any, path: Path) -> Any:
    """The value at a path of plain data; None if there is none."""
    for key in path:
        try:
            data = data[key]
        except (KeyError, IndexError, TypeError):
            return None
    return data


@dataclass(frozen=True)
class InputWarning:
    """An input that is probably not intended.

    Attributes:
        name: name of the driven coordinate, or of a rotation as a whole.
        t: end of the piece of the motion with the warning [s].
        message: the value, the usual range and advice.
    """

    name: str
    t: float
    message: str


def input_warnings(marionette: CompiledPuppet, inputs: Input) -> list[InputWarning]:
    """Warnings about inputs out of proportion to the puppet: one for each coordinate and kind."""
    table = marionette.coordinates
    messages: list[InputWarning] = []
    piece_ends = inputs.breaks[1:]
    share = np.linspace(0.0, 1.0, _N_TIMES)
    t = inputs.breaks[:-1, None] + share * np.diff(inputs.breaks)[:, None]
    # Times inside the pieces: at a break, the acceleration would be the next piece's.
    q_K, v_K, _ = inputs.evaluate(np.nextafter(t, t.mean(axis=1, keepdims=True)))
    reach_scale, start_q_K = _reach_scale(marionette), _start_pose(marionette)
    units = {row.name: row.unit for row in table.rows}
    for q, v in table.scalars_K:
        name = table.q_K[q]
        if not inputs.named[v]:
            continue
        if units[name] == "m":
            distance = np.abs(q_K[:, :, q] - start_q_K[q]).max(axis=1)
            if distance[k := int(distance.argmax())] > USUAL_RANGES.max_reach * reach_scale:
                text = f"moves {distance[k]:.4g} m away from its start; the puppet on its strings "
                text += f"measures {reach_scale:.3g} m: is it in other units?"
                messages.append(InputWarning(name, float(piece_ends[k]), text))
        else:
            angle = np.ptp(q_K[:, :, q], axis=1)
            if angle[k := int(angle.argmax())] > USUAL_RANGES.max_turns * 2 * np.pi:
                text = (
                    f"turns by {angle[k]:.4g} rad, {angle[k] / (2 * np.pi):.3g} turns, since the "
                )
                text += "waypoint before; are these degrees? then write deg"
                messages.append(InputWarning(name, float(piece_ends[k]), text))
        is_length = units[name] == "m"
        bound = USUAL_RANGES.max_speed if is_length else USUAL_RANGES.max_angular_speed
        unit = "m/s" if is_length else "rad/s"
        messages += _speed_warnings(name, piece_ends, np.abs(v_K[:, :, v]), bound, unit)
    for name, (_, v) in table.rotations.items():
        if inputs.named[v]:
            speed = np.linalg.norm(v_K[:, :, v : v + 3], axis=2)
            messages += _speed_warnings(
                name, piece_ends, speed, USUAL_RANGES.max_angular_speed, "rad/s"
            )
    return messages


def _speed_warnings(
    name: str, piece_ends: Array, speed: Array, bound: float, unit: str
) -> list[InputWarning]:
    max_speeds = speed.max(axis=1)
    if not max_speeds[k := int(max_speeds.argmax())] > bound:
        return []
    text = f"moves at up to {max_speeds[k]:.4g} {unit}; usual: up to {bound:g} {unit}; "
    return [
        InputWarning(name, float(piece_ends[k]), text + "give it more time, or look at its units")
    ]


def _reach_scale(marionette: CompiledPuppet) -> float:
    """Sum of the puppet's size and the length of its longest string [m]."""
    tree, number = marionette.tree, marionette.number
    size = measure(tree, number)
    lengths = [*path_lengths(tree, size.poses, number).values()]
    lengths += [number(s.length) for s in (*tree.strings, *tree.chains) if s.length is not None]
    return float(np.linalg.norm(size.lengths)) + max(lengths, default=0.0)


def _start_pose(marionette: CompiledPuppet) -> Array:
    """Start pose (n_qK,); driven lengths that it does not set make strings just taut."""
    tree, table = marionette.tree, marionette.coordinates
    q_D, q_K = table.start_D.copy(), table.start_K.copy()
    paths = path_lengths(tree, measure(tree, marionette.number).poses, marionette.number)
    for string in (*tree.strings, *tree.chains):
        string.set_unknown_length(paths[string.name], q_D, q_K)
    set_commands(tree.drives, (), q_D, q_K)
    return np.nan_to_num(q_K)
