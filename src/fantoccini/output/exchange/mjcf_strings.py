"""Conversion of tendons and constraints of a MuJoCo model to strings, wires and springs.

- A spatial tendon of limited length through sites becomes a string of that length.
- A tendon with stiffness or damping between two sites becomes a spring.
- A tendon of constrained length becomes a wire.
- A point that two bodies share becomes three wires of length L, from the point on one body to three
  points at distance L along the axes of the other: |a - b_i|^2 = L^2 has no other solution nearby.
  A weld has three more wires.

A tendon is a string of MuJoCo, a site a point on a body, and a weld a fixed connection of two
bodies. A wire is a string that also pushes.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fantoccini.base import Array, rotation as rotations
from fantoccini.dynamics.mujoco import library
from fantoccini.output.exchange.draft import number_or_zero, written_number
from fantoccini.output.exchange.mjcf_bodies import BodyConverter, field_value, line_of

_WIRE_RANGE = (1e-3, 1.0)
"""Range of lengths of a point's wires [m]."""

_TORQUE_SCALE = 10  # Index of a weld's torquescale in its data

_POINT_WIRES = {
    "x": ((0, 0, 0), (1, 0, 0)),
    "y": ((0, 0, 0), (0, 1, 0)),
    "z": ((0, 0, 0), (0, 0, 1)),
}
"""Wires that hold a point: their ends in the two frames, relative to their length."""

_ROTATION_WIRES = {
    "xy": ((1, 0, 0), (1, 1, 0)),
    "yz": ((0, 1, 0), (0, 1, 1)),
    "zx": ((0, 0, 1), (1, 0, 1)),
}
"""Wires that hold the orientation: each fixes the rotation about one axis."""


def add_tendons(converter: BodyConverter) -> None:
    """Adds strings, springs and wires for tendons and their constraints; notes the rest."""
    draft, m, compiled = converter.draft, converter.m, converter.compiled
    elements = compiled.elements("tendons")
    prescribed_lengths = _prescribed_lengths(converter)
    acts_on_tendon = m.actuator_trntype == int(library().mjtTrn.mjTRN_TENDON)
    with_actuator = set(m.actuator_trnid[acts_on_tendon, 0].tolist())
    for t in range(m.ntendon):
        name, line = m.tendon(t).name, line_of(elements.get(t))

        def note(text: str, name: str = name, line: int | None = line) -> None:
            draft.note("tendon", name, text, line)

        wrap_indices = range(int(m.tendon_adr[t]), int(m.tendon_adr[t] + m.tendon_num[t]))
        reason = _reason_not_a_string(converter, wrap_indices)
        low, high = map(float, m.tendon_range[t])
        limited = bool(m.tendon_limited[t]) and bool(converter.limits_enabled)
        stiffness_and_damping = _stiffness_and_damping(converter, t)
        for quantity, values in (
            ("frictionloss", m.tendon_frictionloss[t]),
            ("armature", field_value(m, "tendon_armature", t)),
            ("nonlinear stiffness", field_value(m, "tendon_stiffnesspoly", t)),
            ("nonlinear damping", field_value(m, "tendon_dampingpoly", t)),
            ("springyield", field_value(m, "tendon_springyield", t)),
        ):
            if np.any(values):
                note(f"has {quantity}, left out")
        if not (limited or any(stiffness_and_damping) or t in prescribed_lengths):
            text = "left out: nothing limits its length, and it has no stiffness or damping"
            if t in with_actuator and not reason:
                text += "; inputs can change the length of a string with `length: driven`"
            note(text)
            continue
        if reason:
            note(f"left out: {reason}")
            continue
        path = [converter.site_point(int(m.wrap_objid[w])) for w in wrap_indices]
        if t in prescribed_lengths:
            length = written_number(m.tendon_length0[t] + prescribed_lengths[t])
            converter.wires.add(t)
            wire = draft.unique_name("tendon", name, "wire", line)
            draft.strings.append({"name": wire, "path": path, "length": length, "wire": True})
        elif limited:
            if low > 0.0:
                note(f"has the lower limit {low:g} m, left out: strings do not push")
            if high > 0.0:
                string = draft.unique_name("tendon", name, "string", line)
                draft.strings.append({"name": string, "path": path, "length": written_number(high)})
            else:
                note(f"left out: found the range {low:g} to {high:g}; a string has a length")
        if any(stiffness_and_damping):
            _add_spring(converter, t, name, path, line)


def add_constraints(converter: BodyConverter) -> None:
    """Adds wires for shared points and welds; notes other constraints, except of tendons."""
    draft, m, constraint_types = converter.draft, converter.m, library().mjtEq
    elements = converter.compiled.elements("equalities")
    for e in range(m.neq):
        constraint_type, name, line = (
            constraint_types(int(m.eq_type[e])),
            m.equality(e).name,
            line_of(elements.get(e)),
        )
        type_name = constraint_type.name.removeprefix("mjEQ_").lower()
        if not converter.equalities_enabled:
            draft.note("equality", name, f"{type_name}: left out, a flag disables it", line)
        elif not m.eq_active0[e]:
            draft.note("equality", name, f"{type_name}: left out, it is not active", line)
        elif constraint_type in (
            constraint_types.mjEQ_CONNECT,
            constraint_types.mjEQ_WELD,
        ) and _add_wires(converter, e, name, line):
            continue
        elif not (
            constraint_type == constraint_types.mjEQ_TENDON
            and _fixes_one_tendon(m, e)
            and int(m.eq_obj1id[e]) in converter.wires
        ):
            draft.note("equality", name, f"{type_name}: left out, has no counterpart", line)


def _reason_not_a_string(converter: BodyConverter, wrap_indices: range) -> str:
    """Reason why a tendon cannot be a string; empty if it can."""
    m, wrap_types = converter.m, library().mjtWrap
    types = {wrap_types(int(m.wrap_type[w])) for w in wrap_indices}
    if wrap_types.mjWRAP_JOINT in types:
        return "it is a sum of joint positions; strings run through points"
    if wrap_types.mjWRAP_PULLEY in types:
        return "it has pulleys that divide its force"
    if types != {wrap_types.mjWRAP_SITE}:
        return "it wraps around solids"
    carriers = {int(m.body_weldid[m.site_bodyid[m.wrap_objid[w]]]) for w in wrap_indices}
    return "its length never changes" if len(carriers) == 1 else ""


def _stiffness_and_damping(converter: BodyConverter, t: int) -> tuple[float, float]:
    """Stiffness and damping of a tendon; 0 if a flag disables them."""
    m = converter.m
    return (
        number_or_zero(m.tendon_stiffness[t], "stiffness") if converter.springs_enabled else 0.0,
        number_or_zero(m.tendon_damping[t], "damping") if converter.dampers_enabled else 0.0,
    )


def _add_spring(
    converter: BodyConverter, t: int, name: str, path: list[dict[str, Any]], line: int | None
) -> None:
    draft, m = converter.draft, converter.m
    low, high = map(float, m.tendon_lengthspring[t])
    if len(path) != 2:
        text = "has a spring, left out: springs of puppets have two ends"
        draft.note("tendon", name, text, line)
        return
    stiffness, damping = _stiffness_and_damping(converter, t)
    if stiffness and low != high:
        text = f"has a spring with play from {low:g} to {high:g} m, left out"
        draft.note("tendon", name, text, line)
        stiffness = 0.0
    if not stiffness and not damping:
        return
    has_string = draft.strings and draft.strings[-1]["path"] is path
    spring = draft.unique_name("tendon", name, "spring", line, "_spring" if has_string else "")
    data = {
        "name": spring,
        "between": path,
        "stiffness": stiffness,
        "rest": written_number(max(low, 0.0)),
    }
    if damping:
        data["damping"] = damping
    draft.springs.append(data)


def _fixes_one_tendon(m: Any, e: int) -> bool:
    """Whether a tendon constraint fixes the length of a single tendon."""
    return int(m.eq_obj2id[e]) < 0  # polycoef, which couples it to another, is then not used


def _prescribed_lengths(converter: BodyConverter) -> dict[int, float]:
    """Tendon -> prescribed length minus its length in MuJoCo's zero pose [m]."""
    m, constraint_types = converter.m, library().mjtEq
    if not converter.equalities_enabled:
        return {}
    return {
        int(m.eq_obj1id[e]): float(m.eq_data[e, 0])
        for e in range(m.neq)
        if constraint_types(int(m.eq_type[e])) == constraint_types.mjEQ_TENDON
        and m.eq_active0[e]
        and _fixes_one_tendon(m, e)
    }


def _add_wires(converter: BodyConverter, e: int, name: str, line: int | None) -> bool:
    """Adds wires between two bodies; returns False if the constraint has no counterpart."""
    m, draft, constraint_types = converter.m, converter.draft, library().mjtEq
    type_name, wire_ends = "connect", _POINT_WIRES
    if constraint_types(int(m.eq_type[e])) == constraint_types.mjEQ_WELD:
        type_name, wire_ends = "weld", _POINT_WIRES | _ROTATION_WIRES
        if m.eq_data[e, _TORQUE_SCALE] <= 0.0:
            return False
    frames = _frames(m, e)
    if frames is None:
        return False
    (first, R, r), (second, S, s) = frames
    wire, length = "", _wire_length(m)
    for suffix, (first_end, second_end) in wire_ends.items():
        path = [
            converter.point_on_body(first, r + length * R @ np.array(first_end)),
            converter.point_on_body(second, s + length * S @ np.array(second_end)),
        ]
        wire = draft.unique_name("equality", name, type_name, line, f"_{suffix}")
        data = {"name": wire, "path": path, "length": written_number(length), "wire": True}
        draft.strings.append(data)
    text = f"{type_name}: is {len(wire_ends)} wires of {length:g} m here"
    draft.note("equality", name, text, line, wire)
    return True


def _wire_length(m: Any) -> float:
    """Length of wires [m]: a power of ten that is at most the model's extent."""
    shortest, longest = _WIRE_RANGE
    extent = min(longest, max(shortest, float(m.stat.extent)))
    return float(f"1e{math.floor(math.log10(extent))}")


def _frames(m: Any, e: int) -> list[tuple[int, Array, Array]] | None:
    """Body, orientation and origin of the two frames that a constraint makes coincide, or None."""
    object_types, equalities, data = library().mjtObj, library().mjtEq, m.eq_data[e]
    object_type = object_types(int(m.eq_objtype[e]))
    first, second = int(m.eq_obj1id[e]), int(m.eq_obj2id[e])
    if object_type == object_types.mjOBJ_SITE:
        rotation_matrices = rotations.matrix(m.site_quat)
        return [
            (int(m.site_bodyid[k]), rotation_matrices[k], m.site_pos[k]) for k in (first, second)
        ]
    if object_type != object_types.mjOBJ_BODY:
        return None
    if equalities(int(m.eq_type[e])) == equalities.mjEQ_CONNECT:
        return [(first, np.eye(3), data[:3]), (second, np.eye(3), data[3:6])]
    return [(first, rotations.matrix(data[6:10]), data[3:6]), (second, np.eye(3), data[:3])]
