"""Judges a random puppet: its body map, a walk of 1 m on a floor, and a bow."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

import fantoccini as fan
from fantoccini.base import FantocciniError
from fantoccini.theatre import Gait, find_gait, footfalls, load_gesture
from fantoccini.theatre.gaits import WalkStatus
from fantoccini.theatre.gestures import BodyParts

from .drawing import Rig

MAX_SLIDE, DISTANCE = 2e-3, 1.0
"""Largest slide of a foot in a step, and length of the walk [m]."""
_MAX_DISTANCE_ERROR = 0.05
"""Largest relative error of the distance, of a puppet that walks."""
FIRST_GAITS = {n: Gait() if n == 1 else Gait(pattern="trot", duty=0.3) for n in (1, 2, 3)}
"""Number of pairs of legs -> gait with which the search begins; puppets on two legs walk."""


@dataclass(frozen=True)
class Verdict:
    """Results for a puppet.

    Attributes:
        rig: number of legs and size.
        mapped: whether exactly its legs were found, with a string for each.
        walks: whether it walks 1 m without falling, and no foot slides more than 2 mm in a step.
        status: status of its gait after the search; None without one.
        bows: whether the bow's run is done and its head goes down.
        slide: largest slide of a foot in a cycle [m].
        force: mean share of the weight on the feet.
        distance: distance walked [m].
        seconds: time of all this [s].
        problem: error message; empty without one.
    """

    rig: str
    mapped: bool = False
    walks: bool = False
    status: WalkStatus | None = None
    bows: bool = False
    slide: float = np.inf
    force: float = 0.0
    distance: float = 0.0
    seconds: float = 0.0
    problem: str = ""

    def __str__(self) -> str:
        done = [name for name in ("mapped", "walks", "bows") if getattr(self, name)]
        return (
            f"{self.rig}, {' '.join(done) or 'nothing'}; gait "
            f"{self.status.name if self.status else 'none'}, slide {1e3 * self.slide:.2f} mm, feet "
            f"carry {100 * self.force:.1f} %, {self.distance:.3f} m walked, {self.seconds:.0f} s "
            f"{self.problem}"
        )


def judge(seed: int, rounds: int) -> Verdict:
    """Verdict on the puppet of a seed."""
    began, rig = time.perf_counter(), Rig(seed)
    name = f"{2 * rig.n_pairs} legs, {rig.size:.2f} m"
    mapped, bows, problem = False, False, ""
    slide, force, distance = np.inf, 0.0, 0.0
    status = None
    try:
        stage = rig.stage
        body_parts = BodyParts.for_puppet(stage, "rig")
        own = [limb for limb in body_parts.body_map.limbs if limb.kind == "leg" and limb.strings]
        mapped = {limb.bodies[-1].removeprefix("rig.") for limb in own} == set(rig.legs)
        bows = bow(stage, body_parts)
        tuned = find_gait(stage, FIRST_GAITS[rig.n_pairs], rounds=rounds)
        status = tuned.status
        slide, force, distance = walk(stage, body_parts, tuned.gait)
    except FantocciniError as error:
        problem = str(error)
    walks = slide <= MAX_SLIDE and abs(distance - DISTANCE) < _MAX_DISTANCE_ERROR * DISTANCE
    seconds = time.perf_counter() - began
    return Verdict(name, mapped, walks, status, bows, slide, force, distance, seconds, problem)


def bow(stage: fan.Marionette, body_parts: BodyParts) -> bool:
    """Whether the bundled bow lowers the head."""
    x0, head = stage.rest(), body_parts.body_map.head
    if head is None:
        return False
    gesture = (
        load_gesture(stage, "bow", x0, of="rig")
        if body_parts.prefix
        else load_gesture(stage, "bow", x0)
    )
    run = fan.simulate(
        stage, x0, gesture.inputs(x0), method=fan.TimeStepping(dt=2e-3), save_every=10, throw=False
    )
    height = stage.poses(run.q_D, run.q_K)[:, stage.link_index(head.body), 2, 3]
    return (
        run.status is fan.Status.DONE
        and height.min() < height[0] - 0.005 * body_parts.body_map.size
    )


def walk(stage: fan.Marionette, body_parts: BodyParts, gait: Gait) -> tuple[float, float, float]:
    """Largest slide of a foot in a cycle [m], share of weight on the feet, and distance [m].

    The slide is infinite if the puppet falls.
    """
    leg = np.mean([limb.length for limb in body_parts.body_map.limbs if limb.kind == "leg"])
    steps = max(2, round(DISTANCE / (gait.stride * float(leg))))
    x0 = stage.rest()
    inputs = gait.inputs(stage, steps, x0)
    run = fan.simulate(
        stage, x0, inputs, method=fan.TimeStepping(dt=1e-3), save_every=5, throw=False
    )
    feet = footfalls(body_parts, run, gait, steps)
    if run.status is not fan.Status.DONE or feet.falls:
        return np.inf, 0.0, feet.distance
    force = sum(
        float(run.contact.involving(limb.bodies[-1]).normal_force.sum() / len(run.t) / stage.weight)
        for limb in body_parts.body_map.limbs
        if limb.kind == "leg"
    )
    return feet.max_slide, force, feet.distance
