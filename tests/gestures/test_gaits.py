"""Gaits on a floor: order of legs, standing feet, and walks whose feet hardly slide."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base.documents import Orientation
from fantoccini.base.errors import StateError
from fantoccini.model import BodyMap
from fantoccini.model.body_map import Limb
from fantoccini.model.scene import Member, Scene
from fantoccini.theatre import Gait, find_gait, footfalls
from fantoccini.theatre.gaits import (
    BUNDLED_GAITS,
    PREPARATION_STEPS,
    Footfalls,
    WalkStatus,
    standing_lengths,
)
from fantoccini.theatre.gaits.gait_search import gait_cost
from fantoccini.theatre.gestures import BodyParts, Ends, Step, leg_length
from fantoccini.theatre.gestures.leg_order import gait_phases

pytestmark = pytest.mark.slow

PROMENADE = BUNDLED_GAITS["marionette"]


def body_map_with_pairs(n: int) -> BodyMap:
    """Body map with n pairs of legs."""
    legs = [Limb("leg", side, ("foot",), (0, 0, 0)) for _ in range(n) for side in ("left", "right")]
    return BodyMap(("trunk",), None, tuple(legs), (1.0, 0.0, 0.0))


def contact_slides(stage: fan.Marionette, run: fan.Trajectory, gait: Gait) -> np.ndarray:
    """(n_cycles,) largest slide of loaded contact points, after the preparation [m]."""
    cycle = np.floor(0.5 * ((run.t - run.t[0]) / gait.step_time - PREPARATION_STEPS)).astype(int)
    is_walking = cycle[:-1] >= 0
    slides = []
    for limb in BodyParts.for_puppet(stage, "pierrot").body_map.limbs:
        if limb.kind != "leg":
            continue
        points = run.contact.involving(limb.bodies[-1])
        touching = points.normal_force > 1e-6 * stage.weight
        speed = np.zeros(len(run.t))
        np.maximum.at(speed, points.sample[touching], points.sliding_speed[touching])
        slide = speed[:-1] * np.diff(run.t)
        slides.append(np.bincount(cycle[:-1][is_walking], slide[is_walking]))
    return np.max(slides, axis=0)


def test_legs_take_turns_as_their_pattern_says():
    assert gait_phases(body_map_with_pairs(1)) == {"leg_left": 0.0, "leg_right": 0.5}
    lateral = {
        "leg_hind_left": 0.0,
        "leg_front_left": 0.25,
        "leg_hind_right": 0.5,
        "leg_front_right": 0.75,
    }
    assert gait_phases(body_map_with_pairs(2)) == lateral
    diagonal = gait_phases(body_map_with_pairs(2), "trot")
    assert diagonal["leg_front_left"] == diagonal["leg_hind_right"]
    assert diagonal["leg_front_left"] != diagonal["leg_front_right"]
    pace = gait_phases(body_map_with_pairs(2), "pace")
    assert pace["leg_front_left"] == pace["leg_hind_left"] != pace["leg_hind_right"]
    tripod = gait_phases(body_map_with_pairs(3))
    first_legs = {"leg_front_left", "leg_middle_right", "leg_hind_left"}
    assert {name for name, phase in tripod.items() if phase == 0.0} == first_legs
    assert set(gait_phases(body_map_with_pairs(3), "hop").values()) == {0.0}
    with pytest.raises(StateError, match="pairs of legs"):
        gait_phases(
            dataclasses.replace(body_map_with_pairs(1), limbs=body_map_with_pairs(1).limbs[:1])
        )
    legs = body_map_with_pairs(1).limbs
    tripod_of_one_pair = dataclasses.replace(
        body_map_with_pairs(1), limbs=(*legs, dataclasses.replace(legs[0], side="middle"))
    )
    assert gait_phases(tripod_of_one_pair)["leg"] == 0.25
    assert gait_phases(tripod_of_one_pair, "hop")["leg"] == 0.0
    with pytest.raises(ValueError, match="needed: walk, trot"):
        gait_phases(body_map_with_pairs(1), "gallop")  # type: ignore[arg-type]


def test_ends_of_a_standing_leg_stand_still_and_close_up(promenade):
    ends = Ends(BodyParts.for_puppet(promenade, "pierrot"), promenade.rest())
    gait = Gait(leg_lead=0.0, body_lead=0.0, overshoot=0.0)
    walk = gait.gesture(ends, [Step(0.02)] * 6)
    assert walk.duration == pytest.approx(gait.duration(6))
    index = promenade.coordinates.v_K.index("knee_left.x")
    swing, start = 2.0 * (1.0 - gait.duty), PREPARATION_STEPS * gait.step_time
    times = start + np.linspace(swing + 0.01, 1.99, 9) * gait.step_time
    standing = np.array([walk.offsets(t)[0][index] for t in times])
    # It stands where the body is in the middle of that time.
    track = walk.offsets(start + 0.5 * (swing + 2.0) * gait.step_time)[0]
    body = promenade.coordinates.v_K.index("head.x")
    np.testing.assert_allclose(standing, track[body], atol=1e-5)
    for name in ("knee_left.x", "knee_right.x", "head.x", "hand_left.x"):
        assert walk.travel[promenade.coordinates.v_K.index(name)] == pytest.approx(0.12), name


@pytest.mark.parametrize("turn", [0.0, 1.0])
def test_it_walks_a_metre_and_its_feet_hardly_slide(promenade, turn):
    x0, steps = promenade.rest(), 38
    inputs = PROMENADE.inputs(promenade, steps, x0, turn=turn)
    run = fan.simulate(promenade, x0, inputs, method=fan.TimeStepping(dt=1e-3), save_every=5)
    feet = footfalls(BodyParts.for_puppet(promenade, "pierrot"), run, PROMENADE, steps)
    slides = contact_slides(promenade, run, PROMENADE)
    # Landings are chaotic: rounding decides in which of the cycles a foot slides by 2 mm.
    assert slides.mean() < 1e-3
    assert np.percentile(slides, 90) < 2e-3
    assert feet.slide.mean() < 1e-3
    assert np.percentile(feet.slide, 90) < 2e-3
    assert feet.status in (WalkStatus.WALKS, WalkStatus.SLIDES), feet.message
    assert feet.distance == pytest.approx(1.0, rel=0.03)  # along the arc
    start, end = (promenade.pose(run.state(i), "torso")[:2, 3] for i in (0, -1))
    chord = 2.0 * np.sin(0.5 * turn) / turn if turn else 1.0
    assert np.linalg.norm(end - start) == pytest.approx(chord, rel=0.03)
    assert feet.turn == pytest.approx(turn, abs=0.3)
    assert feet.lift[:-1].min() > 0.02
    assert feet.stands[:-1].min() > 0.5
    assert feet.upright > 0.97 and not feet.falls


@pytest.mark.parametrize(("puppet", "lift"), [("dachshund", 0.008), ("hans", 0.018)])
def test_a_puppet_walks_a_metre_keeps_its_heading_and_hardly_slides(puppet, lift):
    member = Member(name="walker", puppet=getattr(fan.puppets, puppet)().puppet)
    floor = Scene(scene="floor", floor=0.0, puppets=(member,), contact={"friction": 0.8})
    stage, gait = fan.Marionette(floor), BUNDLED_GAITS[puppet]
    body_parts, x0 = BodyParts.for_puppet(stage, "walker"), stage.rest()
    steps = int(np.ceil(1.0 / (gait.stride * leg_length(body_parts.body_map))))
    inputs = gait.inputs(stage, steps, x0)
    run = fan.simulate(stage, x0, inputs, method=fan.TimeStepping(dt=1e-3), save_every=5)
    feet = footfalls(body_parts, run, gait, steps)
    assert feet, feet.message
    assert feet.slide.mean() < 0.5e-3 and feet.max_slide < 2e-3
    assert abs(feet.turn) < np.radians(4.0)
    assert feet.lift[:-1].min() > lift


def test_a_found_gait_slides_less_and_is_kept(promenade, monkeypatch):
    first, draws = Gait(body_lead=0.0), fan.control.DrawOptions(runs=8, generations=2)
    tuned = find_gait(promenade, first, rounds=1, draws=draws)
    gait = tuned.gait
    assert (gait.pattern, gait.step_time, gait.stride) == ("walk", first.step_time, first.stride)

    def refused(*_: object, **__: object) -> None:
        raise AssertionError("a search, although the result is kept")

    monkeypatch.setattr("fantoccini.theatre.gaits.gait_search.tune", refused)
    cached = find_gait(promenade, first, rounds=1, draws=draws)
    assert cached.gait == gait
    for field in dataclasses.fields(cached.feet):
        from_cache, searched = getattr(cached.feet, field.name), getattr(tuned.feet, field.name)
        np.testing.assert_array_equal(from_cache, searched)
    assert cached.status is tuned.status and cached.feet.run_status is fan.Status.DONE


def with_leg(body_parts: BodyParts, leg: Limb) -> BodyParts:
    """The puppet with one more leg."""
    limbs = (*body_parts.body_map.limbs, leg)
    return dataclasses.replace(
        body_parts, body_map=dataclasses.replace(body_parts.body_map, limbs=limbs)
    )


def test_a_leg_in_the_middle_steps_between_the_others(promenade):
    body_parts, x0 = BodyParts.for_puppet(promenade, "pierrot"), promenade.rest()
    arm = body_parts.body_map.parts["arm_left"]
    three = with_leg(body_parts, dataclasses.replace(arm, kind="leg", side="middle"))
    gait = Gait(sway=0.05)
    walk = gait.gesture(Ends(three, x0), [Step(0.02)] * 4)
    index = promenade.coordinates.v_K.index(f"{arm.strings[0]}.x")
    start = PREPARATION_STEPS * gait.step_time
    before, after = (walk.offsets(start + t * gait.step_time)[0][index] for t in (0.5, 1.5))
    assert walk.offsets(start)[0][index] == pytest.approx(before, abs=1e-9)
    assert after > before + 0.01
    method = fan.TimeStepping(dt=2e-3)
    run = fan.simulate(promenade, x0, walk.inputs(x0), method=method, save_every=4)
    assert footfalls(three, run, gait, 4).slide.shape[1] == 3


def test_feet_without_shapes_stand_on_the_body_before_them(promenade):
    body_parts, x0 = BodyParts.for_puppet(promenade, "pierrot"), promenade.rest()
    lengths = standing_lengths(body_parts, x0)
    end = "knee_left.end"  # the massless end of a string
    legs = [
        dataclasses.replace(limb, bodies=(*limb.bodies, end)) if limb.kind == "leg" else limb
        for limb in body_parts.body_map.limbs
    ]
    body_map = dataclasses.replace(body_parts.body_map, limbs=tuple(legs))
    assert standing_lengths(dataclasses.replace(body_parts, body_map=body_map), x0) == lengths
    bare = dataclasses.replace(legs[0], kind="leg", side="middle", bodies=(end,))
    message = "it stands on leg; needed: shapes on one of its bodies, knee_left.end"
    with pytest.raises(StateError, match=message):
        standing_lengths(with_leg(body_parts, bare), x0)


@pytest.mark.parametrize(("end", "n_cycles"), [(1.0, 0), (5.0, 1), (6.8, 2)])
def test_runs_that_end_early_have_the_feet_of_whole_cycles_only(promenade, end, n_cycles):
    body_parts, x0, gait = BodyParts.for_puppet(promenade, "pierrot"), promenade.rest(), Gait()
    inputs = gait.inputs(promenade, 8, x0)  # cycles of the right leg begin at 3.15 s, 4.95 s, ...
    run = fan.simulate(promenade, x0, inputs, end, method=fan.TimeStepping(dt=2e-3), save_every=4)
    feet = footfalls(body_parts, run, gait, 8)
    assert feet.slide.shape == feet.lift.shape == feet.stands.shape == (n_cycles, 2)
    assert feet.status is WalkStatus.STOPPED and feet.run_status is fan.Status.RUNNING
    assert "has not reached its end" in feet.message


def test_puppets_stand_alike_in_every_direction():
    dog, lengths = fan.puppets.dachshund().puppet, []
    for turn in ("0 deg", "90 deg"):
        heading = Orientation(axis=(0, 0, 1), angle=turn)
        member = Member(name="dog", puppet=dog, at=(0.3, 0.2, 0.0), orientation=heading)
        stage = fan.Marionette(Scene(scene="floor", floor=0.0, puppets=(member,)))
        lengths.append(standing_lengths(BodyParts.for_puppet(stage, "dog"), stage.rest()))
    assert lengths[1] == pytest.approx(lengths[0], abs=1e-5)


def test_steps_on_the_spot_are_searched_and_may_not_leave_it(promenade):
    draws = fan.control.DrawOptions(runs=3, generations=1)
    tuned = find_gait(promenade, Gait(stride=0.0), rounds=1, draws=draws)
    assert tuned.feet.wanted_distance == 0.0
    assert abs(tuned.feet.distance) < 0.02
    assert np.isfinite(tuned.feet.distance_error)


def test_a_walk_backward_is_not_a_walk_forward(promenade):
    x0, steps = promenade.rest(), 6
    inputs = dataclasses.replace(PROMENADE, stride=-0.1).inputs(promenade, steps, x0)
    run = fan.simulate(promenade, x0, inputs, method=fan.TimeStepping(dt=2e-3), save_every=4)
    body_parts = BodyParts.for_puppet(promenade, "pierrot")
    backward = footfalls(body_parts, run, dataclasses.replace(PROMENADE, stride=-0.1), steps)
    assert backward.wanted_distance < 0.0
    assert backward.distance == pytest.approx(backward.wanted_distance, abs=0.02)
    forward = footfalls(body_parts, run, PROMENADE, steps)
    assert forward.distance == backward.distance and forward.status is WalkStatus.OFF_DISTANCE
    assert gait_cost(body_parts, run, PROMENADE, steps) > 20.0


def test_a_gait_that_does_not_walk_has_that_status_also_from_the_cache(promenade):
    draws = fan.control.DrawOptions(runs=3, generations=1)
    for _ in range(2):
        tuned = find_gait(promenade, Gait(stride=0.6), rounds=1, draws=draws)
        assert not tuned and tuned.status is not WalkStatus.WALKS
        assert tuned.status.name in repr(tuned) and "slide" in tuned.message


@pytest.mark.parametrize(
    ("changes", "status"),
    [
        ({}, WalkStatus.WALKS),
        ({"slide": np.full((2, 2), 3e-3)}, WalkStatus.SLIDES),
        ({"stands": np.full((2, 2), 0.2)}, WalkStatus.HOVERS),
        ({"distance": 0.9, "distance_error": 0.1}, WalkStatus.OFF_DISTANCE),
        ({"upright": 0.5}, WalkStatus.FALLS),
        ({"run_status": fan.Status.TENSION_CAP}, WalkStatus.STOPPED),
    ],
)
def test_footfalls_show_whether_the_puppet_walks(changes, status):
    rows = np.full((2, 2), 1e-3), np.full((2, 2), 0.02), np.full((2, 2), 0.6)
    feet = Footfalls(*rows, 1.0, 1.0, 0.0, 0.0, 0.99, fan.Status.DONE)
    changed = dataclasses.replace(feet, **changes)
    assert changed.status is status
    assert bool(changed) == (status is WalkStatus.WALKS)
    assert status.message in changed.message


def test_stages_and_numbers_that_do_not_fit_are_refused(promenade, marionette):
    with pytest.raises(StateError, match="cannot touch a floor"):
        find_gait(marionette)
    with pytest.raises(ValueError, match="at least 1"):
        Gait().inputs(promenade, 0)
    with pytest.raises(ValueError, match=r"duty is 0\.2; allowed: 0\.25 to 0\.9"):
        Gait(duty=0.2)
    with pytest.raises(StateError, match=r"no limbs|pairs of legs|body map"):
        Gait().inputs(fan.puppets.arm2d(), 4)
