"""Section 6: an accurate run of a gentle motion, against the clock of the motion."""

from __future__ import annotations

import time

import numpy as np

import fantoccini as fan
from fantoccini.motion import Input, Trajectory

from ..strings.report import Section, number
from .figures import Chapter, Goal, Samples, in_turns, ratio_text, time_text
from .subject import hanging, marionette

SECONDS, TOLERANCE, MARK = 10.0, 1e-8, 100.0


def swaying_inputs() -> Input:
    """Inputs that sway the upper ends by 5 cm to both sides and lift a hand by 4 cm."""
    puppet = marionette()
    start = dict(zip(puppet.coordinates.q_K, hanging().q_K, strict=True))
    points = {
        name: [(0.0, y), (2.5, y + 0.05), (7.5, y - 0.05), (SECONDS, y)]
        for name, y in start.items()
        if name.endswith(".y")
    }
    hand = start["hand_left.length"]
    lift = [(0.0, hand), (3.0, hand - 0.04), (6.0, hand - 0.04), (9.0, hand), (SECONDS, hand)]
    return Input.waypoints(puppet, {**points, "hand_left.length": lift})


def chapter(turns: int) -> Chapter:
    """Speed relative to real time."""
    inputs = swaying_inputs()

    def run(tolerance: float) -> Trajectory:
        return fan.simulate(
            marionette(),
            hanging(),
            inputs,
            t_end=SECONDS,
            method=fan.Event(rtol=tolerance, atol=tolerance),
        )

    def timed() -> float:
        start = time.perf_counter()
        run(TOLERANCE)
        return time.perf_counter() - start

    timed()
    taken = in_turns({"event": timed}, turns)["event"]
    run_, right = run(TOLERANCE), run(1e-13)
    q = float(np.max(np.abs(run_.q_D[-1] - right.q_D[-1])))
    v = float(np.max(np.abs(run_.v_D[-1] - right.v_D[-1])))
    rate: Samples = taken.per(SECONDS)
    text = (
        f"A performance of {SECONDS:g} s in which the upper ends of the marionette's strings sway "
        "by 5 cm to both sides and a hand is lifted by 4 cm; the strings stay taut "
        f'({len(run_.events)} events). `fan.simulate` with `method="event"` and tolerances of '
        f"{number(TOLERANCE)} takes {time_text(taken.median)} ({ratio_text(rate.median)} real "
        f"time) and ends {number(q)} (coordinates) and {number(v)} (velocities) from the end of a "
        "run with a tolerance of 1e-13."
    )
    what = f"event-driven run of a gentle {SECONDS:g} s at {number(TOLERANCE)}, times real time"
    return Chapter(Section("6. Real time", [text]), [Goal(what, rate, MARK)])
