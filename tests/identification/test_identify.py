"""Estimates from synthetic records agree with the truth, and their errors are as predicted.

Records come from event-driven runs at a tight tolerance; the fit uses time steps. Both may differ
by the noise, 2 mm for every marker.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.identify.cases import arm, record
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

import fantoccini as fan
from fantoccini.lab.identification.estimating import make_fit
from fantoccini.lab.identification.fit import continuous_point

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def case():
    return arm()


def test_an_arm_is_estimated_within_the_tolerances(case):
    """Lengths and places are found to 1.5 mm, masses to 2 %, damping to 10 % (the elbow's 25 %),
    the delay to 1.5 ms.
    """
    estimate = fan.identify(record(case, 20.0, 3, gaps=0.1, outliers=0.01))
    for name, truth in case.truth.items():
        error = abs(estimate[name] - truth)
        if name.endswith("mass"):
            assert error < 0.02 * truth, name
        elif name.endswith("damping"):
            assert error < 0.25 * truth if name == "elbow_damping" else error < 0.1 * truth, name
        else:
            assert error < 1.5e-3, name
    assert estimate.converged and not estimate.combinations
    assert 0.9 < estimate.chi2 < 1.15  # outliers count as 4 deviations
    assert 10 < len(estimate.outliers) < 100  # of some 35 bad triples
    assert not estimate.rejected  # outliers do not invalidate their segments
    assert abs(estimate.noise["wrist.x"] - 2e-3) < 2e-4
    assert "delay" in estimate.summary()


def test_intervals_contain_the_truth_at_their_rate(case):
    """At least 88 % (95 % less 3 deviations) of 108 intervals of 95 % contain the truth: 9 in each
    of 12 records.
    """
    inside = []
    for seed in range(12):
        estimate = fan.identify(record(case, 10.0, 50 + seed))
        for name, truth in case.truth.items():
            low, high = estimate.interval(name)
            inside.append(low <= truth <= high)
    assert np.mean(inside) >= 0.88


def test_derivatives_agree_with_differences_of_event_driven_runs(case):
    """Derivatives of predictions with respect to parameters, offset and delay; time steps are of
    first order, so the fit uses small ones (0.5 ms).
    """
    data = record(case, 3.0, 1)
    fit = make_fit(data, 0.25, 0.0005, 1)
    point = continuous_point(fit, data.start_state(fit.inputs, float(fit.starts[0])))
    J = fit.jacobians(point).samples
    segment, m = 4, 2 * data.marionette.coordinates.n_vD
    _, segments, _ = fit.sample_positions(point.theta, fit.dt)
    in_segment = np.flatnonzero(segments == segment)[2:-2]

    def predicted(theta):
        values = dict(zip([u.name for u in data.unknowns], theta, strict=False))
        puppet = data.marionette.with_parameters(values)
        projected = fit.projected_point(point.q_D, point.v_D, theta, point.active_rows)
        q_K, v_K, _ = fit.inputs.evaluate(fit.starts[segment])
        offset = fit.offsets(theta)
        x = puppet.rest().replace(
            t=float(fit.starts[segment]),
            q_D=projected.q_D[segment],
            v_D=projected.v_D[segment],
            q_K=q_K + offset,
            v_K=v_K,
        )
        x = puppet.project(x)
        inputs = _with_offset(fit.inputs, offset)
        t = fit.t[in_segment] - fit.delay_of(theta)
        run = fan.simulate(
            puppet,
            x,
            inputs,
            float(t[-1]) + 0.01,
            method=fan.Event(rtol=1e-11, atol=1e-11),
            save_at=t,
        ).resample(t)
        return fit.channels.evaluate(run.q_D, run.q_K, puppet.p, fit.marker_positions(theta))

    for i, name in enumerate(data.labels):
        step = 1e-4 * data.scales[i]
        change = np.zeros(len(point.theta))
        change[i] = step
        slope = (predicted(point.theta + change) - predicted(point.theta - change)) / (2 * step)
        exact = J[in_segment][:, :, m + i]
        assert np.max(np.abs(slope - exact)) < 0.02 * np.max(np.abs(exact)) + 1e-6, name


def _with_offset(inputs, offset):
    """The inputs with constants added to their scalar coordinates."""
    coef = inputs.coef.copy()
    coef[:, :, 0] += offset
    return replace(inputs, coef=coef)


def test_derivatives_of_the_steps_are_exact(case):
    """Derivatives of predictions agree with central differences: to 5e-5 for the unknowns, since
    rotations are interpolated within steps ((omega dt)^2/8 at 4 rad/s), and to 1e-4 for the first
    states, whose smaller steps have more rounding.
    """
    data = replace(record(case, 3.0, 2), delay=0.00137)  # samples fall between nodes
    fit = make_fit(data, 0.25, 0.005, 1)
    point = continuous_point(fit, data.start_state(fit.inputs, float(fit.starts[0])))
    jacobians = fit.jacobians(point)
    J = jacobians.samples
    m, rng = J.shape[2] - len(point.theta), np.random.default_rng(0)
    _, segments, _ = fit.sample_positions(point.theta, fit.dt)
    for i in range(len(point.theta)):
        change = np.zeros(len(point.theta))
        change[i] = 1e-5 * data.scales[i]
        predictions = [
            fit.predict(fit.moved_point(point, np.zeros((len(point.q_D), m)), s * change))
            for s in (1, -1)
        ]
        slope = (predictions[0].y - predictions[1].y) / (2 * change[i])
        exact = J[:, :, m + i]
        assert np.max(np.abs(slope - exact)) < 5e-5 * np.max(np.abs(exact)), data.labels[i]
    state_changes = 1e-6 * rng.standard_normal((len(point.q_D), m))
    predictions = [
        fit.predict(fit.moved_point(point, s * state_changes, 0 * point.theta)) for s in (1, -1)
    ]
    slope = 0.5 * (predictions[0].y - predictions[1].y)
    exact = np.einsum("ncm,nm->nc", J[:, :, :m], state_changes[segments])
    assert np.max(np.abs(slope - exact)) < 1e-4 * np.max(np.abs(exact))
    end_speeds = 0.5 * (predictions[0].v_D - predictions[1].v_D)
    exact = np.einsum("sim,sm->si", jacobians.end[:, m // 2 :, :m], state_changes)
    assert np.max(np.abs(end_speeds - exact)) < 1e-4 * np.max(np.abs(exact))


PENDULUM_YAML = """
puppet: pendulum
bodies:
  - name: rod
    joint: {name: pin, type: revolute, axis: [0, -1, 0], damping: {parameter: damping, value: 0.02}}
    mass: {parameter: mass, value: 0.5}
    com: [0, 0, {parameter: centre, value: -0.35}]
    inertia: [0.01, 0.01, 0.0001]
  - name: cart
    joint: {name: slide, type: prismatic, axis: [1, 0, 0], driven: true, at: [0, 1, 0]}
    mass: 0.1
pose: {pin: 40 deg}
"""


def swing_samples(rng, seconds=12.0, noise=0.01):
    """A freely swinging pendulum, simulated by SciPy: times, noisy angles, true parameters."""
    mass, centre, damping, inertia = 0.4, -0.3, 0.03, 0.01
    inertia_about_pin = inertia + mass * centre**2
    t = np.arange(0.0, seconds, 0.02)
    solution = solve_ivp(
        lambda t, y: [
            y[1],
            (mass * 9.81 * centre * np.sin(y[0]) - damping * y[1]) / inertia_about_pin,
        ],
        (0.0, seconds),
        [np.radians(40.0), 0.0],
        t_eval=t,
        rtol=1e-10,
        atol=1e-10,
    )
    return (
        t,
        solution.y[0] + noise * rng.standard_normal(len(t)),
        (mass, centre, damping, inertia_about_pin),
    )


def test_a_pendulum_is_found_as_scipy_finds_it():
    """Compared with least squares over SciPy's runs: estimates within 0.2 deviations, errors
    within 15 %.
    """
    rng = np.random.default_rng(5)
    t, angle, (mass, centre, *_) = swing_samples(rng)
    puppet = fan.loads(PENDULUM_YAML).with_parameters({"mass": mass, "centre": centre + 0.02})
    puppet = puppet.with_parameters({"damping": 0.02})

    def misfit(theta):
        estimated_centre, damping, start, rate = theta
        inertia_about_pin = 0.01 + mass * estimated_centre**2
        solution = solve_ivp(
            lambda t, y: [
                y[1],
                (mass * 9.81 * estimated_centre * np.sin(y[0]) - damping * y[1])
                / inertia_about_pin,
            ],
            (0.0, t[-1]),
            [start, rate],
            t_eval=t,
            rtol=1e-9,
            atol=1e-9,
        )
        return (solution.y[0] - angle) / 0.01

    scipy_fit = least_squares(misfit, [centre, 0.03, np.radians(40.0), 0.0])
    errors = np.sqrt(np.diag(np.linalg.inv(scipy_fit.jac.T @ scipy_fit.jac)))
    data = fan.lab.Record(
        puppet,
        fan.Input.hold(puppet, float(t[-1])),
        t,
        {"pin": angle},
        unknown=[fan.lab.Unknown("centre", positive=False), "damping"],
        noise={"pin": 0.01},
    )
    estimate = fan.identify(data, drift=(1e-4, 1e-3))
    for i, name in enumerate(("centre", "damping")):
        assert abs(estimate[name] - scipy_fit.x[i]) < 0.2 * errors[i], name
        assert abs(estimate.deviation(name) / errors[i] - 1.0) < 0.15, name


def test_undetermined_combinations_of_a_pendulum_are_named():
    """Angles determine only the ratio of mass and damping: a common factor changes nothing."""
    rng = np.random.default_rng(6)
    text = PENDULUM_YAML.replace(
        "inertia: [0.01, 0.01, 0.0001]", "inertia: [1.0e-9, 1.0e-9, 1.0e-9]"
    )
    t, angle, _ = swing_samples(rng)
    data = fan.lab.Record(
        fan.loads(text),
        fan.Input.hold(fan.loads(text), float(t[-1])),
        t,
        {"pin": angle},
        unknown=["mass", "damping", fan.lab.Unknown("centre", positive=False)],
    )
    estimate = fan.identify(data)
    assert len(estimate.combinations) == 1
    parts = estimate.combinations[0].parts
    assert set(parts) == {"mass", "damping"}
    # Parts are relative to the larger of the first and the estimated value, their ratio to the
    # estimates.
    sizes = data.scales_at(estimate.values)
    mass, damping = (parts[n] * sizes[i] / estimate[n] for i, n in enumerate(("mass", "damping")))
    assert abs(mass / damping - 1.0) < 0.02
    centre = (0.01 + 0.4 * 0.3**2) / (0.4 * 0.3)  # of a point mass that swings like the rod
    ratio = (0.01 + 0.4 * 0.3**2) / (0.03 * centre**2)
    assert abs(estimate["centre"] + centre) < 5e-3
    assert abs(estimate["mass"] / estimate["damping"] / ratio - 1.0) < 0.05
    assert np.isinf(estimate.deviation("mass")) and np.isfinite(estimate.deviation("centre"))
    assert "only together" in estimate.summary()


def case_with_unknown_masses():
    """An arm with unknown masses, damping and drag."""
    truth = {
        "shoulder_damping": 2.4e-3,
        "upper_mass": 0.15,
        "elbow_damping": 2.4e-3,
        "lower_mass": 0.11,
        "upper_drag": 0.022,
        "delay": 0.004,
    }
    markers = [replace(m, find=False) for m in arm().markers]
    return replace(arm(), truth=truth, markers=markers, signed=())


def test_only_forces_determine_the_scale_of_masses():
    """A common factor of masses and damping changes no motion; a tension or one known mass
    determines it.
    """
    case = case_with_unknown_masses()
    without_tension = fan.identify(record(case, 10.0, 1))
    assert len(without_tension.combinations) == 1
    parts = without_tension.combinations[0].parts
    assert {"upper_mass", "lower_mass"} <= set(parts)
    assert all(share > 0 for share in parts.values())
    assert np.isinf(without_tension.deviation("upper_mass")) and np.isfinite(
        without_tension.deviation("delay")
    )
    ratio = without_tension["upper_mass"] / without_tension["lower_mass"]
    assert abs(ratio / (0.15 / 0.11) - 1.0) < 0.05
    with_tension = fan.identify(record(replace(case, tensions=("hand",)), 10.0, 1))
    assert not with_tension.combinations
    assert abs(with_tension["lower_mass"] / 0.11 - 1.0) < 0.02
    assert abs(with_tension["upper_mass"] / 0.15 - 1.0) < 0.02


def test_a_known_mass_determines_the_scale():
    case = case_with_unknown_masses()
    data = record(case, 10.0, 1)
    known = [
        replace(u, about=0.11, known=1e-4) if u.name == "lower_mass" else u for u in data.unknowns
    ]
    estimate = fan.identify(replace(data, unknown=known))
    assert not estimate.combinations
    assert abs(estimate["upper_mass"] / 0.15 - 1.0) < 0.05


def test_motor_parameters_are_found():
    """Stiffness and damping of a pd drive, from the angle of its joint."""
    text = """
puppet: crank
bodies:
  - name: arm
    joint: {name: turn, type: revolute, axis: [0, -1, 0], driven: true}
    mass: 0.3
    com: [0.1, 0, 0]
    inertia: [1.0e-3, 1.0e-3, 1.0e-3]
drives:
  - on: turn
    inertia: 1.0e-4
    control:
      {type: pd, stiffness: {parameter: k, value: 2.0}, damping: {parameter: c, value: 0.05}}
"""
    puppet = fan.loads(text)
    truth = {"k": 3.0, "c": 0.08}
    true_puppet, rng = puppet.with_parameters(truth), np.random.default_rng(0)
    times = np.arange(0.0, 8.0, 0.25)
    values = rng.uniform(-0.8, 0.8, len(times))
    values[[0, -1]] = 0.0
    inputs = fan.Input.waypoints(puppet, {"turn": list(zip(times, values, strict=True))})
    run = fan.simulate(true_puppet, true_puppet.rest(), inputs, 8.0)
    t = np.arange(0.1, 7.9, 1 / 60)
    angle = run.resample(t)["turn"] + 0.01 * rng.standard_normal(len(t))
    estimate = fan.identify(fan.lab.Record(puppet, inputs, t, {"turn": angle}, unknown=["k", "c"]))
    for name, value in truth.items():
        assert abs(estimate[name] - value) < 4 * estimate.deviation(name), name
        assert estimate.deviation(name) < 0.1 * value, name


def test_larger_motions_are_more_informative(case):
    """A motionless candidate ranks last; for the best one, errors are as predicted."""
    data = record(case, 10.0, 4)
    motionless = fan.Input.hold(case.puppet, 10.0)
    candidates = fan.lab.suggest_motion(data, {"still": motionless, "moving": data.inputs})
    assert [c.name for c in candidates] == ["moving", "still"]
    assert candidates[1].combinations and not candidates[0].combinations
    estimate = fan.identify(data)
    for name in arm().truth:
        # Noise is guessed as 5 mm before a record.
        predicted = candidates[0].deviations[name] * 2e-3 / 5e-3
        assert 0.4 < estimate.deviation(name) / predicted < 2.5, name


def test_random_motions_are_tried_and_written(case, tmp_path):
    data = record(case, 5.0, 4)
    candidates = fan.lab.suggest_motion(data, duration=5.0, reach=0.1, draws=1, seed=1)
    assert len(candidates) == 6 and candidates[0].gain >= candidates[-1].gain
    candidates[0].save(tmp_path / "best.csv")
    loaded = fan.Input.load(case.puppet, tmp_path / "best.csv")
    t = np.linspace(0.0, loaded.end, 50)
    assert np.allclose(loaded.evaluate(t)[0], candidates[0].inputs.evaluate(t)[0], atol=1e-4)


def test_a_length_between_joints_is_found():
    """The parameter also moves markers when the configuration does not change."""
    text = PENDULUM_YAML.replace(
        "  - name: cart",
        """  - name: tail
    parent: rod
    joint: {type: revolute, axis: [0, -1, 0], at: [0, 0, {parameter: reach, value: -0.5}]}
    mass: 0.1
    com: [0, 0, -0.1]
    inertia: [1.0e-4, 1.0e-4, 1.0e-4]
  - name: cart""",
    )
    puppet = fan.loads(text).with_parameters({"centre": -0.3})
    true_puppet, rng = puppet.with_parameters({"reach": -0.46}), np.random.default_rng(2)
    hold = fan.Input.hold(puppet, 6.0)
    run = fan.simulate(true_puppet, true_puppet.state({"pin": 0.7}), hold, 6.0)
    t = np.arange(0.0, 5.9, 1 / 60)
    samples = run.resample(t)
    pose = true_puppet.poses(samples.q_D, samples.q_K)[
        :, [link.name for link in true_puppet.tree.links].index("tail")
    ]
    positions = pose[:, :, 3] + 2e-3 * rng.standard_normal((len(t), 3))
    columns = {f"joint.{axis}": positions[:, i] for i, axis in enumerate("xyz")} | {
        "tail": samples["tail"] + 0.01 * rng.standard_normal(len(t))
    }
    data = fan.lab.Record(
        puppet,
        hold,
        t,
        columns,
        [fan.lab.Marker("joint", "tail")],
        [fan.lab.Unknown("reach", positive=False), "damping"],
        start={"pin": 0.1},
    )
    estimate = fan.identify(data)
    assert abs(estimate["reach"] + 0.46) < 1e-3
    assert abs(estimate["damping"] / 0.02 - 1.0) < 0.05


def free_swing_record(first_guess, **options):
    """A record of a freely swinging pendulum with unknown damping."""
    t, angle, _ = swing_samples(np.random.default_rng(3), seconds=3.0, noise=0.05)
    puppet = fan.loads(PENDULUM_YAML).with_parameters({"mass": 0.4, "centre": -0.3})
    return fan.lab.Record(
        puppet,
        fan.Input.hold(puppet, float(t[-1])),
        t,
        {"pin": angle},
        unknown=[fan.lab.Unknown("damping", first_guess)],
        noise={"pin": 0.05},
        **options,
    )


def test_a_small_first_guess_gives_the_same_estimate():
    """A first guess of a thirtieth of the damping leads to the same estimate as a good guess."""
    distant_guess, near_guess = (fan.identify(free_swing_record(about)) for about in (0.001, 0.03))
    assert not near_guess.combinations and not distant_guess.combinations
    assert 0.001 < near_guess.deviation("damping") < 0.5 * near_guess["damping"]
    assert abs(distant_guess["damping"] - near_guess["damping"]) < 0.1 * near_guess.deviation(
        "damping"
    )
    assert abs(near_guess["damping"] - 0.03) < 3.0 * near_guess.deviation("damping")


def test_a_delay_is_found_near_its_guess_and_its_bound_is_reported(case):
    """A delay of 1 s is found from a guess of 1 s; one of 0.4 s stops at the bound of 0.25 s."""
    data = record(case, 5.0, 3)
    delayed = fan.identify(replace(data, t=data.t + 1.0, delay=1.0))
    error = abs(delayed["delay"] - 1.0 - case.truth["delay"])
    assert error < 4.0 * delayed.deviation("delay") < 8e-3 and not delayed.at_bound
    estimate = fan.identify(replace(data, t=data.t + 0.4))
    assert estimate.at_bound and not estimate.converged
    assert abs(estimate["delay"] - 0.25) < 1e-3
    assert "better initial value" in estimate.summary()


def test_columns_without_samples_are_left_out(case, recwarn):
    data = record(case, 3.0, 1)
    columns = {name: values for name, values in data.columns.items() if name != "wrist.y"}
    estimate = fan.identify(replace(data, columns=columns))
    assert "wrist.y" not in estimate.rms() and np.all(np.isfinite(list(estimate.rms().values())))
    assert not [warning for warning in recwarn if "empty slice" in str(warning.message)]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"noise": {"pin": 0.0}}, "noise of pin is 0.0"),
        ({"noise": {"pin": -1.0}}, "noise of pin is -1.0"),
        ({"delay": np.inf}, "delay is inf"),
        ({"t": np.append(np.arange(149) / 50, np.inf)}, "must be finite"),
        ({"t": np.arange(150) / 50 + 1.7e9}, r"from 1\.7e\+09 s .* the inputs from 0 s"),
        ({"columns": {"pin": np.append(np.zeros(149), np.inf)}}, "column pin has infinite"),
        ({"offsets": ("slide", "slide")}, "slide is unknown twice"),
    ],
)
def test_a_record_checks_its_numbers(change, message):
    with pytest.raises((ValueError, fan.FantocciniError), match=message):
        replace(free_swing_record(0.02), **change)


@pytest.mark.parametrize("known", [0.0, -1.0, np.nan])
def test_known_deviations_are_positive(known):
    with pytest.raises(ValueError, match="known of damping"):
        fan.lab.Unknown("damping", known=known)


def test_sensors_with_alternating_rows_all_count(case):
    """Every marker has rows of its own, as with three cameras; a third of the samples remains."""
    data = record(case, 12.0, 4)
    camera = np.arange(len(data.t)) % 3
    columns = {
        name: np.where(camera == ("middle", "wrist", "tip").index(name.split(".")[0]), x, np.nan)
        for name, x in data.columns.items()
    }
    estimate = fan.identify(replace(data, columns=columns))
    assert estimate.converged and all(estimate.noise[name] < 3e-3 for name in columns)
    assert abs(estimate["tie"] - case.truth["tie"]) < 2e-3


def test_a_positive_number_needs_a_positive_initial_value(case):
    data = record(case, 3.0, 1)
    for about in (0.0, -0.1):
        with pytest.raises(
            fan.errors.StateError, match=r"upper_mass has the initial value .* give one above 0"
        ):
            replace(data, unknown=[fan.lab.Unknown("upper_mass", about=about)])


def test_a_puppet_without_dynamic_coordinates_is_refused():
    rail = fan.loads("""
puppet: rail
bodies:
- {name: cart, joint: {name: rail, type: prismatic, axis: [1, 0, 0], driven: true}, mass: 1}
""")
    t = np.linspace(0.1, 1.9, 60)
    with pytest.raises(fan.errors.StateError, match="no dynamic coordinates"):
        fan.lab.Record(
            rail,
            fan.Input.hold(rail, 2.0),
            t,
            {"dot.x": 0.0 * t},
            [fan.lab.Marker("dot", "cart")],
            find_delay=True,
        )
