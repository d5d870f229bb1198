"""Part (c): finite bandwidth. The full model approaches the mixed one as the bandwidth grows.

Every drive has a computed-torque control of bandwidth w, which knows the drive's inertia but not
the strings: e'' + 2 w e' + w^2 e = pull / J. Under a steady pull it lags by e = pull / (J w^2), so
the puppet's motion differs from the mixed model's by a multiple of 1 / w^2.
"""

from __future__ import annotations

from dataclasses import dataclass

from benchmarks.section_vi.deviation import Deviation, deviation
from benchmarks.section_vi.mechanism import Mechanism
from benchmarks.section_vi.reference import Reference

from fantoccini.dynamics.compiled import Event
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation import simulate

BANDWIDTHS = tuple(10.0 * 2.0**k for k in range(8))
"""Relative to sqrt(g/l), the frequency of a pendulum as long as the strings."""
_EVENT = Event(rtol=1e-10, atol=1e-10)


@dataclass(frozen=True, eq=False)
class TrackingRun:
    """A run of the full model under control.

    Attributes:
        bandwidth: bandwidth of all drives [rad/s].
        deviation: deviation from the mixed model.
    """

    bandwidth: float
    deviation: Deviation


def tracking_run(
    mechanism: Mechanism, full: Marionette, reference: Reference, bandwidth: float
) -> TrackingRun:
    """The full model follows the inputs of the mixed model's motion.

    Args:
        mechanism: the puppet.
        full: the puppet on drives with control, as heavy as the puppet.
        reference: motion of the mixed model.
        bandwidth: bandwidth of the drives [rad/s].
    """
    full = mechanism.with_drives(full, 1.0, bandwidth)
    run = simulate(
        full,
        mechanism.full_state(full, reference.x0),
        mechanism.translated(reference.inputs, full),
        reference.inputs.end,
        method=_EVENT,
        effort=False,
        throw=False,
    )
    return TrackingRun(bandwidth, deviation(mechanism, reference.run, run))


def bandwidth_sweep(
    mechanism: Mechanism, full: Marionette, reference: Reference
) -> list[TrackingRun]:
    """The same motion with increasing bandwidths."""
    scaled = (w / mechanism.time_scale for w in BANDWIDTHS)
    return [tracking_run(mechanism, full, reference, w) for w in scaled]
