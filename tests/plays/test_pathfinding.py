"""Paths past tables and players: exact ends, no collisions, and reasons for missing paths.

Collisions are tested with independent distances, at samples of 7 ms.
"""

from __future__ import annotations

import dataclasses
from time import perf_counter

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.theatre.cast.footing import Footing, Hindrance, NoPath, Walk
from fantoccini.theatre.gestures.body_parts import BodyParts
from fantoccini.theatre.gestures.ends import Ends
from fantoccini.theatre.gestures.walking import SWAY, step_gesture
from fantoccini.theatre.pathfinding.planning import plan_walk
from fantoccini.theatre.pathfinding.regions import Box, Disk, Rectangle
from fantoccini.theatre.pathfinding.traffic import OtherPlayer

pytestmark = pytest.mark.medium

SPACE = Rectangle((-1.5, -1.0), (1.5, 1.0))
RADIUS, STEP_TIME, LONGEST_STEP = 0.15, 0.6, 0.08
TABLE = Box("table", (0.0, 0.0), (0.2, 0.3), 0.3)
GATE_WALLS = (Box("wall", (0.0, 0.6), (0.05, 0.4)), Box("wall", (0.0, -0.6), (0.05, 0.4)))
WEST, EAST = Footing(-1.0, 0.0, 0.0), Footing(1.0, 0.0, 0.0)


def plan_or_reason(start: Footing, goal: Footing, **options) -> Walk | NoPath:
    settings = dict(
        begin=0.0,
        step_time=STEP_TIME,
        longest_step=LONGEST_STEP,
        radius=RADIUS,
        space=SPACE,
        latest_begin=3.0,
    )
    return plan_walk(start, goal, **(settings | options))


def player_on(name: str, walk: Walk) -> OtherPlayer:
    t = np.arange(walk.begin, walk.end + 0.02, 0.02)
    return OtherPlayer(name, t, walk.footing(t)[0], RADIUS)


def straight_walker(name: str, first, last, begin: float, end: float) -> OtherPlayer:
    return OtherPlayer(name, np.array([begin, end]), np.array([first, last], dtype=float), RADIUS)


def least_gap(walk: Walk, blocked, others, begin: float = 0.0) -> float:
    """Least distance between disks, and to obstacles, from the beginning until all stand."""
    last_time = max([walk.end, *(float(walker.times[-1]) for walker in others)])
    t = np.arange(begin, last_time + 1.0, 0.007)
    places, _ = walk.footing(t)
    assert np.all(places >= np.array(SPACE.lower) - 1e-6) and np.all(
        places <= np.array(SPACE.upper) + 1e-6
    )
    gaps = [np.inf]
    for walker in others:
        other_places = np.array([np.interp(t, walker.times, walker.xy[:, k]) for k in (0, 1)]).T
        gaps.append(np.min(np.hypot(*(places - other_places).T)) - RADIUS - walker.radius)
    for region in blocked:
        offsets = places - np.array(region.centre)
        if isinstance(region, Box):
            c, s = np.cos(region.yaw), np.sin(region.yaw)
            outside = np.abs(offsets @ np.array([[c, -s], [s, c]])) - np.array(region.half_sizes)
            gap = np.hypot(*np.maximum(outside, 0.0).T) + np.minimum(np.max(outside, axis=1), 0.0)
        else:
            gap = np.hypot(*offsets.T) - region.radius
        gaps.append(np.min(gap) - RADIUS)
    return float(min(gaps))


def check_walk(
    walk: Walk | NoPath, goal: Footing, blocked=(), others=(), begin: float = 0.0
) -> Walk:
    assert isinstance(walk, Walk), walk
    xy, heading = walk.footing(np.array([walk.end]))
    np.testing.assert_allclose(xy[0], (goal.x, goal.y), atol=1e-9)
    assert np.exp(1j * heading[0]) == pytest.approx(np.exp(1j * goal.heading), abs=1e-9)
    assert least_gap(walk, blocked, others, begin) >= -2e-5
    for step in walk.steps:
        assert 0.0 <= step.length <= LONGEST_STEP + 1e-9
        assert abs(step.turn) <= np.radians(36.0) + 1e-6
        assert step.length == 0.0 or step.turn == 0.0
    return walk


def test_without_obstacles_the_path_is_straight():
    walk = check_walk(plan_or_reason(WEST, EAST), EAST)
    assert walk.begin == 0.0 and len(walk.steps) == 25
    assert walk.length == pytest.approx(2.0)
    half_turn = check_walk(
        plan_or_reason(WEST, Footing(-1.0, 0.0, np.pi)), Footing(-1.0, 0.0, np.pi)
    )
    assert len(half_turn.steps) == 8 and half_turn.length == 0.0
    assert plan_or_reason(WEST, WEST) == Walk(WEST, 0.0, (), STEP_TIME)


def test_half_a_turn_takes_eight_steps():
    goal = Footing(-1.0, 0.16, np.pi)
    walk = check_walk(plan_or_reason(WEST, goal), goal)
    kinds = "".join("t" if step.turn else "w" for step in walk.steps)
    assert kinds == "ttttwwtttt"


def test_a_path_is_walked_as_planned():
    """The gesture's ends follow the path's footing, turned to the start's heading."""
    puppet, start, goal = fan.puppets.marionette(), Footing(-1.0, 0.2, 0.7), Footing(0.9, 0.1, 2.0)
    walk = check_walk(plan_or_reason(start, goal, blocked=[TABLE]), goal, [TABLE])
    gesture = step_gesture(
        Ends(BodyParts.for_puppet(puppet), puppet.rest()), walk.steps, walk.step_time
    )
    v_K = puppet.coordinates.v_K
    for t in np.linspace(0.0, gesture.duration, 400):
        d, _ = gesture.offsets(t)
        x, y = (
            0.5 * sum(d[v_K.index(f"shoulder_{s}.{p}")] for s in ("left", "right")) for p in "xy"
        )
        planned_place, _ = walk.footing(np.array([walk.begin + t]))
        walked_place = start.place + np.exp(1j * start.heading) * complex(x, y)
        assert abs(walked_place - complex(*planned_place[0])) <= SWAY + 1e-5
    # At its end there is no sway.
    assert walked_place == pytest.approx(goal.place, abs=1e-9)


def test_a_walk_leads_round_a_table():
    goal = Footing(1.0, 0.1, np.pi)
    walk = check_walk(plan_or_reason(WEST, goal, blocked=[TABLE]), goal, [TABLE])
    assert 2.0 < walk.length < 2.3
    for region in (Box("bench", (0.0, 0.05), (0.02, 0.3), 1.2), Disk("well", (0.1, 0.0), 0.2)):
        check_walk(plan_or_reason(WEST, goal, blocked=[region]), goal, [region])


def test_two_puppets_change_places():
    first_walk = check_walk(plan_or_reason(WEST, EAST), EAST)
    pierrot, goal = player_on("pierrot", first_walk), Footing(-1.0, 0.0, np.pi)
    second_walk = check_walk(plan_or_reason(EAST, goal, others=[pierrot]), goal, others=[pierrot])
    assert second_walk.end < first_walk.end + 10.0


def test_a_puppet_waits_for_another():
    blocking_player = straight_walker("columbine", (0.0, 0.0), (0.6, 0.6), 6.0, 9.0)
    waiting_walk = check_walk(
        plan_or_reason(WEST, EAST, blocked=GATE_WALLS, others=[blocking_player]),
        EAST,
        GATE_WALLS,
        [blocking_player],
    )
    assert any(step.stands for step in waiting_walk.steps) or waiting_walk.begin > 0.0
    assert waiting_walk.end > plan_or_reason(WEST, EAST, blocked=GATE_WALLS).end


@pytest.mark.parametrize("latest_begin", [0.0, 30.0])
def test_a_puppet_pauses_before_and_after_each_straight_part(latest_begin):
    """Pauses are those of a walk on the floor, and do not count as a wait for others."""
    before, after = 3, 2
    other = straight_walker("pierrot", (-0.4, -0.9), (-0.4, 0.9), 5.0, 12.0)
    walk = plan_or_reason(
        WEST,
        EAST,
        blocked=[TABLE],
        others=[other],
        pauses=(before, after),
        latest_begin=latest_begin,
    )
    check_walk(walk, EAST, [TABLE], [other])
    assert len(walk.straight_parts) > 1
    for first, n in walk.straight_parts:
        pauses = *walk.steps[first - before : first], *walk.steps[first + n : first + n + after]
        assert len(pauses) == before + after and all(step.stands for step in pauses)
    if latest_begin:
        assert not walk.steps[0].stands or walk.straight_parts[0][0] == before


@pytest.mark.parametrize(("pauses", "n_steps"), [((0, 0), 4), ((3, 2), 7)])
def test_turns_of_a_puppet_that_is_lowered_are_slower(pauses, n_steps):
    goal = Footing(-1.0, 0.0, 0.5 * np.pi)
    walk = check_walk(plan_or_reason(WEST, goal, pauses=pauses), goal)
    assert len(walk.steps) == n_steps and walk.move_time == walk.begin


def test_a_walk_begins_later_only_if_allowed():
    start, goal = Footing(-0.25, 0.0), Footing(0.25, 0.0)
    leaving_player = straight_walker("columbine", (0.25, 0.0), (1.25, 0.0), 4.0, 8.0)
    delayed_walk, immediate_walk = (
        check_walk(
            plan_or_reason(start, goal, others=[leaving_player], latest_begin=t),
            goal,
            others=[leaving_player],
        )
        for t in (10.0, 0.0)
    )
    assert immediate_walk.begin == 0.0 and delayed_walk.end == pytest.approx(immediate_walk.end)
    n_waiting_steps = [step.stands for step in immediate_walk.steps].index(False)
    assert delayed_walk.begin == pytest.approx(n_waiting_steps * STEP_TIME)


def test_a_puppet_steps_out_of_the_way_of_others():
    """Another player passes first through its place at the goal."""
    passing_player = straight_walker("columbine", (1.0, 0.0), (-1.0, 0.0), 3.0, 15.0)
    start = Footing(0.0, 0.0)
    walk = check_walk(
        plan_or_reason(start, start, others=[passing_player]), start, others=[passing_player]
    )
    assert walk.length > 0.5


@pytest.mark.parametrize(
    ("goal", "options", "kind", "text"),
    [
        (Footing(0.1, 0.1), {"blocked": [TABLE]}, Hindrance.GOAL_BLOCKED, "table is there"),
        (Footing(0.1, 1.1), {}, Hindrance.GOAL_OUTSIDE, "0.10 m outside of the hands' space"),
        (
            EAST,
            {"others": [straight_walker("columbine", (0, 0.5), (1, 0.1), 0, 9)]},
            Hindrance.GOAL_OCCUPIED,
            "columbine stands there when it would arrive",
        ),
        (
            EAST,
            {"others": [straight_walker("columbine", (1, 0.1), (1, 0.1), 0, 9)]},
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
            {"blocked": GATE_WALLS, "others": [straight_walker("columbine", (0, 0), (0, 0), 0, 1)]},
            Hindrance.NO_WAY_ROUND,
            "no way leads round columbine",
        ),
        (
            EAST,
            {
                "blocked": GATE_WALLS,
                "others": [straight_walker("columbine", (0.4, 0), (0, 0), 0, 2)],
            },
            Hindrance.OTHERS_IN_THE_WAY,
            "columbine is in the way, and no way leads past",
        ),
    ],
)
def test_a_missing_path_has_a_reason_and_a_place_nearby(goal, options, kind, text):
    failure = plan_or_reason(WEST, goal, **options)
    assert isinstance(failure, NoPath) and not failure
    assert failure.kind is kind and text in failure.reason
    nearest = failure.nearest
    assert nearest is not None and nearest.heading == goal.heading
    walk = check_walk(
        plan_or_reason(WEST, nearest, **options),
        nearest,
        options.get("blocked", ()),
        options.get("others", ()),
    )
    assert walk.length > 0.0 and abs(nearest.place - goal.place) < 1.3


def test_too_long_a_wait_is_reported_with_its_end():
    blocking_player = straight_walker("columbine", (0.0, 0.0), (0.6, 0.6), 100.0, 105.0)
    failure = plan_or_reason(WEST, EAST, blocked=GATE_WALLS, others=[blocking_player])
    assert isinstance(failure, NoPath) and failure.kind is Hindrance.OTHERS_IN_THE_WAY
    assert failure.earliest is not None and 100.0 < failure.earliest < 125.0
    later_walk = plan_or_reason(
        WEST, EAST, blocked=GATE_WALLS, others=[blocking_player], begin=90.0, latest_begin=110.0
    )
    assert (
        check_walk(later_walk, EAST, GATE_WALLS, [blocking_player], 90.0).end
        <= failure.earliest + STEP_TIME
    )


def test_a_path_cannot_start_at_an_impossible_place():
    """The reason has the distance and the needed one, both from the puppet's middle."""
    post = Box("post", (0.0, 0.0), (0.2, 0.3))
    for start, options, reason in (
        (Footing(0.32, 0.1), {"blocked": [post]}, "post at the start: its middle is 0.120 m from"),
        (
            WEST,
            {"others": [straight_walker("columbine", (-1, 0.2), (1, 0.2), 0, 9)]},
            "columbine at the start: its middle is 0.050 m from",  # 0.2 m less her radius
        ),
        (Footing(-2.0, 0.0), {}, "outside of the hands' space"),
    ):
        failure = plan_or_reason(start, EAST, **options)
        assert isinstance(failure, NoPath) and failure.kind is Hindrance.START_BLOCKED
        assert reason in failure.reason
        assert not options or failure.reason.endswith(f"needed: {RADIUS:.3f} m")


def test_touching_disks_may_part_and_meet():
    start, goal = Footing(-0.3, 0.0), Footing(0.0, 0.3)
    neighbour = straight_walker("columbine", (0.0, 0.0), (0.0, 0.0), 0.0, 1.0)
    check_walk(plan_or_reason(start, goal, others=[neighbour]), goal, others=[neighbour])


def test_the_same_stage_has_the_same_path():
    walkers = [
        straight_walker("pierrot", (1.0, 0.5), (-1.0, 0.5), 0.0, 15.0),
        straight_walker("columbine", (0.3, -0.9), (0.3, 0.9), 0.0, 15.0),
    ]
    first_walk, second_walk = (
        plan_or_reason(WEST, EAST, blocked=[TABLE], others=walkers) for _ in range(2)
    )
    assert dataclasses.asdict(check_walk(first_walk, EAST, [TABLE], walkers)) == dataclasses.asdict(
        second_walk
    )


def test_a_hundred_paths_past_others_never_touch_any():
    rng = np.random.default_rng(3)
    n_walks, n_waiting, seconds = 0, 0, []

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
        others: list[OtherPlayer] = []
        for name in ("pierrot", "columbine", "arlecchino")[: 2 + case % 2]:
            start, goal, begin = footing(), footing(), rng.uniform(0.0, 4.0)
            walk = plan_or_reason(start, goal, blocked=blocked, begin=begin, others=others)
            if isinstance(walk, Walk):
                others.append(player_on(name, walk))
        start, goal = footing(), footing()
        start_time = perf_counter()
        walk = plan_or_reason(start, goal, blocked=blocked, others=others)
        seconds.append(perf_counter() - start_time)
        if isinstance(walk, Walk):
            check_walk(walk, goal, blocked, others)
            n_walks += 1
            n_waiting += walk.begin > 0.0 or any(step.stands for step in walk.steps)
    print(
        f"{n_walks} ways, {n_waiting} wait; {1e3 * np.median(seconds):.0f} ms, at most "
        f"{1e3 * np.max(seconds):.0f} ms"
    )
    assert n_walks > 40 and n_waiting > 5


def test_places_of_other_players_must_match_their_times():
    with pytest.raises(ValueError, match="columbine"):
        OtherPlayer("columbine", np.zeros(3), np.zeros((2, 2)), RADIUS)
    with pytest.raises(ValueError, match="radius"):
        plan_or_reason(WEST, EAST, radius=0.0)
