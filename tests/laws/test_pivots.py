"""Inertias of joints, computed link by link, are the pivots of the factorised mass matrix."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base.errors import PuppetError
from fantoccini.dynamics.compiled import check_mass_matrix
from fantoccini.dynamics.compiled.libraries import Libraries
from fantoccini.dynamics.marionette import loads
from fantoccini.model.tree import joint_inertias

WOUND = """\
puppet: wound
bodies:
  - name: rail
    joint: {type: translation, axes: [x, y], driven: true}
    mass: 0.3
  - name: arm
    parent: rail
    joint: {type: ball, at: [0, 0, 0.1], orientation: {rpy: [0.3, 0.2, 0.1]}, driven: true}
    shapes: [{type: box, size: [0.1, 0.2, 0.3], at: [0.1, 0, 0], mass: {parameter: m, value: 0.2}}]
  - name: rod
    parent: arm
    joint: {type: revolute, axis: [1, 2, 3], at: [0.1, 0.2, 0]}
    mass: 0.4
    com: [0, 0.1, 0.2]
    inertia: [0.01, 0.011, 0.012, 0.001, 0.002, 0.0005]
strings:
  - {name: hand, path: [{body: rod}, {world: [0, 0, 1]}], length: driven}
drives:
  - {on: rail.x, mass: 0.2, control: {type: pd, stiffness: 10, damping: 1}}
  - {on: arm.rotation, inertia: 1.0e-4, gear: 5, control: {type: pd, stiffness: 10, damping: 1}}
  - {on: hand.length, inertia: 1.0e-5, drum: 0.01, control: {type: pd, stiffness: 10, damping: 1}}
"""


@pytest.mark.parametrize("name", ["crane", "marionette_bar", "stand6", "wound"])
def test_the_joints_inertias_are_the_blocks_and_the_pivots_of_M(name):
    """They are blocks of M if outer joints are held; otherwise det M is their product."""
    marionette = loads(WOUND) if name == "wound" else fan.load(fan.puppets.path(name))
    table, rng = marionette.coordinates, np.random.default_rng(1)
    q_D = np.nan_to_num(table.start_D, nan=1.0) + rng.normal(size=table.n_qD)
    q_K = np.nan_to_num(table.start_K, nan=1.0)
    for q, _ in table.quaternions_D:
        q_D[q : q + 4] /= np.linalg.norm(q_D[q : q + 4])
    times = marionette.equations["mass_times"]
    M = np.column_stack(
        [np.array(times(q_D, q_K, e, marionette.p))[:, 0] for e in np.eye(table.n_vD)]
    )
    log_det = 0.0
    for i, held, free in joint_inertias(marionette.tree, q_D, q_K, marionette.number):
        v = marionette.tree.links[i].v
        np.testing.assert_allclose(held, M[v, v], atol=1e-12 * np.abs(held).max())
        log_det += np.linalg.slogdet(free)[1]
    assert log_det == pytest.approx(np.linalg.slogdet(M)[1], abs=1e-9)


def test_a_puppet_is_checked_without_its_equations(monkeypatch):
    """Deriving them took 41 s and 1.9 GB for ten chains of 200 pieces."""
    marionette = loads(WOUND)
    monkeypatch.setattr(Libraries, "equations", property(lambda _: pytest.fail("derived")))
    check_mass_matrix(marionette.puppet, marionette.tree)


def test_an_unresisted_motion_is_named():
    """For a point mass on a free joint, the rotation is named, not the joint below."""
    text = WOUND.replace(
        "drives:", "  - {name: stay, path: [{body: dot}, {world: [0, 0, 1]}], length: 1}\ndrives:"
    )
    dot = "  - {name: dot, joint: {type: free}, mass: 1}\nstrings:"
    with pytest.raises(PuppetError, match=r"dot: the mass matrix is singular: look at dot\.wx"):
        marionette = loads(text.replace("strings:", dot))
        check_mass_matrix(marionette.puppet, marionette.tree)
