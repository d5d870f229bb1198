"""States of rest of bundled puppets, from their own pose and from random ones.

    python -m benchmarks.rests before.npz arm2d crane marionette
    python -m benchmarks.rests after.npz arm2d crane marionette --against before.npz

Lengths and ends of strings are up to 10 % or 0.1 m off, and the puppets begin in random rotations.
"""

from __future__ import annotations

import argparse

import numpy as np

import fantoccini as fan
from fantoccini.base import tangent


def start_state(puppet: fan.Marionette, seed: int) -> fan.State:
    """A state that is not at rest; with seed 0 the puppet's own pose."""
    x, rng = puppet.state(), np.random.default_rng(seed)
    if not seed:
        return x
    t, q_K = puppet.coordinates, np.array(x.q_K)
    for q, _ in t.scalars_K:
        if t.q_K[q].endswith("length"):
            q_K[q] *= 1.0 + rng.uniform(-0.1, 0.1)
        else:
            q_K[q] += rng.uniform(-0.1, 0.1)
    move = rng.uniform(-1.5, 1.5, t.n_vD)
    return x.replace(q_D=tangent.moved(t.scalars_D, t.quaternions_D, x.q_D, move), q_K=q_K)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out")
    parser.add_argument("names", nargs="+")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--against")
    arguments = parser.parse_args()
    rests = {}
    for name in arguments.names:
        puppet = getattr(fan.puppets, name)()
        for seed in range(arguments.seeds):
            try:
                rests[f"{name}-{seed}"] = puppet.rest(start_state(puppet, seed)).q_D
            except fan.errors.StateError:
                rests[f"{name}-{seed}"] = np.zeros(0)
    np.savez(arguments.out, **rests)
    n_found = sum(len(q_D) > 0 for q_D in rests.values())
    print(f"{n_found} of {len(rests)} rests found")
    if arguments.against is None:
        return
    before = np.load(arguments.against)
    for name, q_D in rests.items():
        if len(q_D) != len(before[name]):
            print(f"{name}: found by only one")
        elif (away := np.max(np.abs(q_D - before[name]), initial=0.0)) > 0.0:
            print(f"{name}: {away:.3g} apart")


if __name__ == "__main__":
    main()
