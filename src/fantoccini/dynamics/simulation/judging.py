"""Verdict on a run of fixed steps that reached its end: violations and energy.

Time-stepping never stops by itself. A run that reached its end is DONE only if its rows held and
its energy has a source.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Mask, StateError, Status
from fantoccini.dynamics.compiled import check_step, critical_step_of_tensions
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.steppers import Overlap, deepest
from fantoccini.motion import Columns, Trajectory, pair_name


@dataclass(frozen=True)
class Bounds:
    """Bounds beyond which a run is not sound."""

    violation: float = 0.02  # Largest violation of a string, limit or contact [m or rad]
    fast: float = 0.02
    """Largest move in a step above which violations after the last step are computed; the curvature
    of slower steps causes violations far below ``violation`` [rad or m]."""
    gain: float = 5.0
    """Energy without a source, relative to all available energy. Near the critical step of a spring
    the energy oscillates with several times its value, and does not grow."""
    unbooked: float = 0.2
    """Largest residual of the ledger, relative to the energy exchanged. Over many small impacts,
    errors of sound steps add up: the bundled walk has 0.105 with 2 ms, half of it with 1 ms."""
    coarse: float = 20.0
    """Number of coarse steps: the energy of a fall of this duration is wrong by its own size; and
    that of springs oscillates by its own size, if this many steps are their longest stable one."""
    fall: float = 1e-3  # Fall of the puppet whose energy always counts as available [m]
    energy: float = 1e-9  # Energy that always counts as available [J]
    max_named: int = 5  # Maximum number of rows named in a message


BOUNDS = Bounds()


def verdicts(violation: Array, gain: Array, unbooked: Array) -> Array:
    """``Status`` numbers (...,): DONE or the fault; NaN counts as too large.

    Args:
        violation: (...,) largest violations of strings, limits and contacts [m or rad].
        gain: (...,) results of :func:`gains`.
        unbooked: (...,) largest results of :func:`unbooked`.
    """
    within = (violation <= BOUNDS.violation, gain <= BOUNDS.gain, unbooked <= BOUNDS.unbooked)
    wrong = (Status.OVERSTEPPED, Status.GAINED_ENERGY, Status.UNBALANCED)
    return np.select([np.logical_not(held) for held in within], list(map(int, wrong)), Status.DONE)


def verdict(violation: float, gain: float, unbooked: float) -> Status:
    """Status of one run; see :func:`verdicts`."""
    numbers = map(np.asarray, (violation, gain, unbooked))
    return Status(int(verdicts(*numbers)))


def gains(marionette: Marionette, ledger: Mapping[str, Array] | Columns) -> Array:
    """Largest residuals (...,) of ledgers, relative to the available energy.

    The available energy is T at the start, the largest fall of V, and all work, taken as positive,
    over the whole run: near the longest stable step of a spring the residual oscillates, and
    exceeds at first by far what was available until then.
    The columns of the ledger are (..., T) [J].
    """
    potential, work = ledger["potential"], ledger["work"]
    fallen = np.max(potential[..., :1] - potential, axis=-1)
    worked = np.sum(np.abs(np.diff(work, axis=-1)), axis=-1)
    available = ledger["kinetic"][..., 0] + fallen + worked
    available = available + BOUNDS.fall * marionette.weight + BOUNDS.energy
    return np.max(ledger["residual"], axis=-1) / available


def unbooked(
    marionette: Marionette, ledger: Mapping[str, Array] | Columns, t: Array, dt: float
) -> Array:
    """Residuals (..., T) of ledgers, of either sign, relative to the energy exchanged until then.

    The energy exchanged is the largest T, the range of V and the largest work, and the energy of a
    fall over the number of coarse steps. What comes later does not count: a run that gains energy
    is not sound because its inputs do more work afterwards. The damping of the steps beside a
    sample is not counted, because it is booked a step late.

    Args:
        marionette: the puppet.
        ledger: ledgers with columns (..., T) [J].
        t: (T,) times of the samples [s].
        dt: length of the steps [s].
    """
    g = marionette.weight / max(marionette.mass, BOUNDS.energy)
    step = min(dt, float(t[-1] - t[0]))
    min_energy = 0.5 * marionette.weight * g * (BOUNDS.coarse * step) ** 2
    so_far = np.maximum.accumulate
    potential = ledger["potential"]
    exchanged = so_far(ledger["kinetic"], axis=-1) + so_far(potential, axis=-1)
    exchanged = exchanged + so_far(-potential, axis=-1) + so_far(np.abs(ledger["work"]), axis=-1)
    exchanged = exchanged + min_energy + BOUNDS.energy
    damped = np.abs(np.diff(ledger["damping"])) / np.maximum(np.diff(t) / dt, 1.0)
    late = np.zeros((*damped.shape[:-1], damped.shape[-1] + 2))
    late[..., 1:-1] = damped
    late = np.maximum(late[..., 1:], late[..., :-1])
    return np.maximum(np.abs(ledger["residual"]) - late, 0.0) / exchanged


def swings(marionette: Marionette, q_D: Array, q_K: Array, dt: float) -> bool:
    """Whether fast springs or chains make the energy of sound steps oscillate by a tenth.

    If the step is the fraction s of the longest stable one, it oscillates by 2 s / (1 - s), without
    growth.
    """
    try:
        check_step(marionette, "timestepping", q_D, q_K, BOUNDS.coarse * dt)
    except StateError:
        return True
    return False


def ends_fast(v_D: Array, dt: float) -> Mask:
    """Whether the last step of a run may have caused violations that no step has measured: (...,).

    Steps measure violations at their start, and add to them by their curvature only. ``v_D``
    (..., n_vD) is the velocity at the end, ``dt`` the length of the step [s].
    """
    return ~(dt * np.max(np.abs(v_D), axis=-1, initial=0.0) <= BOUNDS.fast)


def left_by_last_step(marionette: Marionette, q_D: Array, q_K: Array) -> dict[str, float]:
    """Rows and parts that are violated too far at the end of a run -> violation [m or rad].

    Strings on winches that may slip are excluded.
    """
    tree = marionette.tree
    h = np.array(marionette.library.evaluate("rows", q_D=q_D, q_K=q_K, p=marionette.p).h)
    h[marionette.two_sided] = np.abs(h[marionette.two_sided])
    h[np.isfinite(marionette.upper)] = 0.0
    names = [*(s.name for s in tree.strings), *(limit.name for limit in tree.limits)]
    rows = {name: float(x) for name, x in zip(names, h, strict=True) if x > BOUNDS.violation}
    return rows | marionette.overlaps(q_D, q_K, BOUNDS.violation)


def judged(marionette: Marionette, run: Trajectory, dt: float, worst: float) -> tuple[Status, str]:
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
    fast = ends_fast(run.v_D[-1], dt)
    left = left_by_last_step(marionette, run.q_D[-1], run.q_K[-1]) if fast else {}
    largest = max([float(np.max(table.values, initial=worst)), *left.values()])
    shares = unbooked(marionette, ledger, run.t, dt)
    gain, share = float(gains(marionette, ledger)), float(np.max(shares))
    if share > BOUNDS.unbooked and (
        run.method != "timestepping" or swings(marionette, run.q_D[0], run.q_K[0], dt)
    ):
        share = 0.0
    status = verdict(largest, gain, share)
    advice = _advice(marionette, run, dt)
    if status is Status.OVERSTEPPED:
        what = _overstepped(run, worst, left)
        text = f"{what}. {advice}; or the puppet cannot follow the inputs"
        if run.contact is None:
            text += ", which method='event' finds out"
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
        turn = dt * float(np.max(np.abs(run.v_D[k : k + 2])))
        first = run.t[int(np.argmax(~(shares <= BOUNDS.unbooked)))]
        text = (
            f"the ledger's residual reached {100 * share:.2g} % of the energy exchanged, more than "
            f"{100 * BOUNDS.unbooked:g} % from t = {first:.6g} s on; most of it, "
            f"{increments[k]:.3g} J, arose from t = {run.t[k]:.6g} to {run.t[k + 1]:.6g} s, where "
            f"a coordinate moves by {turn:.2g} rad or m in a step. {advice}"
        )
        return status, text
    return status, ""


def prescribed_verdict(overlaps: tuple[Overlap, ...]) -> tuple[Status, str]:
    """Status and error message of a run whose inputs move solids through one another."""
    if not deepest(overlaps):
        return Status.DONE, ""
    worst: dict[tuple[str, str], Overlap] = {}
    for overlap in overlaps:
        if overlap.names not in worst or overlap.depth > worst[overlap.names].depth:
            worst[overlap.names] = overlap
    named = sorted(worst.values(), key=lambda overlap: -overlap.depth)[: BOUNDS.max_named]
    listed = "; ".join(str(overlap) for overlap in named if deepest((overlap,)))
    return Status.OVERSTEPPED, (
        f"{listed}. Both follow the inputs, so that no force parts them: move the driven "
        "coordinates otherwise, or let the two pass through one another by contact.pairs with "
        "meet: false"
    )


def _overstepped(run: Trajectory, worst: float, left: dict[str, float]) -> str:
    """Violated rows or parts, their violations, and the time of the first, in words."""
    table = run.violation
    assert table is not None
    largest = np.max(table.values, axis=0)
    rows = [
        r for r in np.argsort(-largest)[: BOUNDS.max_named] if not largest[r] <= BOUNDS.violation
    ]
    if rows:
        names = ", ".join(f"{table.names[r]} by {largest[r]:.3g}" for r in rows)
        first = int(np.argmax(~(np.max(table.values, axis=1, initial=0.0) <= BOUNDS.violation)))
        when = f"from t = {run.t[first]:.6g} s on"
        return f"{names} m or rad, more than {BOUNDS.violation:g} {when}"
    if not worst <= BOUNDS.violation:
        if run.contact is not None and -run.contact.gap.min(initial=0.0) > 0.0:
            deepest = int(np.argmin(run.contact.gap))
            name = pair_name(run.contact.names[run.contact.pair[deepest]])
            return f"{name} overlap by {-run.contact.gap[deepest]:.3g} m"
        return f"by {worst:.3g} m or rad in a step between the samples that were written"
    names = ", ".join(f"{name} by {x:.3g}" for name, x in left.items())
    return f"{names} m or rad after the last step, at t = {run.t[-1]:.6g} s"


def _advice(marionette: Marionette, run: Trajectory, dt: float) -> str:
    start = run.q_D[0], run.q_K[0], run.tension.values[0]
    longest = critical_step_of_tensions(marionette, *start)
    if dt <= longest:
        return f"Take a dt shorter than {dt:g} s"
    return (
        f"The tensions at the start make vibrations that grow in steps above {longest:.2g} s: take "
        f"a dt below that instead of {dt:g} s"
    )
