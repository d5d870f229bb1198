"""Bundled gestures of animals, for dogs and birds of any names, sizes and directions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML
from tests.body_map import zoo

import fantoccini as fan
from fantoccini.base.errors import FileError, StateError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.theatre.gestures import (
    MAX_ACCELERATION,
    MAX_SPEED,
    BodyParts,
    bundled_gesture_path,
    gesture_names,
    load_gesture,
    motion_bounds,
)
from fantoccini.theatre.gestures.body_parts import string_moves

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]

DOG = ("wag", "sniff", "lie_down", "stretch", "beg")
BIRD = ("flap", "glide", "peck")
FLOOR_MARGIN = 0.02
"""Height by which feet may sink below their first one, which is less than the lift in plays [m]."""


@pytest.fixture(scope="module")
def puppets() -> dict[str, Marionette]:
    """The bundled dog and bird, and others with other names, sizes, bodies and directions."""
    return {
        "dachshund": fan.puppets.dachshund(),
        "heron": fan.puppets.heron(),
        "other dog": Marionette(zoo.dachshund()),
        "other bird": Marionette(zoo.heron()),
    }


class PerformedGesture:
    """A gesture as the puppet performs it, in time steps.

    Attributes:
        t: times [s].
        marks: marks of the gesture [s].
    """

    def __init__(self, puppet: Marionette, name: str):
        x0, gesture = puppet.rest(), load_gesture(puppet, name)
        self._puppet, self._body, self.marks = puppet, puppet.body_map, gesture.marks
        run = fan.simulate(
            puppet,
            x0,
            gesture.inputs(x0),
            gesture.duration,
            method=fan.TimeStepping(dt=2e-3),
            save_every=5,
        )
        assert run.status is fan.Status.DONE
        self.t, self._poses = run.t, puppet.poses(run.q_D, run.q_K)
        trunk = self._poses[0, puppet.link_index(self._body.trunk[0]), :, :3]
        forward = trunk @ np.array(self._body.facing)
        # Rows: forward, left, up.
        self._axes = np.array([forward, np.cross([0.0, 0.0, 1.0], forward), [0.0, 0.0, 1.0]])

    def length(self, part: str) -> float:
        """Length of a limb [m]."""
        return self._body.parts[part].length

    def tip(self, part: str) -> np.ndarray:
        """(T, 3) end of a limb or the head: forward, left and up, relative to the first one [m]."""
        limb = self._body.head if part == "head" else self._body.parts[part]
        assert limb is not None
        return self._path(limb.body if part == "head" else limb.bodies[-1], limb.end)

    def trunk(self, k: int = 0) -> np.ndarray:
        """(T, 3) place of a body of the trunk: forward, left and up, from the first one on [m]."""
        return self._path(self._body.trunk[k], (0.0, 0.0, 0.0))

    def slope(self) -> np.ndarray:
        """(T,) angle by which the first body of the trunk has turned its front up [rad]."""
        axes = self._poses[:, self._puppet.link_index(self._body.trunk[0]), :, :3]
        rise = (axes @ np.array(self._body.facing))[:, 2]
        return np.arcsin(rise) - np.arcsin(rise[0])

    def lowest_foot(self) -> float:
        """Lowest height of any foot, relative to its first one [m]."""
        legs = [name for name, limb in self._body.parts.items() if limb.kind == "leg"]
        return min(float(self.tip(name)[:, 2].min()) for name in legs)

    def at(self, mark: str) -> int:
        """Index of the sample at a mark."""
        return int(np.argmin(np.abs(self.t - self.marks[mark])))

    def _path(self, body: str, point: tuple[float, float, float]) -> np.ndarray:
        pose = self._poses[:, self._puppet.link_index(body)]
        positions = pose[:, :, :3] @ np.array(point) + pose[:, :, 3]
        return (positions - positions[0]) @ self._axes.T


def check_wag(performed: PerformedGesture) -> None:
    # The tail of the other dog has a spring that is five times as stiff.
    swing = performed.tip("tail")[:, 1]
    assert np.ptp(swing) > 0.16 * performed.length("tail")
    assert np.count_nonzero(np.diff(np.sign(np.diff(swing[:: len(swing) // 40])))) >= 7


def check_sniff(performed: PerformedGesture) -> None:
    assert performed.tip("head")[performed.at("down"), 2] < -0.35 * performed.length(
        "leg_front_left"
    )


def check_lie_down(performed: PerformedGesture) -> None:
    assert performed.trunk()[-1, 2] < -0.3 * performed.length("leg_front_left")
    assert abs(performed.slope()[-1]) < np.radians(15.0)
    assert np.ptp(performed.tip("head")[-10:, 2]) < 0.01


def check_stretch(performed: PerformedGesture) -> None:
    low = performed.at("low")
    assert performed.slope()[low] < -np.radians(10.0)
    assert performed.tip("leg_front_left")[low, 0] > performed.trunk()[low, 0]


def check_beg(performed: PerformedGesture) -> None:
    up = performed.at("up")
    assert performed.slope()[up] > np.radians(20.0)
    for paw in ("leg_front_left", "leg_front_right"):
        assert performed.tip(paw)[up, 2] > 0.5 * performed.length(paw)


def check_flap(performed: PerformedGesture) -> None:
    for wing in ("wing_left", "wing_right"):
        height = performed.tip(wing)[:, 2]
        beats = np.diff(np.sign(height - 0.5 * (height.max() + height.min())))
        assert np.ptp(height) > 0.4 * performed.length(wing)
        assert np.count_nonzero(beats > 0) == 4


def check_glide(performed: PerformedGesture) -> None:
    high = performed.at("high")
    assert performed.trunk()[high, 2] > 0.02
    for wing in ("wing_left", "wing_right"):
        assert performed.tip(wing)[high, 2] - performed.trunk()[high, 2] > 0.15 * performed.length(
            wing
        )


def check_peck(performed: PerformedGesture) -> None:
    head = performed.tip("head")
    for mark in ("first", "second", "third"):
        assert head[performed.at(mark), 2] < -0.4 * performed.length("neck")
    picks = np.diff(np.sign(np.diff(head[performed.at("first") : performed.at("third"), 2])))
    assert np.count_nonzero(picks) >= 3


CHECKS: dict[str, Callable[[PerformedGesture], None]] = {
    "wag": check_wag,
    "sniff": check_sniff,
    "lie_down": check_lie_down,
    "stretch": check_stretch,
    "beg": check_beg,
    "flap": check_flap,
    "glide": check_glide,
    "peck": check_peck,
}


@pytest.mark.parametrize("name", DOG)
@pytest.mark.parametrize("dog", ["dachshund", "other dog"])
def test_four_legged_puppets_do_what_the_name_says(puppets, dog, name):
    performed = PerformedGesture(puppets[dog], name)
    CHECKS[name](performed)
    assert performed.lowest_foot() > -FLOOR_MARGIN


@pytest.mark.parametrize("name", BIRD)
@pytest.mark.parametrize("bird", ["heron", "other bird"])
def test_birds_do_what_the_name_says(puppets, bird, name):
    performed = PerformedGesture(puppets[bird], name)
    CHECKS[name](performed)
    assert performed.lowest_foot() > -FLOOR_MARGIN


DOG_HAS = (
    "dachshund has trunk, trunk_front, trunk_hind, head, leg_front_left, leg_front_right, "
    "leg_hind_left, leg_hind_right, tail"
)
LACKS = {
    ("heron", "wag"): "gesture wag: it moves tails; heron has trunk, head, wing_left, wing_right, "
    "leg_left, leg_right, neck",
    ("heron", "beg"): "gesture beg: it moves trunk_front, which no string of heron moves",
    ("dachshund", "flap"): f"gesture flap: it moves wings; {DOG_HAS}",
    ("dachshund", "peck"): f"gesture peck: the size of a neck scales its moves; {DOG_HAS}",
}


@pytest.mark.parametrize(("animal", "name"), LACKS)
def test_a_missing_part_is_told_in_one_sentence(puppets, animal, name):
    with pytest.raises(FileError) as error:
        load_gesture(puppets[animal], name)
    assert str(error.value) == LACKS[animal, name]


def test_ends_of_a_trunk_are_told_by_the_places_of_the_carrying_strings(puppets):
    expected = {
        "dachshund": (("withers",), ("croup",)),
        "other dog": (("b", "c"), ("d",)),
        "heron": ((), ()),  # both strings are tied at one place along its back
        "other bird": (("front",), ("back_l", "back_r")),
    }
    for name, (front, hind) in expected.items():
        assert BodyParts.for_puppet(puppets[name]).trunk_ends == {
            "trunk_front": front,
            "trunk_hind": hind,
        }


def test_sizes_of_other_parts_scale_offsets(puppets, tmp_path):
    path = tmp_path / "crouch.yaml"
    path.write_text(
        "gesture: crouch\nsizes: {leg: 10 cm, whole: 1 m}\nscaled_by: {trunk: leg}\n"
        "parts: {trunk.down: [[0, 0], [1, 5 cm]], head.down: [[0, 0], [1, 5 cm]]}\n",
        encoding="utf-8",
    )
    puppet = puppets["other dog"]
    body, coordinates = puppet.body_map, puppet.coordinates
    offsets = dict(zip(coordinates.v_K, load_gesture(puppet, path).offsets(1.0)[0], strict=True))
    leg = body.parts["leg_front_left"].length
    assert offsets["b.length"] == pytest.approx(0.05 * leg / 0.1, abs=1e-9)
    assert offsets["a.length"] == pytest.approx(0.05 * body.size, abs=1e-9)


MISTAKES = {
    "{tail: leg}": "crouch.yaml:3: scaled_by.tail: 'tail' is not among the parts",
    "{trunk: neck}": "crouch.yaml:3: scaled_by.trunk: needed: a kind of part whose size is in",
    "{trunk: nose}": "crouch.yaml:3: scaled_by.trunk: ",
}


@pytest.mark.parametrize("entry", MISTAKES)
def test_mistakes_in_scaled_by(entry, puppets, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = (
        "gesture: crouch\nsizes: {leg: 10 cm}\nscaled_by: ENTRY\nparts: {trunk.down: [[0, 0.1]]}\n"
    )
    Path("crouch.yaml").write_text(text.replace("ENTRY", entry), encoding="utf-8")
    with pytest.raises(FileError) as error:
        load_gesture(puppets["dachshund"], "crouch.yaml")
    assert MISTAKES[entry] in str(error.value)


def test_limbs_without_strings_stay_out_of_a_plural(puppets):
    body = puppets["other bird"].body_map
    assert body.parts["neck"].strings == ()
    body_parts = BodyParts.for_puppet(puppets["other bird"])
    assert body_parts.moves("necks.up") == []
    with pytest.raises(StateError, match="it moves neck, which no string of heron moves"):
        body_parts.moves("neck.up")
    with pytest.raises(StateError, match="it moves necks, which no string of heron moves"):
        string_moves(body_parts, ["necks.up"])


def test_only_moves_that_a_puppet_has_need_a_size(puppets):
    scaled_by = {"trunk": "whole", "wings": "wing"}
    moves = string_moves(
        BodyParts.for_puppet(puppets["dachshund"]), ["trunk.up", "wings.up"], scaled_by
    )
    assert {part for part, _ in moves.values()} == {"trunk.up"}


@pytest.mark.parametrize("name", [*DOG, *BIRD])
def test_they_keep_to_the_default_bounds(puppets, name):
    puppets = {**puppets, "dragon": fan.puppets.dragon()} if name == "wag" else puppets
    n = 0
    for animal, puppet in puppets.items():
        try:
            gesture = load_gesture(puppet, name)
        except FileError:
            continue
        n += 1
        peaks = gesture.peaks / motion_bounds(puppet.coordinates, MAX_SPEED, MAX_ACCELERATION)
        assert np.max(peaks) < 1.0 + 2e-3, animal
    assert n >= 2


WOUND = """
puppet: wound
bodies:
- {name: trunk, joint: {type: free}, mass: 1.0, com: [0, 0, 0], inertia: [0.01, 0.01, 0.01]}
- {name: tail, parent: trunk, joint: {type: ball, at: [-0.1, 0, 0]}, mass: 0.1, com: [-0.1, 0, 0],
   inertia: [1e-4, 1e-4, 1e-4]}
- {name: fin, parent: trunk, joint: {type: ball, at: [0, 0, 0.05]}, mass: 0.1, com: [0, 0, 0.1],
   inertia: [1e-4, 1e-4, 1e-4]}
strings:
- {name: left, path: [{body: trunk, at: [0, 0.1, 0]}, {at: [0, 0.1, 1], driven: [x, y]}], length: 1}
- {name: right, path: [{body: trunk, at: [0, -0.1, 0]}, {at: [0, -0.1, 1], driven: [x, y]}],
   length: 1}
- {name: winch, path: [{body: tail, at: [-0.2, 0, 0]}, {world: [-0.3, 0, 1]}], length: driven}
- {name: sail, path: [{body: fin, at: [0, 0, 0.2]}, {at: [0, 0, 1], driven: [y]}], length: 0.8}
rig:
  trunk: [trunk]
  facing: [1, 0, 0]
  carrying: [left, right]
  limbs:
  - {kind: tail, bodies: [tail], end: [-0.2, 0, 0], strings: [winch]}
  - {kind: wing, bodies: [fin], end: [0, 0, 0.2], strings: [sail]}
"""


def test_parts_that_stay_need_no_driven_coordinate(tmp_path):
    """A tail whose string is only wound, and a wing in the middle that moves along y alone."""
    puppet = fan.loads(WOUND)
    path = tmp_path / "still.yaml"
    rows = ("trunk.forward", "tails.up", "tails.forward", "wings.forward", "wings.out")
    text = "".join(f"  {row}: [[0, 0], [0.4, 0]]\n" for row in rows)
    path.write_text(f"gesture: still\nparts:\n{text}")
    assert set(load_gesture(puppet, path).uses) == {"left", "right", "winch", "sail"}
    path.write_text("gesture: go\nparts: {tails.forward: [[0, 0], [0.4, 1 cm]]}\n")
    with pytest.raises(FileError, match=r"would move winch\.x, which is not a driven coordinate"):
        load_gesture(puppet, path)


def test_hang_brings_back_wings_and_tail(puppets):
    for animal, name, string in (
        ("dachshund", "wag", "tail_tip"),
        ("heron", "flap", "pinion_left"),
    ):
        assert string in load_gesture(puppets[animal], name).uses
        assert string in load_gesture(puppets[animal], "hang").uses


def test_no_bundled_gesture_names_a_string():
    """Bundled gestures have `parts` for any puppet, and neither `moves` nor `poses`."""
    for name in gesture_names():
        if bundled_gesture_path(name).is_file():
            keys = (
                YAML(typ="safe").load(bundled_gesture_path(name).read_text(encoding="utf-8")).keys()
            )
            assert "parts" in keys and not keys & {"moves", "poses"}, name
