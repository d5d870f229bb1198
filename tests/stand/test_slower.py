"""A slower tempo: the inputs of a run at another speed, simulated again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.stand.hoist import HOIST, lift, stand

import fantoccini as fan
from fantoccini.stand import check_stand, find_slower_tempo, inputs_of, loads_stand, slow_down
from fantoccini.stand.stand_file import BUNDLED_STANDS_FOLDER
from fantoccini.stand.tempo import body_distances


@pytest.fixture(scope="module")
def conducted(stand6, conduct):
    inputs = fan.Input.load(stand6, fan.puppets.performance("conduct"))
    return stand6, inputs.bound(stand6.rest().q_K), conduct


@pytest.mark.parametrize("factor", [1.0, 1.7])
def test_the_inputs_of_a_run_are_those_it_had(conducted, factor):
    """q(t / f), v / f, acc / f^2; splines' accelerations jump between samples."""
    _, inputs, run = conducted
    slower_inputs = inputs_of(run, factor)
    t = np.linspace(0.0, 5.0, 1237)
    q, v, acc = inputs.evaluate(t)
    slow = slower_inputs.evaluate(factor * t)
    assert np.max(np.abs(slow[0] - q)) < 1e-7
    assert np.max(np.abs(slow[1] * factor - v)) < 1e-4
    assert np.max(np.abs(slow[2] * factor**2 - acc)) < 0.02 * np.max(np.abs(acc))


def test_the_same_tempo_is_the_same_motion(conducted):
    puppet, _, run = conducted
    again = slow_down(check_stand("six_winches", run, puppet), 1.0)
    assert again.deviation < 1e-3 and again.rms < 1e-4


def test_a_slower_run_is_simulated_and_differs(conducted):
    """The motion is not merely stretched in time: the swing keeps its period."""
    puppet, _, run = conducted
    text = (BUNDLED_STANDS_FOLDER / "six_winches.yaml").read_text(encoding="utf-8")
    tight = loads_stand(text.replace("speed: 1.2", "speed: 0.3"))
    check = check_stand(tight, run, puppet)
    assert not check.ok and check.first.quantity == "speed"
    need = max(limit.value / limit.bound for limit in check.broken)
    best, words = find_slower_tempo(check)
    assert best is not None and best.check.ok
    assert need < best.factor < 1.1 * need and f"{best.factor:.3g} times as long" in words
    assert best.run.duration == pytest.approx(5.0 * best.factor)
    speeds = [max(check.limits_of_axis(a.name)["speed"].value for a in check.axes)]
    speeds.append(max(best.check.limits_of_axis(a.name)["speed"].value for a in check.axes))
    assert speeds[0] / speeds[1] == pytest.approx(best.factor, rel=1e-3)
    # The puppet differs by millimetres, and would not if time were only stretched.
    assert best.deviation > 0.003
    f = best.factor
    rates = {name: getattr(run, name) / f for name in ("v_D", "v_K")}
    rates |= {name: getattr(run, name) / f**2 for name in ("acc_D", "acc_K")}
    stretched = replace(run, t=run.t * f, events=(), **rates)
    assert body_distances(puppet, run, stretched, best.factor)[0] < 1e-9


def test_no_tempo_makes_a_travel_longer():
    hoist = fan.loads(HOIST)
    check = check_stand(stand(**{"[0.2, 0.9]": "[0.5, 0.9]"}), lift(hoist), hoist)
    assert check.limits_of_axis("winch")["travel"].broken is not None
    best, words = find_slower_tempo(check)
    assert best is None and "the travel is too short at any tempo" in words


def test_no_tempo_holds_too_heavy_a_load_at_rest():
    hoist = fan.loads(HOIST)
    check = check_stand(stand("0.02"), lift(hoist), hoist)
    best, words = find_slower_tempo(check)
    assert best is None and "the torque of winch is still insufficient" in words
    assert check.lost["winch"].since == 0.0
