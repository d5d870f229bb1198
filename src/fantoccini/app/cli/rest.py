"""``fantoccini rest``: the state in which a puppet hangs still.

q_D are the dynamic coordinates of the puppet and q_K the driven ones, the ends and lengths of
strings, which are fixed in this search. A slack string does not pull. A row of the tree describes a
string, limit, spring or drive, a row of the coordinate table one coordinate.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fantoccini.app.cli_support import (
    PICTURE_SUFFIXES,
    ProgressDisplay,
    check_output,
    fail,
    load_marionette,
    print_output,
    print_table,
    read_values,
)
from fantoccini.base import StateError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation import simulate
from fantoccini.motion import State, Trajectory

_RUN_DURATION = 1e-3
"""Duration of the run whose first sample has the tensions and contact forces at rest [s]."""
_DEGREES_PER_UNIT = {"rad": 180.0 / np.pi}


def describe_rest(file: str, start: list[str], out: Path | None, quiet: bool) -> None:
    """Prints lengths, tensions, coordinates and contact forces at rest, and draws the puppet.

    Args:
        file: puppet file, or name of a bundled puppet.
        start: NAME=VALUE settings: fixed values of driven coordinates, and values of dynamic ones
            from which the search begins.
        out: picture to write.
        quiet: print no progress.
    """
    if out is not None:
        check_output(out, PICTURE_SUFFIXES, "--out")
    values = read_values(start)
    with ProgressDisplay(quiet) as display:
        puppet = load_marionette(file, display.update)
        display.stage("searching the state of rest")
        try:
            x = puppet.rest(values)
        except StateError as error:
            fail(str(error), file)
        run = simulate(puppet, x, t_end=x.t + _RUN_DURATION)
        if out is not None:
            from fantoccini.output import draw

            display.stage(f"drawing {out}")
            draw(puppet, x, out, tension=run.tension.values[0])
    _print_strings(puppet, x, run)
    _print_coordinates(puppet, x)
    _print_contacts(run)
    names, q_K = puppet.coordinates.q_K, x.q_K
    if names:
        print_output("a CSV of inputs that begins here has these first lines:")
        print_output(",".join(("t", *names)))
        print_output(",".join(("0", *(f"{value:.9g}" for value in q_K))))


def _print_strings(puppet: Marionette, x: State, run: Trajectory) -> None:
    lengths = puppet.string_lengths(x.q_D, x.q_K)
    table_lines = []
    for i, (name, points) in enumerate(puppet.string_points(x.q_D, x.q_K).items()):
        path_length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        slack = 1e3 * max(0.0, float(lengths[i]) - path_length)
        tension = f"{run.tension.values[0, i]:.4f}"
        state = "taut" if float(tension) > 0.0 else "straight, without tension"
        if not run.taut.values[0, i]:
            state = f"slack by {slack:.1f} mm"
        table_lines.append((name, f"{lengths[i]:.6f}", tension, state))
    print_table("Strings", ("name", "length [m]>", "tension [N]>", ""), table_lines)


def _print_coordinates(puppet: Marionette, x: State) -> None:
    values = {"dynamic": x.q_D, "driven": x.q_K}
    table_lines = []
    for row in puppet.coordinates.rows:
        if row.index is not None:
            value = float(values[row.role][row.index])
            degrees = (
                f"{value * _DEGREES_PER_UNIT[row.unit]:.2f} deg"
                if row.unit in _DEGREES_PER_UNIT
                else ""
            )
            table_lines.append((row.name, row.role, f"{value:z.6f}", row.unit, degrees))
    print_table("Coordinates", ("name", "role", "value>", "unit", ""), table_lines)


def _print_contacts(run: Trajectory) -> None:
    if run.contact is None:
        return
    contact_points = run.contact
    table_lines = []
    for k, names in enumerate(contact_points.names):
        of_pair = (contact_points.sample == 0) & (contact_points.pair == k)
        if np.any(of_pair):
            force = np.linalg.norm(contact_points.force[of_pair].sum(axis=0))
            table_lines.append((" on ".join(names), f"{force:.4f}", int(np.sum(of_pair))))
    print_table("Contacts", ("pair", "force [N]>", "points>"), table_lines)
