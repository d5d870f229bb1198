"""Samples, events and contact points that a run writes, and numbers of winches that it reads.

A sample is one saved instant of a run. A winch changes the length of a string, and its slip is the
length that it has let out; at a catch, a slack string becomes taut. In names, D stands for dynamic
coordinates, which move by the equations of motion, and K for driven ones: ends and lengths of
strings, driven joints.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from fantoccini.kernel.contract.arguments import ARGUMENTS
from fantoccini.kernel.contract.quantity import Quantity

_ENERGY_TERMS = (
    Quantity("kinetic", (), "J", "kinetic energy"),
    Quantity("potential", (), "J", "potential energy"),
    Quantity("work", (), "J", "work of the inputs"),
    Quantity("damping", (), "J", "loss by damping and drag"),
    Quantity("impact", (), "J", "loss at catches"),
    Quantity("slip_loss", (), "J", "loss by slipping winches"),
    Quantity("friction", (), "J", "loss by friction of contacts"),
)
ENERGY_TERMS = tuple(q.name for q in _ENERGY_TERMS)
"""Energies, work and losses of a sample; a batch saves them as one part, ``energy_terms``."""
SUMS = ENERGY_TERMS[2:]
"""Work and losses, which accumulate over a run."""

SAMPLE: tuple[Quantity, ...] = (
    Quantity("t", (), "s", "time"),
    *(ARGUMENTS[name] for name in ("q_D", "v_D", "acc_D", "q_K", "v_K", "acc_K", "tension")),
    Quantity("taut", ("n_rows",), "1", "1 where the row is active, else 0"),
    *_ENERGY_TERMS,
    Quantity("slip", ("n_strings",), "m", "lengths let out by slipping winches"),
    Quantity(
        "contact_residual",
        (),
        "1",
        "error of the contact laws in the last step, relative to the largest speed in them",
    ),
)
"""Parts of a sample of a run."""

EVENT: tuple[Quantity, ...] = (
    Quantity("t", (), "s", "time"),
    Quantity("kind", (), "1", "EventCode"),
    Quantity("row", (), "1", "index: rows, then drives, then contact pairs; -1 for none"),
    Quantity("impulse", (), "N s or N m s", "impulse of a catch"),
    Quantity("speed", (), "m/s or rad/s", "hdot before a catch"),
)
"""Parts of an event of a run."""

EVENT_AT = {part.name: k for k, part in enumerate(EVENT)}
"""Part of an event -> its column."""

CONTACT: tuple[Quantity, ...] = (
    Quantity("sample", (), "1", "index of the sample in the record"),
    Quantity("pair", (), "1", "index of the pair of solids"),
    Quantity("gap", (), "m", "distance of their surfaces; negative if they overlap"),
    Quantity("point", (3,), "m", "midpoint between the surfaces, in the world"),
    Quantity("normal", (3,), "1", "unit normal from the second solid to the first"),
    Quantity("force", (3,), "N", "force on the first solid, in the world"),
    Quantity("velocity", (3,), "m/s", "velocity of the first solid relative to the second"),
)
"""Parts of a contact point of a run."""

WINCH: tuple[Quantity, ...] = (
    Quantity("max_tension", (), "N", "tension at which the winch slips; infinite or 1e300: never"),
    Quantity("rewind_speed", (), "m/s", "speed at which it rewinds its slip; 0: never"),
    Quantity("restitution", (), "1", "restitution of catches, 0 to 1"),
)
"""Properties of every string's winch."""

WINCH_AT = {part.name: k for k, part in enumerate(WINCH)}
"""Property of a winch -> its column."""

PARTS: tuple[Quantity, ...] = (
    *SAMPLE[1:7],
    Quantity("force", ("n_rows",), "N or N m", "tensions of strings, forces of limits"),
    Quantity("taut", ("n_rows",), "1", "whether the row is active"),
    Quantity("energy_terms", (len(ENERGY_TERMS),), "J", "energies, work and losses"),
    *SAMPLE[-2:],
)
"""Parts of a sample that a batch can save, in the order of :data:`SAMPLE`."""


def width(parts: Iterable[Quantity], sizes: Mapping[str, int]) -> int:
    """Total number of entries of several parts."""
    return sum(part.numel(sizes) for part in parts)
