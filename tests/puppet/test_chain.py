"""The key `chain` of a string, and puppets whose strings all become chains."""

from __future__ import annotations

import numpy as np
import pytest
from tests.puppet.toys import TEXT

import fantoccini as fan
from fantoccini.base.errors import PuppetError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.puppet import json_schema, loads
from fantoccini.model.scene import Scene, assembled
from fantoccini.model.tree import grow
from fantoccini.output.view.geometry import state_geometry
from fantoccini.output.view.still import UncompiledPuppet

pytestmark = pytest.mark.own_puppets

CHAIN = "chain: {pieces: 4, mass: 0.01, stiffness: 500}"

MISTAKES = [
    ("chain: {pieces: 1, mass: 0.01, stiffness: 500}", 11, "chain.pieces", "greater than or eq"),
    ("chain: {pieces: 201, mass: 0.01, stiffness: 500}", 11, "chain.pieces", "less than or eq"),
    ("chain: {pieces: 2.5, mass: 0.01, stiffness: 500}", 11, "chain.pieces", "found 2.5"),
    ("chain: {mass: 0, stiffness: 500}", 11, "chain.mass", "found 0; needed: a positive number"),
    ("chain: {mass: 1, stiffness: .inf}", 11, "chain.stiffness", "needed: a finite number"),
    ("chain: {mass: 1, stiffness: 5, damping: -1}", 11, "chain.damping", "zero or a positive"),
    ("chain: {stiffness: 5}", 11, "chain.mass", "this key is missing"),
    ("chain: {mass: 1, stifness: 5}", 11, "chain.stifness", "did you mean 'stiffness'?"),
    (f"wire: true\n    {CHAIN}", 8, "", "chain and wire: true"),
    (f"restitution: 0.5\n    {CHAIN}", 8, "", "chain and restitution"),
    (f"max_tension: 5\n    {CHAIN}", 8, "", "chain and max_tension"),
]


@pytest.mark.parametrize(("text", "line", "key", "message"), MISTAKES)
def test_a_mistake_is_located(text: str, line: int, key: str, message: str) -> None:
    with pytest.raises(PuppetError) as caught:
        loads(f"{TEXT}    {text}\n", "bad.yaml")
    places = [(p.file, p.line, p.key) for p in caught.value.mistakes if message in p.message]
    place = "strings[0]" + (f".{key}" if key else "")
    assert places == [("bad.yaml", line, place)], caught.value.mistakes


def test_masses_do_not_run_over_pulleys() -> None:
    text = TEXT.replace("{world: [0, 1, 1]}", "{world: [0, 1, 1]}, {world: [1, 1, 1]}")
    with pytest.raises(PuppetError, match=r"bad\.yaml:8: .*a path of 3 points"):
        loads(f"{text}    {CHAIN}\n", "bad.yaml")
    with pytest.raises(PuppetError, match=r"bad\.yaml:8: .*a path of 3 points"):
        loads(text, "bad.yaml").with_chains()


def test_the_mirror_yaml_and_the_compile_key_keep_it() -> None:
    text = CHAIN.replace("0.01", "{parameter: mu, value: 0.01}")
    puppet = loads(f"{TEXT}    {text}\n")
    assert loads(puppet.to_yaml()) == puppet
    left, right = puppet.expanded().strings
    assert left.chain == right.chain is not None
    other = loads(f"{TEXT}    {text.replace('0.01', '0.02')}\n")
    assert puppet.canonical() != other.canonical()
    assert puppet.canonical(values=False) == other.canonical(values=False)
    assert puppet.canonical() != loads(f"{TEXT}    {CHAIN}\n").canonical()
    assert set(json_schema()["$defs"]["Chain"]["required"]) == {"mass", "stiffness"}


def test_chains_on_all_strings_leave_wires_and_chains_alone() -> None:
    more = """\
  - {name: rod, path: [{body: bob_left}, {world: [1, 1, 0]}], length: 1, wire: true}
  - {name: rope, path: [{body: bob_left}, {world: [0, 1, -1]}], length: 1, CHAIN}
"""
    puppet = loads(TEXT + more.replace("CHAIN", CHAIN))
    chained = puppet.with_chains(pieces=3, mass=0.02, stiffness=70.0, damping=0.0)
    string, rod, rope = chained.strings
    assert (string.chain.pieces, string.chain.mass, string.chain.stiffness) == (3, 0.02, 70.0)
    assert rod.chain is None
    assert rope == puppet.strings[2]
    assert chained.with_chains() == chained
    assert chained.locate("s_left") == puppet.locate("s_left")


def test_strings_that_slip_cannot_become_chains() -> None:
    with pytest.raises(PuppetError, match=r"bad\.yaml:8: .*chain and max_tension"):
        loads(f"{TEXT}    max_tension: 5\n", "bad.yaml").with_chains()


def test_the_masses_are_named_after_the_string_and_lie_between_its_ends() -> None:
    tree = grow(loads(f"{TEXT}    {CHAIN}\n"))
    table = tree.coordinates
    assert tree.row_names == ()
    assert [c.name for c in tree.chains] == ["s_left", "s_right"]
    start = dict(zip(table.q_D, table.start_D, strict=True))
    assert start["s_left.3.z"] == pytest.approx(0.75)
    assert start["s_right.1.y"] == -1.0


def test_a_longer_string_begins_as_a_v_of_relaxed_pieces() -> None:
    tree = grow(loads(f"{TEXT.replace('length: 1', 'length: 1.5')}    {CHAIN}\n"))
    q = tree.coordinates.start_D[tree.coordinates.q_D.index("s_left.1.x") :][:9].reshape(3, 3)
    points = np.vstack([[0, 1, 0], q, [0, 1, 1]])
    assert np.allclose(np.linalg.norm(np.diff(points, axis=0), axis=1), 1.5 / 4)


def test_several_puppets_of_a_scene_keep_their_masses_apart() -> None:
    first = loads(f"{TEXT}    {CHAIN.replace('500', '{parameter: EA, value: 500}')}\n")
    text = first.to_yaml().replace("puppet: p", "puppet: other")
    tree = grow(assembled(Scene.of(first, loads(text))))
    assert "other.s_right.2.z" in tree.coordinates.q_D
    assert tree.chains[2].stiffness.parameter == "other.EA"


def test_pictures_draw_the_string_through_its_masses() -> None:
    marionette = Marionette(loads(f"{TEXT}    {CHAIN}\n"))
    still = UncompiledPuppet(marionette.puppet, marionette.tree)
    x = still.start()
    x = x.replace(q_D=x.q_D + 0.01)
    threads = state_geometry(still, x, np.zeros(0)).string_curves(0)
    assert [t.points.shape for t in threads] == [(5, 3), (5, 3)]
    assert np.allclose(threads[0].points[2], [0.01, 1.01, 0.51])
    assert threads[0].tension == max(threads[0].tension, 0.0)


def test_the_string_model_is_chosen_when_a_puppet_is_loaded() -> None:
    assert not fan.loads(TEXT).tree.chains
    assert len(fan.loads(TEXT, string_model="chain").tree.chains) == 2
    assert len(fan.puppets.arm3d(string_model="chain").tree.chains) == 1
    with pytest.raises(ValueError, match="string_model is 'rope'; it must be one of constraint"):
        fan.loads(TEXT, string_model="rope")
