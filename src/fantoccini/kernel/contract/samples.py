"""What a run writes: samples and events; and what it reads of every winch."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from fantoccini.kernel.contract.arguments import ARGUMENTS
from fantoccini.kernel.contract.quantity import Quantity

_BOOKS = (
    Quantity("kinetic", (), "J", "kinetic energy"),
    Quantity("potential", (), "J", "potential energy"),
    Quantity("work", (), "J", "work of the inputs"),
    Quantity("damping", (), "J", "lost to damping and drag"),
    Quantity("impact", (), "J", "lost at catches"),
    Quantity("slip_loss", (), "J", "lost by slipping winches"),
    Quantity("friction", (), "J", "lost to friction of contacts"),
)
BOOKS = tuple(q.name for q in _BOOKS)
"""Energies, work and losses of a sample, which a batch saves as one part, ``books``."""
SUMS = BOOKS[2:]
"""Those that add up over a run: work and losses, without the energies."""

SAMPLE: tuple[Quantity, ...] = (
    Quantity("t", (), "s", "time"),
    *(ARGUMENTS[name] for name in ("q_D", "v_D", "acc_D", "q_K", "v_K", "acc_K", "tension")),
    Quantity("taut", ("n_rows",), "1", "1 where the row is active, else 0"),
    *_BOOKS,
    Quantity("slip", ("n_strings",), "m", "what the winches have let out"),
    Quantity(
        "contact_residual",
        (),
        "1",
        "of the laws of contact in the step before: a speed, relative to the largest in them",
    ),
)
"""A saved instant of a run."""

EVENT: tuple[Quantity, ...] = (
    Quantity("t", (), "s", "time"),
    Quantity("kind", (), "1", "an EventCode"),
    Quantity("row", (), "1", "of the row; then of the drive; then of the meeting; -1 for none"),
    Quantity("impulse", (), "N s or N m s", "of a catch"),
    Quantity("speed", (), "m/s or rad/s", "hdot before a catch"),
)
"""An event of a run."""

EVENT_AT = {part.name: k for k, part in enumerate(EVENT)}
"""Columns of events."""

CONTACT: tuple[Quantity, ...] = (
    Quantity("sample", (), "1", "which of the record's samples"),
    Quantity("pair", (), "1", "which pair of solids"),
    Quantity("gap", (), "m", "between their surfaces; negative where they overlap"),
    Quantity("point", (3,), "m", "midway between them, in the world"),
    Quantity("normal", (3,), "1", "from the second solid to the first"),
    Quantity("force", (3,), "N", "on the first solid, in the world"),
    Quantity("velocity", (3,), "m/s", "of the first solid against the second there"),
)
"""A contact point at a sample of a run."""

WINCH: tuple[Quantity, ...] = (
    Quantity("max_tension", (), "N", "at which the winch slips; infinite, or 1e300, for never"),
    Quantity("rewind_speed", (), "m/s", "at which it rewinds what it has let out; 0 for never"),
    Quantity("restitution", (), "1", "of catches, 0 to 1"),
)
"""What a run reads of every string's winch."""

WINCH_AT = {part.name: k for k, part in enumerate(WINCH)}
"""Columns of winches."""

PARTS: tuple[Quantity, ...] = (
    *SAMPLE[1:7],
    Quantity("force", ("n_rows",), "N or N m", "tensions of strings, forces of limits"),
    Quantity("taut", ("n_rows",), "1", "whether the row is active"),
    Quantity("books", (len(BOOKS),), "J", "energies, work and losses"),
    *SAMPLE[-2:],
)
"""Parts of a batch's samples, in the order of :data:`SAMPLE` after its time."""


def width(parts: Iterable[Quantity], sizes: Mapping[str, int]) -> int:
    """How many numbers some parts have together."""
    return sum(part.numel(sizes) for part in parts)
