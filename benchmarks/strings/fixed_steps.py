"""Section 7: errors of time-stepping, by step."""

from __future__ import annotations

import numpy as np

from . import scenarios
from .report import Section, Table, number, order

STEPS = (8e-3, 4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4)
LED_SECONDS = 2.0
"""Duration of the guided arm's run; later a first-order error is too large to compare [s]."""


def section() -> Section:
    """Violation, ledger residual and error of a pendulum and of the guided arm."""
    out = Section("7. Time-stepping against its step")
    out.parts.append(
        "The violation is the largest excess of a string's length, the residual the largest of "
        "the ledger. Position and velocity are the errors at the end against `event` at 1e-13. "
        "Orders are computed between neighbouring rows."
    )
    for scenario, seconds in ((scenarios.chain(), 5.0), (scenarios.arm_led(), LED_SECONDS)):
        runs = [scenario.run(seconds, method="timestepping", dt=dt) for dt in STEPS]
        known = scenario.run(seconds, tolerance=1e-13)
        columns = [
            [float(np.max(run.violation.values)) for run in runs],
            [float(np.max(np.abs(run.ledger["residual"]))) for run in runs],
            [float(np.max(np.abs(run.q_D[-1] - known.q_D[-1]))) for run in runs],
            [float(np.max(np.abs(run.v_D[-1] - known.v_D[-1]))) for run in runs],
        ]
        rows = [[number(dt, 3)] for dt in STEPS]
        for values in columns:
            for row, value, power in zip(rows, values, order(values, STEPS), strict=True):
                row += [number(value), power]
        head = ["step (s)", "violation (m)", "order", "residual (J)", "order"]
        head += ["position (m, rad)", "order", "velocity (m/s, rad/s)", "order"]
        title = f"{scenario.name[0].upper()}{scenario.name[1:]}"
        out.parts += [f"### {title}: {seconds:g} s, {len(known.events)} events", Table(head, rows)]
    return out
