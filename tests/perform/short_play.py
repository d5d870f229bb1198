"""A short play of two players, for tests of shows."""

from __future__ import annotations

PLAY = """\
play: short
stage:
  marks: {west: {at: [0, 0.6]}, east: {at: [0, -0.6]}}
cast: {pierrot: {at: west}, columbine: {at: east}}
acts:
  - act: One
    cues:
      - {who: pierrot, does: wave, says: "Good evening!"}
      - {who: columbine, does: nod, when: 3, name: yes}
  - act: Two
    after: 2
    cues:
      - {who: columbine, does: wave, go: true}
      - {who: pierrot, does: bow, after: 1}
"""
