"""Draws random puppets, lets each walk 1 m and bow, and counts those that can.

python -m benchmarks.rigs [--count 100] [--first 0] [--rounds 8]
"""

from __future__ import annotations

import argparse

from .judging import judge


def main() -> None:
    """Judges the puppets and prints a line for each, and the counts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="seed of the first puppet")
    parser.add_argument("--rounds", type=int, default=8, help="searches for a gait")
    options = parser.parse_args()
    verdicts = []
    for seed in range(options.first, options.first + options.count):
        verdicts.append(judge(seed, options.rounds))
        print(f"{seed}: {verdicts[-1]}", flush=True)
    n = len(verdicts)
    mapped = sum(v.mapped for v in verdicts)
    walks = sum(v.walks for v in verdicts)
    print(f"of {n}: map found {mapped}, walk 1 m {walks}, bow {sum(v.bows for v in verdicts)}")


if __name__ == "__main__":
    main()
