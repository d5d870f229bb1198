"""Puppets that share a world agree on gravity and floor and differ in name."""

from __future__ import annotations

import pytest

from fantoccini.errors import PuppetError
from fantoccini.puppet import Puppet, loads
from fantoccini.world import World


def puppet(name: str, rest: str = "") -> Puppet:
    """A puppet that is one fixed body."""
    return loads(f"puppet: {name}\nbodies: [{{name: a}}]\n{rest}")


def test_one_puppet_is_a_world() -> None:
    only = puppet("p", "floor: 0.5\nobstacles: [{name: o, type: sphere, radius: 1}]")
    world = World.of(only)
    assert (world.puppets, world.name, world.floor) == ((only,), "p", 0.5)
    assert world.gravity == (0.0, 0.0, -9.81)
    assert [o.name for o in world.obstacles] == ["o"]


def test_several_puppets_share_obstacles_and_a_floor() -> None:
    table = "obstacles: [{name: table, type: box, size: [1, 1, 1]}]"
    world = World.of(puppet("p", table), puppet("q", table), puppet("r", "floor: 1"))
    assert world.name == "p+q+r"
    assert len(world.obstacles) == 1
    assert world.floor == 1.0
    assert World.of(puppet("p"), puppet("q"), name="stage").name == "stage"


@pytest.mark.parametrize(
    ("first", "second", "message"),
    [
        (("p", ""), ("p", ""), "<p>: puppet: the name is used twice"),
        (("p", ""), ("q", "gravity: [0, 0, -1.62]"), "<q>: gravity: found .* one gravity"),
        (("p", "floor: 0"), ("q", "floor: 1"), "<q>: floor: found .* one floor"),
    ],
)
def test_puppets_that_do_not_go_together(first, second, message: str) -> None:
    with pytest.raises(PuppetError, match=message):
        World.of(puppet(*first), puppet(*second))


def test_an_empty_world() -> None:
    with pytest.raises(PuppetError, match="needs a puppet"):
        World.of()
