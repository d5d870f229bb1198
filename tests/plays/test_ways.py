"""Paths past tables and players: exact ends, no collisions, and reasons for missing paths.

Collisions are tested with independent distances, at samples of 7 ms.
"""

from __future__ import annotations

import dataclasses
from time import perf_counter

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.theatre.cast.footing import Footing, Hindrance, NoWay, Way
from fantoccini.theatre.gestures.body_parts import BodyParts
from fantoccini.theatre.gestures.ends import Ends
from fantoccini.theatre.gestures.walking import SWAY, step_gesture
from fantoccini.theatre.ways.regions import Box, Disk, Rectangle
from fantoccini.theatre.ways.traffic import Other
from fantoccini.theatre.ways.ways import find_way

pytestmark = pytest.mark.medium

SPACE = Rectangle((-1.5, -1.0), (1.5, 1.0))
RADIUS, STEP_TIME, LONGEST = 0.15, 0.6, 0.08
TABLE = Box("table", (0.0, 0.0), (0.2, 0.3), 0.3)
GATE = (Box("wall", (0.0, 0.6), (0.05, 0.4)), Box("wall", (0.0, -0.6), (0.05, 0.4)))
WEST, EAST = Footing(-1.0, 0.0, 0.0), Footing(1.0, 0.0, 0.0)


def found(start: Footing, goal: Footing, **given) -> Way | NoWay:
    settings = dict(
        begin=0.0,
        step_time=STEP_TIME,
        longest_step=LONGEST,
        radius=RADIUS,
        space=SPACE,
        latest_begin=3.0,
    )
    return find_way(start, goal, **(settings | given))


def other(name: str, way: Way) -> Other:
    t = np.arange(way.begin, way.end + 0.02, 0.02)
    return Other(name, t, way.footing(t)[0], RADIUS)


def straight(name: str, first, last, begin: float, end: float) -> Other:
    return Other(name, np.array([begin, end]), np.array([first, last], dtype=float), RADIUS)


def closest(way: Way, blocked, others, begin: float = 0.0) -> float:
    """Least distance between disks, and to obstacles, from the beginning until all stand."""
    last = max([way.end, *(float(walker.times[-1]) for walker in others)])
    t = np.arange(begin, last + 1.0, 0.007)
    p, _ = way.footing(t)
    assert np.all(p >= np.array(SPACE.low) - 1e-6) and np.all(p <= np.array(SPACE.high) + 1e-6)
    gaps = [np.inf]
    for walker in others:
        q = np.array([np.interp(t, walker.times, walker.xy[:, k]) for k in (0, 1)]).T
        gaps.append(np.min(np.hypot(*(p - q).T)) - RADIUS - walker.radius)
    for region in blocked:
        rel = p - np.array(region.centre)
        if isinstance(region, Box):
            c, s = np.cos(region.yaw), np.sin(region.yaw)
            own = np.abs(rel @ np.array([[c, -s], [s, c]])) - np.array(region.half)
            gap = np.hypot(*np.maximum(own, 0.0).T) + np.minimum(np.max(own, axis=1), 0.0)
        else:
            gap = np.hypot(*rel.T) - region.radius
        gaps.append(np.min(gap) - RADIUS)
    return float(min(gaps))


def check(way: Way | NoWay, goal: Footing, blocked=(), others=(), begin: float = 0.0) -> Way:
    assert isinstance(way, Way), way
    xy, heading = way.footing(np.array([way.end]))
    np.testing.assert_allclose(xy[0], (goal.x, goal.y), atol=1e-9)
    assert np.exp(1j * heading[0]) == pytest.approx(np.exp(1j * goal.heading), abs=1e-9)
    assert closest(way, blocked, others, begin) >= -2e-5
    for step in way.steps:
        assert 0.0 <= step.length <= LONGEST + 1e-9
        assert abs(step.turn) <= np.radians(36.0) + 1e-6
        assert step.length == 0.0 or step.turn == 0.0
    return way


def test_without_obstacles_the_path_is_straight():
    way = check(found(WEST, EAST), EAST)
    assert way.begin == 0.0 and len(way.steps) == 25
    assert way.length == pytest.approx(2.0)
    about = check(found(WEST, Footing(-1.0, 0.0, np.pi)), Footing(-1.0, 0.0, np.pi))
    assert len(about.steps) == 8 and about.length == 0.0
    assert found(WEST, WEST) == Way(WEST, 0.0, (), STEP_TIME)


def test_turns_are_eight_to_half_a_turn_and_walks_between():
    goal = Footing(-1.0, 0.16, np.pi)
    way = check(found(WEST, goal), goal)
    kinds = "".join("t" if step.turn else "w" for step in way.steps)
    assert kinds == "ttttwwtttt"


def test_a_path_is_walked_as_planned():
    """The gesture's ends follow the path's footing, turned to the start's heading."""
    puppet, start, goal = fan.puppets.marionette(), Footing(-1.0, 0.2, 0.7), Footing(0.9, 0.1, 2.0)
    way = check(found(start, goal, blocked=[TABLE]), goal, [TABLE])
    gesture = step_gesture(
        Ends(BodyParts.for_puppet(puppet), puppet.rest()), way.steps, way.step_time
    )
    v_K = puppet.coordinates.v_K
    for t in np.linspace(0.0, gesture.duration, 400):
        d, _ = gesture.offsets(t)
        x, y = (
            0.5 * sum(d[v_K.index(f"shoulder_{s}.{p}")] for s in ("left", "right")) for p in "xy"
        )
        planned, _ = way.footing(np.array([way.begin + t]))
        walked = start.place + np.exp(1j * start.heading) * complex(x, y)
        assert abs(walked - complex(*planned[0])) <= SWAY + 1e-5
    # At its end there is no sway.
    assert walked == pytest.approx(goal.place, abs=1e-9)


def test_it_goes_round_a_table():
    goal = Footing(1.0, 0.1, np.pi)
    way = check(found(WEST, goal, blocked=[TABLE]), goal, [TABLE])
    assert 2.0 < way.length < 2.3
    for region in (Box("bench", (0.0, 0.05), (0.02, 0.3), 1.2), Disk("well", (0.1, 0.0), 0.2)):
        check(found(WEST, goal, blocked=[region]), goal, [region])


def test_two_change_places():
    first = check(found(WEST, EAST), EAST)
    pierrot, home = other("pierrot", first), Footing(-1.0, 0.0, np.pi)
    second = check(found(EAST, home, others=[pierrot]), home, others=[pierrot])
    assert second.end < first.end + 10.0


def test_it_waits_at_a_place_for_one():
    blocks = straight("columbine", (0.0, 0.0), (0.6, 0.6), 6.0, 9.0)
    waits = check(found(WEST, EAST, blocked=GATE, others=[blocks]), EAST, GATE, [blocks])
    assert any(step.stands for step in waits.steps) or waits.begin > 0.0
    assert waits.end > found(WEST, EAST, blocked=GATE).end


def test_it_begins_later_only_if_allowed():
    start, goal = Footing(-0.25, 0.0), Footing(0.25, 0.0)
    leaves = straight("columbine", (0.25, 0.0), (1.25, 0.0), 4.0, 8.0)
    later, now = (
        check(found(start, goal, others=[leaves], latest_begin=t), goal, others=[leaves])
        for t in (10.0, 0.0)
    )
    assert now.begin == 0.0 and later.end == pytest.approx(now.end)
    waiting = [step.stands for step in now.steps].index(False)
    assert later.begin == pytest.approx(waiting * STEP_TIME)


def test_it_steps_out_of_the_way_of_others():
    """Another player passes first through its place at the goal."""
    passes = straight("columbine", (1.0, 0.0), (-1.0, 0.0), 3.0, 15.0)
    start = Footing(0.0, 0.0)
    way = check(found(start, start, others=[passes]), start, others=[passes])
    assert way.length > 0.5


@pytest.mark.parametrize(
    ("goal", "given", "kind", "text"),
    [
        (Footing(0.1, 0.1), {"blocked": [TABLE]}, Hindrance.GOAL_BLOCKED, "table is there"),
        (Footing(0.1, 1.1), {}, Hindrance.GOAL_OUTSIDE, "0.10 m outside of the hands' space"),
        (
            EAST,
            {"others": [straight("columbine", (0, 0.5), (1, 0.1), 0, 9)]},
            Hindrance.GOAL_OCCUPIED,
            "columbine stands there when it would arrive",
        ),
        (
            EAST,
            {"others": [straight("columbine", (1, 0.1), (1, 0.1), 0, 9)]},
            Hindrance.GOAL_OCCUPIED,
            "columbine stands there",
        ),
        (
            EAST,
            {
                "blocked": [
                    Box("cage", (1.0, 0.3), (0.5, 0.02)),
                    Box("cage", (1.0, -0.3), (0.5, 0.02)),
                    Box("door", (0.6, 0.0), (0.02, 0.3)),
                ]
            },
            Hindrance.NO_WAY_ROUND,
            "no way leads round cage and door",
        ),
        (
            EAST,
            {"blocked": GATE, "others": [straight("columbine", (0, 0), (0, 0), 0, 1)]},
            Hindrance.NO_WAY_ROUND,
            "no way leads round columbine",
        ),
        (
            EAST,
            {"blocked": GATE, "others": [straight("columbine", (0.4, 0), (0, 0), 0, 2)]},
            Hindrance.OTHERS_IN_THE_WAY,
            "columbine is in the way, and no way leads past",
        ),
    ],
)
def test_a_missing_path_has_a_reason_and_a_place_nearby(goal, given, kind, text):
    nothing = found(WEST, goal, **given)
    assert isinstance(nothing, NoWay) and not nothing
    assert nothing.kind is kind and text in nothing.reason
    nearest = nothing.nearest
    assert nearest is not None and nearest.heading == goal.heading
    way = check(
        found(WEST, nearest, **given), nearest, given.get("blocked", ()), given.get("others", ())
    )
    assert way.length > 0.0 and abs(nearest.place - goal.place) < 1.3


def test_too_long_a_wait_names_its_end():
    blocks = straight("columbine", (0.0, 0.0), (0.6, 0.6), 100.0, 105.0)
    late = found(WEST, EAST, blocked=GATE, others=[blocks])
    assert isinstance(late, NoWay) and late.kind is Hindrance.OTHERS_IN_THE_WAY
    assert late.earliest is not None and 100.0 < late.earliest < 125.0
    again = found(WEST, EAST, blocked=GATE, others=[blocks], begin=90.0, latest_begin=110.0)
    assert check(again, EAST, GATE, [blocks], 90.0).end <= late.earliest + STEP_TIME


def test_a_path_cannot_start_at_an_impossible_place():
    """The reason has the distance and the needed one, both from the puppet's middle."""
    post = Box("post", (0.0, 0.0), (0.2, 0.3))
    for start, options, reason in (
        (Footing(0.32, 0.1), {"blocked": [post]}, "post at the start: its middle is 0.120 m from"),
        (
            WEST,
            {"others": [straight("columbine", (-1, 0.2), (1, 0.2), 0, 9)]},
            "columbine at the start: its middle is 0.050 m from",  # 0.2 m less her radius
        ),
        (Footing(-2.0, 0.0), {}, "outside of the hands' space"),
    ):
        nothing = found(start, EAST, **options)
        assert isinstance(nothing, NoWay) and nothing.kind is Hindrance.START_BLOCKED
        assert reason in nothing.reason
        assert not options or nothing.reason.endswith(f"needed: {RADIUS:.3f} m")


def test_touching_disks_may_part_and_meet():
    start, goal = Footing(-0.3, 0.0), Footing(0.0, 0.3)
    beside = straight("columbine", (0.0, 0.0), (0.0, 0.0), 0.0, 1.0)
    check(found(start, goal, others=[beside]), goal, others=[beside])


def test_the_same_stage_has_the_same_path():
    walks = [
        straight("pierrot", (1.0, 0.5), (-1.0, 0.5), 0.0, 15.0),
        straight("columbine", (0.3, -0.9), (0.3, 0.9), 0.0, 15.0),
    ]
    first, second = (found(WEST, EAST, blocked=[TABLE], others=walks) for _ in range(2))
    assert dataclasses.asdict(check(first, EAST, [TABLE], walks)) == dataclasses.asdict(second)


def test_a_hundred_paths_past_others_never_touch_any():
    rng = np.random.default_rng(3)
    ways, waited, took = 0, 0, []

    def footing() -> Footing:
        return Footing(*rng.uniform((-1.4, -0.9, -3.0), (1.4, 0.9, 3.0)))

    for case in range(100):
        blocked = [
            Box(
                "table",
                tuple(rng.uniform(-0.6, 0.6, 2)),
                tuple(rng.uniform(0.05, 0.3, 2)),
                rng.uniform(-3.0, 3.0),
            )
        ]
        if case % 3 == 0:
            blocked.append(Disk("well", tuple(rng.uniform(-0.9, 0.9, 2)), rng.uniform(0.05, 0.2)))
        others: list[Other] = []
        for name in ("pierrot", "columbine", "arlecchino")[: 2 + case % 2]:
            start, goal, begin = footing(), footing(), rng.uniform(0.0, 4.0)
            way = found(start, goal, blocked=blocked, begin=begin, others=others)
            if isinstance(way, Way):
                others.append(other(name, way))
        start, goal = footing(), footing()
        now = perf_counter()
        way = found(start, goal, blocked=blocked, others=others)
        took.append(perf_counter() - now)
        if isinstance(way, Way):
            check(way, goal, blocked, others)
            ways += 1
            waited += way.begin > 0.0 or any(step.stands for step in way.steps)
    print(
        f"{ways} ways, {waited} wait; {1e3 * np.median(took):.0f} ms, at most "
        f"{1e3 * np.max(took):.0f} ms"
    )
    assert ways > 40 and waited > 5


def test_others_must_fit_their_times():
    with pytest.raises(ValueError, match="columbine"):
        Other("columbine", np.zeros(3), np.zeros((2, 2)), RADIUS)
    with pytest.raises(ValueError, match="radius"):
        found(WEST, EAST, radius=0.0)
