"""Props handed over, sat on, put down and picked up, in simulations with contact."""

from __future__ import annotations

from importlib.resources import files
from itertools import combinations, product

import numpy as np
import pytest
from ruamel.yaml import YAML

import fantoccini as fan
from fantoccini.dynamics.clearance import Clearance, StringDistances
from fantoccini.model.puppet.contact import FLOOR
from fantoccini.theatre import cast
from fantoccini.theatre.cast import prop_gestures
from fantoccini.theatre.gestures.stepping import Step
from fantoccini.theatre.plays import putting
from fantoccini.theatre.plays.sitting import sit

pytestmark = [pytest.mark.slow, pytest.mark.own_puppets, pytest.mark.long]

FEET_HEIGHT = 0.02
"""Height of the feet above the floor: event-driven runs have many events just above it [m]."""
CONTACT_RULES = {"friction": 0.6, "meets": ["floor", "obstacles", "props"]}
STRING_LENGTHS = {"head": 0.6225, "shoulder": 0.7658, "hand": 0.9154, "knee": 1.0609}
TIME_STEPPING = fan.TimeStepping(dt=1e-3)


def puppet(name: str, x: float, y: float, heading: float) -> dict:
    pose = {"torso.z": 0.345 + FEET_HEIGHT, "head.length": STRING_LENGTHS["head"] - FEET_HEIGHT}
    for side in ("left", "right"):
        for string in ("shoulder", "hand", "knee"):
            pose[f"{string}_{side}.length"] = STRING_LENGTHS[string] - FEET_HEIGHT
    return {
        "name": name,
        "puppet": "marionette",
        "at": [x, y, 0.0],
        "pose": pose,
        "orientation": {"axis": [0, 0, 1], "angle": heading},
    }


def world_place(
    x: float, y: float, heading: float, forward: float, left: float
) -> tuple[float, float]:
    """A place in front of a puppet, in world coordinates [m]."""
    c, s = np.cos(heading), np.sin(heading)
    return x + c * forward - s * left, y + s * forward + c * left


PROP_DATA = {
    name: YAML(typ="safe").load(files(cast).joinpath("prop_files", f"{name}.yaml").read_text())
    for name in ("ball", "basket", "chair")
}


def prop(kind: str, x: float, y: float, z: float, heading: float) -> dict:
    return {
        "name": kind,
        "at": [x, y, z],
        "drag": PROP_DATA[kind]["drag"],
        "orientation": {"axis": [0, 0, 1], "angle": heading},
        "shapes": PROP_DATA[kind]["shapes"],
    }


def hanging_prop(
    kind: str, x: float, y: float, heading: float, side: str, shift: float = 0.0
) -> dict:
    """A prop on the forearm of a puppet standing there."""
    forward, left, up = prop_gestures.handle_place(fan.puppets.marionette(), side=side)
    up += FEET_HEIGHT
    place = world_place(x, y, heading, forward + shift, left)
    return prop(kind, *place, up - 0.35 * shift - PROP_DATA[kind]["handle"], heading)


def stage(puppets: list, prop_data: list, obstacles=(), pairs=()) -> fan.Marionette:
    pair_rules = [{"between": [actor["name"], "floor"], "meet": False} for actor in puppets]
    for actor, prop_entry in product(puppets, prop_data):
        if prop_entry["name"] == "chair":
            continue
        pair_rules.append({"between": [actor["name"], prop_entry["name"]], "meet": False})
        prefix = f"{actor['name']}." if len(puppets) > 1 else ""
        pair_rules += [
            {"between": [f"{prefix}forearm_{side}", prop_entry["name"]], "friction": 0.6}
            for side in ("left", "right")
        ]
    rules = CONTACT_RULES | {"pairs": [*pair_rules, *pairs]}
    return fan.Marionette(
        fan.Scene.model_validate(
            {
                "scene": "props",
                "floor": 0,
                "contact": rules,
                "puppets": puppets,
                "props": prop_data,
                "obstacles": list(obstacles),
            }
        )
    )


def contact_times(run, name: str) -> dict[str, tuple[float, float]]:
    """Other body -> first and last time of its contact with a body [s]."""
    times: dict[str, tuple[float, float]] = {}
    contact = run.contact
    for pair, sample, force in zip(contact.pair, contact.sample, contact.force, strict=True):
        names = contact.names[pair]
        if name in names and np.linalg.norm(force) > 1e-6:
            other_body = names[1 - names.index(name)]
            first_time = times.get(other_body, (float(run.t[sample]),) * 2)[0]
            times[other_body] = first_time, float(run.t[sample])
    return times


def handle_positions(scene, run, kind: str, body: str) -> np.ndarray:
    """(T, 3) place of a handle's middle in the frame of a forearm [m]."""
    poses = scene.poses(run.q_D, run.q_K)
    prop_poses, arm_poses = (poses[:, scene.link_index(name)] for name in (kind, body))
    places = prop_poses[:, :, 3] + PROP_DATA[kind]["handle"] * prop_poses[:, :, 2]
    return np.einsum("tij,ti->tj", arm_poses[:, :, :3], places - arm_poses[:, :, 3])


def least_distance(scene, run, kind: str, arms: tuple[str, ...]) -> float:
    """Least distance of a prop or a string from those of others [m]; none may cross."""
    links = [link.name for link in scene.tree.links]
    t, q_D, q_K = run.t[::2], run.q_D[::2], run.q_K[::2]
    free_pairs = [frozenset((name, FLOOR)) for name in links] + [
        frozenset((kind, arm)) for arm in arms
    ]
    distances = [Clearance(scene, free=free_pairs).at(q_D, q_K).min()]
    # Bodies of one puppet may touch each other, but not the prop.
    body_pairs = [frozenset(pair) for pair in combinations([x for x in links if x != kind], 2)]
    distances.append(Clearance(scene, free=[*free_pairs, *body_pairs]).at(q_D, q_K).min())
    strings = StringDistances(scene).motion(q_D, q_K, t)
    assert not strings.crossings()
    approaches = strings.nearest()
    with_owners = [
        (approach, approach.first.split(".")[0], approach.second.split(".")[0])
        for approach in (*approaches.strings, *approaches.bodies)
    ]
    return min(
        *distances,
        *(
            approach.distance
            for approach, first_owner, second_owner in with_owners
            if first_owner != second_owner
        ),
    )


def handover_scene(kind: str, side: str, place: tuple[float, float, float], shift: float = 0.0):
    """The scene, the pair of gestures and their sum."""
    sign = -1.0 if side == "right" else 1.0
    elbow_distance = 0.061 if shift == 0.0 else 0.0595 + shift
    receiver_place = world_place(
        *place, RECEIVER_FORWARD + 0.986 * (elbow_distance - 0.061), sign * RECEIVER_ASIDE
    )
    puppets = [puppet("pierrot", *place), puppet("columbine", *receiver_place, place[2])]
    scene = stage(puppets, [hanging_prop(kind, *place, side, shift)])
    handover = prop_gestures.give(
        scene, "pierrot", "columbine", kind, side=side, elbow_distance=elbow_distance
    )
    assert handover.place(*place) == pytest.approx((*receiver_place, place[2]), abs=1e-3)
    return scene, handover


RECEIVER_ASIDE, RECEIVER_FORWARD = 0.4322, 0.0202
"""Her place beside him, and in front of him [m]."""


@pytest.mark.parametrize(
    ("kind", "side", "place", "shift"),
    [
        ("ball", "right", (0.0, 0.0, 0.0), 0.0),
        ("ball", "right", (0.0, 0.0, 0.0), 0.01),
        ("basket", "left", (0.7, -0.4, 2.1), 0.0),
    ],
)
def test_a_prop_is_handed_over_and_no_string_passes_it(kind, side, place, shift):
    scene, handover = handover_scene(kind, side, place, shift)
    x0, gesture = scene.rest(), handover.giver + handover.receiver
    run = fan.simulate(
        scene, x0, gesture.inputs(x0), t_end=16.0, method=TIME_STEPPING, save_every=10
    )
    assert run.status is fan.Status.DONE
    receiver_side = {"left": "right", "right": "left"}[side]
    giver_arm, receiver_arm = f"pierrot.forearm_{side}", f"columbine.forearm_{receiver_side}"
    times = contact_times(run, kind)
    assert set(times) == {giver_arm, receiver_arm} == {arm for arm, _ in handover.touching}
    assert times[giver_arm][0] == 0.0 and times[giver_arm][1] < 9.0
    assert times[receiver_arm][0] > 2.0 and times[receiver_arm][1] == run.t[-1]
    positions = handle_positions(scene, run, kind, receiver_arm)
    assert 0.03 < -positions[-1, 2] < 0.088
    assert np.ptp(positions[run.t > 15.0], axis=0).max() < 0.002
    # A handle 1 cm nearer to the hand is nearer to its string as well.
    assert least_distance(scene, run, kind, (giver_arm, receiver_arm)) > (
        0.005 if shift == 0.0 else 0.004
    )


@pytest.mark.parametrize(("kind", "side"), [("ball", "right"), ("basket", "left")])
def test_a_prop_stays_on_the_forearm_in_a_walk(kind, side):
    place = (0.0, 0.0, 0.0)
    scene = stage([puppet("pierrot", *place), OTHER_PUPPET], [hanging_prop(kind, *place, side)])
    x0 = scene.rest()
    pose = prop_gestures.carry(scene, "pierrot", side=side)
    straight_steps, turning_steps = [Step(0.06)] * 12, [Step(0.0, np.pi / 6)] * 3
    walk = pose.then(
        prop_gestures.steps_carrying(
            scene, pose, x0, "pierrot", [*straight_steps, *turning_steps, *straight_steps]
        )
    )
    run = fan.simulate(
        scene, x0, walk.inputs(x0), t_end=walk.duration + 1.0, method=TIME_STEPPING, save_every=10
    )
    arm = f"pierrot.forearm_{side}"
    assert set(contact_times(run, kind)) == {arm}
    elbow_distance = -handle_positions(scene, run, kind, arm)[:, 2]
    assert elbow_distance.min() > 0.03 and elbow_distance.max() < 0.08
    assert elbow_distance[-1] == pytest.approx(
        prop_gestures.handle_distance(
            scene, run.state(len(run) - 1), "pierrot", kind, PROP_DATA[kind]["handle"], side=side
        )
    )
    assert least_distance(scene, run, kind, (arm,)) > 0.005


SEAT = PROP_DATA["chair"]["seat"]
OTHER_PUPPET = puppet("other", 3.0, 3.0, 0.0)
"""A puppet that takes no part."""


def test_a_seat_bears_a_player_and_lets_her_stand_up():
    place = (0.3, 0.2, -1.2)
    x, y = world_place(*place, -0.135, 0.0)
    chair = {
        "name": "chair",
        "at": [x, y, 0],
        "shapes": PROP_DATA["chair"]["shapes"],
        "orientation": {"axis": [0, 0, 1], "angle": place[2]},
    }
    scene = stage([puppet("columbine", *place)], [chair])
    x0 = scene.rest()
    sitting = sit(scene, "", "chair", SEAT)
    down, up = sitting.down, sitting.up
    run = fan.simulate(
        scene,
        x0,
        down.then(down.rest(scene, 2.0, everything=False), up).inputs(x0),
        t_end=12.0,
        method=TIME_STEPPING,
        save_every=10,
    )
    assert run.status is fan.Status.DONE
    floor = run.contact.involving("chair", "floor")
    chair_force = np.zeros(len(run))
    np.add.at(chair_force, floor.sample, np.abs(floor.force[:, 2]))
    chair_weight = 0.9 * 9.81
    weight_share = (chair_force - chair_weight) / (scene.weight - chair_weight)
    is_sitting, is_standing = (run.t > 4.5) & (run.t < 5.9), run.t > 10.0
    assert weight_share[is_sitting].min() > 0.3 and weight_share[is_sitting].max() < 0.95
    # Her legs may still swing against the chair: in plays she steps away from it.
    assert np.abs(weight_share[is_standing]).mean() < 0.02
    assert set(contact_times(run, "chair")) - {"floor"} <= {body for body, _ in sitting.touching}
    torso = scene.poses(run.q_D, run.q_K)[:, scene.link_index("torso"), :, 3]
    assert np.linalg.norm(torso[-1] - torso[0]) < 0.04  # it swings
    assert np.ptp(run["chair.x"]) < 5e-3


def test_a_basket_is_put_down():
    side, place, top = "left", (0.3, 0.2, -1.2), 0.195
    x, y = world_place(*place, 0.36, 0.07)
    table = {
        "name": "table",
        "type": "box",
        "size": [0.3, 0.3, top],
        "at": [x, y, top / 2],
        "orientation": {"axis": [0, 0, 1], "angle": place[2]},
    }
    scene = stage(
        [puppet("columbine", *place)],
        [hanging_prop("basket", *place, side)],
        [table],
        [{"between": ["table", "columbine"], "meet": False}],
    )
    x0 = scene.rest()
    pose = prop_gestures.carry(scene, "", side=side)
    pose = pose.then(pose.rest(scene, 1.0, everything=False))
    carried = fan.simulate(scene, x0, pose.inputs(x0), t_end=2.5, method=TIME_STEPPING)
    start = carried.state(len(carried) - 1)
    put_down = putting.put_down(scene, "", "basket", top, start=start, side=side)
    motion = pose.then(put_down.gesture)
    run = fan.simulate(
        scene, x0, motion.inputs(x0), t_end=22.0, method=TIME_STEPPING, save_every=10
    )
    assert run.status is fan.Status.DONE
    times = contact_times(run, "basket")
    positions = np.stack([run[f"basket.{axis}"] for axis in "xyz"], axis=1)
    c, s = np.cos(place[2]), np.sin(place[2])
    local_positions = (positions[:, :2] - place[:2]) @ np.array([[c, -s], [s, c]])
    is_standing = run.t > 14.5
    assert np.ptp(positions[is_standing], axis=0).max() < 1e-3
    assert positions[is_standing, 2].mean() == pytest.approx(top, abs=2e-3)
    assert local_positions[is_standing].mean(axis=0) == pytest.approx(
        [put_down.forward, put_down.left], abs=0.01
    )
    assert set(times) == {"table", f"forearm_{side}"}


@pytest.mark.parametrize(
    ("prop", "side", "drop"), [("basket", "right", 0.008), ("ball", "left", 0.0)]
)
def test_the_string_of_a_hand_keeps_away_from_a_prop_that_is_picked_up(prop, side, drop):
    alone = fan.puppets.marionette()
    picking = putting.pick_up(alone, "", prop, drop, side=side)
    carried_height = prop_gestures.handle_place(alone, side=side)[2] + putting.CARRY_RISE
    top = carried_height + FEET_HEIGHT - PROP_DATA[prop]["handle"] - drop
    x, y = picking.forward, picking.left
    table = {"name": "table", "type": "box", "size": [0.3, 0.3, top], "at": [x, y, top / 2]}
    scene = stage(
        [puppet("columbine", 0.0, 0.0, 0.0)],
        [hanging_prop(prop, 0.0, 0.0, 0.0, side) | {"at": [x, y, top]}],
        [table],
        [{"between": ["table", "columbine"], "meet": False}],
    )
    x0, gesture = scene.rest(), putting.pick_up(scene, "", prop, drop, side=side).gesture
    run = fan.simulate(
        scene, x0, gesture.inputs(x0), t_end=18.5, method=TIME_STEPPING, save_every=10
    )
    assert run.status is fan.Status.DONE
    assert 0.05 < -handle_positions(scene, run, prop, f"forearm_{side}")[-1, 2] < 0.075
    strings = StringDistances(scene).motion(run.q_D[::2], run.q_K[::2], run.t[::2])
    assert not strings.crossings()
    near = [pair for pair in strings.nearest().bodies if pair.second == prop]
    # It passes through the bar if the arm is placed as for putting the prop down.
    assert min(pair.distance for pair in near) > 0.006
