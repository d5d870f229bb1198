"""Puppets with a rest by construction: `rest` finds one from every start.

`make soak-rests` tries a thousand.
"""

from __future__ import annotations

import pytest

from properties import rests

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("puppet", [1, 2, 27])
def test_a_puppet_with_a_rest_is_found_one(puppet):
    """Starts keep the rows, violate them by centimetres, or pass limits."""
    counts, failures = rests.try_cases(puppet, cases=10)
    assert not failures, "\n".join(failures)
    assert counts["settles: found"] >= 8
