"""Live on a stage with contact: feet follow, and no motion of the hands breaks it."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan

pytestmark = pytest.mark.slow

CARRYING = ("head", "shoulder_left", "shoulder_right")
MAX_ENERGY_GAIN = 12.0
"""Largest gain of energy, relative to the weight times 1 m; as for puppets without contact."""


def place(live, body):
    """(3, 4) pose of a body."""
    x = live.state
    return live.marionette.poses(x.q_D, x.q_K)[live.marionette.link_index(body)]


def feet(live):
    """(2, 3) middles of the soles [m]."""
    poses = [place(live, f"shin_{side}") for side in ("left", "right")]
    return np.array([pose[:, 3] + pose[:, :3] @ [0.007, 0.0, -0.141] for pose in poses])


def test_the_feet_of_a_dragged_puppet_follow_on_the_floor():
    live = fan.Performance(fan.puppets.promenade())
    begin, weight = feet(live)[:, 0].copy(), live.marionette.weight
    homes = {h.name: live.place(h.name)[0] for h in live.handles}
    carried, gaps, upright = [], [], []
    for k in range(420):
        for name, home in homes.items():
            live.move(name, home + np.array([min(0.5, 0.5 * k / 360), 0.0, 0.0]))
        live.advance(1 / 60)
        contacts = live.contact.involving("floor")
        carried.append(contacts.force[:, 2].sum() / weight)
        gaps.append(contacts.gap.min(initial=0.0))
        upright.append(place(live, "torso")[2, 2])
    live.advance(2.0)
    assert live.lagging == {}
    went = feet(live)[:, 0] - begin
    # They slide along behind: friction holds them until the strings slant enough.
    assert np.all((went > 0.36) & (went < 0.52))
    assert np.mean(np.array(carried) > 0.02) > 0.5
    assert min(gaps) > -1e-3
    assert np.degrees(np.arccos(min(upright))) < 25.0
    assert feet(live)[:, 2].min() > -1e-3


def test_one_hand_drags_the_bar_along_and_the_feet_follow():
    live = fan.Performance(fan.puppets.stroll())
    assert [handle.name for handle in live.handles] == ["bar"]
    begin, (home, _) = feet(live)[:, 0].copy(), live.place("bar")
    upright, gaps = [], []
    for k in range(420):
        live.move("bar", home + np.array([min(0.5, 0.5 * k / 360), 0.0, 0.0]))
        live.advance(1 / 60)
        gaps.append(live.contact.involving("floor").gap.min(initial=0.0))
        upright.append(place(live, "torso")[2, 2])
    live.advance(2.0)
    assert live.lagging == {}
    went = feet(live)[:, 0] - begin
    assert np.all((went > 0.36) & (went < 0.52))
    assert min(gaps) > -1e-3
    assert np.degrees(np.arccos(min(upright))) < 25.0


def test_a_released_puppet_falls_on_the_floor_and_stands_up_again():
    live = fan.Performance(fan.puppets.promenade())
    before = {name: live.length(name) for name in live.lengths}
    for name in live.lengths:
        live.wind(name, 2.0)
    live.advance(4.0)
    heap = live.contact.involving("floor")
    held = heap.force[:, 2].sum() + live.tension[:7].sum()  # the head's string is just long enough
    assert held == pytest.approx(live.marionette.weight, rel=0.02)
    assert heap.force[:, 2].sum() > 0.9 * live.marionette.weight
    assert place(live, "torso")[2, 3] < 0.15
    assert heap.gap.min() > -2e-3
    for name, length in before.items():
        live.wind(name, length)
    live.advance(6.0)
    assert place(live, "torso")[2, 3] > 0.33
    assert place(live, "torso")[2, 2] > 0.95


@pytest.mark.parametrize(("name", "throws", "seed"), [("promenade", 60, 1), ("visit", 12, 2)])
def test_a_thrown_puppet_stays_finite_and_above_the_floor(name, throws, seed):
    marionette, rng = getattr(fan.puppets, name)(), np.random.default_rng(seed)
    live = fan.Performance(marionette)
    homes = {h.name: live.place(h.name)[0] for h in live.handles}
    before, max_gain = sum(marionette.energies(live.state)), 0.0
    for throw in range(throws):
        # Directions: to the floor, to the other puppet, and random.
        aim = np.array([0.5, 0.0, -0.5]) if throw % 3 == 0 else rng.normal(size=3)
        for handle, home in homes.items():
            there = home + (10.0 * aim / np.linalg.norm(aim) if throw % 2 == 0 else 0.0)
            live.move(handle, there)
        for string, ends in live.lengths.items():
            live.wind(string, rng.choice(ends))
        for _ in range(40):
            x = live.step()
            for part in (x.q_D, x.v_D, x.q_K, x.v_K, x.slip, live.tension, live.contact.force):
                assert np.all(np.isfinite(part))
            assert not any("stopped" in why for why in live.lagging.values()), live.lagging
            max_gain = max(max_gain, sum(marionette.energies(x)) - before)
            assert live.contact.involving("floor").gap.min(initial=0.0) > -0.02
    assert max_gain < MAX_ENERGY_GAIN * marionette.weight
    t = live.t
    live.advance(0.5)
    assert live.t == pytest.approx(t + 0.5, abs=1e-6)


def test_a_recording_on_a_stage_replays_to_the_last_bit():
    live = fan.Performance(fan.puppets.promenade())
    live.record()
    for name in CARRYING:
        live.move(name, live.place(name)[0] + np.array([0.05, 0.0, 0.0]))
    live.advance(0.5)
    recording = live.stop()
    assert len(recording.trajectory.contact) > 0
    assert np.array_equal(recording.replay().q_D, recording.trajectory.q_D)


def test_hands_bring_back_a_puppet_that_stands():
    """Its torso is pulled aside and released; alone it would continue to swing."""
    swings = []
    for balanced in (False, True):
        live = fan.Performance(fan.puppets.promenade())
        begin = place(live, "torso")[:, 3]
        if balanced:
            law = fan.theatre.Balance(live)
            live.set_hand_law(law)
        live.push("torso", [1.5, 0.5, 0.0])
        live.advance(0.4)
        live.push("torso", None)
        live.advance(1.0)
        distances = []
        for _ in range(40):
            live.advance(0.02)
            distances.append(float(np.linalg.norm(place(live, "torso")[:, 3] - begin)))
        swings.append(max(distances))
    assert swings[0] > 0.03
    assert swings[1] < 0.4 * swings[0]
    assert law.message == "" and law.mpc is not None and law.mpc.updates > 100
