"""Random puppets: their legs are found, they bow, and walk on a floor without falling."""

from __future__ import annotations

import pytest
from benchmarks.rigs.drawing import Rig
from benchmarks.rigs.judging import bow, walk

from fantoccini.theatre import Gait
from fantoccini.theatre.gestures import BodyParts

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets]


@pytest.mark.parametrize("seed", [0])
def test_a_random_puppet_has_its_legs_bows_and_walks(seed):
    rig = Rig(seed)
    stage = rig.stage
    body_parts = BodyParts.for_puppet(stage, "rig")
    legs = [limb for limb in body_parts.body_map.limbs if limb.kind == "leg"]
    assert {limb.bodies[-1] for limb in legs} == set(rig.legs)
    assert all(limb.strings for limb in legs)
    assert bow(stage, body_parts)
    slide, force, distance = walk(stage, body_parts, Gait())
    assert slide < 0.05  # it has not fallen; a search makes it slide less
    assert force > 0.01
    assert distance == pytest.approx(1.0, rel=0.05)


def test_puppets_of_the_target_differ_in_legs_size_and_names():
    rigs = [Rig(seed) for seed in range(100)]
    assert {rig.n_pairs for rig in rigs} == {1, 2, 3}
    assert min(rig.size for rig in rigs) < 0.2 and max(rig.size for rig in rigs) > 1.2
    assert len({rig.puppet.bodies[0].name for rig in rigs}) > 5
