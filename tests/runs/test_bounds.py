"""Numbers that a run is given are bounded: by the integers of the compiled code, by memory."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.runtime.functions import Numbers, whole

ARM = fan.puppets.arm2d()
X0 = ARM.rest()


@pytest.mark.parametrize("method", ["event", "timestepping", "variational"])
@pytest.mark.parametrize("x0", [X0, [X0, X0]], ids=["one", "many"])
@pytest.mark.parametrize("every", [0, -1, 2.5, np.nan, 2**31, 2**32, 2**33 + 5, 2**70])
def test_rows_are_saved_as_often_as_can_be_counted(method, x0, every):
    """23: an interval that does not fit its integer is refused; 2^32 was 0 and killed Python."""
    with pytest.raises(ValueError, match=r"save_every is .* a whole number from 1 to 2147483647"):
        fan.simulate(ARM, x0, t_end=0.01, method=method, save_every=every)
    run = fan.simulate(ARM, x0, t_end=0.01, method=method, save_every=np.int64(2**31 - 1))
    assert run.t[-1] == 0.01 and (method == "event" or len(run.t) == 2)


def test_integers_that_cross_to_compiled_code_are_checked():
    """23: arguments and fields of every structure; ctypes by itself wraps them round."""

    class Pair(Numbers, ctypes.Structure):
        _fields_ = [("short", ctypes.c_int), ("long", ctypes.c_longlong)]

    pair = Pair(2**31 - 1, -(2**63))
    assert (pair.short, pair.long) == (2**31 - 1, -(2**63))
    for wrong in ({"short": 2**31}, {"short": -(2**31) - 1}, {"long": 2**63}, {"short": 0.5}):
        with pytest.raises(ValueError, match=f"{next(iter(wrong))} is "):
            Pair(**wrong)
    assert whole("n", 7, least=1) == 7
    for steps in (0, -1, 2**63, 1e6):
        with pytest.raises(ValueError, match="max_steps is "):
            ARM.run_options(max_steps=steps)


def test_every_structure_of_the_runtime_is_checked():
    """23: none of them takes an integer unseen."""
    import fantoccini.runtime as runtime

    def below(kind):
        return {kind, *(s for child in kind.__subclasses__() for s in below(child))}

    own = [s for s in below(ctypes.Structure) if s.__module__.startswith(runtime.__name__)]
    assert len(own) >= 10
    assert [s.__name__ for s in own if not issubclass(s, Numbers)] == []
