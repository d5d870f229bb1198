"""``fantoccini import``: converts a model of another program to a puppet file."""

from __future__ import annotations

import os
from pathlib import Path

from fantoccini.app.cli_support import (
    check_output,
    fail,
    output_errors,
    print_message,
    print_output,
)
from fantoccini.output.exchange import import_model

_PUPPET_ARGUMENT = "PUPPET"


def import_file(
    model: Path, out: Path, keyframe: str | None, density: float | None, force: bool, quiet: bool
) -> None:
    """Writes the puppet file and its meshes, and prints the report.

    Args:
        model: MJCF or URDF file.
        out: puppet file.
        keyframe: keyframe of the model in which the puppet starts.
        density: density of the solids of links without inertia [kg/m^3].
        force: overwrite existing files.
        quiet: print no report.
    """
    check_output(out, (".yaml", ".yml"), _PUPPET_ARGUMENT)
    if os.path.exists(out) and not force:
        fail(f"{out} exists already; use --force to replace it", _PUPPET_ARGUMENT)
    imported = import_model(model, keyframe, density)
    with output_errors(out):
        imported.save(out, force)
    if quiet:
        return
    for note in imported.report:
        print_output(note)
    n_joints, n_meshes = len(imported.joints), len(imported.meshes)
    joints = f"{n_joints} joint{'' if n_joints == 1 else 's'}"
    meshes = f", {n_meshes} mesh{'' if n_meshes == 1 else 'es'} beside it" if n_meshes else ""
    n_notes = len(imported.report)
    summary = f"{n_notes} difference{'' if n_notes == 1 else 's'} from the model"
    print_message(
        f"fantoccini: {out}: {joints}{meshes}; {summary if n_notes else 'no differences'}"
    )
