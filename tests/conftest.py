"""Path, order, compiler flags and shared fixtures of the tests.

The folder of the tests is on the path, so that they find the oracles.
"""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import fantoccini as fan

sys.path.insert(0, str(Path(__file__).parent))

SHARED = {"arm", "marionette", "crane"}
"""Puppets of the session. Their libraries are compiled when first used, by any file."""

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
    """Compiles the puppets of files marked ``own_puppets`` with -Og.

    Compiling small puppets takes longer than running them. Bundled and random puppets, and tests of
    bits and speed, have the default flags or the flag of ``--puppet-flag``. Flags that the user has
    set override both.
    """
    marked = request.node.get_closest_marker("own_puppets") is not None
    with pytest.MonkeyPatch.context() as patch:
        if marked and not request.config.stash[FLAGS_OF_USER]:
            patch.setenv(FLAGS, "-Og")
        yield


def pytest_collection_modifyitems(config, items):
    """Slow tests go last, files marked ``long`` first: the run waits for a file that begins last.

    With a time limit, the other slow files begin at one that the commit selects, so that successive
    commits run different files before the limit.

    Raises:
        UsageError: a file marked ``own_puppets`` uses a puppet of the session, which it would
            compile with -Og for the files after it.
    """
    for item in items:
        shared = SHARED & set(item.fixturenames)
        if shared and item.get_closest_marker("own_puppets"):
            raise pytest.UsageError(f"{item.nodeid}: {sorted(shared)} in a file marked own_puppets")
    marked = ("slow", True), ("long", False)
    items.sort(key=lambda item: [bool(item.get_closest_marker(n)) is last for n, last in marked])
    if config.getoption("--time-limit") < float("inf"):
        others = [
            item
            for item in items
            if item.get_closest_marker("slow") and not item.get_closest_marker("long")
        ]
        files = list(dict.fromkeys(item.path for item in others))
        first = _commit_number() % max(1, len(files))
        order = {path: i for i, path in enumerate(files[first:] + files[:first])}
        items[len(items) - len(others) :] = sorted(others, key=lambda item: order[item.path])


def _commit_number() -> int:
    """Number of the commit that is tested; 0 outside a repository."""
    command = ["git", "-C", str(Path(__file__).parent), "rev-parse", "HEAD"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return int(done.stdout.strip() or "0", 16)


@pytest.fixture(scope="session")
def arm() -> fan.Marionette:
    """The bundled planar arm."""
    return fan.puppets.arm2d()


@pytest.fixture(scope="session")
def marionette() -> fan.Marionette:
    """The bundled marionette."""
    return fan.puppets.marionette()


@pytest.fixture(scope="session")
def crane() -> fan.Marionette:
    """The bundled gantry crane."""
    return fan.puppets.crane()


@pytest.fixture(scope="module")
def promenade() -> fan.Marionette:
    """The bundled stage with a marionette that stands; with the compiler flags of the file."""
    return fan.puppets.promenade()
