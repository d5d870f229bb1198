"""Random puppets with a rest by construction: `rest` finds one for each.

Every root is on a joint to the world, or is a body on strings at least one of which leads up to the
world; every joint is damped, and the lengths of the strings are drawn at a pose that keeps all
limits: released there, a puppet falls into its strings and comes to rest. `rest` then begins there,
at the file's pose, at a pose pulled out of its strings, or at or beyond limits.

`make soak-rests` tries 20 cases of each of 50 puppets.
"""

from __future__ import annotations

import argparse
import collections
import functools
import json
import sys
import time
from dataclasses import dataclass

import numpy as np

import fantoccini as fan
from fantoccini.base import tangent
from fantoccini.dynamics.compiled import Evaluation
from fantoccini.dynamics.equilibrium.projection import onto_rows, retract

START_KINDS = ("drawn", "file", "pulled", "at limits", "beyond limits")
"""Starts of `rest`: the pose at which the lengths were drawn, and poses that violate rows."""

RELEASE_TIMES = (8.0, 40.0, 160.0)
"""Times at which a released puppet is checked [s]."""

_MAX_REST_ENERGY = 1e-9
"""Largest kinetic energy of a settled puppet, divided by its weight [m]."""
_MAX_REST_ACCELERATION = 1e-7
"""Largest acceleration at rest [m/s^2 or rad/s^2]."""
_MAX_ENERGY_RISE = 1e-9
"""Rounding of the energy of a rest above that of its start, divided by the puppet's weight [m]."""
_N_MOVES = 10
"""Number of small random moves that must not lower the energy."""


def description(seed: int) -> dict:
    """A random puppet with the keys of a puppet file, 2 to 16 degrees of freedom."""
    rng = np.random.default_rng([seed, 17])
    bodies, roots = [], int(rng.choice([1, 1, 1, 2]))
    for root in range(roots):
        position = [0.3 * root, 0.0, 0.0]
        kind = str(rng.choice(["free", "free", "free", "translation", "ball", "revolute"]))
        root_name = f"r{root}"
        bodies.append(
            _body(rng, root_name, None, _joint(rng, kind, position, limited=kind != "free"))
        )
        names = [root_name]
        for limb in range(int(rng.integers(0, 4))):
            parent, name = str(rng.choice(names)), f"{root_name}_{limb}"
            kind = str(rng.choice(["revolute", "ball", "prismatic"], p=[0.7, 0.2, 0.1]))
            at = _rounded(rng.uniform([-0.1, -0.06, -0.08], [0.1, 0.06, 0.02]))
            bodies.append(_body(rng, name, parent, _joint(rng, kind, at, limited=True)))
            names.append(name)
    strings = []
    for body in bodies:
        is_hung = not body.get("parent") and body["joint"]["type"] in ("free", "translation")
        min_strings = 1 if is_hung else 0
        for k in range(max(min_strings, int(rng.choice([0, 1, 2, 3], p=[0.3, 0.4, 0.2, 0.1])))):
            strings.append(_string(rng, f"s_{body['name']}_{k}", body["name"], bodies))
    springs = []
    if len(bodies) > 1 and rng.random() < 0.25:
        end_bodies = (bodies[0]["name"], bodies[-1]["name"])
        ends = [{"body": name, "at": _rounded(rng.uniform(-0.05, 0.05, 3))} for name in end_bodies]
        springs.append(
            {
                "name": "spring",
                "between": ends,
                "stiffness": float(rng.uniform(1.0, 40.0)),
                "rest": float(rng.uniform(0.0, 0.2)),
                "damping": 0.1,
            }
        )
    bar = [{"name": "bar", "joint": {"type": "free", "at": [0.0, 0.0, 0.7], "driven": True}}]
    uses_bar = any(point.get("body") == "bar" for s in strings for point in s["path"])
    return {
        "puppet": f"rest{seed}",
        "bodies": (bar if uses_bar else []) + bodies,
        "strings": strings,
        "springs": springs,
    }


def _rounded(values) -> list[float]:
    return [round(float(x), 4) for x in np.asarray(values).ravel()]


def _body(rng, name: str, parent: str | None, joint: dict) -> dict:
    length, radius = float(rng.uniform(0.04, 0.2)), float(rng.uniform(0.008, 0.04))
    shape = {"type": "capsule", "from": [0, 0, 0], "to": [0, 0, -length], "radius": radius}
    if rng.random() < 0.4:
        shape = {"type": "box", "size": _rounded(rng.uniform(0.04, 0.2, 3))}
    drag = {"linear": float(rng.uniform(0.1, 0.5)), "angular": float(rng.uniform(3e-4, 1e-3))}
    body = {"name": name, "joint": joint, "shapes": [shape | {"density": 480}], "drag": drag}
    return body | ({"parent": parent} if parent else {})


def _joint(rng, kind: str, at: list[float], limited: bool) -> dict:
    joint: dict = {"type": kind, "at": at, "damping": float(rng.choice([3e-4, 1e-3, 3e-3]))}
    if kind in ("free", "translation"):
        joint["damping"] = float(rng.choice([1e-3, 1e-2]))
    if kind == "translation":
        joint["axes"] = [["x", "z"], ["x", "y", "z"]][int(rng.integers(2))]
    if kind in ("revolute", "prismatic"):
        is_planar = rng.random() < 0.5
        joint["axis"] = [0, -1, 0] if is_planar else _rounded(rng.normal(size=3))
        scale = 1.0 if kind == "revolute" else 0.05
        if limited or kind == "prismatic":
            low, high = rng.uniform(0.2, 2.0, 2) * scale
            # Many joints begin at their limit, such as a straight knee.
            low = 0.0 if rng.random() < 0.4 else low
            joint["limits"] = {"lower": -float(low), "upper": float(high)}
    if kind == "ball" and limited and rng.random() < 0.7:
        joint["cone"] = {"max": float(rng.uniform(0.3, 1.4)), "axis": [0, 0, -1]}
        joint["twist"] = {"lower": -float(rng.uniform(0.2, 1.0)), "upper": 0.7}
    return joint


def _string(rng, name: str, body: str, bodies: list[dict]) -> dict:
    path = [{"body": body, "at": _rounded(rng.uniform([-0.1, -0.06, -0.06], [0.1, 0.06, 0.05]))}]
    if rng.random() < 0.2:
        path.append({"world": _rounded(rng.uniform([-0.3, -0.2, 0.4], [0.5, 0.2, 0.6]))})
    elif rng.random() < 0.1 and len(bodies) > 1:
        other = str(rng.choice([b["name"] for b in bodies if b["name"] != body]))
        path.append({"body": other, "at": _rounded(rng.uniform(-0.06, 0.06, 3))})
    if rng.random() < 0.3:
        path.append({"body": "bar", "at": _rounded(rng.uniform([-0.2, -0.1, 0], [0.2, 0.1, 0]))})
    else:
        path.append({"world": _rounded(rng.uniform([-0.3, -0.2, 0.5], [0.6, 0.2, 0.9]))})
    return {"name": name, "path": path, "length": "driven"}


@functools.cache
def load(seed: int) -> fan.Marionette:
    """The marionette of a seed."""
    return fan.loads(json.dumps(description(seed)))


@dataclass(frozen=True, eq=False)
class Case:
    """Arguments of `rest`.

    Attributes:
        marionette: the puppet.
        feasible: an admissible state at rest.
        start: initial guess, with the same driven coordinates.
        start_kind: one of `START_KINDS`.
    """

    marionette: fan.Marionette
    feasible: fan.State
    start: fan.State
    start_kind: str


def draw_case(puppet: int, number: int) -> Case:
    """The case of a number."""
    marionette, rng = load(puppet), np.random.default_rng([puppet, number, 99])
    start_kind, x = START_KINDS[number % len(START_KINDS)], marionette.state()
    drawn_state = _moved_state(
        marionette, x, rng.normal(size=len(x.v_D)) * rng.choice([0.0, 0.1, 0.4])
    )
    drawn_state = _within_limits(marionette, drawn_state)
    lengths = marionette.string_lengths(drawn_state.q_D, drawn_state.q_K)
    span_lengths = lengths + Evaluation.at_state(marionette, drawn_state).h[: len(lengths)]
    slack = np.where(
        rng.random(len(span_lengths)) < 0.5, rng.uniform(0.0, 0.05, len(span_lengths)), 0.0
    )
    values = {
        f"{s.name}.length": float(a + b)
        for s, a, b in zip(marionette.tree.strings, span_lengths, slack, strict=True)
    }
    file_state = marionette.state(values)
    feasible = file_state.replace(q_D=drawn_state.q_D)
    start = {"drawn": feasible, "file": file_state}.get(start_kind)
    if start_kind == "pulled":
        pull = rng.uniform(-1, 1, len(x.v_D)) * rng.choice([0.02, 0.1])
        start = _moved_state(marionette, feasible, pull)
    elif start_kind == "at limits":
        start = _at_limits(marionette, feasible, rng, 0.0)
    elif start_kind == "beyond limits":
        start = _at_limits(marionette, feasible, rng, 0.1)
    return Case(marionette, feasible, start, start_kind)


def _moved_state(marionette: fan.Marionette, x: fan.State, move: np.ndarray) -> fan.State:
    return x.replace(q_D=retract(marionette, x.q_D, move))


def _within_limits(marionette: fan.Marionette, x: fan.State) -> fan.State:
    """The state between the file's pose, which keeps all limits, and this one, that keeps them
    too.
    """
    table, start = marionette.coordinates, marionette.state()
    index_pairs = table.scalars_D, table.quaternions_D
    displacement = tangent.between(*index_pairs, start.q_D, x.q_D, table.n_vD)
    n = len(marionette.tree.strings)
    for share in 0.8 ** np.arange(60):
        candidate = _moved_state(marionette, start, share * displacement)
        if np.all(Evaluation.at_state(marionette, candidate).h[n:] <= 0.0):
            return candidate
    return start


def _at_limits(marionette: fan.Marionette, x: fan.State, rng, beyond: float) -> fan.State:
    """The state with half of the scalar joints at one of their limits, or beyond."""
    tree, q_D = marionette.tree, x.q_D.copy()
    for limit, name in zip(tree.limits, tree.row_names[len(tree.strings) :], strict=True):
        link, side = tree.links[limit.link], name.rsplit(".", 1)[1]
        if link.v.stop - link.v.start > 1 or rng.random() < 0.5:
            continue
        h = Evaluation.at_state(marionette, x.replace(q_D=q_D)).h[tree.row_names.index(name)]
        q_D[link.q] += (1.0 if side == "upper" else -1.0) * (beyond * rng.random() - h)
    return x.replace(q_D=q_D)


def settles_by_itself(tested: Case) -> bool:
    """Whether the puppet, released at the feasible state, comes to rest by itself."""
    marionette, x = tested.marionette, tested.feasible
    for t_end in RELEASE_TIMES:
        run = fan.simulate(
            marionette, x, t_end=t_end, method="timestepping", throw=False, save_every=50
        )
        if run.status is not fan.Status.DONE:
            return False
        kinetic = run.ledger["kinetic"]
        if np.max(kinetic[-len(kinetic) // 4 :]) < _MAX_REST_ENERGY * marionette.weight:
            return True
    return False


def broken_property(tested: Case) -> str:
    """The broken property of `rest` in a case; empty if all hold."""
    marionette, energy = tested.marionette, lambda x: marionette.energies(x)[1]
    try:
        x = marionette.rest(tested.start)
    except fan.errors.StateError as error:
        return f"not found: {error}"
    acc, tension = marionette.forward_dynamics(x)
    weight, h = marionette.weight, Evaluation.at_state(marionette, x).h
    if np.max(h, initial=-1.0) > 1e-9:
        return "a row is broken"
    if np.min(tension, initial=0.0) < 0.0:
        return "a row pushes"
    if np.max(np.abs(acc), initial=0.0) > _MAX_REST_ACCELERATION:
        return "the forces do not balance"
    if (
        tested.start is tested.feasible
        and energy(x) > energy(tested.feasible) + _MAX_ENERGY_RISE * weight
    ):
        return "the energy is above the start's"
    rng = np.random.default_rng(0)
    for _ in range(_N_MOVES):
        move = 1e-3 * rng.normal(size=len(x.v_D))
        moved_state, violation = onto_rows(marionette, _moved_state(marionette, x, move))
        if violation <= 1e-9 and energy(moved_state) < energy(x) - 1e-9 * weight:
            return "a small move lowers the energy"
    return ""


def try_cases(puppet: int, cases: int) -> tuple[collections.Counter, list[str]]:
    """Results of the cases of a puppet, and failures in those that settle by themselves."""
    counts, failures = collections.Counter(), []
    for number in range(cases):
        tested = draw_case(puppet, number)
        message, settles = broken_property(tested), settles_by_itself(tested)
        outcome = "settles" if settles else "does not settle"
        counts[f"{outcome}: {message.split(':')[0] or 'found'}"] += 1
        if message:
            failures.append(
                f"puppet {puppet}, case {number} ({tested.start_kind}, {outcome}): {message}"
            )
    return counts, failures


def main() -> int:
    """Try the cases, print the failures; 1 when there are some."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--puppets", type=int, default=50, help="(default 50)")
    parser.add_argument("--cases", type=int, default=20, help="of each puppet (default 20)")
    parser.add_argument("--first", type=int, default=0, help="seed of the first puppet")
    options = parser.parse_args()
    total, failed, start_time = collections.Counter(), 0, time.perf_counter()
    for puppet in range(options.first, options.first + options.puppets):
        counts, failures = try_cases(puppet, options.cases)
        total, failed = total + counts, failed + len(failures)
        print(f"puppet {puppet}: {dict(counts)}", *failures, sep="\n  ", flush=True)
    print(f"{total.total()} cases, {time.perf_counter() - start_time:.0f} s")
    for message, n in total.most_common():
        print(f"{n:>6}  {message}")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
