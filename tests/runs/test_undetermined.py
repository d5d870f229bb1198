"""Undetermined tensions and efforts are marked, for their string and time.

The oracle is the null space of the taut strings' A_D^T by SVD, from the geometry.
"""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from scipy.spatial.transform import Rotation
from tests.runs.cable_robot import BOX, FRAME, MIDDLE, NAMES, REWOUND, moved, robot

import fantoccini as fan
from fantoccini.app.cli_support.reporting import undetermined_lines
from fantoccini.stand import check_stand, loads_stand

pytestmark = pytest.mark.medium

METHODS = ("event", "timestepping", "variational")
WEIGHT = 98.1


def pulls(pose: np.ndarray) -> np.ndarray:
    """(6, 8) force and moment about the centre of unit tensions on a box at (7,) a pose."""
    at = MIDDLE + pose[:3]
    w, x, y, z = pose[3:]
    R = np.eye(3) + 2 * (w * hat(x, y, z) + hat(x, y, z) @ hat(x, y, z))
    arms = BOX @ R.T
    ways = FRAME - at - arms
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    return np.vstack([ways.T, np.cross(arms, ways).T])


def hat(x: float, y: float, z: float) -> np.ndarray:
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_eight_cables_at_rest_are_marked_at_every_time(eight, method, tmp_path):
    """The rank is 5 (the yaw is free): three self-stresses involve every cable and winch."""
    x0, _ = moved(eight)
    run = fan.simulate(eight, x0, t_end=0.1, method=method)
    null = scipy.linalg.null_space(pulls(run.q_D[0]))
    assert null.shape[1] == 3 and np.all(np.linalg.norm(null, axis=1) > 0.1)
    for name in NAMES:
        assert np.all(run.undetermined[name]) and np.all(run.undetermined[f"{name}.length"])
    assert run.summary()["tension"]["c0"]["undetermined"] == pytest.approx(0.1)
    assert np.all(run.columns()["undetermined:c3"])
    run.save(tmp_path / "run.npz")
    loaded = fan.Trajectory.load(tmp_path / "run.npz")
    assert np.array_equal(loaded.undetermined.values, run.undetermined.values)
    assert loaded.undetermined.values.dtype == bool
    assert run.resample(np.array([0.05])).undetermined["c0"].tolist() == [True]


STAND = """
stand: eight_winches
axes:
  w0:
    motor: {type: servo, torque: 6, inertia: 1.0e-6}
    transmission: {type: drum, radius: 0.02}
    moves: {c0.length: 1}
    travel: [0.5, 5]
    speed: 5
    acceleration: 50
""" + "".join(f"  w{i}: {{like: w0, moves: {{c{i}.length: 1}}}}\n" for i in range(1, 8))


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_batches_and_steppers_mark_what_single_runs_mark(moving, method):
    platform = moving[0]
    x0, inputs = moved(platform)
    held_inputs = fan.Input.hold(platform, 1.2).bound(x0.q_K)
    times = {"save_at": np.linspace(0.0, 1.2, 25)} if method == "event" else {}
    single = fan.simulate(platform, x0, inputs, 1.2, method=method, **times)
    for save in (None, "all"):  # by default, where strings outnumber the freedoms
        batch = fan.simulate_batch(
            platform, x0, [inputs, held_inputs], 1.2, method=method, save=save, **times
        )
        flags = batch.undetermined.values[0]
        assert np.mean(flags == single.undetermined.values[: len(flags)]) > 0.95
        assert np.all(batch.undetermined["c1"][1, 1:])
    run = batch.trajectory(0)
    assert np.array_equal(run.undetermined["c1"], batch.undetermined["c1"][0])
    stepper = platform.stepper(x0, method)
    stepper.advance(0.5, inputs=inputs)
    forces = {*NAMES, *(f"{name}.length" for name in NAMES)}
    assert set(stepper.undetermined) == forces
    steppers = platform.stepper_batch(x0, 2, method)
    steppers.advance(0.05)
    assert set(steppers.undetermined(0)) == set(steppers.undetermined(-1)) == forces


@pytest.mark.slow
def test_batches_and_steppers_of_determined_tensions_mark_nothing():
    arm = fan.puppets.arm2d()
    x0 = arm.rest()
    assert fan.simulate_batch(arm, x0, t_end=0.05).undetermined is None
    assert not np.any(fan.simulate_batch(arm, x0, t_end=0.05, save="all").undetermined.values)
    stepper, steppers = arm.stepper(x0), arm.stepper_batch(x0, 2)
    stepper.advance(0.05)
    assert stepper.undetermined == () == steppers.undetermined(1)


@pytest.fixture(scope="module")
def moving():
    """A platform on eight winches of at most 60 N, and its runs by both methods."""
    platform = robot(REWOUND)
    x0, inputs = moved(platform)
    return platform, [
        fan.simulate(platform, x0, inputs, 1.2, method=method)
        for method in ("event", "timestepping")
    ]


@pytest.mark.slow
def test_determined_tensions_agree_between_both_methods(moving):
    """Rounding puts tensions at the winch's cap in one method, and not in the other."""
    _, (event, stepped) = moving
    stepped = stepped.resample(event.t)
    differences = np.abs(event.tension.values - stepped.tension.values)
    marked = event.undetermined.values[:, :8]
    assert np.max(differences) > 0.1 * WEIGHT
    assert np.all(marked[differences > 0.05 * WEIGHT])
    assert np.mean(marked) > 0.9


@pytest.mark.slow
def test_a_stand_is_not_judged_by_tensions_that_the_motion_does_not_determine(moving):
    platform, runs = moving
    for run in runs:
        check = check_stand(loads_stand(STAND), run, platform)
        assert (
            not check.ok
            and not check.broken
            and set(check.undetermined) == {f"w{i}" for i in range(8)}
        )
        assert "is not determined" in check.summary() and "w3" in check.summary()
        assert any("does not determine the forces of w0" in note for note in check.notes)
        # Speeds are those of the inputs, and are judged.
        slow = check_stand(loads_stand(STAND.replace("speed: 5", "speed: 0.1")), run, platform)
        assert {limit.quantity for limit in slow.broken} == {"speed"}


CART_AND_BOB = """
puppet: small
bodies:
  - {name: cart, joint: {type: translation, axes: [x]}, mass: 1}
  - {name: bob, joint: {type: translation, axes: [x, y, z]}, mass: 1}
strings:
  - {name: first, path: [{body: cart}, {world: [-1, 0, 0]}], length: 1}
  - {name: second, path: [{body: cart}, {world: [-2, 0, 0]}], length: 2}
  - {name: alone, path: [{body: bob}, {world: [0, 0, 1]}], length: driven}
"""


@pytest.fixture(scope="module")
def small():
    return fan.loads(CART_AND_BOB)


@pytest.mark.parametrize("method", METHODS)
def test_only_strings_in_the_null_space_are_marked(small, method):
    """A cart pushed against two parallel strings; a bob beside it hangs on one."""
    x0 = small.state({"alone.length": 1.0})
    pushed = fan.Input.hold(small, 0.1).with_forces({"cart.x": [(0.0, 5.0), (0.1, 5.0)]})
    run = fan.simulate(small, x0, pushed, 0.1, method=method)
    assert np.all(run.undetermined["first"][1:]) and np.all(run.undetermined["second"][1:])
    assert not np.any(run.undetermined["alone"])
    assert not np.any(run.undetermined["alone.length"])
    (line,) = undetermined_lines(run)
    assert "tension or effort of first, second; other" in line and "from t = " in line


@pytest.mark.parametrize("method", METHODS)
def test_unloaded_parallel_strings_have_zero_tension(small, method):
    """Without a force on the cart, (1, -1) is a null vector; neither tension can be negative."""
    run = fan.simulate(small, small.state({"alone.length": 1.0}), t_end=0.1, method=method)
    assert not np.any(run.undetermined.values) and not undetermined_lines(run)
    assert np.max(run.tension["first"]) < 1e-9


def plate(string_model: str = "constraint") -> fan.Marionette:
    """A plate of 10 kg on four upright cables."""
    lines = [
        "puppet: plate",
        "bodies:",
        "  - {name: plate, joint: {type: free, at: [0, 0, 1.5]}, "
        "shapes: [{type: box, size: [0.6, 0.6, 0.2], mass: 10}]}",
        "strings:",
    ]
    for i, (x, y, z) in enumerate(CORNERS.tolist()):
        path = f"[{{body: plate, at: [{x}, {y}, {z}]}}, {{world: [{x}, {y}, 3]}}]"
        lines.append(f"  - {{name: c{i}, path: {path}, length: driven}}")
    return fan.loads("\n".join(lines), string_model=string_model)


CORNERS = np.array([(x, y, 0.1) for x in (-0.3, 0.3) for y in (-0.3, 0.3)])


@pytest.mark.slow
@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0)])
def test_rounding_peaks_near_a_symmetric_pose_are_marked(axis):
    """Upright, the cables have a self-stress; tilted by their inverse kinematics, almost one."""
    four, share = plate(), np.linspace(0.0, 1.0, 101)
    share = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    turn = 0.2 * np.array(axis) / np.linalg.norm(axis)
    centre = np.array([0.0, 0.0, 1.5])
    turned = [Rotation.from_rotvec(s * turn).apply(CORNERS) for s in share]
    ends = np.array(turned) + centre * (1.0 + share[:, None, None] / 15.0)
    tops = CORNERS * [1.0, 1.0, 0.0] + [0.0, 0.0, 3.0]
    lengths = np.linalg.norm(ends - tops, axis=2)
    columns = {f"c{i}.length": lengths[:, i] for i in range(4)}
    x0 = four.project(four.state({name: column[0] for name, column in columns.items()}))
    inputs = fan.Input.samples(four, np.linspace(0.0, 1.0, 101), columns)
    times = np.linspace(0.0, 1.5, 601)
    event, stepped = (
        fan.simulate(four, x0, inputs, 1.5, method=method).resample(times)
        for method in ("event", fan.TimeStepping(dt=5e-4))
    )
    differences = np.abs(event.tension.values - stepped.tension.values)
    marked = event.undetermined.values[:, :4] | stepped.undetermined.values[:, :4]
    assert (
        np.max(differences[marked]) > 0.2 * WEIGHT and np.max(differences[~marked]) < 0.005 * WEIGHT
    )
    assert 0.05 < np.mean(marked) < 0.5


@pytest.mark.slow
def test_strings_that_stretch_are_determined():
    """The motion determines every tension of chains."""
    chains = plate("chain")
    run = fan.simulate(chains, chains.rest({f"c{i}.length": 1.4 for i in range(4)}), t_end=0.05)
    assert not np.any(run.undetermined.values)
    efforts = [run.effort[f"c{i}.length"][-1] for i in range(4)]
    assert efforts == pytest.approx([-WEIGHT / 4] * 4, rel=1e-2)


STANDING = """
puppet: standing
contact: true
floor: 0
bodies:
  - name: foot
    joint: {type: free, at: [0, 0, 0.05]}
    shapes: [{type: box, size: [0.4, 0.2, 0.1], mass: 2}]
  - name: shin
    parent: foot
    joint: {type: revolute, axis: [0, 1, 0], at: [0, 0, 0.05]}
    mass: 1
    com: [0.1, 0, 0.4]
    inertia: [0.01, 0.01, 0.01]
  - name: load
    joint: {type: free, at: [2, 0, 0.1]}
    shapes: [{type: box, size: [0.2, 0.2, 0.2], mass: 2}]
strings:
  - {name: leans, path: [{body: shin, at: [0, 0, 0.5]}, {world: [-1, 0, 0.6]}], length: driven}
  - {name: lifts, path: [{body: load, at: [0, 0, 0.1]}, {world: [2, 0, 1.2]}], length: driven}
"""

LIFTS = """
stand: lifts
axes:
  lifts:
    motor: {type: servo, torque: 6, inertia: 1.0e-6}
    transmission: {type: drum, radius: 0.02}
    moves: {lifts.length: 1}
    travel: [0.5, 5]
    speed: 5
    acceleration: 50
  leans: {like: lifts, moves: {leans.length: 1}}
"""


@pytest.mark.slow
@pytest.mark.parametrize("method", ["event", "timestepping"])
def test_four_corners_of_a_sole_alone_are_not_marked(method):
    """The corners share the weight in several ways, without effect on the string that holds the
    shin. A string upright over a box on the floor shares its weight with the floor, and is
    marked.
    """
    standing = fan.loads(STANDING)
    x0 = standing.project(standing.state({"leans.length": 1.0, "lifts.length": 1.0}))
    run = fan.simulate(standing, x0, t_end=0.1, method=method)
    assert run.tension["leans"][-1] > 1.0
    assert len(run.contact.involving("foot", "floor")) >= 4 * (len(run) - 2)
    assert not np.any(run.undetermined["leans"]) and not np.any(run.undetermined["leans.length"])
    assert np.all(run.undetermined["lifts"][2:])
    stepper = standing.stepper(x0, method)
    stepper.advance(0.1)
    assert "lifts" in stepper.undetermined and "leans" not in stepper.undetermined
    steppers = standing.stepper_batch(x0, 2, method)
    steppers.advance(0.1)
    assert steppers.undetermined(1) == stepper.undetermined
    # A batch does not keep the points of contact that share the weight.
    batch = fan.simulate_batch(standing, x0, t_end=0.05, save="all")
    assert batch.undetermined is None
    winches = loads_stand(LIFTS)
    assert "no contact points" in str(check_stand(winches, batch.trajectory(0), standing).notes)
    assert "no contact points" not in str(check_stand(winches, run, standing).notes)
    with pytest.raises(ValueError, match="does not store contact points"):
        fan.simulate_batch(standing, x0, t_end=0.05, save="undetermined")
