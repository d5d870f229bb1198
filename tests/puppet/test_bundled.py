"""The bundled puppets have the stated sizes, the paper's names and a description."""

from __future__ import annotations

import numpy as np
import pytest

from fantoccini import puppets
from fantoccini.base.documents.values import value_of
from fantoccini.base.errors import UnknownNameError
from fantoccini.model.puppet import Puppet, load
from fantoccini.model.puppet.shapes import shape_inertia
from fantoccini.model.tree import Tree, grow

# name: n_qD, n_vD, n_qK, n_vK, strings
SIZES = {
    "airplane": (31, 25, 15, 13, 8),
    "arm2d": (2, 2, 2, 2, 1),
    "arm3d": (5, 4, 3, 3, 1),
    "crane": (7, 6, 2, 2, 1),
    "dachshund": (27, 23, 24, 24, 8),
    "dragon": (43, 35, 33, 33, 11),
    "hans": (35, 28, 24, 24, 8),
    "heron": (36, 29, 24, 24, 8),
    "marionette": (31, 25, 21, 21, 7),
    "marionette_bar": (31, 25, 7, 6, 7),
    "stand6": (31, 25, 6, 6, 8),
    "string_pendulum": (2, 2, 0, 0, 1),
}


def bundled(name: str) -> tuple[Puppet, Tree]:
    """A bundled puppet and its tree."""
    puppet = load(puppets.path(name))
    return puppet, grow(puppet)


def test_all_of_them_are_tested() -> None:
    assert puppets.names() == tuple(SIZES)
    with pytest.raises(UnknownNameError, match="did you mean 'arm2d'"):
        puppets.path("arm_2d")


@pytest.mark.parametrize("name", SIZES)
def test_sizes(name: str) -> None:
    puppet, tree = bundled(name)
    table = tree.coordinates
    sizes = (table.n_qD, table.n_vD, table.n_qK, table.n_vK, len(tree.strings))
    assert puppet.name == name
    assert sizes == SIZES[name]


@pytest.mark.parametrize("name", SIZES)
def test_files_are_short_and_begin_with_a_description(name: str) -> None:
    text = puppets.path(name).read_text()
    assert text.startswith("# ")
    assert len(text.splitlines()) <= 150


@pytest.mark.parametrize("name", SIZES)
def test_no_driven_length_is_left_without_a_start(name: str) -> None:
    _, tree = bundled(name)
    assert np.isfinite(tree.coordinates.start_K).all()


def test_coordinates_carry_the_paper_s_names() -> None:
    _, arm2d = bundled("arm2d")
    assert arm2d.coordinates.q_D == ("shoulder", "elbow")
    assert arm2d.coordinates.q_K == ("hand.x", "hand.length")
    assert list(arm2d.parameters) == ["m1", "m2"]
    np.testing.assert_array_equal(arm2d.links[0].axes[:, 0], [0, -1, 0])
    _, arm3d = bundled("arm3d")
    assert arm3d.coordinates.v_D == ("shoulder.wx", "shoulder.wy", "shoulder.wz", "elbow")
    assert arm3d.coordinates.q_K == ("hand.x", "hand.y", "hand.length")


def test_the_marionette_has_the_size_of_a_wooden_one() -> None:
    puppet, tree = bundled("marionette")
    mass = 0.0
    for link in tree.links:
        mass += sum(value_of(share.amount) * share.volume for share in link.mass_shares)
    assert 0.5 < mass < 1.2
    assert list(tree.parameters) == ["neck_stiffness", "foot_density"]
    strings = {s.name for s in puppet.expanded().strings}
    sides = {
        f"{part}_{side}" for part in ("shoulder", "hand", "knee") for side in ("left", "right")
    }
    assert strings == {"head", *sides}


def test_the_marionettes_are_one_puppet() -> None:
    names = ("marionette", "marionette_bar", "stand6", "airplane")
    plain, *others = (bundled(n)[0].expanded() for n in names)
    for body in plain.bodies:
        for other in others:
            assert {b.name: b for b in other.bodies}[body.name] == body
    for body in plain.bodies:
        assert all(shape_inertia(s)[0] > 0 for s in body.shapes)
