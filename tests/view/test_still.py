"""Poses without a compiled model are those of the compiled one."""

from __future__ import annotations

import textwrap

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.output.view.geometry import state_geometry
from fantoccini.output.view.still import UncompiledPuppet

PUPPETS = ("arm2d", "arm3d", "crane", "marionette", "marionette_bar", "string_pendulum")

LONGER = """
puppet: longer
bodies:
  - {name: rod, joint: {type: revolute, axis: [0, 1, 0]}, mass: 1, com: [0, 0, -1],
     inertia: [0.1, 0.1, 0.1]}
  - {name: tip, parent: rod, joint: {type: revolute, axis: [0, 1, 0],
     at: [0, 0, {parameter: reach, value: -1}]}, mass: 1, com: [0, 0, -1], inertia: [1, 1, 1]}
strings:
  - {name: line, path: [{body: tip, at: [0, 0, -1]}, {driven: [x], at: [0, 0, 1]}], length: driven}
"""


def still(marionette):
    return UncompiledPuppet(marionette.puppet, marionette.tree, marionette.number)


def moved_configurations(marionette, seed):
    """Configurations (4, n_qD), (4, n_qK) about the file's pose."""
    rng, table = np.random.default_rng(seed), marionette.coordinates
    q_D = table.start_D + rng.normal(0.0, 0.4, (4, table.n_qD))
    q_K = np.nan_to_num(table.start_K, nan=1.0) + rng.normal(0.0, 0.2, (4, table.n_qK))
    for q, places in ((q_D, table.quaternions_D), (q_K, table.quaternions_K)):
        for k, _ in places:
            q[:, k : k + 4] /= np.linalg.norm(q[:, k : k + 4], axis=1, keepdims=True)
    return q_D, q_K


@pytest.mark.parametrize("name", PUPPETS)
def test_poses_points_and_lengths_are_those_of_the_compiled_model(name):
    compiled = getattr(fan.puppets, name)()
    plain, q = still(compiled), moved_configurations(compiled, 3)
    assert np.allclose(plain.poses(*q), compiled.poses(*q), atol=1e-12)
    for ours, theirs in zip(
        plain.string_points(*q).values(), compiled.string_points(*q).values(), strict=True
    ):
        assert np.allclose(ours, theirs, atol=1e-12)
    assert np.allclose(plain.string_lengths(*q), compiled.string_lengths(*q), atol=1e-12)


def test_strings_without_a_length_just_reach_in_the_start_pose():
    longer = fan.loads(LONGER)
    start = still(longer).start()
    assert start.q_K[longer.coordinates.q_K.index("line.length")] == pytest.approx(3.0)
    assert start.taut[0]


def test_pictures_take_the_present_values_of_parameters():
    longer = fan.loads(LONGER).with_parameters({"reach": -2.0})
    plain = still(longer)
    geometry = state_geometry(plain, plain.start())
    assert geometry.poses[0, 1, 2, 3] == pytest.approx(-2.0)
    solids = [s for s in geometry.solids if s.link == 0 and len(np.unique(s.points)) > 1]
    reaches = [s.points[1, 2] for s in solids]
    assert -2.0 in reaches


def test_commands_of_drives_are_where_their_coordinates_are():
    text = """
    puppet: p
    bodies: [{name: b, joint: {type: translation, axes: [z]}, mass: 1}]
    strings: [{name: s, path: [{body: b}, {world: [0, 0, 1]}], length: driven}]
    pose: {b.z: 0.2}
    drives: [{on: s.length, mass: 1.5, control: {type: pd, stiffness: 9, damping: 1}}]
    """
    puppet = fan.loads(textwrap.dedent(text))
    start = UncompiledPuppet(puppet.puppet, puppet.tree).start()
    assert start.q_K == pytest.approx([0.8]) and start.q_D == pytest.approx([0.2, 0.8])
