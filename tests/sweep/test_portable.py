"""Marionettes are pickled as text; the copy is the same puppet, compiled if the cache has it."""

from __future__ import annotations

import copy
import pickle
import shutil

import numpy as np
import pytest
import trimesh

import fantoccini as fan
from fantoccini.model.scene import assembled


@pytest.mark.parametrize("name", ["arm2d", "marionette_bar"])
def test_the_copy_is_the_same_puppet(name):
    original = getattr(fan.puppets, name)()
    if original.p.size:
        original = original.with_parameters({next(iter(original.tree.parameters)): 0.07})
    received = pickle.loads(pickle.dumps(original))
    assert received.puppet.canonical() == original.puppet.canonical()
    assert np.array_equal(received.p, original.p) and received.name == original.name


def test_winches_are_pickled_too():
    arm = fan.puppets.arm2d()
    original = arm.with_winches([[12.0, 0.5, 0.0]])
    assert np.array_equal(pickle.loads(pickle.dumps(original)).winches, [[12.0, 0.5, 0.0]])
    assert np.array_equal(original.with_parameters({"m1": 0.2}).winches, arm.winches)


def test_libraries_are_not_pickled_but_are_kept_by_a_copy():
    arm = fan.puppets.arm2d()
    library = arm.library
    assert "library" not in pickle.loads(pickle.dumps(arm)).__dict__
    assert copy.copy(arm).library is library
    assert arm.with_parameters({"m2": 0.1}).library is library


def test_meshes_are_pickled_with_their_puppet(tmp_path):
    folder = tmp_path / "there" / "meshes"
    folder.mkdir(parents=True)
    trimesh.creation.box((0.1, 0.2, 0.3)).export(folder / "box.stl")
    file = folder.parent / "stone.yaml"
    file.write_text(
        "puppet: stone\nbodies:\n  - name: stone\n    joint: {type: free}\n"
        "    shapes: [{type: mesh, file: meshes/box.stl, density: 1000}]\n"
    )
    stone = fan.load(file)
    original = pickle.dumps(stone)
    mass = stone.mass
    shutil.rmtree(folder.parent)
    received = pickle.loads(original)
    assert received.mass == mass == pytest.approx(6.0)
    assert received.puppet.bodies[0].shapes[0].path.is_file()


def test_a_whole_scene_is_pickled():
    arm, crane = (getattr(fan.puppets, n)().puppet for n in ("arm2d", "crane"))
    scene = fan.Scene.of(arm, crane, name="stage")
    received = pickle.loads(pickle.dumps(fan.Marionette(scene)))
    assert received.name == "stage" and received.puppet == assembled(scene)
