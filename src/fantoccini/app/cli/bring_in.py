"""``fantoccini import``: a model of another program as a puppet file."""

from __future__ import annotations

import os
from pathlib import Path

from fantoccini.app.console import check_output, fail, say, write, writing
from fantoccini.output.exchange import import_model

_OPTION = "PUPPET"


def import_file(
    model: Path, out: Path, keyframe: str | None, density: float | None, force: bool, quiet: bool
) -> None:
    """Writes the puppet file and its meshes, and prints the report.

    Args:
        model: MJCF or URDF file.
        out: puppet file.
        keyframe: of the model, that the puppet starts in.
        density: for the solids of links without inertia [kg/m^3].
        force: write over files that exist.
        quiet: print no report.
    """
    check_output(out, (".yaml", ".yml"), _OPTION)
    if os.path.exists(out) and not force:
        fail(f"{out} exists already; use --force to replace it", _OPTION)
    made = import_model(model, keyframe, density)
    with writing(out):
        made.save(out, force)
    if quiet:
        return
    for note in made.report:
        write(note)
    n, k = len(made.joints), len(made.meshes)
    joints = f"{n} joint{'' if n == 1 else 's'}"
    meshes = f", {k} mesh{'' if k == 1 else 'es'} beside it" if k else ""
    said = len(made.report)
    left = f"{said} {'thing is' if said == 1 else 'things are'} not as in the model"
    say(f"fantoccini: {out}: {joints}{meshes}; {left if said else 'nothing lost'}")
