"""A slower tempo: the inputs of a run on another clock, simulated again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.stand.hoist import HOIST, lift, stand

import fantoccini as fan
from fantoccini.stand import check_stand, inputs_of, loads_stand, slowed, slower
from fantoccini.stand.stand_file import STANDS
from fantoccini.stand.tempo import distances


@pytest.fixture(scope="module")
def conducted(stand6, conduct):
    given = fan.Input.load(stand6, fan.puppets.performance("conduct"))
    return stand6, given.bound(stand6.rest().q_K), conduct


@pytest.mark.parametrize("factor", [1.0, 1.7])
def test_the_inputs_of_a_run_are_those_it_had(conducted, factor):
    """q(t / f), v / f, acc / f^2; splines' accelerations jump between samples."""
    _, given, run = conducted
    made = inputs_of(run, factor)
    t = np.linspace(0.0, 5.0, 1237)
    q, v, acc = given.evaluate(t)
    slow = made.evaluate(factor * t)
    assert np.max(np.abs(slow[0] - q)) < 1e-7
    assert np.max(np.abs(slow[1] * factor - v)) < 1e-4
    assert np.max(np.abs(slow[2] * factor**2 - acc)) < 0.02 * np.max(np.abs(acc))


def test_as_fast_as_before_is_the_same_motion(conducted):
    puppet, _, run = conducted
    again = slowed(check_stand("six_winches", run, puppet), 1.0)
    assert again.apart < 1e-3 and again.rms < 1e-4


def test_slower_is_simulated_and_moves_otherwise(conducted):
    """Not the old motion on a longer clock: the swing keeps its own time."""
    puppet, _, run = conducted
    text = (STANDS / "six_winches.yaml").read_text(encoding="utf-8")
    tight = loads_stand(text.replace("speed: 1.2", "speed: 0.3"))
    found = check_stand(tight, run, puppet)
    assert not found.ok and found.first.quantity == "speed"
    need = max(limit.value / limit.bound for limit in found.broken)
    best, words = slower(found)
    assert best is not None and best.check.ok
    assert need < best.factor < 1.1 * need and f"{best.factor:.3g} times as long" in words
    assert best.run.duration == pytest.approx(5.0 * best.factor)
    speeds = [max(found.of(a.name)["speed"].value for a in found.axes)]
    speeds.append(max(best.check.of(a.name)["speed"].value for a in found.axes))
    assert speeds[0] / speeds[1] == pytest.approx(best.factor, rel=1e-3)
    # The puppet is elsewhere by millimetres, and would not be if time were only stretched.
    assert best.apart > 0.003
    f = best.factor
    rates = {name: getattr(run, name) / f for name in ("v_D", "v_K")}
    rates |= {name: getattr(run, name) / f**2 for name in ("acc_D", "acc_K")}
    stretched = replace(run, t=run.t * f, events=(), **rates)
    assert distances(puppet, run, stretched, best.factor)[0] < 1e-9


def test_no_tempo_makes_a_travel_longer():
    hoist = fan.loads(HOIST)
    found = check_stand(stand(**{"[0.2, 0.9]": "[0.5, 0.9]"}), lift(hoist), hoist)
    assert found.of("winch")["travel"].broken is not None
    best, words = slower(found)
    assert best is None and "the travel is too short at any tempo" in words


def test_no_tempo_holds_what_is_too_heavy_at_rest():
    hoist = fan.loads(HOIST)
    found = check_stand(stand("0.02"), lift(hoist), hoist)
    best, words = slower(found)
    assert best is None and "the torque of winch is still not enough" in words
    assert found.lost["winch"].since == 0.0
