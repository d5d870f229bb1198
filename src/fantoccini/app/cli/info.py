"""``fantoccini info``: describes the parts of a puppet.

A row of the puppet is a string or a joint limit. Driven coordinates q_K are given as functions of
time, dynamic ones q_D move by the equations of motion; a drive moves one by a motor, and a member
is a puppet of a scene. A link is a body on its joint.
"""

from __future__ import annotations

from fantoccini.app.cli.rig import print_body_map
from fantoccini.app.cli_support import (
    format_number,
    load_marionette,
    print_output,
    print_table,
    warn_implausible,
)
from fantoccini.base import BuildError, Progress, StateError
from fantoccini.base.documents import Number, Parameter
from fantoccini.dynamics.compiled import check_mass_matrix
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.build import describe
from fantoccini.kernel.codegen import operations
from fantoccini.model.puppet import bundled_files
from fantoccini.model.tree import WORLD, DriveRow, LimitRow, StringRow
from fantoccini.output.view import UncompiledPuppet

_OPTIONAL_COLUMNS = ("restitution", "max_tension", "rewind_speed")
"""Columns of the strings' table that are shown only if a string has them."""
_FUNCTION_PURPOSES = {
    "dynamics": "an evaluation of an event-driven run",
    "step_dynamics": "a time step",
    "columns": "all limits together, once each",
}
"""Function -> purpose of one evaluation."""


class _NotCachedError(Exception):
    """The compiled model is not in the cache."""


def list_bundled() -> None:
    """Prints tables of the bundled puppets and scenes, and the names of other bundled files."""
    from fantoccini.stand import stand_names
    from fantoccini.theatre import clip_names, gesture_names
    from fantoccini.theatre.cast import prop_names
    from fantoccini.theatre.plays import play_names

    bundled = {"Bundled puppets": bundled_files.names(), "Bundled scenes": bundled_files.scenes()}
    for title, names in bundled.items():
        table_lines = []
        for name in names:
            puppet = load_marionette(name)
            coordinates = puppet.coordinates
            table_lines.append((name, coordinates.n_vD, len(puppet.tree.strings), coordinates.n_vK))
        print_table(title, ("name", "DOF>", "strings>", "driven>"), table_lines)
    names_by_use = {
        "Plays, for `play` and `perform`": play_names(),
        "Performances, for `--inputs`": bundled_files.performances(),
        "Clips, for `follow`": clip_names(),
        "Gestures, for scores and plays": gesture_names(),
        "Props, for plays": prop_names(),
        "Stands, for `stand`": stand_names(),
    }
    for title, names in names_by_use.items():
        print_output(f"{title}: {', '.join(names)}")


def describe_puppet(file: str) -> None:
    """Prints tables of a puppet's parts."""
    puppet = load_marionette(file)
    check_mass_matrix(puppet.puppet, puppet.tree)
    warn_implausible(puppet, file)
    tree, coordinates = puppet.tree, puppet.coordinates
    print_output(
        f"{puppet.name}: {coordinates.n_vD} degrees of freedom ({coordinates.n_qD} configuration "
        f"numbers), {coordinates.n_vK} driven ({coordinates.n_qK}), {len(tree.strings)} strings, "
        f"{len(tree.limits)} limits"
    )
    moving_mass = f"moving mass {format_number(puppet.mass)} kg"
    print_output(
        f"{moving_mass}, weight {format_number(puppet.weight)} N; {_compilation_text(file)}"
    )
    if (contact_rules := puppet.puppet.touching) is not None:
        print_output(
            f"contact with {', '.join(contact_rules.meets) or 'nothing'}: friction "
            f"{format_number(contact_rules.friction)}, restitution "
            f"{format_number(contact_rules.restitution)}, "
            f"{len(contact_rules.pairs)} pairs with their own"
        )
    print_output()
    names = [link.name for link in tree.links]
    rotors = [_value_text(link.armature) for link in tree.links]
    with_armature = any(rotor != "0" for rotor in rotors)
    print_table(
        "Bodies",
        ("name", "parent", "joint", "type", "role", *(["armature"] if with_armature else [])),
        [
            (
                link.name,
                "world" if link.parent == WORLD else names[link.parent],
                link.joint,
                link.kind,
                link.role,
                *([rotor] if with_armature else []),
            )
            for link, rotor in zip(tree.links, rotors, strict=True)
        ],
    )
    taut_state = UncompiledPuppet(puppet.puppet, tree).start()
    starts = {
        "dynamic": (coordinates.start_D, taut_state.q_D),
        "driven": (coordinates.start_K, taut_state.q_K),
    }
    print_table(
        "Coordinates",
        ("name", "role", "unit", "start>"),
        [
            (
                c.name,
                c.role,
                c.unit,
                ""
                if c.index is None
                else _start_text(*(float(q[c.index]) for q in starts[c.role])),
            )
            for c in coordinates.rows
        ],
    )
    optional_columns = [
        key for key in _OPTIONAL_COLUMNS if any(getattr(string, key) for string in tree.strings)
    ]
    print_table(
        "Strings",
        (
            "name",
            "length",
            "kind",
            "from",
            "to",
            "points>",
            *(k.replace("_", " ") for k in optional_columns),
        ),
        [
            (*_string_cells(puppet, s), *(_value_or_empty(getattr(s, k)) for k in optional_columns))
            for s in tree.strings
        ],
    )
    print_table(
        "Springs",
        ("name", "stiffness", "rest", "damping"),
        [(s.name, *map(_value_text, (s.stiffness, s.rest, s.damping))) for s in tree.springs],
    )
    print_table(
        "Drives",
        ("coordinate", "command", "ratio", "inertia>", "motor", "control"),
        [_drive_cells(puppet, row) for row in tree.drives],
    )
    print_table(
        "Chains",
        ("name", "pieces>", "length", "stiffness", "damping"),
        [
            (
                c.name,
                c.pieces,
                "driven" if c.length is None else _value_text(c.length),
                *map(_value_text, (c.stiffness, c.damping)),
            )
            for c in tree.chains
        ],
    )
    print_table(
        "Limits",
        ("name", "bound>"),
        [(limit.name, _bound_text(puppet, limit)) for limit in tree.limits],
    )
    _print_body_maps(puppet)
    print_table(
        "Parameters", ("name", "value>"), [(n, float(v)) for n, v in tree.parameters.items()]
    )
    operation_counts = operations(puppet.equations)
    function_rows = [
        (name, _FUNCTION_PURPOSES.get(name, ""), n) for name, n in operation_counts.items()
    ]
    print_table(
        "Operations",
        ("function", "", "count>"),
        [*function_rows, ("all", "", sum(operation_counts.values()))],
    )
    flags = describe().get("flags")
    print_output("no compiler was found" if flags is None else f"compiled with {flags}")


def _print_body_maps(puppet: Marionette) -> None:
    """Prints the body map of the puppet, or of each puppet of a scene, or why there is none."""
    for member in puppet.puppet.members or ("",):
        try:
            body_map = puppet.body_map_of(member)
        except (StateError, BuildError) as error:
            print_output(f"no body map: {error}")
            print_output()
        else:
            print_body_map(body_map, member)


def _compilation_text(file: str) -> str:
    """Text that says whether the cache has the compiled model."""

    def stop(progress: Progress) -> None:
        raise _NotCachedError(progress.what)

    try:
        load_marionette(file, stop).compile()
    except _NotCachedError:
        return "not compiled yet"
    except BuildError:
        return "not compiled, and cannot be compiled on this machine (see fantoccini doctor)"
    return "compiled"


def _start_text(value: float, taut_length: float) -> str:
    """A start value; a length that the file does not give makes its string just taut."""
    return f"{format_number(taut_length)}, just taut" if value != value else format_number(value)


def _value_text(value: Number | None) -> str:
    if isinstance(value, Parameter):
        return f"{value.parameter} = {format_number(float(value.value))}"
    return "driven" if value is None else format_number(float(value))


def _value_or_empty(value: Number | None) -> str:
    return "" if value is None else _value_text(value)


def _string_cells(puppet: Marionette, string: StringRow) -> tuple[object, ...]:
    ends = [
        "world" if point.link == WORLD else puppet.tree.links[point.link].name
        for point in (string.points[0], string.points[-1])
    ]
    kind = "wire" if string.wire else "string"
    return string.name, _value_text(string.length), kind, *ends, len(string.points)


def _drive_cells(puppet: Marionette, row: DriveRow) -> tuple[object, ...]:
    """Coordinate, command, ratio n, inertia m + n^2 J, motor and control."""
    drive, unit = row.drive, "kg m^2" if row.drive.drum is None and row.drive.mass is None else "kg"
    n, inertia = row.ratio(puppet.number), row.inertia(puppet.number)
    types = [getattr(part, "type", "") for part in (drive.motor, drive.control)]
    return row.name, row.command_name, format_number(n), f"{format_number(inertia)} {unit}", *types


def _bound_text(puppet: Marionette, limit: LimitRow) -> str:
    unit = "m" if puppet.tree.links[limit.link].kind == "prismatic" else "rad"
    return f"{format_number(float(limit.bound))} {unit}"
