"""Section VI as an experiment on one puppet."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np
from benchmarks.section_vi.bandwidth import bandwidth_sweep
from benchmarks.section_vi.exact import compare, shared_catches
from benchmarks.section_vi.file_drives import FileDrives, follow_on_file_drives
from benchmarks.section_vi.heavy_string import heavy_strings
from benchmarks.section_vi.mechanism import Mechanism
from benchmarks.section_vi.plots import Measurements
from benchmarks.section_vi.reference import Reference, simulate_reference, smooth_reference, toss
from benchmarks.section_vi.report import SectionReport
from benchmarks.section_vi.symbolic import symbolic_blocks

from fantoccini.base.errors import FantocciniError, StateError
from fantoccini.base.progress import OnProgress, Progress
from fantoccini.dynamics.marionette import Marionette
from fantoccini.lab import validate_reduction
from fantoccini.motion import Input

T = TypeVar("T")


def measure(
    marionette: Marionette, inputs: Input | None = None, progress: OnProgress | None = None
) -> SectionReport:
    """Sec. VI, tested: does a puppet on driven mechanisms move as the mixed model says?

    (a) examines the structure that the paper claims; (b) moves the puppet on drives by the forces
    of exact tracking and compares it with the mixed model; (c) lets the drives follow with a finite
    bandwidth, and gives a string mass. Every driven coordinate gets a drive as heavy as the puppet;
    the drives of the file are measured separately. Compiles up to eight models the first time.

    Args:
        marionette: the puppet.
        inputs: the motion to compare, from rest; by default small moves of every driven
            coordinate.
        progress: called with each step.

    Raises:
        PuppetError: it has no driven coordinates.
        StateError: the inputs have forces.
    """
    report_step = progress or (lambda _: None)
    mechanism = Mechanism.of(marionette)
    report_step(Progress("examining the kinetic energy and taut strings"))
    reduction = validate_reduction(marionette)
    if inputs is not None and inputs.force is not None:
        raise StateError("found inputs with forces; needed: motions of driven coordinates alone")
    attempts = _Attempts(report_step)
    reference = attempts.run(
        "the motion", "finding a motion to compare", lambda: _reference(mechanism, inputs)
    )
    measured, on_file_drives = Measurements(), None
    if reference is not None:
        measured, on_file_drives = _measure(mechanism, marionette, reference, attempts)
    return SectionReport(
        reduction=reduction,
        symbolic=symbolic_blocks(mechanism.mixed),
        mass=mechanism.mixed.mass,
        duration=reference.inputs.duration if reference else np.nan,
        first_impact=reference.first_impact if reference else np.nan,
        missing=tuple(attempts.missing),
        file_drives=on_file_drives,
        **vars(measured),
    )


class _Attempts:
    """Runs measurements that may be impossible, and lists why.

    Attributes:
        missing: one line per failure.
    """

    def __init__(self, report_step: OnProgress):
        self.missing: list[str] = []
        self._report_step = report_step

    def run(self, what: str, step: str, measure: Callable[[], T]) -> T | None:
        """The result of a measurement, or None."""
        self._report_step(Progress(step))
        try:
            return measure()
        except FantocciniError as error:
            self.missing.append(f"{what}: {error}")
            return None


def _measure(
    mechanism: Mechanism, marionette: Marionette, reference: Reference, attempts: _Attempts
) -> tuple[Measurements, FileDrives | None]:
    """Parts (b) and (c)."""
    full = mechanism.full()
    comparisons, stopped = attempts.run(
        "exact tracking",
        "comparing with exact tracking",
        lambda: compare(mechanism, full, reference),
    ) or ([], [])
    attempts.missing += [f"exact tracking, {line}" for line in stopped]
    thrown, catches = toss(mechanism, reference.x0, reference.inputs), None
    if thrown is None:
        attempts.missing.append("catches: nothing catches when the puppet is tossed")
    else:
        catches = attempts.run(
            "catches", "comparing a catch", lambda: shared_catches(mechanism, full, thrown)
        )
    tracking = attempts.run(
        "bandwidth",
        "varying the drives' bandwidth",
        lambda: bandwidth_sweep(mechanism, mechanism.full(bandwidth=1.0), reference),
    )
    heavy = attempts.run(
        "a string with mass", "giving a string mass", lambda: heavy_strings(mechanism, reference)
    )
    on_file_drives = None
    if marionette.tree.drives:
        on_file_drives = attempts.run(
            "the file's drives",
            "moving the file's own drives",
            lambda: follow_on_file_drives(mechanism, marionette, reference),
        )
    measured = Measurements(
        comparisons=tuple(comparisons),
        catches=tuple(catches or ()),
        tracking=tuple(tracking or ()),
        heavy_strings=tuple(heavy or ()),
    )
    return measured, on_file_drives


def _reference(mechanism: Mechanism, inputs: Input | None) -> Reference:
    if inputs is None:
        return smooth_reference(mechanism, mechanism.mixed.rest())
    bound_inputs = mechanism.translated(inputs, mechanism.mixed)
    x0 = mechanism.mixed.rest(bound_inputs.first_values())
    return simulate_reference(mechanism, x0, bound_inputs.bound(x0.q_K))
