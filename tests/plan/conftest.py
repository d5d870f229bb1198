"""A problem shared by tests of plans."""

from __future__ import annotations

import pytest

import fantoccini as fan


@pytest.fixture(scope="module")
def boxes() -> fan.control.Problem:
    """The bundled problem of the spatial arm among boxes."""
    return fan.control.load_problem("arm3d_boxes")
