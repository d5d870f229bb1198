"""Section VI as an experiment: everything that is measured of one puppet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fantoccini.errors import FantocciniError, StateError
from fantoccini.marionette import Marionette
from fantoccini.motion import Input
from fantoccini.reduction.bandwidth import Tracked, bandwidths, order
from fantoccini.reduction.claims import Claim, claims, meaning
from fantoccini.reduction.exact import Caught, Compared, caught, compared
from fantoccini.reduction.massive import Massive, massive
from fantoccini.reduction.mechanism import Mechanism
from fantoccini.reduction.motions import Motion, performed, swayed, tossed
from fantoccini.reduction.own import Own, own
from fantoccini.reduction.structure import Structure, structure


@dataclass(frozen=True, eq=False)
class ReductionReport:
    """What of Sec. VI holds for a puppet, with the figures.

    Attributes:
        name: of the puppet.
        driven: its driven velocities; each has a drive in the full model.
        mass: of the puppet [kg], and of each drive where nothing else is said.
        structure: (a) the kinetic energy, symmetric products, taut strings.
        claims: (a) in words, with verdicts.
        meaning: what follows for the mixed model, in paragraphs.
        duration, ends: of the motion that is compared, and up to its first catch [s].
        compared: (b) both models with exact tracking; empty where the motion cannot be run.
        caught: (b) the first catch of a toss with heavier and heavier drives.
        tracked: (c) drives of larger and larger bandwidth.
        massive: (c) a string with mass, on such drives.
        own: (c) the drives of the puppet's file, as they are; None where it has none.
        missing: what could not be measured, and why.
    """

    name: str
    driven: tuple[str, ...]
    mass: float
    structure: Structure
    claims: tuple[Claim, ...]
    meaning: tuple[str, ...]
    duration: float
    ends: float
    compared: tuple[Compared, ...]
    caught: tuple[Caught, ...]
    tracked: tuple[Tracked, ...]
    massive: tuple[Massive, ...]
    missing: tuple[str, ...]
    own: Own | None = None

    @property
    def exact(self) -> Compared | None:
        """The comparison with the smallest tolerance."""
        return min(
            (c for c in self.compared if c.method == "event"), key=lambda c: c.step, default=None
        )

    @property
    def catch_order(self) -> float:
        """The power of the drives' inertia with which a catch differs; -1 is expected."""
        return order([c.ratio for c in self.caught], [c.jump for c in self.caught])

    @property
    def bandwidth_order(self) -> float:
        """The power of the bandwidth with which the puppet's motion differs; -2 is expected."""
        return order([t.bandwidth for t in self.tracked], [t.worst[0] for t in self.tracked])

    def write(self, folder: str | Path) -> list[Path]:
        """Writes reduction.md and its plots into a folder; each file appears whole.

        Args:
            folder: that exists.

        Returns:
            The files.
        """
        from fantoccini.reduction.page import write

        return write(self, Path(folder))


def validate_reduction(
    marionette: Marionette,
    inputs: Input | None = None,
    progress: Callable[[str], None] | None = None,
) -> ReductionReport:
    """Sec. VI, checked: is the mixed model what a puppet on driven mechanisms does?

    (a) looks at the structure that the paper claims; (b) moves the puppet on drives by the forces
    of exact tracking and compares with the mixed model; (c) lets the drives follow with a finite
    bandwidth, and gives a string mass. For that every driven coordinate gets a drive as heavy as
    the puppet; drives that the file has are compared as they are, beside it. Compiles up to eight
    models when it is first asked.

    Args:
        marionette: the puppet.
        inputs: the motion to compare, from rest where it begins; small moves of every driven
            coordinate when not given.
        progress: told what begins.

    Raises:
        PuppetError: it has no driven coordinates, or it is a world of several puppets.
        StateError: it does not hang at rest, or the inputs have forces.
    """
    say = progress or (lambda _: None)
    mechanism = Mechanism.of(marionette)
    say("looking at the kinetic energy and at taut strings")
    found = structure(mechanism.mixed, mechanism.inertia(1.0))
    missing: list[str] = []
    if inputs is not None and inputs.force is not None:
        raise StateError("found inputs with forces; needed: motions of driven coordinates alone")
    motion = _attempt(missing, "the motion", lambda: _motion(mechanism, inputs, say))
    parts: dict[str, tuple] = dict.fromkeys(("compared", "caught", "tracked", "massive"), ())
    as_it_is = None
    if motion is not None:
        full = mechanism.full()
        say("comparing with exact tracking")
        both = _attempt(missing, "exact tracking", lambda: compared(mechanism, full, motion))
        if both is not None:
            parts["compared"] = both[0]
            missing += [f"exact tracking, {line}" for line in both[1]]
        thrown = tossed(mechanism, motion.x0, motion.inputs)
        if thrown is None:
            missing.append("catches: nothing catches when the puppet is tossed")
        else:
            say("comparing a catch")
            parts["caught"] = _attempt(missing, "catches", lambda: caught(mechanism, full, thrown))
        say("sweeping the drives' bandwidth")
        parts["tracked"] = _attempt(
            missing, "bandwidth",
            lambda: bandwidths(mechanism, mechanism.full(bandwidth=1.0), motion),
        )  # fmt: skip
        say("giving a string mass")
        parts["massive"] = _attempt(
            missing, "a string with mass", lambda: massive(mechanism, motion)
        )
        if marionette.tree.drives:
            say("moving the file's own drives")
            as_it_is = _attempt(
                missing, "the file's drives", lambda: own(mechanism, marionette, motion)
            )
    return ReductionReport(
        mechanism.mixed.name,
        mechanism.mixed.coordinates.v_K,
        mechanism.mixed.mass,
        found,
        claims(found),
        tuple(meaning(found)),
        motion.inputs.duration if motion else np.nan,
        motion.ends if motion else np.nan,
        **{name: tuple(part or ()) for name, part in parts.items()},
        missing=tuple(missing),
        own=as_it_is,
    )


def _motion(mechanism: Mechanism, inputs: Input | None, say: Callable[[str], None]) -> Motion:
    say("finding a motion to compare")
    if inputs is None:
        return swayed(mechanism, mechanism.mixed.rest())
    given = mechanism.commanded(mechanism.mixed, inputs)
    x0 = mechanism.mixed.rest(given.first_values())
    return performed(mechanism, x0, given.bound(x0.q_K))


def _attempt(missing: list[str], what: str, measure: Callable):
    """What is measured, or None and a line that says why not."""
    try:
        return measure()
    except FantocciniError as error:
        missing.append(f"{what}: {error}")
        return None
