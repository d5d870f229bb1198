"""One run and its required properties.

`python -m properties.check PUPPET SEED METHOD` runs one case and prints broken properties.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace

import numpy as np
from tests.harness import method_of

import fantoccini as fan
from fantoccini import Status
from properties.performances import Performance, draw_performance

METHODS = ("event", "timestepping", "variational")
FIXED_STEPS = {"event": 0.002, "timestepping": 0.002, "variational": 0.01}
"""Steps of the methods with fixed steps [s]."""

EXPECTED_STATUSES = {
    "event": {
        Status.DONE,
        Status.IMPOSSIBLE_INPUT,
        Status.TENSION_CAP,
        Status.COLLAPSED,
        Status.LENGTH_NOT_POSITIVE,
        Status.REDUNDANT_STRINGS,
    },
    "timestepping": {
        Status.DONE,
        Status.COLLAPSED,
        Status.LENGTH_NOT_POSITIVE,
        Status.REDUNDANT_STRINGS,
        Status.OVERSTEPPED,
        Status.GAINED_ENERGY,
        Status.UNBALANCED,
    },
    "variational": {
        Status.DONE,
        Status.IMPOSSIBLE_INPUT,
        Status.TENSION_CAP,
        Status.LENGTH_NOT_POSITIVE,
        Status.NOT_SETTLED,
        Status.REDUNDANT_STRINGS,
    },
}
"""Expected statuses. Time-stepping continues under impossible inputs; the variational integrator
may stop there without a specific reason.
"""

INACCURATE_STATUSES = {Status.GAINED_ENERGY, Status.UNBALANCED}
"""Expected statuses for steps that are too long for the bodies' rotations."""

MAX_RELATIVE_GAP = 1e-12
"""Bound on violations and on gaps of rows that pull, relative to a string's length, or to 1 rad
or 1 m (event-driven)."""
MAX_RELATIVE_HDOT = 1e-9
"""Bound on hdot of a closed row after an event, relative to the largest velocity or 1."""
MAX_NEWTON_RESIDUAL = 1e-7
"""Bound on the residual of Eqs. 10 and 11, relative to their largest term."""
MAX_OPENING = 1e-5
"""Bound on hddot of a loose closed row that is nearly dependent on other closed ones, relative
to its largest term: if strings are nearly parallel, heights known to 1e-13 determine their
directions to the root of that, about 1e-6. The row is caught before its gap exceeds
`MAX_RELATIVE_GAP`.
"""
NEARLY_DEPENDENT = 1e-3
"""Part of a row's column of W outside the span of other closed rows that counts as none."""
MAX_LEDGER_RESIDUAL = 1e-7
"""Bound on the residual, relative to weight * 1 m + |work| + losses + kinetic energy."""
MAX_GAP_FACTOR = 10.0
"""Bound on gaps of rows that pull, in dt * the largest speed of the run or 1 (time-stepping)."""
MAX_VIOLATION_FACTOR = 2.0
"""Bound on violations under possible inputs, in dt * (speed + duration * speed^2 / (2 length))
with the largest speed of the run and the shortest string (time-stepping).
"""
MAX_FOLLOWED_VIOLATION = 1e-4
"""Relative violation below which inputs count as possible (time-stepping)."""
MAX_VIOLATION = 1e-11
"""Bound on violations [m or rad] (variational)."""
MAX_GAP = 1e-9
"""Bound on gaps of rows that pull [m or rad] (variational)."""
HARD_TENSION = 100.0
"""Tension that counts as a hard pull [weights]."""
MAX_PIECES = 250
"""Bound on the pieces of up to 200 steps of a run; it needs one or two, unless strings with
restitution are pulled apart.
"""


@dataclass(frozen=True)
class Result:
    """Result of one case.

    Attributes:
        puppet, seed, method: the case.
        input_kind: kind of the inputs.
        status: name of the status.
        catches, events: their numbers.
        violation: worst, relative to the string's length (event-driven), as in
            `MAX_VIOLATION_FACTOR`, or absolute (variational).
        gap: worst gap of a row that pulls, likewise, or as in `MAX_GAP_FACTOR`.
        residual: residual of the ledger, relative to the energies.
        broken: broken properties, in words; empty when all hold.
    """

    puppet: str
    seed: int
    method: str
    input_kind: str
    status: str
    catches: int
    events: int
    violation: float
    gap: float
    residual: float
    broken: tuple[str, ...]

    @property
    def command(self) -> str:
        """Command that repeats the case."""
        module = "PYTHONPATH=tests .venv/bin/python -m properties.check"
        return f"{module} {self.puppet} {self.seed} {self.method}"


def simulate_performance(
    performance: Performance, method: str, dt: float | None = None
) -> fan.Trajectory:
    """The run of a performance; an endless one is stopped after a number of steps."""
    pieces = iter(range(MAX_PIECES))

    def count(_: object) -> None:
        if next(pieces, None) is None:
            raise KeyboardInterrupt

    return fan.simulate(
        performance.marionette,
        performance.x0,
        performance.inputs,
        performance.t_end,
        method=method_of(method, dt=dt or FIXED_STEPS[method]),
        effort=False,
        progress=count,
        throw=False,
    )


def check_case(
    puppet: str,
    seed: int,
    method: str,
    performance: Performance | None = None,
    event_status: Status | None = None,
) -> Result:
    """Run one case and return broken properties.

    Args:
        puppet: name in `puppets.ALL`.
        seed: seed of the performance.
        method: event, timestepping or variational.
        performance: the performance, if it exists already.
        event_status: status of its event-driven run, which shows whether the inputs are possible;
            simulated when not given.
    """
    performance = draw_performance(puppet, seed) if performance is None else performance
    if method != "event" and event_status is None:
        event_status = simulate_performance(performance, "event").status
    run = simulate_performance(performance, method)
    broken, measures = _check_common(performance, run, method), (0.0, 0.0, 0.0)
    if not any("finite" in message for message in broken):
        rows = _RowArrays(performance, run)
        if method == "event":
            measures, method_broken = _check_event_driven(performance, run, rows)
        elif method == "timestepping":
            measures, method_broken = _check_time_stepping(performance, run, rows, event_status)
        else:
            measures, method_broken = _check_variational(performance, run, rows, event_status)
        broken += method_broken
    return Result(
        puppet,
        seed,
        method,
        performance.input_kind,
        run.status.name,
        sum(e.kind in ("catch", "limit_on") for e in run.events),
        len(run.events),
        *(float(x) for x in measures),
        tuple(broken),
    )


class _RowArrays:
    """The rows along a run: strings, then limits.

    Attributes:
        force: (T, n_rows) tensions and limit forces [N or N m].
        has_force: (T, n_rows) bool, one-sided rows with a force.
        h: (T, n_rows) [m or rad].
        gap: (T, n_rows) opening of rows that pull, else 0 [m or rad].
        scale: (T, n_rows) lengths of strings [m], 1 for limits.
    """

    def __init__(self, performance: Performance, run: fan.Trajectory):
        puppet = performance.marionette
        h = puppet.library.evaluate("rows", q_D=run.q_D, q_K=run.q_K, p=puppet.p).h
        slip = getattr(run, "slip", None)
        if slip is not None:
            # A string is longer by the slip of its winch.
            h[:, : slip.values.shape[1]] -= slip.values
        self.h, self.scale = h, np.ones_like(h)
        for r, string in enumerate(puppet.tree.strings):
            driven = string.length_index
            length = puppet.number(string.length) if driven is None else run.q_K[:, driven[0]]
            self.scale[:, r] = np.maximum(length, 1e-3)
        self.force = np.concatenate([run.tension.values, run.limit_force.values], axis=1)
        self.has_force = (self.force != 0) & ~puppet.two_sided
        self.gap = np.where(self.has_force, np.maximum(-h, 0.0), 0.0)


class _RowRates:
    """Velocities of the rows along a run, from the model itself.

    Attributes:
        hdot: (T, n_rows) [m/s or rad/s].
        W: (T, n_rows, n_vD) F^-T A_D^T, row by row.
    """

    def __init__(self, performance: Performance, run: fan.Trajectory):
        puppet, tree = performance.marionette, performance.marionette.tree
        self._puppet, self._n, self._n_s = puppet, run.v_D.shape[1], len(tree.strings)
        dynamics = puppet.library.evaluate(
            "dynamics",
            q_D=run.q_D,
            v_D=run.v_D,
            q_K=run.q_K,
            v_K=run.v_K,
            acc_K=run.acc_K,
            u_D=performance.inputs.evaluate_force(run.t),
            p=puppet.p,
        )
        self._L, self._w0 = dynamics.L, dynamics.w0
        self._J = np.zeros((len(run), len(tree.limits), self._n))
        for i, limit in enumerate(tree.limits):
            columns = tree.links[limit.link].v
            self._J[:, i, columns] = dynamics.J_limit[:, : columns.stop - columns.start, i]
        limit_hdot = (self._J * run.v_D[:, None]).sum(axis=-1)
        self.hdot = np.concatenate([dynamics.hdot, limit_hdot], axis=1)
        self._gamma = np.concatenate([dynamics.gamma, dynamics.gamma_limit], axis=1)
        self.W = dynamics.W.swapaxes(-1, -2)
        if self._J.shape[1]:
            limit_W = puppet.library.evaluate(
                "solve_factor_transposed", L=self._L[:, None], x=self._J
            ).y
            self.W = np.concatenate([self.W, limit_W], axis=1)

    def is_nearly_dependent(self, t: int, r: int, closed: np.ndarray) -> bool:
        """Whether row r at time t is nearly in the span of the other closed rows."""
        other_rows = closed & (np.arange(len(closed)) != r)
        W, column = self.W[t, other_rows].T, self.W[t, r]
        projection = W @ np.linalg.lstsq(W, column, rcond=1e-9)[0]
        return bool(
            np.linalg.norm(column - projection) <= NEARLY_DEPENDENT * np.linalg.norm(column)
        )

    def newton_residual(self, run: fan.Trajectory, force: np.ndarray):
        """Residual of Eq. 10, and accelerations of the rows.

        Returns:
            (T,)

        acc_D - M_DD^-1 (forces + A_D^T lambda)

         relative to its largest term, hddot (T, n_rows) [m/s^2 or rad/s^2] and the size of its
             terms, at least 1.
        """
        W = self.W
        pull_terms = (force[..., None] * W).sum(axis=1)
        acc = self._puppet.library.evaluate(
            "solve_factor", L=self._L, x=np.stack([self._w0, pull_terms])
        ).y
        terms = np.abs(acc).max(axis=2, initial=0.0).sum(axis=0) + 1.0
        residual = np.abs(acc[0] - acc[1] - run.acc_D).max(axis=1, initial=0.0) / terms
        hddot = self._gamma + (W * (self._w0 - pull_terms)[:, None]).sum(axis=-1)
        force_sizes = np.linalg.norm(self._w0, axis=1) + np.linalg.norm(pull_terms, axis=1)
        term_sizes = 1.0 + np.abs(self._gamma) + np.linalg.norm(W, axis=-1) * force_sizes[:, None]
        return residual, hddot, term_sizes


def _check_common(performance: Performance, run: fan.Trajectory, method: str) -> list[str]:
    """Properties of all methods, for any inputs."""
    broken = []
    tables = ("tension", "limit_force", "ledger", "violation")
    arrays = {name: getattr(run, name) for name in ("t", "q_D", "v_D", "acc_D", "q_K", "v_K")}
    arrays |= {name: getattr(run, name).values for name in tables}
    arrays["events"] = np.array([(e.t, e.impulse, e.speed) for e in run.events])
    broken += [f"{name} is not finite" for name, a in arrays.items() if not np.all(np.isfinite(a))]
    if run.status is Status.STOPPED:
        broken.append(f"takes more than {MAX_PIECES * 200} steps")
    elif run.status not in EXPECTED_STATUSES[method]:
        broken.append(f"ends with {run.status.name}")
    elif (
        run.status is not Status.DONE
        and performance.input_kind == "nothing"
        and performance.inputs.force is None
    ):
        broken.append(f"ends with {run.status.name} though all inputs hold still")
    if run.status is Status.DONE and run.t[-1] != performance.t_end:
        broken.append("ends with DONE before the end")
    if run.t[0] != performance.x0.t or np.any(np.diff(run.t) < 0):
        broken.append("times do not increase from the start's")
    times = [run.t[0], *(e.t for e in run.events), *run.t[-1:][: run.status is Status.DONE]]
    if np.any(np.diff(times) < 0):
        broken.append("events are not in order")
    one_sided = ~performance.marionette.two_sided
    n_s = run.tension.values.shape[1]
    if np.min(run.tension.values[:, one_sided[:n_s]], initial=0.0) < 0:
        broken.append("a string pushes")
    if np.min(run.limit_force.values, initial=0.0) < 0:
        broken.append("a limit pulls")
    wires = {s.name for s in performance.marionette.tree.strings if s.wire}
    if any(e.impulse < 0 and e.name not in wires for e in run.events):
        broken.append("an impulse is negative")
    if np.any(run.tension.values[~run.taut.values] != 0):
        broken.append("a slack string has tension")
    return broken


def _energy_scale(performance: Performance, run: fan.Trajectory) -> np.ndarray:
    """(T,) energies with which a residual is compared [J], the largest so far."""
    size = np.abs(run.ledger["work"]) + np.abs(run.ledger["kinetic"]) + run.ledger["impact"]
    return performance.marionette.weight + np.maximum.accumulate(size)


def _check_event_driven(performance: Performance, run: fan.Trajectory, rows: _RowArrays):
    """Lengths, complementarity, Eqs. 10 and 11 and the ledger of an event-driven run."""
    broken, rates = [], _RowRates(performance, run)
    hdot = rates.hdot
    violation = np.max(run.violation.values / rows.scale, initial=0.0)
    gap = np.max(rows.gap / rows.scale, initial=0.0)
    if violation > MAX_RELATIVE_GAP:
        broken.append("a row is violated")
    if gap > MAX_RELATIVE_GAP:
        broken.append("tension across a gap")
    # After an event: the last of the rows at one time. A run that stops may stop within a catch.
    after_events = np.append(np.diff(run.t) > 0, run.status is Status.DONE)
    after_events[-1] &= all(e.t < run.t[-1] for e in run.events)
    # Strings on slipping winches yield, so that only Eq. 10 applies to them.
    without_slip = ~np.isfinite(performance.marionette.max_forces)
    speed = (
        MAX_RELATIVE_HDOT * np.maximum(1.0, np.max(np.abs(run.v_D), axis=1, initial=0.0))[:, None]
    )
    closed = (np.abs(rows.h) <= 1e-14 * rows.scale) & without_slip
    pulls = rows.has_force & without_slip
    newton_residual, hddot, term_sizes = rates.newton_residual(run, rows.force)
    if np.any(newton_residual[after_events] > MAX_NEWTON_RESIDUAL):
        broken.append("Eq. 10 does not hold")
    # A loose row may close briefly until it reverses within rounding: for strings in line, as three
    # beads, this happens twice in every swing.
    reverses = (hddot < 0) & (hdot**2 <= -2 * hddot * 1e-14 * rows.scale)
    is_moving = np.where(pulls, np.abs(hdot), np.where(reverses, 0.0, hdot)) > speed
    if np.any(is_moving[(pulls | closed) & after_events[:, None]]):
        broken.append("a closed row moves on")
    at_rest = closed & (np.abs(hdot) <= speed)
    is_released = np.where(pulls, np.abs(hddot), hddot) > MAX_NEWTON_RESIDUAL * term_sizes
    is_released &= (pulls | at_rest) & after_events[:, None]
    for t, r in np.argwhere(is_released & ~pulls & (hddot <= MAX_OPENING * term_sizes)):
        is_released[t, r] = not rates.is_nearly_dependent(t, r, closed[t])
    if np.any(is_released):
        broken.append("a closed row is let go beyond its bound")
    energy = _energy_scale(performance, run)
    residual = np.max(np.abs(run.ledger["residual"]) / energy)
    if residual > MAX_LEDGER_RESIDUAL:
        broken.append("the ledger does not close")
    for column in ("impact", "damping"):
        if np.any(np.diff(run.ledger[column]) < -1e-9 * energy[1:]):
            broken.append(f"{column} decreases")
    return (violation, gap, residual), broken


def _check_time_stepping(
    performance: Performance, run: fan.Trajectory, rows: _RowArrays, event_status: Status
):
    """Bounded violation, and no tension on rows that one step does not close.

    If the event-driven run found the inputs impossible, rows must be violated or pull hard. The cap
    on tensions is weaker: a limb that snaps straight may exceed it for a moment that a step skips.
    """
    broken = []
    speed = max(float(np.max(np.abs(v), initial=1.0)) for v in (run.v_D, run.v_K))
    step_length = FIXED_STEPS["timestepping"] * speed
    # A step is straight where the row curves: it leaves by up to step_length^2 / (2 length).
    max_deviation = step_length * (
        1.0 + 0.5 * run.duration * speed / np.min(rows.scale, initial=1.0)
    )
    violation = float(np.max(run.violation.values, initial=0.0)) / max_deviation
    gap = np.max(rows.gap, initial=0.0) / step_length
    if event_status is Status.DONE and violation > MAX_VIOLATION_FACTOR:
        broken.append("a row is violated")
    event_impossible = run.status is Status.DONE and event_status is Status.IMPOSSIBLE_INPUT
    max_tension = np.max(rows.force, initial=0.0) / performance.marionette.weight
    relative_violation = np.max(run.violation.values / rows.scale, initial=0.0)
    if (
        event_impossible
        and relative_violation < MAX_FOLLOWED_VIOLATION
        and max_tension < HARD_TENSION
    ):
        broken.append(
            f"follows the inputs that the event-driven run ends with {event_status.name} at"
        )
    if gap > MAX_GAP_FACTOR:
        broken.append("tension across a gap")
    if (
        event_status is Status.DONE
        and run.status in INACCURATE_STATUSES
        and _is_inaccurate_in_finer_steps(performance)
    ):
        broken.append("the ledger does not close, though the inputs can be followed in fine steps")
    residual = np.max(np.abs(run.ledger["residual"]) / _energy_scale(performance, run))
    return (violation if event_status is Status.DONE else 0.0, gap, residual), broken


def _check_variational(
    performance: Performance, run: fan.Trajectory, rows: _RowArrays, event_status: Status
):
    """Exact lengths, no tension on open rows, and no early end under possible inputs.

    Inputs are possible if the event-driven run reaches the end, from the start and from the state
    before the failed step: errors of the steps may lead to a state without a continuation.
    """
    broken = []
    violation, gap = np.max(run.violation.values, initial=0.0), np.max(rows.gap, initial=0.0)
    if violation > MAX_VIOLATION:
        broken.append("a row is violated")
    if gap > MAX_GAP:
        broken.append("tension across a gap")
    stops_early = event_status is Status.DONE and run.status is not Status.DONE
    if stops_early and _reaches_end_event_driven(performance, run):
        broken.append(f"ends with {run.status.name} though the inputs can be followed")
    residual = np.max(np.abs(run.ledger["residual"]) / _energy_scale(performance, run))
    return (violation, gap, residual), broken


def _is_inaccurate_in_finer_steps(performance: Performance) -> bool:
    """Whether the ledger does not balance with a quarter of the step either.

    Random kicks turn the lightest bodies by a radian and more in a whole step, which is too long.
    """
    finer = simulate_performance(performance, "timestepping", FIXED_STEPS["timestepping"] / 4.0)
    return finer.status in INACCURATE_STATUSES


def _reaches_end_event_driven(performance: Performance, run: fan.Trajectory) -> bool:
    """Whether the event-driven method reaches the end from a run's last whole step."""
    last_state = run.state(max(len(run) - 2, 0))
    continued = replace(performance, x0=last_state)
    return simulate_performance(continued, "event").status is Status.DONE


def main() -> None:
    """Run the case of the command line."""
    puppet, seed, method = sys.argv[1:4]
    result = check_case(puppet, int(seed), method)
    print(result)
    print("broken:", *(result.broken or ["nothing"]), sep="\n  ")
    sys.exit(bool(result.broken))


if __name__ == "__main__":
    main()
