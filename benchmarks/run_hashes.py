"""Prints a SHA-256 of every array of some 190 runs, to compare two versions of the code bit by bit.

    python -m benchmarks.run_hashes [arm2d crane ...] > before.txt
    ...                                               > after.txt; diff before.txt after.txt

A change that only moves code keeps every line. Hashes differ from one processor, compiler or flag
to the next: compare those of one machine. Runs of every method, batches in lanes, steppers, held
accelerations, rollouts with their gradients, linearised steps and plans are among them.
"""

from __future__ import annotations

import argparse
import hashlib
import warnings
from collections.abc import Iterator

import numpy as np

import fantoccini as fan

FAST_PUPPETS = ("arm2d", "arm3d", "crane", "string_pendulum")
PUPPETS = (*FAST_PUPPETS, "stand6", "marionette", "promenade")
METHODS = ("event", "timestepping", "variational")
"""The last one does not support contact."""
SAMPLES = ("t", "q_D", "v_D", "acc_D", "q_K", "v_K", "tension", "taut", "slip")
ENDS = (
    "q_D",
    "v_D",
    "q_K",
    "v_K",
    "slip",
    "tension",
    "taut",
    "energy_terms",
    "violation",
    "status",
)
Parts = Iterator[tuple[str, list[object]]]


def arrays(result: object, names: tuple[str, ...]) -> list[object]:
    """The arrays of a result with these names, if it has them."""
    return [x for x in (getattr(result, name, None) for name in names) if x is not None]


def pulling_inputs(puppet: fan.Marionette, x0: fan.State, pull: float) -> fan.Input | None:
    """A driven length or height that is shortened by ``pull`` and lengthened again [m]."""
    table = puppet.coordinates
    names = [n for n in table.q_K if n.endswith(("length", ".z"))] or list(table.q_K)
    if not pull or not names:
        return None
    at = float(x0[names[0]])
    return fan.Input.waypoints(puppet, {names[0]: [(0, at), (0.15, at - pull), (0.2, at + pull)]})


def runs(puppet: fan.Marionette, x0: fan.State, t_end: float) -> Parts:
    """Single runs and batches of every method."""
    for pull in (0.0, 0.02, 0.04, 0.4):
        inputs = pulling_inputs(puppet, x0, pull)
        if pull and inputs is None:
            continue
        for method in METHODS[: 3 if puppet.contacts is None else 2]:
            run = fan.simulate(puppet, x0, inputs, t_end=t_end, method=method, throw=False)
            yield f"{method} {pull} {run.status.name}", arrays(run, SAMPLES)
            several = (
                [pulling_inputs(puppet, x0, pull * (1 + 0.1 * i)) for i in range(5)]
                if pull
                else None
            )
            many = fan.simulate_batch(
                puppet, [x0] * 5, several, t_end=0.5 * t_end, method=method, save="all"
            )
            yield f"{method} {pull} batch", arrays(many, (*SAMPLES, "status", "end_q_D"))


def steps(puppet: fan.Marionette, x0: fan.State) -> Parts:
    """Steppers, held accelerations, rollouts with gradients, and linearised steps."""
    table, rng = puppet.coordinates, np.random.default_rng(0)
    acc = rng.normal(size=(20, table.n_vK))
    stepper = puppet.stepper(x0)
    for held in acc[:5]:
        stepper.advance(0.02, held, throw=False)
    yield "stepper", arrays(stepper.state, ENDS)
    batch = puppet.stepper_batch(x0, 11)
    for _ in range(4):
        batch.advance(0.023, rng.normal(size=(11, table.n_vK)))
    batch.reset([3, 4])
    batch.advance(0.01)
    yield "stepper batch", arrays(batch, ENDS)
    rollout = puppet.rollout(x0, acc, throw=False)
    yield f"rollout {rollout.status.name}", arrays(rollout, ENDS)
    cost = np.ones((len(acc) + 1, table.n_vD))
    yield "gradient", arrays(rollout.gradient(q_D=cost), ("q_D", "v_D", "q_K", "acc_K", "p"))
    nodes = [np.repeat(x[None], 3, axis=0) for x in (x0.q_D, x0.v_D, x0.q_K, x0.v_K)]
    linearised = puppet.linearise_steps(*nodes, acc[:3], forces=True)
    yield "linearised steps", arrays(linearised, ("q_D", "v_D", "A", "B", "tension"))


def plans(puppet: fan.Marionette, x0: fan.State) -> Parts:
    """A short plan."""
    aim = puppet.rest({"hand.length": float(x0["hand.length"]) - 0.1})
    for seed in range(3):
        plan = fan.plan(puppet, x0, aim, seed=seed, time_limit=60.0, iterations=300)
        parts = [plan.tree.time, plan.states.q_D, plan.tree.n_checks, plan.acceleration]
        yield f"plan {seed} {bool(plan)}", parts


def main() -> None:
    """Prints a line for each result, or its error."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("puppets", nargs="*", default=PUPPETS)
    warnings.simplefilter("ignore")
    for name in parser.parse_args().puppets:
        puppet = getattr(fan.puppets, name)()
        x0 = puppet.rest()
        parts = [runs(puppet, x0, 0.6 if name in FAST_PUPPETS else 0.25)]
        if puppet.coordinates.n_vK:
            parts.append(steps(puppet, x0))
        if name == "arm2d":
            parts.append(plans(puppet, x0))
        for part in parts:
            try:
                for what, values in part:
                    digest = hashlib.sha256()
                    for x in values:
                        digest.update(np.ascontiguousarray(getattr(x, "values", x)).tobytes())
                    print(name, what, digest.hexdigest()[:16], flush=True)
            except fan.errors.FantocciniError as error:
                print(name, type(error).__name__, error, flush=True)


if __name__ == "__main__":
    main()
