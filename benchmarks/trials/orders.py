"""A play whose player walks, waves, looks and bows, in all orders; the catch of one cue and the
start of the next meet in other ways each time.

    python benchmarks/trials/orders.py
"""

from __future__ import annotations

import itertools
import tempfile
from pathlib import Path

import fantoccini as fan

VERBS = {
    "walk": "walks to: there",
    "wave": "does: wave",
    "look": "looks at: [1.5, 0.5, 0.4]",
    "bow": "does: bow",
}
PLAY = """\
play: orders
stage:
  marks: {{here: {{at: [0, 0]}}, there: {{at: [0.4, 0]}}}}
cast:
  pierrot: {{puppet: marionette, at: here}}
acts:
- act: all
  cues:
{cues}
"""


def main() -> None:
    """Prints a line for each order."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "orders.yaml"
        for order in itertools.permutations(VERBS):
            cues = [f"  - {{who: pierrot, {VERBS[verb]}, after: 0}}" for verb in order]
            path.write_text(PLAY.format(cues="\n".join(cues)), encoding="utf-8")
            checked = fan.theatre.verify_play(fan.load_play(path))
            print(", ".join(order), "|", str(checked).splitlines()[0], flush=True)


if __name__ == "__main__":
    main()
