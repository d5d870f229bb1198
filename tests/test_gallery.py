"""The gallery shows every bundled puppet, scene and performance, and stays small."""

from __future__ import annotations

import re

import pytest
from docs.gallery import PAGE, PERFORMANCES, PICTURES, PIECES, ROOT, page, perform_piece

import fantoccini as fan

pytestmark = pytest.mark.medium


def test_every_bundled_puppet_and_scene_is_shown():
    bundled = (*fan.puppets.names(), *fan.puppets.scenes())
    assert sorted(piece.puppet for piece in PIECES) == sorted(bundled)


def test_the_pictures_exist_and_are_not_too_large():
    shown = re.findall(r"!\[[^]]+\]\(([^)]+)\)", page())
    assert {PAGE.parent / name for name in shown} == set(PICTURES.iterdir())
    assert sum(file.stat().st_size for file in PICTURES.iterdir()) < 8_000_000


def test_every_bundled_performance_is_shown():
    files = {path.stem for path in (ROOT / PERFORMANCES).glob("*.yaml")}
    assert files == {piece.inputs for piece in PIECES if piece.inputs}


@pytest.mark.parametrize("piece", PIECES, ids=lambda p: p.puppet)
def test_a_piece_runs_to_its_end(piece):
    _, run = perform_piece(piece)
    assert run.status is fan.Status.DONE
    start, stop = piece.part or (0.0, piece.duration)
    assert 0.0 <= start < stop <= piece.duration == pytest.approx(run.duration)
    assert max(piece.times) <= piece.duration
