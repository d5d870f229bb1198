"""Continuation of a stream that was stopped: from a line, or from a time on several controllers.

Controllers that continue together follow the path p(s) from rest, with ds/dt rising linearly to 1:

    s = t + tau^2 / 2T for tau < T,   s = t + tau - T / 2 afterwards

Here t is the time at which the path stopped, tau the time since the continuation began, and T the
duration of the speed ramp, the same for all axes, so that all controllers keep the same time.

An axis is a motor of the stand. A planner is the buffer of a controller for moves that it has
acknowledged and not yet made.
"""

from __future__ import annotations

import dataclasses
import re

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from fantoccini.base import StandError
from fantoccini.stand.axes import AxisMotion
from fantoccini.stand.points import SetPoints
from fantoccini.stand.sending import check_start_time
from fantoccini.stand.streaming import Line, gcode_lines

RETURN_FEED = 600.0
"""Feed of the move to the position at which a stream resumes [mm/min]."""
SHORTEST_INTERVAL = 1e-6
"""Shortest time between the last two set points [s]."""

_WORD = re.compile(r"([A-Z])(-?[\d.]+)")


def first_lost_line(text: str, last: int, planner: int) -> int:
    """Number of the first line that a reset may have lost.

    ``last`` is the number of the last acknowledged line, ``planner`` the length of the buffer.

    Acknowledged moves wait in that buffer; a dwell, or a line that is no move, waits for their end.
    """
    acknowledged = [line for line in gcode_lines(text) if line.number <= last]
    first = last
    for line in reversed(acknowledged[-planner:]):
        if not line.text.startswith(("G1", "X")):
            break
        first = line.number
    return first


def resume_lines(text: str, first: int, feed: float = RETURN_FEED) -> list[Line]:
    """The lines from number ``first`` on, after lines that restore the controller's state.

    The controller must still know its axes' positions. The modes are set again, and the axes move
    slowly to the end point of the previous line. Lines that home axes or set positions are not
    repeated.

    Args:
        text: text of the file.
        first: number of the first line to send.
        feed: feed of the move to the end of the previous line [mm/min].

    Raises:
        StandError: there is no such line.
    """
    lines = gcode_lines(text)
    remaining_lines = [line for line in lines if line.number >= first]
    if not remaining_lines:
        raise StandError(
            f"there is no line {first} to continue from; the last is {lines[-1].number}"
        )
    positions: dict[str, str] = {}
    mode = "G94"
    for line in lines:
        if line.number >= first:
            break
        if line.text in ("G93", "G94"):
            mode = line.text
        for letter, value in _WORD.findall(line.text) if _sets_position(line.text) else ():
            if letter in "XYZABCUVW":
                positions[letter] = value
    words = "".join(letter + value for letter, value in positions.items())
    preamble = ["G21", "G90", "G94"]
    if words:
        preamble += [f"G1{words}F{feed:g}", "G4P0.1"]
    return [*(Line(first, text) for text in [*preamble, mode]), *remaining_lines]


def resume_points(points: SetPoints, t: float) -> SetPoints:
    """The set points from time t on [s], from rest, without homing and winding in of slack.

    Raises:
        StandError: t is not within the motion.
    """
    motion = points.motion
    end = float(motion.t[-1])
    check_start_time(t, end)
    ramp = points.ramp_time
    remaining_time = end - t
    duration = (
        float(np.sqrt(2.0 * ramp * remaining_time))
        if remaining_time < 0.5 * ramp
        else remaining_time + 0.5 * ramp
    )
    tau = np.arange(0.0, duration - SHORTEST_INTERVAL, 1.0 / points.rate)
    tau = np.append(tau, duration)
    rate = np.minimum(tau / ramp, 1.0)
    s = t + np.where(tau < ramp, 0.5 * tau * rate, tau - 0.5 * ramp)
    s[-1] = end
    path = CubicHermiteSpline(motion.t, motion.position, motion.velocity)
    derivative, second_derivative = path(s, 1), path(s, 2)
    rate_change = np.where(tau < ramp, 1.0 / ramp, 0.0)[:, None]
    acceleration = second_derivative * rate[:, None] ** 2 + derivative * rate_change
    resumed_motion = AxisMotion(points.axes, tau, path(s), derivative * rate[:, None], acceleration)
    return dataclasses.replace(points, motion=resumed_motion, home=False, slack=0.0, resumed=s)


def _sets_position(text: str) -> bool:
    return text.startswith(("G1", "G0", "X", "G92")) or text.startswith("G10L20P1")
