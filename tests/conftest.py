"""Puts the folder of the tests on the path, so that they find the oracles, and long files first."""

import signal
import sys
from pathlib import Path

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
)
"""The files that take longest, which go first: one that begins last is waited for."""


def pytest_configure(config):
    """Ctrl-C works in the tests of it also where they run in the background of a script: there
    SIGINT is ignored, and who starts with it ignored, a process that a test starts too, stays so.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(items):
    folder = Path(__file__).parent
    rank = {folder / name: k for k, name in enumerate(LONG)}
    items.sort(key=lambda item: rank.get(item.path, len(LONG)))
