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
THROWS = 6
TICKS = 40
"""Ticks of a throw."""
JUMP = 10.0
"""Jumps of the hands' targets [m]; hands move there at their largest speed."""
ENERGY = 12.0
"""Largest gain of energy, in the weight times 1 m."""
AFTER = 0.25
"""Time after the throws [s]."""


@dataclass(frozen=True)
class Thrown:
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


def thrown(name: str, seed: int, i: int) -> Thrown | None:
    """The i-th performance of a stage and seed; None if nothing fits among its obstacles."""
    rng = np.random.default_rng([seed, i, zlib.crc32(f"{name} live".encode())])
    marionette = stages.scene(name, rng)
    x0 = stages.start(rng, marionette)
    if x0 is None:
        return None
    live = fan.Performance(marionette, x0)
    homes = {h.name: live.place(h.name)[0] for h in live.handles}
    before, max_gain, depth, touched, stopped = sum(marionette.energies(x0)), 0.0, 0.0, False, False
    for k in range(THROWS):
        _throw(rng, live, homes, back=k % 2 == 1)
        for _ in range(TICKS):
            x, contact = live.step(), live.contact
            assert contact is not None
            parts = (x.q_D, x.v_D, x.q_K, x.v_K, x.slip, live.tension, contact.force, contact.gap)
            if not all(np.all(np.isfinite(part)) for part in parts):
                return Thrown("DONE", touched, depth, max_gain, ("is not finite",))
            touched = touched or len(contact) > 0
            stopped = stopped or any("hand was stopped" in why for why in live.lagging.values())
            max_gain = max(max_gain, (sum(marionette.energies(x)) - before) / marionette.weight)
            depth = max([depth, *marionette.overlaps(x.q_D, x.q_K).values()])
    t = live.t
    live.advance(AFTER)
    broken = []
    if abs(live.t - t - AFTER) > live.tick:
        broken.append("does not go on")
    if max_gain > ENERGY:
        broken.append("gains energy")
    if depth > stages.OVERLAP:
        broken.append("overlaps")
    return Thrown("HANDS_STOPPED" if stopped else "DONE", touched, depth, max_gain, tuple(broken))


def _throw(
    rng: np.random.Generator, live: fan.Performance, homes: dict[str, np.ndarray], back: bool
) -> None:
    """New targets: home, to the floor, at the other puppets, or random; and new lengths."""
    middle = np.mean(list(homes.values()), axis=0)
    aims, at = rng.normal(size=3), rng.choice(["floor", "others", "anywhere"])
    for handle, home in homes.items():
        if at == "floor":
            aims = np.array([0.5 * aims[0], 0.5 * aims[1], -1.0])
        elif at == "others":
            aims = np.append((middle - home)[:2], 0.2 * aims[2])
        jump = 0.0 if back else JUMP * aims / (np.linalg.norm(aims) + 1e-9)
        live.move(handle, home + jump)
    for string, ends in live.lengths.items():
        if rng.random() < 0.5:
            live.wind(string, float(rng.choice(ends)))
