"""``fantoccini rig``: writes the body map of a puppet into its file, with a picture of it.

A body map says which bodies and strings are trunk, head and limbs. A member is a puppet of a scene.
"""

from __future__ import annotations

from pathlib import Path

from fantoccini.app.cli_support import (
    PICTURE_SUFFIXES,
    ProgressDisplay,
    check_output,
    fail,
    format_number,
    output_errors,
    print_message,
    print_output,
    print_table,
    puppet_path,
)
from fantoccini.base import StateError, replacing
from fantoccini.base.documents import has_key, with_section
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model import BodyMap, rig_of
from fantoccini.model.puppet import bundled_files, dump, load

_FILE_ARGUMENT = "FILE"
"""Name of the argument for the puppet file, in messages."""


def write_rig(file: str, out: Path | None, force: bool, quiet: bool) -> None:
    """Writes the section `rig` into a puppet file, and draws it.

    Args:
        file: FILE argument.
        out: picture; by default beside the file.
        force: replace the section if the file has one.
        quiet: print no progress and no table.
    """
    path = puppet_path(file)
    bundled = map(bundled_files.path, (*bundled_files.names(), *bundled_files.scenes()))
    if path.resolve() in {file.resolve() for file in bundled}:
        fail(f"{file} is a bundled puppet; copy {path} and name the copy", _FILE_ARGUMENT)
    if has_key(path, "scene"):
        fail(f"{file} is a scene; name the file of one of its puppets", _FILE_ARGUMENT)
    if has_key(path, "rig") and not force:
        fail(
            f"{file} has a rig already; use --force to replace it by the one found", _FILE_ARGUMENT
        )
    picture = path.with_name(f"{path.stem}_rig.png") if out is None else out
    check_output(picture, PICTURE_SUFFIXES, "--out")
    with ProgressDisplay(quiet) as display:
        puppet_file = load(path)
        puppet = Marionette(puppet_file.model_copy(update={"rig": None}), display.update)
        display.stage("finding trunk, head and limbs")
        body_map = puppet.body_map
        section = dump.to_yaml({"rig": dump.plain(rig_of(body_map, puppet_file.mirror))})
        text = with_section(path.read_bytes().decode("utf-8-sig"), "rig", section)
        display.stage(f"drawing {picture}")
        _draw(puppet, body_map, picture)
    with output_errors(path), replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="")
    if not quiet:
        print_body_map(body_map)
        print_message(f"fantoccini: {file}: rig written; {picture} shows it")


def print_body_map(body_map: BodyMap, member: str = "") -> None:
    """Prints a table of the parts of a body map, and where the puppet looks.

    Args:
        body_map: body map.
        member: name of the puppet in its scene, for the title.
    """
    head = body_map.head
    table_lines = [("trunk", body_map.trunk, "")]
    if head is not None:
        table_lines.append(("head", (head.body,), _point(head.end)))
    table_lines += [(name, limb.bodies, _point(limb.end)) for name, limb in body_map.parts.items()]
    print_table(
        f"Body map of {member}" if member else "Body map",
        ("part", "bodies", "end [m]", "strings", "doubt"),
        [
            (
                part,
                ", ".join(bodies),
                end,
                ", ".join(body_map.strings_of(part)),
                body_map.doubt(part),
            )
            for part, bodies, end in table_lines
        ],
    )
    control = f"; its strings hang from {body_map.control}" if body_map.control else ""
    print_output(
        f"the puppet looks along {_point(body_map.facing)} in the frame of "
        f"{body_map.trunk[0]}{control}"
    )
    printed_parts = {part for part, *_ in table_lines}
    for doubt in body_map.doubts:
        if doubt.part not in printed_parts:
            print_output(f"{doubt.part}: {doubt.reason}")
    print_output()


def _point(point: tuple[float, float, float]) -> str:
    return ", ".join(format_number(x) for x in point)


def _draw(puppet: Marionette, body_map: BodyMap, picture: Path) -> None:
    """Draws the puppet at rest, or in its file's pose if it has no rest."""
    from fantoccini.output import body_map_picture

    try:
        pose = puppet.rest()
    except StateError:
        pose = puppet.state()
    body_map_picture(puppet, pose, body_map, picture)
