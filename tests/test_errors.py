"""Exceptions survive copies and transport to another process."""

from __future__ import annotations

import copy
import importlib
import inspect
import multiprocessing
import pickle
import pkgutil

import pytest

import fantoccini as fan
from fantoccini.base import errors
from fantoccini.base.documents.yaml_text import Unreadable
from fantoccini.base.errors import FileError, Mistake, Status
from fantoccini.theatre.cast.stops import CannotBegin, Stop
from fantoccini.theatre.gestures.styling import StyleError
from fantoccini.theatre.gestures.turns import TurnError
from fantoccini.theatre.retarget import TooShortError

pytestmark = pytest.mark.medium

PROBLEMS = [Mistake("a.yaml", 3, "bodies[0].mass", "found -1"), Mistake("a.yaml", None, "", "no")]
FACTS = {
    errors.MissingLibraryError: ("a film", "pyvista", "pyvista"),
    errors.UnknownNameError: ("string", "hnd", ["hand", "foot"]),
    errors.SimulationError: (Status.TENSION_CAP, "at t = 1 s", {"rows": 3}),
    errors.PacketError: (1.5, "not sent"),
    errors.StreamError: (7, "G7", "error:20"),
    errors.SweepStopped: ("stopped at 3 of 5", [1, 2, 3]),
    CannotBegin: (Stop(("columbine",), 0.0, "a string is too short"),),
    StyleError: ("larger", "the hand would be higher than its bar"),
    TooShortError: ("wave", 0.8, 1.55),
    TurnError: ("bar.rotation", 3.2, 1.5),
    Unreadable: (4, ("bodies", 0), "a tab"),
}
"""Arguments of exceptions that take more than a sentence."""


def exceptions() -> list[type[Exception]]:
    """Every exception class of the package."""
    names = [m.name for m in pkgutil.walk_packages(fan.__path__, "fantoccini.")]
    modules = [importlib.import_module(n) for n in names if not n.endswith("__main__")]
    kinds = {
        x
        for module in modules
        for x in vars(module).values()
        if inspect.isclass(x) and issubclass(x, Exception) and x.__module__ == module.__name__
    }
    return sorted(kinds, key=lambda x: x.__qualname__)


def example(kind: type[Exception]) -> Exception:
    if issubclass(kind, FileError):
        return kind(PROBLEMS)
    return kind(*FACTS.get(kind, ("it went wrong",)))


def test_all_are_found():
    assert {*FACTS, errors.StoreError, FileError} <= set(exceptions())


@pytest.mark.parametrize("kind", exceptions(), ids=lambda kind: kind.__qualname__)
def test_a_copy_and_a_pickle_are_the_exception(kind):
    """Class, sentence, arguments and facts are restored."""
    error = example(kind)
    error.add_note("while the puppet hung")
    for again in (pickle.loads(pickle.dumps(error)), copy.copy(error), copy.deepcopy(error)):
        assert type(again) is kind
        assert (str(again), again.args, vars(again)) == (str(error), error.args, vars(error))
        assert getattr(again, "msg", None) == getattr(error, "msg", None)


def _stops(string: str) -> None:
    raise errors.UnknownNameError("string", string, ["hand", "foot"])


def test_an_exception_of_a_worker_is_raised_in_the_caller():
    """A pool does not wait for ever for a worker that raised an exception."""
    with (
        multiprocessing.get_context("spawn").Pool(1) as pool,
        pytest.raises(errors.UnknownNameError, match="did you mean 'hand'") as caught,
    ):
        pool.map_async(_stops, ["hnd"]).get(timeout=60)
    assert caught.value.allowed == ("hand", "foot")


BIG = 10**400
"""An integer beyond the range of floats."""


def test_times_and_numbers_beyond_floats_are_refused_by_name(tmp_path):
    arm = fan.puppets.arm2d()
    x0 = arm.rest({"hand.length": 0.8})
    lift = fan.Input.waypoints(arm, {"hand.length": [(0, 0.8), (1, 0.7)]})
    stepper = arm.stepper(x0)
    zeros = [0.0] * arm.coordinates.n_vK
    for wrong in (
        lambda x: fan.simulate(arm, x0, t_end=x),
        lambda x: fan.simulate_batch(arm, [x0], t_end=x),
        lambda x: fan.simulate(arm, x0, t_end=0.1, save_at=[x]),
        lambda x: fan.simulate(arm, x0, t_end=0.1, method=fan.TimeStepping(dt=x)),
        lambda x: x0.replace(t=x),
        lambda x: arm.rest({"hand.length": x}),
        lambda x: arm.state({"elbow": x}),
        stepper.advance,
        lambda x: stepper.advance(0.1, [x, *zeros[1:]]),
        lift.with_rest_until,
        lift.shifted,
        lambda x: lift.with_rest_before(-x),
        lambda x: lift.with_forces({"elbow": [(x, 0.0)]}),
        lambda x: fan.Input.waypoints(arm, {"hand.length": [(0, 0.8), (x, 0.7)]}),
        lambda x: fan.Input.samples(arm, [0, x], {"hand.length": [0.8, 0.7]}),
        lambda x: fan.Input.segments(arm, [0, x], x0.q_K, x0.v_K, [zeros]),
        lambda x: fan.Task(arm, x0, x, []),
        lambda x: fan.theatre.Recording(arm, x0, [zeros], x, 1),
    ):
        for number in (BIG, float("inf"), float("nan")):
            with pytest.raises((ValueError, errors.InputError)):
                wrong(number)
