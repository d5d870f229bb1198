"""Plays of the tests, all with one cast, so that its library is compiled once."""

from __future__ import annotations

from pathlib import Path

import pytest

import fantoccini as fan

HEAD = """
play: trial
tempo: 100
stage:
  space: {x: [-1, 1], y: [-1.2, 1.2]}
  obstacles:
    - {name: table, type: box, size: [0.2, 0.2, 0.25], at: [-0.5, 0.55, 0.125]}
  marks:
    west: {at: [0, 0.6]}
    east: {at: [0, -0.6]}
    centre: {at: [0.3, 0.1], facing: audience}
    far: {at: [1.4, 0]}
    table_side: {at: [-0.5, 0.5]}
cast:
  pierrot: {at: west}
  columbine: {at: east}
"""


class Plays:
    """Write and compile plays of the trial's cast."""

    def __init__(self, folder: Path):
        self.folder = folder

    def write(self, acts: str, head: str = HEAD, name: str = "trial.yaml") -> Path:
        """Path of a play's file."""
        path = self.folder / name
        path.write_text(head + acts)
        return path

    def compile(self, cues: str, **options: object) -> fan.theatre.Play:
        """A play of one act."""
        lines = "".join(f"      - {line.strip()}\n" for line in cues.strip().splitlines())
        return fan.load_play(self.write(f"acts:\n  - act: one\n    cues:\n{lines}"), **options)


@pytest.fixture(name="plays")
def _plays(tmp_path: Path) -> Plays:
    return Plays(tmp_path)
