"""What a run asks of its arguments: the method, the start state, the inputs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import InputError, Problem, StateError
from fantoccini.motion import Input, Inputs, State, States
from fantoccini.runtime import RunOptions, memory

if TYPE_CHECKING:
    from fantoccini.marionette.handle import Marionette

METHODS = ("event", "timestepping", "variational")

CLOSED = 1e-9
"""|h| below which a row counts as closed, relative to 1 m or the string's length."""

_SAME_SPEED = 1e-9
"""Relative difference of velocities that counts as none."""
_AT_ONCE = 4096
"""States that are evaluated together."""
_MOST_SHOWN = 20
"""Mistakes of one kind that a message lists."""


def check_method(method: str) -> None:
    """Raises ValueError unless ``method`` is one that runs know."""
    if method not in METHODS:
        raise ValueError(f"method is {method!r}; it must be one of {', '.join(METHODS)}")


def check_step(marionette: Marionette, method: str, q_D: Array, q_K: Array, dt: float) -> None:
    """Raises where the time-stepper would blow up on a chain.

    dt <= 2 (sqrt(1 + zeta^2) - zeta) / omega,   omega = 2 sqrt(k / m) cos(pi / 2n)

    omega is the fastest vibration of a chain whose ends are held, n being its pieces, k their
    stiffness and m each of its masses; zeta = omega c / 2k is its damping ratio, c being a piece's
    damping. Both forces are those at the step's beginning, v+ = v - dt (omega^2 q + 2 zeta omega v)
    and q+ = q + dt v+, with an eigenvalue -1 at (omega dt)^2 + 4 zeta omega dt = 4.

    Args:
        marionette: the puppet.
        method: only ``timestepping`` takes the springs' forces from the beginning of the step.
        q_D, q_K: (..., n_qD), (..., n_qK) configurations at the start.
        dt: the step [s].

    Raises:
        StateError: naming the chain and the longest step.
    """
    for chain in marionette.tree.chains if method == "timestepping" else ():
        n, length = chain.pieces, np.min(chain.own_length(q_D, q_K, marionette.number))
        lump = marionette.tree.links[chain.points[1].link].lumps[0]
        k = marionette.number(chain.stiffness) * n / length
        m = marionette.number(lump.amount) * lump.volume
        omega = 2.0 * np.sqrt(k / m) * np.cos(np.pi / (2 * n))
        zeta = 0.5 * omega * marionette.number(chain.damping) / marionette.number(chain.stiffness)
        longest = 2.0 / (omega * (np.hypot(1.0, zeta) + zeta))
        if dt > longest:
            raise StateError(
                f"dt = {dt:g} s is too long for the chain {chain.name}: with method="
                f"'timestepping' its vibrations grow without bound in steps above {longest:.2g} s. "
                "Take a shorter dt, method='event', or fewer, softer, heavier or less damped pieces"
            )


def check_rows(
    marionette: Marionette,
    method: str,
    options: RunOptions,
    t: float,
    t_end: float,
    save_at: Array | None = None,
) -> None:
    """Raises where the rows of a run, as far as they are known before it, do not fit in memory.

    An event-driven run that writes its own steps is stopped when its rows reach the bound.

    Args:
        marionette: the puppet.
        method: of the run.
        options: with the bound on memory, and how far rows of fixed steps are apart.
        t, t_end: the run [s].
        save_at: times at which an event-driven run writes rows; None for its own steps.

    Raises:
        StateError: with the number of rows, what they need and what they may.
    """
    if method != "event":
        n = rows_of_steps(options, t, t_end)
    elif save_at is not None:
        n = len(save_at)
    else:
        return
    width = sum(marionette.row_layout.widths.values())
    check_memory(method, options, t, t_end, n, memory.bytes_of(n, width))


def rows_of_steps(options: RunOptions, t: float, t_end: float) -> float:
    """How many rows fixed steps write from a time to another [s].

    Raises:
        StateError: a step is shorter than what the clock resolves.
    """
    finest = 4.0 * np.spacing(max(1.0, abs(t), abs(t_end)))
    if options.dt < min(finest, 0.5 * (t_end - t)):
        raise StateError(
            f"dt is {options.dt:g} s; the clock of a run from {t:g} s to {t_end:g} s resolves "
            f"{finest:.2g} s. Take longer steps, or count time from a start near 0"
        )
    return np.ceil((t_end - t) / options.dt / options.save_every) + 1.0


def check_memory(
    method: str, options: RunOptions, t: float, t_end: float, n: float, need: float
) -> None:
    """Raises StateError unless ``need`` bytes for n rows from t to t_end [s] may be taken."""
    most = memory.bound(need, options.max_memory)
    if need <= most:
        return
    asked = f"{n:.3g} rows from {t:g} s to {t_end:g} s"
    fewer = "give fewer times in save_at"
    if method != "event":
        every = np.ceil(1.1 * options.save_every * need / most)
        asked += f", one every {options.save_every * options.dt:g} s,"
        fewer = f"write fewer with save_every={every:.0f}"
    raise StateError(
        f"{asked} need {need / 1e9:.3g} GB of memory; {most / 1e9:.3g} GB may be "
        f"taken. End sooner, {fewer}, or allow more with max_memory"
    )


def check_start(marionette: Marionette, x: State) -> None:
    """Raises when a string is longer than its length, or is about to be.

    Raises:
        StateError: naming the rows, by how much, and the repair.
    """
    check_starts(marionette, States.of([x], len(marionette.tree.strings)))


def check_starts(marionette: Marionette, states: States) -> None:
    """:func:`check_start` of many states; the first wrong one is reported."""
    for first in range(0, len(states), _AT_ONCE):
        some = states.some(slice(first, first + _AT_ONCE))
        h, hdot = _rows_of(marionette, some)
        scale = marionette.row_scales(some.q_D, some.q_K)
        speed = 1e-7 * np.max(np.abs(some.v_D), axis=1, initial=1.0)[:, None]
        too_long = h > CLOSED * scale
        # A string on a winch that slips gives way.
        opening = (np.abs(h) <= CLOSED * scale) & (hdot > speed) & ~np.isfinite(marionette.upper)
        off = np.abs(h) > CLOSED * scale
        wires = marionette.two_sided & (off | (np.abs(hdot) > speed))
        wrong = too_long | opening | wires
        if not np.any(wrong):
            continue
        i = int(np.argmax(np.any(wrong, axis=1)))
        which = f"states[{first + i}]" if len(states) > 1 else "the start state"
        rows, findings = np.flatnonzero(wrong[i]), []
        for r in rows:
            name = marionette.tree.row_names[r]
            if too_long[i, r] or (wires[i, r] and off[i, r]):
                findings.append(f"{name} is violated by {h[i, r]:.3g}")
            else:
                findings.append(f"{name} is at its bound and moves past it at {hdot[i, r]:.3g}/s")
        raise StateError(
            f"{which} breaks {len(findings)} of the strings and limits: "
            + "; ".join(findings)
            + ". marionette.project(x) gives the nearest state that does not."
        )


def _rows_of(marionette: Marionette, x: States) -> tuple[Array, Array]:
    """h and hdot (n, n_rows) of states."""
    tree, table = marionette.tree, marionette.coordinates
    still = np.zeros(table.n_vK), np.zeros(table.n_vD)
    state = [x.q_D, x.v_D, x.q_K, x.v_K, *still, marionette.p]
    outputs = marionette.library.evaluate("dynamics", state)
    h, hdot, h_limit, J_limit = (outputs[i] for i in (4, 5, 9, 10))
    hdot_limit = np.zeros_like(h_limit)
    for i, limit in enumerate(tree.limits):
        place = tree.links[limit.link].v
        J = J_limit[:, 3 * i : 3 * i + place.stop - place.start]
        hdot_limit[:, i] = (J * x.v_D[:, place]).sum(axis=1)
    hdot = hdot - marionette.winding(x.slip)
    return np.hstack([h - x.slip, h_limit]), np.hstack([hdot, hdot_limit])


def check_inputs(
    marionette: Marionette, inputs: Input | Inputs, t: float, t_end: float
) -> None:
    """Raises unless inputs are this puppet's and do not stop or start dead within a run.

    Args:
        marionette: the puppet.
        inputs: not bound yet.
        t, t_end: the run [s].

    Raises:
        InputError: naming the coordinates and times.
    """
    inputs = many_of(inputs)
    own, theirs = marionette.coordinates, inputs.coordinates
    if (own.q_K, own.v_D) != (theirs.q_K, theirs.v_D):
        text = (
            "were made for a puppet with the driven coordinates "
            f"{', '.join(theirs.q_K) or 'none'}; {marionette.name} has "
            f"{', '.join(own.q_K) or 'none'}"
        )
        raise InputError([Problem("inputs", None, "", text)])
    problems = []
    last = inputs.breaks[:, -1]
    ends = (
        ("begin", inputs.breaks[:, 0], inputs.breaks[:, 0] > t, inputs.coef[:, 0, :, 1]),
        ("end", last, last < t_end, inputs.evaluate(last)[1]),
    )
    for what, when, inside, speed in ends:
        wrong = (np.abs(speed) > _SAME_SPEED) & inside[:, None]
        for n, i in np.argwhere(wrong)[:_MOST_SHOWN]:
            at = when[n if len(when) > 1 else 0]
            which = f"inputs[{n}].{own.v_K[i]}" if len(inputs) > 1 else own.v_K[i]
            problems.append(
                Problem(
                    "inputs",
                    None,
                    which,
                    f"the inputs {what} at t = {at:g} s with the velocity {speed[n, i]:.6g}, and "
                    f"the run goes from {t:g} s to {t_end:g} s; let them {what} at rest, or let "
                    "the run not go beyond them",
                )
            )
    if problems:
        raise InputError(problems)


def check_speed(marionette: Marionette, x: State, bound: Input) -> None:
    """Raises StateError when the driven velocities would jump from a state to its inputs."""
    check_speeds(marionette, x.t, x.v_K[None], many_of(bound))


def check_speeds(marionette: Marionette, t: float, v_K: Array, bound: Inputs) -> None:
    """:func:`check_speed` of many states, (n or 1, n_vK) at a time [s], or many inputs, or both."""
    found = bound.evaluate(t)[1]
    wrong = np.abs(found - v_K) > _SAME_SPEED * np.maximum(1.0, np.abs(v_K))
    if not np.any(wrong):
        return
    i = int(np.argmax(np.any(wrong, axis=1)))
    rows = np.flatnonzero(wrong[i])
    names = [marionette.coordinates.v_K[r] for r in rows]
    has, begins = np.broadcast_to(v_K, wrong.shape)[i], np.broadcast_to(found, wrong.shape)[i]
    which = f" of run {i}" if len(wrong) > 1 else ""
    raise StateError(
        f"the velocity of {', '.join(names)}{which} would jump at t = {t:g} s: the state has "
        f"{has[rows[0]]:.6g}, the inputs begin with {begins[rows[0]]:.6g}"
    )


def many_of(inputs: Input | Inputs | Sequence[Input]) -> Inputs:
    """Inputs side by side."""
    if isinstance(inputs, Inputs):
        return inputs
    return Inputs.of([inputs] if isinstance(inputs, Input) else list(inputs))
