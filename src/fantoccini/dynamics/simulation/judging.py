"""Verdict on a run of fixed steps that reached its end, with the reason in words.

The ledger is the table of energies and work of a run. A row is a string or a joint limit; q_D and
q_K are the dynamic and driven coordinates.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from fantoccini.base import Array, Mask, Status, Times
from fantoccini.dynamics.compiled import critical_step_of_tensions
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.steppers import (
    BOUNDS,
    LedgerCheck,
    Overlap,
    decide,
    deepest,
    excused_share,
    fault_of_run,
    springs_swing,
)
from fantoccini.motion import Columns, Trajectory, pair_name

_CHUNK_SIZE = 1024
"""Number of samples of a ledger that are checked at once."""


def ends_fast(v_D: Array, dt: float) -> Mask:
    """Whether the last step of a run may have caused unmeasured violations: (...,).

    Steps measure violations at their start, and add to them by their curvature only. ``v_D``
    (..., n_vD) is the velocity at the end, ``dt`` the length of the step [s].
    """
    return ~(dt * np.max(np.abs(v_D), axis=-1, initial=0.0) <= BOUNDS.max_slow_move)


def violations_after_last_step(marionette: Marionette, q_D: Array, q_K: Array) -> dict[str, float]:
    """Rows and parts that are violated too far at the end of a run -> violation [m or rad].

    Strings on winches that may slip are excluded.
    """
    tree = marionette.tree
    h = np.array(marionette.library.evaluate("rows", q_D=q_D, q_K=q_K, p=marionette.p).h)
    h[marionette.two_sided] = np.abs(h[marionette.two_sided])
    h[np.isfinite(marionette.max_forces)] = 0.0
    names = [*(s.name for s in tree.strings), *(limit.name for limit in tree.limits)]
    row_violations = {
        name: float(violation)
        for name, violation in zip(names, h, strict=True)
        if violation > BOUNDS.max_violation
    }
    return row_violations | marionette.overlaps(q_D, q_K, BOUNDS.max_violation)


def fixed_step_verdict(
    marionette: Marionette, run: Trajectory, dt: float, worst: float
) -> tuple[Status, str]:
    """Status of a run with fixed steps that reached its end, and the reason in words.

    Args:
        marionette: the puppet.
        run: the run.
        dt: length of the steps [s].
        worst: largest violation of all steps [m or rad]; samples may have smaller ones.
    """
    ledger, table = run.ledger, run.violation
    if table is None:
        return Status.DONE, ""
    is_fast = ends_fast(run.v_D[-1], dt)
    after_last_step = (
        violations_after_last_step(marionette, run.q_D[-1], run.q_K[-1]) if is_fast else {}
    )
    max_violation = max([float(np.max(table.values, initial=worst)), *after_last_step.values()])
    start = {name: ledger[name][0] for name in ledger.names}
    check = LedgerCheck(marionette, dt, start, run.t[0])
    shares = _shares(check, ledger, run.t)
    gain = float(check.gain)
    share = excused_share(
        run.method,
        float(check.share),
        lambda: springs_swing(marionette, run.q_D[0], run.q_K[0], dt),
    )
    status = fault_of_run(max_violation, gain, share)
    advice = _advice(marionette, run, dt)
    if status is Status.OVERSTEPPED:
        message = _violation_message(run, worst, after_last_step)
        text = f"{message}. {advice}; or the puppet cannot follow the inputs"
        if run.contact is None:
            text += ", which method='event' decides"
        return status, text
    if status is Status.GAINED_ENERGY:
        text = (
            f"the ledger's residual reached {np.max(ledger['residual']):.3g} J, {gain:.2g} times "
            f"all available energy. {advice}"
        )
        return status, text
    if status is Status.UNBALANCED:
        increments = np.diff(ledger["residual"])
        k = int(np.argmax(np.abs(increments)))
        move = dt * float(np.max(np.abs(run.v_D[k : k + 2])))
        first_time = run.t[int(np.argmax(~(shares <= BOUNDS.max_unbalanced)))]
        text = (
            f"the ledger's residual reached {100 * share:.2g} % of the energy exchanged, more than "
            f"{100 * BOUNDS.max_unbalanced:g} % from t = {first_time:.6g} s on; most of it, "
            f"{increments[k]:.3g} J, arose from t = {run.t[k]:.6g} to {run.t[k + 1]:.6g} s, where "
            f"a coordinate moves by {move:.2g} rad or m in a step. {advice}"
        )
        return status, text
    return status, ""


def _shares(check: LedgerCheck, ledger: Columns, t: Times) -> Array:
    """(T,) shares of all samples of a run, added to its check in pieces, which need less memory."""
    shares: list[Array] = []
    for k in range(1, max(2, len(t)), _CHUNK_SIZE):
        columns = {name: ledger[name][k : k + _CHUNK_SIZE] for name in ledger.names}
        new_shares = check.add(columns, t[k : k + _CHUNK_SIZE])
        # The first is the last of the piece before, whose damping is available only now.
        shares = [*shares[:-1], *(previous[:-1] for previous in shares[-1:]), new_shares]
    return np.concatenate(shares)


def with_verdict(marionette: Marionette, run: Trajectory, dt: float) -> Trajectory:
    """A run with fixed steps whose status is its verdict, by violations at its samples alone."""
    status = decide(run.status, None, [lambda: fixed_step_verdict(marionette, run, dt, 0.0)]).status
    return run if status is run.status else dataclasses.replace(run, status=status)


def prescribed_verdict(overlaps: tuple[Overlap, ...]) -> tuple[Status, str]:
    """Status and error message of a run whose inputs move solids through one another."""
    if not deepest(overlaps):
        return Status.DONE, ""
    deepest_by_pair: dict[tuple[str, str], Overlap] = {}
    for overlap in overlaps:
        if (
            overlap.names not in deepest_by_pair
            or overlap.depth > deepest_by_pair[overlap.names].depth
        ):
            deepest_by_pair[overlap.names] = overlap
    listed_overlaps = sorted(deepest_by_pair.values(), key=lambda overlap: -overlap.depth)[
        : BOUNDS.max_named
    ]
    texts = "; ".join(str(overlap) for overlap in listed_overlaps if deepest((overlap,)))
    return Status.OVERSTEPPED, (
        f"{texts}. Both follow the inputs, so that no force parts them: move the driven "
        "coordinates otherwise, or let the two pass through one another by contact.pairs with "
        "meet: false"
    )


def _violation_message(run: Trajectory, worst: float, after_last_step: dict[str, float]) -> str:
    """Violated rows or parts, their violations, and the time of the first, in words."""
    table = run.violation
    assert table is not None
    max_by_row = np.max(table.values, axis=0)
    rows = [
        r
        for r in np.argsort(-max_by_row)[: BOUNDS.max_named]
        if not max_by_row[r] <= BOUNDS.max_violation
    ]
    if rows:
        names = ", ".join(f"{table.names[r]} by {max_by_row[r]:.3g}" for r in rows)
        first = int(np.argmax(~(np.max(table.values, axis=1, initial=0.0) <= BOUNDS.max_violation)))
        since = f"from t = {run.t[first]:.6g} s on"
        return f"{names} m or rad, more than {BOUNDS.max_violation:g} {since}"
    if not worst <= BOUNDS.max_violation:
        if run.contact is not None and -run.contact.gap.min(initial=0.0) > 0.0:
            deepest = int(np.argmin(run.contact.gap))
            name = pair_name(run.contact.names[run.contact.pair[deepest]])
            return f"{name} overlap by {-run.contact.gap[deepest]:.3g} m"
        return f"by {worst:.3g} m or rad in a step between the saved samples"
    names = ", ".join(f"{name} by {x:.3g}" for name, x in after_last_step.items())
    return f"{names} m or rad after the last step, at t = {run.t[-1]:.6g} s"


def _advice(marionette: Marionette, run: Trajectory, dt: float) -> str:
    start = run.q_D[0], run.q_K[0], run.tension.values[0]
    critical_dt = critical_step_of_tensions(marionette, *start)
    if dt <= critical_dt:
        return f"Use a dt shorter than {dt:g} s"
    return (
        f"The tensions at the start cause growing vibrations in steps above {critical_dt:.2g} s: "
        "use "
        f"a shorter dt than {dt:g} s"
    )
