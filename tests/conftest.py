"""Puts the folder of the tests on the path, so that they find the oracles, and long files first.

Sets the compiler flags of puppets (``--puppet-flag``).
"""

import os
import signal
import sys
import time
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

LONG = (
    "properties/test_properties.py",
    "cross/test_mujoco.py",
    "laws/test_linearisation.py",
    "laws/test_complementarity.py",
    "plan/test_marionette_plan.py",
    "test_readme.py",
    "codegen/test_c99.py",
    "cpp/test_lanes.py",
    "runs/test_integrators.py",
    "test_examples.py",
    "perform/test_abuse.py",
    "plan/test_plan.py",
    "animation/test_glb.py",
    "plays/test_props.py",
    "plays/test_clips.py",
    "capture/test_retarget.py",
    "plays/test_companies.py",
    "laws/test_equations.py",
    "animation/test_export.py",
    "exchange/test_import_mjcf.py",
    "optimal/test_optimise.py",
    "drives/test_weak_motors.py",
    "plan/test_clearance.py",
    "plan/test_meshes.py",
    "cli/test_show_command.py",
    "cli/test_stand_stream.py",
    "plays/test_compiling.py",
    "plays/test_sitting.py",
)
"""The files that take longest, which go first: one that begins last is waited for."""

CONTACT = (
    "contact/test_books.py",
    "contact/test_closed_forms.py",
    "contact/test_contact_files.py",
    "contact/test_contact_linearisation.py",
    "contact/test_contact_rollout_gradient.py",
    "contact/test_contact_sensitivity.py",
    "contact/test_contact_step_derivatives.py",
    "contact/test_dented_meshes.py",
    "contact/test_event_contact.py",
    "contact/test_event_hulls.py",
    "contact/test_event_sliding.py",
    "contact/test_event_winches.py",
    "contact/test_mesh_pieces.py",
    "contact/test_meshes.py",
    "contact/test_patches.py",
    "contact/test_prescribed.py",
    "contact/test_shared_forces.py",
    "contact/test_standing.py",
    "contact/test_starts.py",
    "contact/test_thin_walls.py",
)
"""Files that compile many small puppets with contact."""

SLOW = (
    *CONTACT,
    "animation/test_bvh.py",
    "animation/test_three.py",
    "cli/test_perform_command.py",
    "cli/test_simulate_command.py",
    "codegen/test_c99.py",
    "contact/test_contact_lanes.py",
    "contact/test_contact_runs.py",
    "cpp/test_complementarity.py",
    "cpp/test_lanes.py",
    "cpp/test_sanitizers.py",
    "cpp/test_touch.py",
    "cpp/test_touch_follow.py",
    "cpp/test_touch_hull.py",
    "cpp/test_variational.py",
    "cross/test_mujoco.py",
    "drives/test_drive_derivatives.py",
    "drives/test_drives.py",
    "exchange/test_import_models.py",
    "gestures/test_rehearsing.py",
    "gestures/test_walk_and_targets.py",
    "identification/test_identify.py",
    "laws/test_complementarity.py",
    "laws/test_linearisation.py",
    "laws/test_sensitivity.py",
    "optimal/test_clear_rows.py",
    "optimal/test_contact.py",
    "optimal/test_design.py",
    "optimal/test_exact_search.py",
    "optimal/test_forces.py",
    "optimal/test_modes.py",
    "optimal/test_motors.py",
    "optimal/test_mpc.py",
    "optimal/test_reach.py",
    "optimal/test_task_files.py",
    "optimal/test_tosses.py",
    "optimal/test_touches.py",
    "optimal/test_walk.py",
    "perform/test_abuse.py",
    "perform/test_live_on_stage.py",
    "perform/test_playing.py",
    "perform/test_show.py",
    "plan/test_contact_problem_files.py",
    "plan/test_marionette_plan.py",
    "plan/test_plan.py",
    "plan/test_pushing_plans.py",
    "plan/test_standing_plans.py",
    "plan/test_touching_plans.py",
    "plan/test_verify_mujoco.py",
    "plays/test_clips.py",
    "plays/test_companies.py",
    "plays/test_compiling.py",
    "plays/test_props.py",
    "plays/test_putting.py",
    "plays/test_sitting.py",
    "properties/",
    "runs/test_cable_robot.py",
    "runs/test_impossible.py",
    "runs/test_integrators.py",
    "runs/test_rollout_gradient.py",
    "runs/test_soundness.py",
    "runs/test_step_partials.py",
    "runs/test_stepper_batch.py",
    "scene/test_event_scenes.py",
    "scene/test_on_stage.py",
    "scene/test_scene_motion.py",
    "section_vi/test_experiment.py",
    "show/test_balance_page.py",
    "show/test_forces_page.py",
    "show/test_hands_page.py",
    "show/test_page.py",
    "show/test_perform_page.py",
    "show/test_play_page.py",
    "show/test_round_trip_page.py",
    "show/test_viewers.py",
    "sweep/test_scene_sweep.py",
    "variational/",
    "test_contact_benchmark.py",
    "test_examples.py",
    "test_readme.py",
)
"""Left out by `make test`, which is to stay short; `make test-all` has them."""

QUICK = (
    *CONTACT,
    "cross/test_mechanisms.py",
    "cross/test_reeling_pendulum.py",
    "cross/test_string_pendulum.py",
    "cross/test_two_strings.py",
    "drives/",
    "exchange/test_import_mjcf.py",
    "laws/test_chains.py",
    "laws/test_redundant.py",
    "laws/test_restitution.py",
    "motion/test_files.py",
    "motion/test_trajectory.py",
    "optimal/test_clear_rows.py",
    "optimal/test_contact.py",
    "optimal/test_design.py",
    "optimal/test_tuning.py",
    "plan/test_damaged_plans.py",
    "plan/test_plan_files.py",
    "plan/test_touching_plans.py",
    "plays/test_props.py",
    "puppet/test_chain.py",
    "puppet/test_shapes.py",
    "puppet/test_winches.py",
    "runs/test_cable_robot.py",
    "runs/test_events.py",
    "runs/test_integrators.py",
    "runs/test_short_steps.py",
    "runs/test_slipping.py",
    "runs/test_soundness.py",
    "runs/test_timestepping.py",
    "runs/test_winch_runs_out.py",
    "scene/test_scene_files.py",
    "scene/test_scene_planning.py",
    "show/test_motion_page.py",
    "show/test_page.py",
    "variational/test_laws.py",
    "variational/test_standing_still.py",
    "view/test_forces.py",
    "view/test_pictures.py",
)
"""Files and folders with small puppets of their own. Compiling these takes longer than running
them, so they are compiled with -Og.

Bundled and random puppets, and tests of bits and speed, have the default flags or the flag of
``--puppet-flag``. ``FANTOCCINI_CXXFLAGS`` overrides both.
"""

STARTED = time.monotonic()
FLAGS = "FANTOCCINI_CXXFLAGS"
FLAGS_OF_USER = pytest.StashKey[bool]()


def pytest_addoption(parser):
    help_text = "compiler flag for all puppets except those compiled with -Og"
    parser.addoption("--puppet-flag", default="", metavar="FLAG", help=help_text)
    help_text = "skip the tests that have not begun after this time [s]"
    parser.addoption("--time-limit", type=float, default=float("inf"), help=help_text)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item):
    if time.monotonic() - STARTED > item.config.getoption("--time-limit"):
        pytest.skip("the time limit had passed")


def pytest_configure(config):
    """Sets the compiler flag of puppets, and restores SIGINT for the Ctrl-C tests.

    Session fixtures compile before module fixtures could set flags. A script's background jobs
    start with SIGINT ignored, and their children inherit this.
    """
    config.stash[FLAGS_OF_USER] = bool(os.environ.get(FLAGS))
    starts_workers = bool(config.getoption("numprocesses", None))  # these set the flag themselves
    if not config.stash[FLAGS_OF_USER] and not starts_workers:
        os.environ[FLAGS] = config.getoption("--puppet-flag")
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="module", autouse=True)
def compiled_with_og(request):
    """Compiles the puppets of files in QUICK with -Og, unless the user has set flags."""
    name = request.path.relative_to(Path(__file__).parent).as_posix()
    with pytest.MonkeyPatch.context() as patch:
        if name.startswith(QUICK) and not request.config.stash[FLAGS_OF_USER]:
            patch.setenv(FLAGS, "-Og")
        yield


def pytest_collection_modifyitems(items):
    folder = Path(__file__).parent
    for item in items:
        if item.path.relative_to(folder).as_posix().startswith(SLOW):
            item.add_marker(pytest.mark.slow)
    rank = {folder / name: k for k, name in enumerate(LONG)}
    items.sort(key=lambda item: rank.get(item.path, len(LONG)))
