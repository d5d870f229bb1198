"""Runs with contact: reports, files, refusals and robustness."""

from __future__ import annotations

import copy
import pickle
import re
from pathlib import Path

import numpy as np
import pytest
from tests.perform.previous_format import previous_format_arrays

import fantoccini as fan
from contact.bodies import G, on_slope, stepped, thrown
from fantoccini import puppets
from fantoccini.base.errors import Status
from fantoccini.dynamics.compiled import refuse_contact
from fantoccini.model import scene as scene_file

pytestmark = pytest.mark.slow

DT = 1e-3


@pytest.fixture(scope="module")
def box() -> fan.Marionette:
    return on_slope(0.2, 0.4)


def tumbling(box: fan.Marionette, n: int) -> list[fan.State]:
    """Rotated, spinning boxes above the floor."""
    rng = np.random.default_rng(5)
    states = []
    for q in rng.normal(size=(n, 4)):
        place = {"body.z": 0.3 + 0.1 * rng.random(), "body.rotation": tuple(q / np.linalg.norm(q))}
        x = box.state(place)
        states.append(x.replace(v_D=rng.normal(size=6) * [1, 1, 1, 5, 5, 5]))
    return states


def test_a_lane_does_not_depend_on_its_neighbours(box):
    """Alone, with others, and as other lanes: the same bits, close to those of a scalar run."""
    states = tumbling(box, 11)
    about = {"t_end": 0.5, "method": fan.TimeStepping(dt=DT), "save": "all", "save_every": 1}
    full_batch = fan.simulate_batch(box, states, **about)
    assert np.all(full_batch.status == Status.DONE)
    turned = fan.simulate_batch(box, states[::-1], **about)
    assert np.array_equal(full_batch.q_D, turned.q_D[::-1])
    single = stepped(box, states[4], 0.5, DT)
    assert np.allclose(full_batch.q_D[4, 1], single.q_D[1], atol=1e-12)
    assert np.allclose(full_batch.q_D[4], single.q_D, atol=1e-4)
    assert np.allclose(full_batch.ledger["friction"][4], single.ledger["friction"], atol=1e-3)


def test_the_ledger_balances_and_energy_never_rises(box):
    for x in tumbling(box, 4):
        run = stepped(box, x, 1.0, DT)
        energy = run.ledger["kinetic"] + run.ledger["potential"]
        assert np.all(np.diff(energy) < 2e-5 * energy[0] + 1e-9)
        assert np.all(np.diff(run.ledger["friction"]) > -1e-12)
        assert abs(run.ledger["residual"][-1]) < 0.02 * (run.ledger["impact"][-1] + 1.0)
        finer = stepped(box, x, 0.3, DT / 8)
        coarse = stepped(box, x, 0.3, DT)
        assert abs(finer.ledger["residual"][-1]) < abs(coarse.ledger["residual"][-1]) + 1e-4


def test_forces_of_contact_carry_the_weight_and_obey_the_cone(box):
    """Sliding bodies do not lift: the normal force is the share of the weight, not more."""
    x0 = thrown(box, {"body.z": 0.05}, {"body.x": 1.0})
    run = stepped(box, x0, 0.3, DT)
    contact = run.contact
    assert contact.names == (("body", "floor"),)
    normal = contact.normal_force
    across = np.linalg.norm(contact.force - normal[:, None] * contact.normal, axis=1)
    slides = contact.sliding_speed > 1e-6
    assert np.allclose(across[slides], 0.4 * normal[slides], rtol=1e-6)
    assert np.all(across <= 0.4 * normal + 1e-9)
    force = contact.force_on("body", len(run))
    assert np.allclose(force[5:, 2], G * np.cos(0.2), atol=1e-6)
    assert np.all(contact.gap > -1e-9)
    assert np.all(np.einsum("ij,ij->i", contact.force, contact.velocity)[slides] < 0.0)
    last = contact.at_sample(len(run) - 1)
    assert len(last) == 4
    assert np.allclose(last.point[:, 2], 0.0, atol=1e-9)
    with pytest.raises(fan.errors.UnknownNameError, match="flor"):
        contact.involving("flor")


def test_contact_is_saved_resampled_and_reported_as_events(box, tmp_path):
    run = stepped(box, tumbling(box, 1)[0], 0.5, DT)
    assert {"touch"} <= {event.kind for event in run.events}
    assert {event.name for event in run.events} == {"body|floor"}
    run.save(tmp_path / "run.npz")
    loaded = fan.Trajectory.load(tmp_path / "run.npz")
    for name in ("sample", "pair", "gap", "point", "normal", "force", "velocity"):
        assert np.array_equal(getattr(loaded.contact, name), getattr(run.contact, name))
    assert loaded.contact.names == run.contact.names
    resampled = run.resample(run.t[100:200:10])
    assert len(resampled.contact.at_sample(3)) == len(run.contact.at_sample(130))
    assert np.array_equal(resampled.contact.at_sample(3).force, run.contact.at_sample(130).force)


def test_a_damaged_file_of_contact_is_refused(box, tmp_path):
    run = stepped(box, box.state({"body.z": 0.05}), 0.01, DT)
    run.save(tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz") as file:
        arrays = dict(file)
    arrays["contact:pair"] = arrays["contact:pair"] + 7
    np.savez(tmp_path / "bad.npz", **arrays)
    with pytest.raises(fan.errors.FileError, match="pair"):
        fan.Trajectory.load(tmp_path / "bad.npz")


def test_copies_of_a_stepper_continue_to_the_same_bits(box):
    stepper = box.stepper(tumbling(box, 1)[0], method=fan.TimeStepping(dt=DT))
    stepper.advance(0.3)
    others = copy.copy(stepper), copy.deepcopy(stepper), pickle.loads(pickle.dumps(stepper))
    stepper.advance(0.3)
    assert len(stepper.contacts)
    for other in others:
        other.advance(0.3)
        assert np.array_equal(other.state.q_D, stepper.state.q_D)
        assert np.array_equal(other.contacts, stepper.contacts)


def test_methods_without_contact_refuse_it(box):
    x = box.state({"body.z": 0.5})
    with pytest.raises(fan.errors.StateError, match="needed: method='event' or 'timestepping'"):
        fan.simulate(box, x, t_end=0.1, method="variational")
    with pytest.raises(fan.errors.StateError, match="contact: false"):
        fan.simulate_batch(box, [x], t_end=0.1, method="variational")
    with pytest.raises(fan.errors.StateError, match="external integrators does not support"):
        box.flow(x)


def test_the_advice_to_leave_contact_out_names_a_file_that_can_be_copied(tmp_path):
    scene = fan.load(puppets.path("promenade"))
    with pytest.raises(fan.errors.StateError, match="in a copy of it") as caught:
        refuse_contact(scene, "follow")
    named = re.search(r"contact: false in (\S+), or in a copy", str(caught.value))[1]
    text = Path(named).read_text(encoding="utf-8")
    copy_of = tmp_path / "promenade.yaml"
    copy_of.write_text(re.sub(r"^contact: .*$", "contact: false", text, flags=re.MULTILINE))
    copied = scene_file.load(copy_of)
    assert copied.touching is None and copied.members == scene.puppet.members


def test_a_plan_avoids_contact_by_default():
    """It is the plan of the same puppet without contact."""
    text = puppets.path("arm2d").read_text(encoding="utf-8")
    arm = fan.loads(f"{text}\ncontact: true\nfloor: -2.0\n")
    plain = fan.loads(f"{text}\nfloor: -2.0\n")
    plans = [
        fan.plan(m, m.rest({"hand.length": 0.8}), m.rest({"hand.length": 0.6}), seed=0)
        for m in (arm, plain)
    ]
    assert all(plans)
    assert np.array_equal(plans[0].trajectory.q_D, plans[1].trajectory.q_D)


def test_a_start_in_which_solids_overlap_is_refused_by_name(box):
    with pytest.raises(fan.errors.StateError, match=r"body\|floor by 0.02 m"):
        stepped(box, box.state({"body.z": 0.03}), 0.1, DT)


def test_rest_is_the_final_state_on_the_support(box):
    """A tilted box comes to lie, and stays; hanging puppets hang as before."""
    x = box.rest({"body.z": 0.12, "body.rotation": (0.95, 0.1, 0.25, 0.1)})
    run = stepped(box, x, 1.0, DT)
    assert np.max(np.abs(run.q_D - x.q_D)) < 1e-6
    assert np.isclose(run.contact.force_on("body", len(run))[-1, 2], G * np.cos(0.2))
    slides = on_slope(0.5, 0.3)
    with pytest.raises(fan.errors.StateError, match="still moves"):
        slides.rest({"body.z": 0.05})


def test_bounces_with_restitution_end_at_rest():
    """Heights decrease by e^2 each time; all ends by sqrt(2 h/g) (1 + e) / (1 - e)."""
    ball = fan.loads("""
puppet: ball
floor: 0
contact: {restitution: 0.7}
bodies:
- {name: ball, joint: {type: free}, shapes: [{type: sphere, radius: 0.1, mass: 2}]}
""")
    h, e = 0.5, 0.7
    # The energy of a bounce at v is too small by 2 g dt/v on average.
    run = stepped(ball, ball.state({"ball.z": 0.1 + h}), 2.5, 1.25e-4)
    z, v = run["ball.z"] - 0.1, run["v:ball.z"]
    tops = z[np.flatnonzero((v[:-1] > 0) & (v[1:] <= 0))]
    assert np.allclose(tops[:4], h * e ** (2 * np.arange(1, 5)), rtol=1e-2)
    rests = np.sqrt(2 * h / G) * (1 + e) / (1 - e)
    moving = run.t[np.abs(v) > 0.02]
    assert abs(moving[-1] - rests) < 0.05
    assert run.contact.gap.min() > -1e-9
    energy = run.ledger["kinetic"] + run.ledger["potential"]
    assert np.all(np.diff(energy) < 1e-4)


def test_colliding_hung_puppets_keep_their_momentum_in_free_directions():
    """Two bobs on long strings meet: no external impulse acts along x."""
    pair = fan.loads("""
puppet: cradle
contact: {friction: 0.2}
bodies:
- {name: a, joint: {type: free}, shapes: [{type: sphere, radius: 0.05, mass: 1}]}
- {name: b, joint: {type: free}, shapes: [{type: sphere, radius: 0.05, mass: 0.4}]}
strings:
- {name: left, path: [{body: a, at: [0, 0, 0.05]}, {world: [-0.05, 0, 1]}], length: 0.95}
- {name: right, path: [{body: b, at: [0, 0, 0.05]}, {world: [0.05, 0, 1]}], length: 0.95}
pose: {a.x: -0.05, b.x: 0.05}
""")
    lifted = 0.3
    x0 = pair.state(
        {
            "a.x": -0.05 - 0.95 * np.sin(lifted),
            "a.z": 0.95 - 0.95 * np.cos(lifted),
            "a.rotation": (np.cos(lifted / 2), 0.0, np.sin(lifted / 2), 0.0),
            "b.x": 0.051,
        }
    )
    run = stepped(pair, pair.project(x0), 0.7, 2.5e-4)
    i = next(k for k, t in enumerate(run.t) if run.contact.at_sample(k) and t > 0)
    m = np.array([1.0, 0.4])
    before, after = (m @ [run["v:a.x"][k], run["v:b.x"][k]] for k in (i - 2, i + 4))
    assert before > 0.3
    assert abs(after - before) < 2e-3 * before
    assert run["v:b.x"][i + 4] >= run["v:a.x"][i + 4] - 1e-6
    energy = run.ledger["kinetic"] + run.ledger["potential"]
    assert energy[-1] <= energy[0] + 1e-9


def test_too_many_points_end_the_run():
    """Seventeen boxes lie on the floor with four points each: 68."""
    bodies = "\n".join(
        f"- {{name: b{k}, joint: {{type: free}}, shapes: [{{type: box, size: [0.1, 0.1, 0.1], "
        "mass: 1}]}"
        for k in range(17)
    )
    pile = fan.loads(f"puppet: pile\nfloor: 0\ncontact: {{meets: [floor]}}\nbodies:\n{bodies}\n")
    x0 = pile.state({f"b{k}.z": 0.05 for k in range(17)})
    run = fan.simulate(pile, x0, t_end=0.1, method="timestepping", throw=False)
    assert run.status is Status.TOO_MANY_CONTACTS


PLATE = """
puppet: plate
contact: {restitution: RESTITUTION}
bodies:
- name: plate
  joint: {type: prismatic, axis: [0, 0, 1], driven: true}
  shapes: [{type: box, size: [1, 1, 0.1], mass: 3}]
- {name: load, joint: {type: free}, shapes: [{type: box, size: [0.2, 0.2, 0.1], mass: 2}]}
pose: {load.z: 0.1}
"""


def test_effort_includes_the_load_of_a_driven_body():
    plate = fan.loads(PLATE.replace("RESTITUTION", "0"))
    run = stepped(plate, plate.state(), 0.2, DT)
    assert np.allclose(run.effort["plate"][2:], 5 * G, rtol=1e-6)


def test_a_load_with_restitution_rests_on_a_platform_that_accelerates():
    plate = fan.loads(PLATE.replace("RESTITUTION", "0.7"))
    lift = fan.Input.waypoints(plate, {"plate": [(0.0, 0.0), (0.2, 0.3), (0.4, 0.3)]})
    run = fan.simulate(plate, plate.state(), lift, t_end=0.1, method=fan.TimeStepping(dt=DT))
    force = run.contact.force_on("load", len(run))[5:, 2]
    of_step = run.acc_K[4:-1, 0]  # the mean velocity of a step is that of its middle
    assert not run.events
    assert np.allclose(force, 2 * (G + of_step), atol=0.05)


def test_the_ledger_has_an_impact_in_the_first_step(box):
    ball = on_slope(0.0, 0.3, "sphere")
    for gap in (1e-6, 1e-3, 2e-3):
        x0 = thrown(ball, {"body.z": 0.1 + gap}, {"body.z": -3.0})
        run = stepped(ball, x0, 0.1, DT)
        assert np.isclose(run.ledger["impact"][-1], 4.5, rtol=0.02)
        assert [event.kind for event in run.events] == ["touch"]


def test_restitution_with_friction_adds_no_energy():
    """Newton's law of impact alone would: Kane's double pendulum that hits the floor."""
    pendulum = fan.loads(
        """
puppet: kane
floor: 0
contact: {friction: 0.5, restitution: RESTITUTION}
bodies:
- name: upper
  joint: {type: revolute, axis: [0, 1, 0], at: [0, 0, 1.6]}
  shapes: [{type: capsule, from: [0, 0, 0], to: [0, 0, -1], radius: 0.01, mass: 1}]
- name: lower
  parent: upper
  joint: {type: revolute, axis: [0, 1, 0], at: [0, 0, -1]}
  shapes: [{type: capsule, from: [0, 0, -0.1], to: [0, 0, -1], radius: 0.01, mass: 1}]
""".replace("RESTITUTION", "0.9")
    )
    rng = np.random.default_rng(0)
    struck = 0
    for _ in range(20):
        x = pendulum.state({"upper": rng.uniform(-0.6, 0.6), "lower": rng.uniform(-2.2, 2.2)})
        if pendulum.overlaps(x.q_D, x.q_K):
            continue
        run = stepped(pendulum, x.replace(v_D=rng.normal(size=2) * 6), 1.0, 2e-4)
        energy = run.ledger["kinetic"] + run.ledger["potential"]
        struck += run.ledger["impact"][-1] > 0.1
        assert np.all(np.diff(energy) < 2e-3 * energy[0])
        # The forces of a step act at its touch: the loss of an impact includes up to twice the work
        # of gravity in a step with the velocities before and after.
        a, b = run.q_D.T
        by_a, by_b = run.v_D.T
        power = 9.81 * (1.5 * np.sin(a) * by_a + 0.55 * np.sin(a + b) * (by_a + by_b))
        lower_bound = -2e-6 * energy[0] - 4e-4 * (np.abs(power[1:]) + np.abs(power[:-1]))
        assert np.all(np.diff(run.ledger["impact"]) > lower_bound)
        assert np.all(np.diff(run.ledger["friction"]) > -1e-12)
    assert struck > 3


def test_persistent_overlaps_end_overstepped():
    """A driven plate presses a ball into the floor, which cannot yield."""
    press = fan.loads("""
puppet: press
floor: 0
contact: true
bodies:
- name: plate
  joint: {type: prismatic, axis: [0, 0, 1], at: [0, 0, 0.3], driven: true}
  shapes: [{type: box, size: [1, 1, 0.1], mass: 3}]
- {name: ball, joint: {type: free}, shapes: [{type: sphere, radius: 0.1, mass: 1}]}
pose: {ball.z: 0.1}
""")
    down = fan.Input.waypoints(press, {"plate": [(0.0, 0.0), (1.0, -0.15)]})
    run = fan.simulate(press, press.state(), down, method="timestepping", throw=False)
    assert run.status in (Status.OVERSTEPPED, Status.NOT_SETTLED)


def test_damaged_contacts_of_a_recording_are_refused(box, tmp_path):
    performance = fan.Performance(box, box.state({"body.z": 0.06}))
    performance.record()
    performance.advance(0.2)
    take = performance.stop()
    arrays = previous_format_arrays(take, tmp_path / "take.npz")
    loaded = fan.theatre.Recording.load(tmp_path / "take.npz")
    assert len(loaded.trajectory.contact) > 0
    assert np.array_equal(loaded.trajectory.contact.force, take.trajectory.contact.force)
    arrays["contacts"] = arrays["contacts"].copy()
    arrays["contacts"][0, 1] = 99.0
    np.savez(tmp_path / "bad.npz", **arrays)
    with pytest.raises(fan.errors.FileError, match="pair"):
        fan.theatre.Recording.load(tmp_path / "bad.npz")


def test_the_residual_of_the_law_is_a_column(box, tmp_path):
    """It is at most 1e-10 at rest and sliding, 0 without contact; saved, resampled, in batches."""
    falls = box.state({"body.z": 0.055})
    slides = thrown(box, {"body.z": 0.05}, {"body.x": 1.0, "body.wz": 4.0})
    for x0 in (box.state({"body.z": 0.05}), slides, falls):
        run = stepped(box, x0, 0.3, DT)
        residual = run.contact_residual
        assert residual.shape == run.t.shape
        assert np.all(residual <= 1e-10) and np.all(residual >= 0.0)
        touches = np.isin(np.arange(len(run)), run.contact.sample)
        assert np.all(residual[~touches] == 0.0)
        assert np.any(residual[touches] > 0.0)
        assert np.array_equal(run["contact_residual"], residual)
        batch = fan.simulate_batch(
            box, [x0, falls], t_end=0.3, method=fan.TimeStepping(dt=DT), save="all", save_every=1
        )
        assert np.all(batch.contact_residual[0] <= 1e-10)
        assert np.array_equal(batch.contact_residual[0] > 0.0, residual > 0.0)
        assert np.array_equal(batch.trajectory(1).contact_residual, batch.contact_residual[1])
    assert np.sum(~touches) > 10
    run.save(tmp_path / "run.npz")
    assert np.array_equal(fan.Trajectory.load(tmp_path / "run.npz").contact_residual, residual)
    assert np.array_equal(run.resample(run.t[20:90]).contact_residual, residual[20:90])
    joint = "{type: translation, axes: [x]}"
    free = fan.loads(f"puppet: free\nbodies:\n- {{name: ball, joint: {joint}, mass: 1}}\n")
    assert stepped(free, free.state(), 0.01, DT).contact_residual is None


def test_sharing_changes_no_motion_and_no_sum(box):
    """The bits of the motion are the same for results written in every step or only once."""
    x0 = tumbling(box, 1)[0]
    often = stepped(box, x0, 0.5, DT)
    seldom = fan.simulate(box, x0, t_end=0.5, method=fan.TimeStepping(dt=DT), save_every=100)
    assert np.array_equal(often.q_D[::100], seldom.q_D)
    mass = 1.0
    change = np.diff(often.v_D[:, :3], axis=0) / DT
    gravity = np.array([G * np.sin(0.2), 0.0, -G * np.cos(0.2)])
    force = often.contact.force_on("body", len(often))[1:]
    assert np.allclose(force, mass * (change - gravity), atol=1e-6 * np.max(np.abs(force)))


def kinds(run: fan.Trajectory) -> list[tuple[str, str]]:
    return [(event.kind.value, event.name) for event in run.events]


def test_a_block_thrown_along_the_floor_touches_slides_and_sticks():
    block = on_slope(0.0, 0.4)
    x0 = thrown(block, {"body.z": 0.051}, {"body.x": 1.0, "body.wz": 0.5})
    run = stepped(block, x0, 1.0, DT)
    assert kinds(run) == [(k, "body|floor") for k in ("touch", "slide", "stick")]
    touch, slide, stick = (event.t for event in run.events)
    assert touch == slide
    assert abs(stick - touch - 1.0 / (0.4 * G)) < 0.02
    assert kinds(stepped(block, block.state({"body.z": 0.05}), 1.0, DT)) == []


def test_a_ball_sticks_once_it_rolls_and_lifts_off_where_the_floor_ends():
    ball = fan.loads("""
puppet: ball
obstacles:
- {name: table, type: box, size: [2, 2, 0.1], at: [0, 0, -0.05]}
contact: {friction: 0.3}
bodies:
- {name: ball, joint: {type: free}, shapes: [{type: sphere, radius: 0.1, mass: 2}]}
""")
    run = stepped(ball, thrown(ball, {"ball.z": 0.1}, {"ball.x": 3.0}), 0.7, DT)
    kinds_of_events = [kind for kind, name in kinds(run) if name == "ball|table"]
    assert kinds_of_events[0] == "stick" and kinds_of_events[-1] == "lift"
    assert abs(run.events[0].t - 2 * 3.0 / (7 * 0.3 * G)) < 0.01


def test_a_body_of_several_shapes_touches_once():
    """Events name the bodies, for contact of any of their shapes."""
    stool = fan.loads("""
puppet: stool
floor: 0
contact: true
bodies:
- name: stool
  joint: {type: free}
  shapes:
  - {type: box, size: [0.1, 0.1, 0.1], at: [-0.2, 0, 0], mass: 1}
  - {type: box, size: [0.1, 0.1, 0.1], at: [0.2, 0, 0], mass: 1}
""")
    run = stepped(stool, stool.state({"stool.z": 0.06}), 0.3, DT)
    assert kinds(run) == [("touch", "stool|floor")]
    assert len(set(run.contact.pair)) == 2
    tilted = stool.state({"stool.z": 0.15, "stool.rotation": (0.98, 0.0, 0.199, 0.0)})
    run = stepped(stool, tilted, 0.8, DT)
    kinds_of_events = [kind for kind, _ in kinds(run) if kind in ("touch", "lift")]
    assert kinds_of_events == ["touch", "lift"] * (len(kinds_of_events) // 2) + ["touch"]
