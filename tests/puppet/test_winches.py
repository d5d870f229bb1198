"""The keys of a string's winch and of its catches: restitution, max_tension, rewind_speed."""

from __future__ import annotations

import json

import numpy as np
import pytest
from tests.puppet.toys import TEXT

import fantoccini as fan
from fantoccini.base.errors import PuppetError
from fantoccini.base.progress import Progress
from fantoccini.model.puppet import json_schema, loads

pytestmark = pytest.mark.own_puppets

MISTAKES = [
    ("restitution: 1.1", 11, "restitution", "found 1.1; needed: a number from 0 to 1"),
    ("restitution: -0.1", 11, "restitution", "found -0.1; needed: a number from 0 to 1"),
    ("restitution: .nan", 11, "restitution", "found nan; needed: a finite number"),
    ("restitution: half", 11, "restitution", "found 'half'; needed: a number"),
    ("restitution: {parameter: e, value: 2}", 11, "restitution", "found 2; needed: a number from"),
    ("max_tension: 0", 11, "max_tension", "found 0; needed: a positive number"),
    ("max_tension: .inf", 11, "max_tension", "found inf; needed: a finite number"),
    ("max_tension: true", 11, "max_tension", "found true; needed: a number"),
    ("max_tension: {parameter: g, value: -1}", 11, "max_tension", "found -1; needed: a positive"),
    ("max_tension: 5\n    rewind_speed: 0", 12, "rewind_speed", "found 0; needed: a positive"),
    ("max_tensoin: 5", 11, "max_tensoin", "did you mean 'max_tension'?"),
    ("rewind_speed: 1", 8, "", "rewind_speed without max_tension"),
    ("wire: true\n    restitution: 0.5", 8, "", "a wire neither bounces nor slips"),
    ("wire: true\n    max_tension: 5", 8, "", "a wire neither bounces nor slips"),
    ("max_tension: 5\n    restitution: 0.5", 8, "", "on a slipping winch does not bounce"),
]


@pytest.mark.parametrize(("text", "line", "key", "message"), MISTAKES)
def test_a_mistake_is_located(text: str, line: int, key: str, message: str) -> None:
    with pytest.raises(PuppetError) as caught:
        loads(f"{TEXT}    {text}\n", "bad.yaml")
    places = [(p.file, p.line, p.key) for p in caught.value.mistakes if message in p.message]
    place = "strings[0]" + (f".{key}" if key else "")
    assert places == [("bad.yaml", line, place)], caught.value.mistakes


def test_the_keys_may_stand_alone_or_with_a_parameter() -> None:
    for text in ("restitution: 0", "restitution: 1", "max_tension: 1.0e+6", "wire: true"):
        loads(f"{TEXT}    {text}\n")
    string = loads(TEXT).strings[0]
    assert (string.restitution, string.max_tension, string.rewind_speed) == (0.0, None, None)


WINCH = TEXT + "    max_tension: {parameter: grip, value: 5}\n    rewind_speed: 0.25\n"
BOUNCE = TEXT + "    restitution: {parameter: e, value: 0.5}\n"


@pytest.mark.parametrize("text", [WINCH, BOUNCE], ids=["winch", "bounce"])
def test_a_round_trip_and_the_twins_keep_the_keys(text: str) -> None:
    puppet = loads(text)
    assert loads(puppet.to_yaml()) == puppet
    assert puppet.canonical() != loads(TEXT).canonical()
    left, right = puppet.expanded().strings
    assert right.name == "s_right"
    for key in ("restitution", "max_tension", "rewind_speed"):
        assert getattr(left, key) == getattr(right, key)
    assert loads(puppet.expanded().to_yaml()) == puppet.expanded()


def test_the_json_schema_has_the_keys() -> None:
    schema = json.loads(json.dumps(json_schema()))
    keys = schema["$defs"]["String"]["properties"]
    assert {"restitution", "max_tension", "rewind_speed"} <= set(keys)
    assert all("description" in keys[key] for key in keys)
    assert not {"restitution", "max_tension"} & set(schema["$defs"]["String"]["required"])


def test_a_parameter_changes_a_winch_without_compiling_again() -> None:
    """A bob of 1 kg on a winch that gives way at 5 N falls with g - 5 m/s^2."""
    messages: list[Progress] = []
    puppet = fan.loads(WINCH, messages.append)
    assert puppet.winches.tolist() == [[5.0, 0.25, 0.0], [5.0, 0.25, 0.0]]
    library = puppet.library
    messages.clear()
    for grip in (5.0, 8.0, 20.0):
        other = puppet.with_parameters({"grip": grip})
        assert other.library is library
        assert messages == []
        assert other.winches[:, 0].tolist() == [grip, grip]
        run = fan.simulate(other, other.state(), t_end=0.5)
        expected = 0.5 * max(9.81 - grip, 0.0) * run.t**2
        worst = np.max(np.abs(run.slip.values - expected[:, None]))
        assert worst <= 1e-12, f"{worst:.2e} m"
        assert np.max(np.abs(run.tension.values - min(grip, 9.81))) <= 1e-12
    with pytest.raises(PuppetError, match="positive"):
        puppet.with_parameters({"grip": 0.0})
    assert puppet.winches[0, 0] == 5.0


def test_an_impossible_restitution_is_refused_after_loading_too() -> None:
    puppet = fan.loads(BOUNCE)
    assert puppet.with_parameters({"e": 1.0}).winches[0, 2] == 1.0
    with pytest.raises(PuppetError, match="from 0 to 1"):
        puppet.with_parameters({"e": 1.5})
