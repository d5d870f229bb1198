"""The puppets of benchmarks/growth have the sizes that its page states."""

from __future__ import annotations

import pytest
from benchmarks.growth.__main__ import BODY, DOF, STRINGS
from benchmarks.growth.measure import Size
from benchmarks.growth.puppets import marionette
from benchmarks.growth.report import exponent


@pytest.mark.parametrize("kind", ["chain", "bushy"])
def test_a_puppet_has_the_requested_size(kind):
    for dof, strings in [*((n, 3) for n in DOF), *((BODY, n) for n in STRINGS)]:
        puppet = marionette(kind, dof, strings)
        assert (puppet.coordinates.n_vD, len(puppet.tree.strings)) == (dof, strings)


def test_the_exponent_of_a_power():
    sizes = [Size("chain", n, 3, 0, 0, 0, 0, 7.0 * n**1.5, 0, 0, 0) for n in (5, 10, 40)]
    assert exponent(sizes, "dof", "evaluate") == pytest.approx(1.5)
