"""The bundled play with a dog on a leash, a bird and two persons of different files."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from ruamel.yaml import YAML

import fantoccini as fan
from fantoccini.model.puppet import bundled, load
from fantoccini.theatre import plays

PARK = Path(plays.__file__).parent / "repertory" / "park.yaml"
DATA = YAML(typ="safe").load(PARK.read_text(encoding="utf-8"))


def test_the_park_has_a_dog_on_a_leash_a_bird_and_two_persons_of_different_files():
    puppets = [player.get("puppet", "marionette") for player in DATA["cast"].values()]
    assert sorted(puppets) == ["dachshund", "hans", "heron", "marionette"]
    assert DATA["leashes"]["lead"]["to"] == "dog"
    assert sum(len(act["cues"]) for act in DATA["acts"]) == 25


def test_the_park_names_no_body_and_no_string():
    words = set(re.findall(r"[a-z_]+", PARK.read_text(encoding="utf-8")))
    for player in DATA["cast"].values():
        puppet = load(bundled(player.get("puppet", "marionette"))).expanded()
        assert not words & {part.name for part in (*puppet.bodies, *puppet.strings)}  # type: ignore[attr-defined]


@pytest.mark.slow
@pytest.mark.long
def test_all_cues_of_the_park_can_be_done_and_its_run_is_verified():
    play = fan.load_play("park")
    assert play, play.changes
    assert len(play.cues) == 25 and not any(cue.refused for cue in play.cues)
    verification = fan.theatre.verify_play(play)
    assert verification, verification.faults
    assert 55.0 < verification.run.t[-1] < 70.0
