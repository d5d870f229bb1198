"""Puppets thrown about live: to the floor, at one another, and at random.

A throw imitates hands on the page: targets that jump, and strings that are wound in and let out at
once. `python -m properties.crowds STAGE SEED live I` runs one case.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np

import fantoccini as fan
from properties import stages

STAGES = ("figure", "duet")
"""Stages whose hands hold only strings: a driven plate could be pressed through the floor."""
N_THROWS = 6
TICKS_PER_THROW = 40
"""Ticks of a throw."""
JUMP_DISTANCE = 10.0
"""Jumps of the hands' targets [m]; hands move there at their largest speed."""
MAX_ENERGY_GAIN = 12.0
"""Largest gain of energy, in the weight times 1 m."""
TIME_AFTER_THROWS = 0.25
"""Time after the throws [s]."""


@dataclass(frozen=True)
class ThrowResult:
    """Result of one performance.

    Attributes:
        status: DONE, or `HANDS_STOPPED` if the performance stopped the hands.
        touched: whether there was any contact.
        overlap: deepest overlap [m].
        energy: largest gain, in the weight times 1 m.
        broken: broken properties, in words.
    """

    status: str
    touched: bool
    overlap: float
    energy: float
    broken: tuple[str, ...]


def throw_puppets(name: str, seed: int, i: int) -> ThrowResult | None:
    """The i-th performance of a stage and seed; None if nothing fits among its obstacles."""
    rng = np.random.default_rng([seed, i, zlib.crc32(f"{name} live".encode())])
    marionette = stages.draw_scene(name, rng)
    x0 = stages.draw_start(rng, marionette)
    if x0 is None:
        return None
    live = fan.Performance(marionette, x0)
    home_positions = {h.name: live.place(h.name)[0] for h in live.handles}
    start_energy, max_gain, max_overlap = sum(marionette.energies(x0)), 0.0, 0.0
    touched, stopped = False, False
    for k in range(N_THROWS):
        _draw_targets(rng, live, home_positions, home_again=k % 2 == 1)
        for _ in range(TICKS_PER_THROW):
            x, contact = live.step(), live.contact
            assert contact is not None
            arrays = (x.q_D, x.v_D, x.q_K, x.v_K, x.slip, live.tension, contact.force, contact.gap)
            if not all(np.all(np.isfinite(array)) for array in arrays):
                return ThrowResult("DONE", touched, max_overlap, max_gain, ("is not finite",))
            touched = touched or len(contact) > 0
            stopped = stopped or any(
                "hand was stopped" in reason for reason in live.lagging.values()
            )
            max_gain = max(
                max_gain, (sum(marionette.energies(x)) - start_energy) / marionette.weight
            )
            max_overlap = max([max_overlap, *marionette.overlaps(x.q_D, x.q_K).values()])
    t = live.t
    live.advance(TIME_AFTER_THROWS)
    broken = []
    if abs(live.t - t - TIME_AFTER_THROWS) > live.tick:
        broken.append("does not go on")
    if max_gain > MAX_ENERGY_GAIN:
        broken.append("gains energy")
    if max_overlap > stages.MAX_OVERLAP:
        broken.append("overlaps")
    return ThrowResult(
        "HANDS_STOPPED" if stopped else "DONE", touched, max_overlap, max_gain, tuple(broken)
    )


def _draw_targets(
    rng: np.random.Generator,
    live: fan.Performance,
    home_positions: dict[str, np.ndarray],
    home_again: bool,
) -> None:
    """New targets: home, to the floor, at the other puppets, or random; and new lengths."""
    middle = np.mean(list(home_positions.values()), axis=0)
    direction, target_kind = rng.normal(size=3), rng.choice(["floor", "others", "anywhere"])
    for handle, home_position in home_positions.items():
        if target_kind == "floor":
            direction = np.array([0.5 * direction[0], 0.5 * direction[1], -1.0])
        elif target_kind == "others":
            direction = np.append((middle - home_position)[:2], 0.2 * direction[2])
        jump = 0.0 if home_again else JUMP_DISTANCE * direction / (np.linalg.norm(direction) + 1e-9)
        live.move(handle, home_position + jump)
    for string, ends in live.lengths.items():
        if rng.random() < 0.5:
            live.wind(string, float(rng.choice(ends)))
