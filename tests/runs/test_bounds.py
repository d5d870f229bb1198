"""Numerical arguments of runs are bounded by the integers of the compiled code and by memory."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest
from tests.harness import method_of

import fantoccini as fan
from fantoccini import Status
from fantoccini.kernel.runtime import memory
from fantoccini.kernel.runtime.functions import checked_integer
from fantoccini.kernel.runtime.structures import Numbers

ARM = fan.puppets.arm2d()
X0 = ARM.rest()


def simulated(x0, **how):
    """A run from a state, or a batch from several."""
    return (fan.simulate if isinstance(x0, fan.State) else fan.simulate_batch)(ARM, x0, **how)


@pytest.mark.parametrize("method", ["event", "timestepping", "variational"])
@pytest.mark.parametrize("x0", [X0, [X0, X0]], ids=["one", "many"])
@pytest.mark.parametrize("every", [0, -1, 2.5, np.nan, 2**31, 2**32, 2**33 + 5, 2**70])
def test_saving_intervals_fit_their_integer(method, x0, every):
    """An interval beyond its integer is refused; 2^32 used to become 0 and crash Python."""
    with pytest.raises(ValueError, match=r"save_every is .* a whole number from 1 to 2147483647"):
        simulated(x0, t_end=0.01, method=method, save_every=every)
    if method == "event":
        return  # this method takes no interval
    run = simulated(x0, t_end=0.01, method=method, save_every=np.int64(2**31 - 1))
    assert run.t[-1] == 0.01 and len(run.t) == 2


def test_integers_that_cross_to_compiled_code_are_checked():
    """Arguments and fields of all structures are checked; ctypes silently wraps them."""

    class Pair(Numbers):
        _fields_ = (("short", ctypes.c_int), ("long", ctypes.c_longlong))

    pair = Pair(2**31 - 1, -(2**63))
    assert (pair.short, pair.long) == (2**31 - 1, -(2**63))
    for wrong in ({"short": 2**31}, {"short": -(2**31) - 1}, {"long": 2**63}, {"short": 0.5}):
        with pytest.raises(ValueError, match=f"{next(iter(wrong))} is "):
            Pair(**wrong)
    assert checked_integer("n", 7, minimum=1) == 7
    for steps in (0, -1, 2**63, 1e6):
        with pytest.raises(ValueError, match="max_steps is "):
            ARM.run_options(max_steps=steps)


def test_every_structure_of_the_runtime_is_checked():
    """No structure takes an integer without a check."""
    import fantoccini.kernel.runtime as runtime

    def with_subclasses(kind):
        return {kind, *(s for child in kind.__subclasses__() for s in with_subclasses(child))}

    runtime_structures = [
        s for s in with_subclasses(ctypes.Structure) if s.__module__.startswith(runtime.__name__)
    ]
    assert len(runtime_structures) >= 10
    assert [s.__name__ for s in runtime_structures if not issubclass(s, Numbers)] == []


@pytest.mark.parametrize("method", ["timestepping", "variational"])
@pytest.mark.parametrize("x0", [X0, [X0] * 8], ids=["one", "many"])
def test_too_many_rows_are_refused_before_allocation(method, x0):
    """5e11 rows of fixed steps; a batch used to allocate 37 GiB before the check."""
    with pytest.raises(ValueError, match=r"5e\+11 samples from 0 s .* GB may be used.*save_every="):
        simulated(x0, t_end=1e9, method=method)
    with pytest.raises(ValueError, match=r"need 0.0.* GB .*max_memory"):
        simulated(x0, t_end=1.0, method=method, max_memory=5e3)
    run = simulated(x0, t_end=1.0, method=method, max_memory=5e3, save_every=250)
    assert len(run.t) == 3
    with pytest.raises(ValueError, match="max_memory is"):
        simulated(x0, t_end=1.0, method=method, max_memory=0)


@pytest.mark.parametrize("x0", [X0, [X0] * 2000], ids=["one", "many"])
def test_times_to_save_that_do_not_fit_are_refused(x0):
    """The number of rows of an event-driven run with fixed times is known beforehand."""
    times = np.linspace(0.0, 1e3, 10**5)
    with pytest.raises(ValueError, match=r"1e\+05 samples .* fewer times in save_at"):
        simulated(x0, t_end=1e3, save_at=times, max_memory=1e7)


def test_a_run_with_too_many_rows_ends_and_keeps_them():
    """A run with too many steps ends with a status, before memory is exhausted."""
    x0 = ARM.project(X0.replace(v_D=[3.0, -3.0]))
    how = {"t_end": 20.0, "method": fan.Event(rtol=1e-9, atol=1e-9)}
    whole_run = simulated(x0, max_memory=1e9, **how)
    run = simulated(x0, max_memory=3e5, throw=False, **how)
    assert run.status is Status.TOO_MANY_SAMPLES
    assert 100 < len(run) < len(whole_run) // 2
    assert np.array_equal(run.q_D, whole_run.q_D[: len(run)])
    with pytest.raises(
        fan.errors.SimulationError, match=r"after \d+ samples; save fewer with save_at"
    ):
        simulated(x0, max_memory=3e5, **how)


def test_steps_of_a_batch_are_bounded(monkeypatch):
    """max_steps also ends runs with fixed steps in a batch."""
    options = fan.Marionette.run_options
    monkeypatch.setattr(
        fan.Marionette, "run_options", lambda *a, **how: options(*a, max_steps=10, **how)
    )
    batch = fan.simulate_batch(ARM, [X0] * 3, t_end=1.0, method="timestepping", threads=1)
    assert batch.status.tolist() == [Status.TOO_MANY_STEPS] * 3
    assert batch.reached == pytest.approx([0.02] * 3)


def test_memory_is_limited_by_the_machine_the_group_and_the_process(tmp_path):
    """A container's limit counts, minus its memory in use that cannot be freed."""
    assert 1e6 < memory.allowed() < 1e15
    assert memory.bound(1e3, None) == np.inf and memory.bound(1e9, None) < 1e15
    assert memory.bound(1e9, 5.0) == 5.0
    group = tmp_path / "memory.max", tmp_path / "memory.current", tmp_path / "memory.stat"
    for file, text in zip(group, ("1000\n", "700\n", "anon 400\ninactive_file 300\n"), strict=True):
        file.write_text(text)
    assert memory.of_group(tmp_path) == 600
    group[0].write_text("max\n")
    assert memory.of_group(tmp_path) is None


def test_a_run_needs_no_more_memory_than_estimated():
    """The estimate counts every copy that a run creates."""
    import tracemalloc

    fan.simulate(ARM, X0, t_end=0.1, method="timestepping")
    tracemalloc.start()
    run = fan.simulate(ARM, X0, t_end=20.0, method="timestepping")
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < memory.bytes_of(len(run), sum(ARM.sample_layout.widths.values()))


@pytest.mark.parametrize("method", ["timestepping", "variational"])
@pytest.mark.parametrize("x0", [X0, [X0] * 3], ids=["one", "many"])
def test_a_step_longer_than_the_run_is_one_step(method, x0):
    """dt = 1e300 used to be DONE at once; dt below the clock's resolution never ended."""
    for dt in (0.01, 1.0, 1e300):
        run = simulated(x0, t_end=0.01, method=method_of(method, dt=dt))
        assert run.t.tolist() == [0.0, 0.01]
        assert np.all(run.status == Status.DONE)
    stepper = ARM.stepper(X0, method_of(method, dt=1e300))
    assert stepper.advance(0.01).t == 0.01
    with pytest.raises(ValueError, match="the clock of a run from 0 s to 1 s resolves"):
        simulated(x0, t_end=1.0, method=method_of(method, dt=1e-17))
    with pytest.raises(ValueError, match="dt is nan; it must be a finite number"):
        simulated(x0, t_end=1.0, method=method_of(method, dt=np.nan))


def test_threads_and_arrays_of_a_batch_are_checked():
    """threads=-1 used to be called a lack of memory; an array for two results had both."""
    for threads in (-1, 0, 1.5):
        with pytest.raises(ValueError, match=r"threads is .* a whole number from 1"):
            fan.simulate_batch(ARM, [X0] * 2, t_end=0.1, threads=threads)
    out = np.zeros((2, 2, ARM.coordinates.n_qD))
    with pytest.raises(ValueError, match=r"out\['v_D'\] and out\['q_D'\] share their memory"):
        fan.simulate_batch(ARM, [X0] * 2, t_end=0.1, out={"q_D": out, "v_D": out[:]})
