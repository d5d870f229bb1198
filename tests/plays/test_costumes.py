"""Players of one file in different costumes."""

from __future__ import annotations

import pytest

import fantoccini as fan
from fantoccini.theatre.cast import ResultCache
from fantoccini.theatre.plays.reading import read_play
from plays.tiny import write_play

RED, GREEN, BLUE = "#aa0000", "#00aa00", "#0000aa"


def test_players_of_one_file_wear_other_colours_on_the_stage(tmp_path):
    path = write_play(tmp_path)
    bob = tmp_path / "bob.yaml"
    bob.write_text(bob.read_text().replace("mass: 0.2}", f'mass: 0.2, colour: "{RED}"}}'))
    text = path.read_text()
    text = text.replace("at: here}", f'at: here, colours: {{"{RED}": "{GREEN}"}}}}')
    path.write_text(text.replace("at: there}", f'at: there, colours: {{ball: "{BLUE}"}}}}'))
    players = read_play(path, ResultCache()).cast
    of_body = {
        body.name: body.shapes[0].colour for body in players.marionette.puppet.expanded().bodies
    }
    assert of_body == {"one.ball": GREEN, "two.ball": BLUE}
    # Each is alone as the file has it, and both are compiled once.
    first, second = players.players.values()
    assert first.marionette is second.marionette
    assert first.marionette.puppet.expanded().bodies[0].shapes[0].colour == RED


def test_a_colour_that_the_puppet_lacks_is_a_mistake_at_its_line(tmp_path):
    path = write_play(tmp_path)
    path.write_text(
        path.read_text().replace("at: here}", f'at: here, colours: {{"{RED}": "{BLUE}"}}}}')
    )
    with pytest.raises(fan.errors.FileError) as caught:
        read_play(path, ResultCache())
    assert f"tiny.yaml:9: cast.one.colours['{RED}']: found '{RED}'; needed: " in str(caught.value)
