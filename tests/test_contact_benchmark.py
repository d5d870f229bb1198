"""Comparison of benchmarks/contact: MuJoCo's scene equals ours, and problems are stored exactly."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.contact import methods, problems, programs, scenarios
from benchmarks.contact.boxes import UnsupportedSceneError
from benchmarks.contact.mujoco_scene import SETTINGS, MuJoCoScene, scene_mjcf

import fantoccini as fan

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def cube():
    return scenarios.cube_on_floor(0.5)


def test_mujoco_gets_our_scene(cube):
    """Four corners carry the weight in both, and coordinates have the same order."""
    x = cube.state()
    scene = MuJoCoScene.of(cube, x.q_K, scenarios.DT)
    x = x.replace(v_D=np.arange(1.0, 7.0))
    scene.put(x)
    assert scene.data.qvel[scene.v_D].tolist() == x.v_D.tolist()
    assert scene.data.qpos[scene.q_D].tolist() == x.q_D.tolist()
    weight = scenarios.MASS * scenarios.G
    for settings in SETTINGS:
        scene.choose(settings)
        scene.put(cube.state())
        scene.step(1000)
        assert scene.points == 4
        normal = sum(scene.force(i)[0] for i in range(scene.data.ncon))
        assert normal == pytest.approx(weight, rel=1e-3)
    course = scenarios.run_fantoccini(cube, cube.state(), 0.01)
    assert course.normal[-1].sum() == pytest.approx(weight, rel=1e-9)
    assert len(course.normal[-1]) == 4


def test_a_cube_slides_and_is_pushed_in_both(cube):
    """It stops after v^2 / (2 mu g); a push below the threshold moves nothing in our method."""
    for run in (
        scenarios.run_fantoccini,
        lambda *a, **k: scenarios.run_mujoco(*a, hard=False, **k),
    ):
        assert scenarios.stopping_error(run) < 2e-3
    assert scenarios.dragged_distance(scenarios.run_fantoccini) < 1e-12


@pytest.mark.parametrize("engine", ["Drake, SAP", "Drake, lagged", "Bullet"])
def test_other_engines_get_our_scene(cube, engine):
    runs = scenarios.installed_engines()
    if engine not in runs:
        pytest.skip(f"without {engine}")
    assert scenarios.stopping_error(runs[engine]) < 2e-3
    # A cube thrown up with a spin moves as ours until it lands.
    start = cube.state({"cube.z": 1.0})
    rate = np.array([0.1, 0.2, 3.0, 1.0, -2.0, 0.5])
    q = start.q_D.copy()
    q[3:] = np.array([0.8, 0.2, -0.4, 0.4])
    start = start.replace(q_D=q / np.r_[1, 1, 1, np.full(4, np.linalg.norm(q[3:]))], v_D=rate)
    result, wanted = runs[engine](cube, start, 0.2), scenarios.run_fantoccini(cube, start, 0.2)
    assert result.q[-1] == pytest.approx(wanted.q[-1], abs=2e-3)
    assert result.v[-1] == pytest.approx(wanted.v[-1], abs=2e-3)


def test_engines_without_strings_say_so():
    for name in ("Drake, SAP", "Bullet"):
        if name in scenarios.installed_engines():
            with pytest.raises(UnsupportedSceneError, match="without strings"):
                scenarios.sunk_depth(scenarios.installed_engines()[name])


def test_impacts_at_the_ends_of_variational_steps_leave_the_angle_at_first_order():
    """They are not worth an option: event-driven runs have angle and energy at a tolerance."""
    free = fan.loads(methods.KNOCKER)
    walled = fan.loads(methods.KNOCKER + methods.WALL)
    angle, energy, knocks, _ = methods.whole_run(walled, free, fan.Event())
    runs = [methods.variational_run(free, dt) for dt in (0.004, 0.001)]
    assert knocks == 14
    assert abs(runs[1][0] - angle) > 1e-3
    assert abs(runs[0][0] - angle) < 8 * abs(runs[1][0] - angle)  # order 2 has 16
    assert abs(runs[1][1] - energy) < 1e-5


def test_the_timed_program_makes_our_steps(cube):
    program = programs.compile_scene(cube, scenarios.DT)
    burst = program.run(cube.state(), "step", 1, 200)
    assert burst.points == 4
    assert burst.force == pytest.approx(scenarios.MASS * scenarios.G, rel=1e-9)
    assert burst.residual < 1e-10


def test_bodies_that_do_not_meet_are_excluded(cube):
    assert "exclude" not in scene_mjcf(cube, cube.state().q_K)


@pytest.fixture
def problem(tmp_path):
    """Two contacts on a body and one that touches nothing else, as text."""
    rng = np.random.default_rng(0)
    A = rng.normal(size=(8, 6))
    M = np.zeros((9, 9))
    M[:6, :6], M[6:, 6:] = A.T @ A, np.eye(3)
    q = np.array([-1.0, 0.3, 0.1, -0.5, 0.0, 0.2, 1.0, 0.0, 0.0])
    return problems.Problem(tmp_path / "a.hdf5.dat", M, q, np.array([0.5, 0.0, 0.9]))


def test_problems_survive_being_written(problem):
    problem.file.write_text(problem.text(), encoding="utf-8")
    read = problems.read_problem(problem.file)
    assert read.name == "a"
    for name in ("M", "q", "mu"):
        assert np.array_equal(getattr(read, name), getattr(problem, name))
    dense = [3, 3, 0, 9, 9, 9, 9, *problem.M.ravel(), *problem.q, *problem.mu]
    problem.file.write_text(" ".join(map(repr, map(float, dense))).replace(".0 ", " "))
    assert np.array_equal(problems.read_problem(problem.file).M, problem.M)
    problem.file.write_text("2 1 0 2 2 2 2 1 0 0 1 0 0 0.5")
    assert problems.read_problem(problem.file) is None


def test_our_answer_satisfies_the_law_and_another_does_not(problem):
    answer = problems.solve_with_fantoccini(problem)
    assert answer.residual < 1e-12
    assert problem.residual(np.zeros(9)) > 0.1


def test_a_page_without_failures_says_so(tmp_path):
    for folder in (None, tmp_path):
        text = problems.chapter(folder, None).section.markdown()
        assert "Not measured" in text and "--problems" in text


def test_problems_in_fclibs_files(tmp_path):
    """Contacts in rows and bodies in triplets: W = H^T M^-1 H, q = w + H^T M^-1 f."""
    h5py = pytest.importorskip("h5py")
    rng = np.random.default_rng(0)
    H, mass = rng.standard_normal((4, 3)), np.array([1.0, 2.0, 0.5, 3.0])
    f, w = rng.standard_normal(4), rng.standard_normal(3)
    W, q = H.T @ (H / mass[:, None]), w + H.T @ (f / mass)

    def write(group, name, nz, x, i, p, shape):
        numbers = {"m": [shape[0]], "n": [shape[1]], "nz": [nz], "x": x, "i": i, "p": p}
        for key, value in numbers.items():
            group[f"{name}/{key}"] = np.asarray(value)

    with h5py.File(tmp_path / "local.hdf5", "w") as file:
        own = file.create_group("fclib_local")
        write(own, "W", -2, W.ravel(), [0, 1, 2] * 3, [0, 3, 6, 9], (3, 3))
        own["spacedim"], own["vectors/q"], own["vectors/mu"] = [3], q, [0.4]
    with h5py.File(tmp_path / "global.hdf5", "w") as file:
        own = file.create_group("fclib_global")
        write(own, "M", 4, mass, range(4), range(4), (4, 4))
        rows, columns = np.repeat(np.arange(4), 3), np.tile(np.arange(3), 4)
        write(own, "H", 12, H.ravel(), rows, columns, (4, 3))
        own["spacedim"], own["vectors/f"], own["vectors/w"] = [3], f, w
        own["vectors/mu"] = [0.4]
    for name in ("local", "global"):
        parsed = problems.read_problem(tmp_path / f"{name}.hdf5")
        assert np.allclose(parsed.M, W, atol=1e-13) and np.allclose(parsed.q, q, atol=1e-13)
        assert parsed.mu == [0.4] and problems.solve_with_fantoccini(parsed).residual < 1e-10
